//! Planned postures in the problem that `calib run` would state: their whitened rows, and how the task follows the parameters.
//!
//! There is no second model: the postures become a recording without noise, beside those that exist, and the pipeline states the
//! problem. What a posture tells is then [`Model::whitened_rows`] of its sample, what the tool does [`Model::linear_points`].

use std::collections::BTreeMap;
use std::ops::Range;

use calib_core::{Model, Target, Values};
use calib_pipeline::PipelineError;
use calib_pipeline::formulate::formulation::{Formulation, FreeSet};
use calib_pipeline::formulate::ml;
use calib_pipeline::options::Plugins;
use calib_pipeline::prepare::inputs::Inputs;
use calib_pipeline::prepare::load::of_tables;
use calib_profile::{RecordingSpec, Usage};
use calib_recording::{JointUnit, Poses};
use calib_urdf::{LinkId, RobotModel};
use nalgebra::{DMatrix, DVector, Isometry3};
use rayon::prelude::*;

use crate::basis::compressed;
use crate::candidates::Candidate;
use crate::known::Known;
use crate::sight::Subject;

/// Name of the recording of the planned postures; a profile's own name has no such letters.
const PLANNED: &str = "\u{2}planned";
/// Candidates that are linearized together: their whole rows are in memory at once.
const PART: usize = 8192;
/// Name of the recording of the task postures.
const TASK: &str = "\u{2}task";

/// A linearized problem.
#[derive(Debug, Clone)]
pub struct Linear {
    /// Names of the free parameters, in the order of the columns.
    pub names: Vec<String>,
    /// One unit of each: prior σ, else 1°, 1 cm, … .
    pub scale: DVector<f64>,
    /// Which have a prior.
    pub has_prior: Vec<bool>,
    /// Whether a length (m), an angle (rad) or something else, by parameter.
    pub units: Vec<calib_core::Unit>,
    /// Whitened rows of the samples that are recorded already.
    pub recorded: Vec<DMatrix<f64>>,
    /// Whitened rows of each planned posture.
    pub planned: Vec<DMatrix<f64>>,
    /// Derivatives of the tool's position in the tracker's frame over the task postures, divided by the root of their number:
    /// (3 × postures) × parameters.
    pub task: DMatrix<f64>,
}

impl Linear {
    /// With no more rows of each planned posture than their rank, in units of the scale.
    fn compressed(mut self) -> Self {
        let scale = &self.scale;
        let of = |mut y: DMatrix<f64>| {
            let scaled = y.column_iter_mut().zip(scale.iter());
            scaled.for_each(|(mut column, s)| column *= *s);
            let mut y = compressed(&y);
            let back = y.column_iter_mut().zip(scale.iter());
            back.for_each(|(mut column, s)| column /= *s);
            y
        };
        self.planned = self.planned.into_par_iter().map(of).collect();
        self
    }
}

impl Known {
    /// The subjects that the tracker can see, at their nominal places.
    #[must_use]
    pub fn subjects(&self, moves: &dyn Fn(LinkId) -> bool) -> Vec<Subject> {
        let mut subjects = Vec::new();
        for (name, body) in &self.robot.profile.bodies {
            let track = &self.tracks[name];
            let facing = &self.robot.profile.plan.facing;
            let link_from_body = self.start.mounts.get(name).copied();
            let link_from_body = link_from_body.unwrap_or_else(Isometry3::identity);
            let turned = |marker: Option<&String>| {
                let own = marker.and_then(|m| facing.get(m)).or(facing.get(name))?;
                let mut own = own.clone();
                if track.template.is_some() || marker.is_none() {
                    own.normal = link_from_body.rotation * own.normal;
                }
                Some(own)
            };
            let subject = |marker: Option<&String>, at| Subject {
                body: name.clone(),
                marker: marker.cloned(),
                link: body.link.index(),
                at,
                facing: turned(marker),
                moves: moves(body.link),
            };
            match (&track.template, self.start.points.get(name)) {
                (Some(template), _) if !track.is_computed => {
                    let markers = template.names.iter().zip(&template.points);
                    subjects.extend(markers.map(|(m, p)| subject(Some(m), link_from_body * p)));
                }
                (None, Some(points)) => {
                    subjects.extend(points.iter().map(|(m, p)| subject(Some(m), *p)));
                }
                _ => subjects.push(subject(None, link_from_body.translation.vector.into())),
            }
        }
        subjects
    }

    /// States and linearizes the problem of everything that is recorded and planned.
    ///
    /// # Errors
    /// [`PipelineError`] where the problem cannot be stated.
    pub fn linearize(
        &self,
        planned: &[Candidate],
        subjects: &[Subject],
        task: &[Vec<f64>],
    ) -> Result<Linear, PipelineError> {
        let inputs = self.with_planned(planned, subjects, task)?;
        let mut tracks = self.tracks.clone();
        for (name, track) in &mut tracks {
            let of_pose = |s: &Subject| s.body == *name && s.marker.is_none();
            if let Some(i) = subjects.iter().position(of_pose) {
                let mount = self.start.mounts.get(name).copied();
                let mount = mount.unwrap_or_else(Isometry3::identity);
                let poses = planned.iter().map(|c| {
                    let link = link_pose(&inputs.robot.model, &c.q, subjects[i].link);
                    c.seen[i].map(|_| self.start.tracker_from_root * link * mount)
                });
                track.poses.insert(PLANNED.to_owned(), poses.collect());
                if self.inverse.contains(name) || !track.inverse.is_empty() {
                    track.inverse.insert(PLANNED.to_owned());
                }
            }
        }
        let formulation = ml::state(&inputs, &tracks, &self.start, FreeSet::Profile);
        let model = Model::new(&formulation.problem)?;
        let values = self.values_of(&model);
        let variances: Vec<f64> = formulation
            .problem
            .groups()
            .iter()
            .map(|g| self.noise.get(&g.name).copied().unwrap_or(g.sigma).powi(2))
            .collect();
        let rows = |samples: Range<usize>| {
            let rows = model.whitened_rows(&values, &variances, samples);
            rows.unwrap_or_default()
        };
        let (of_plan, of_task) = (range(&formulation, PLANNED), range(&formulation, TASK));
        let fitted = |s: &usize| !model.is_held_out(*s) && !of_plan.contains(s);
        let all = rows(0..formulation.samples.len());
        let (planned, recorded) = all.into_iter().enumerate().fold(
            (Vec::new(), Vec::new()),
            |(mut planned, mut recorded), (sample, rows)| {
                if of_plan.contains(&sample) {
                    planned.push(rows);
                } else if fitted(&sample) && rows.nrows() > 0 {
                    recorded.push(rows);
                }
                (planned, recorded)
            },
        );
        let parameters = model.problem().parameters();
        let free = || model.free_parameters().iter().map(|p| &parameters[*p]);
        let tool = tool(&inputs, &formulation);
        let count = of_task.len();
        let mut b = DMatrix::zeros(3 * count, model.free());
        if let Some(tool) = tool {
            let points = model.linear_points(&values, (formulation.tracker, tool), of_task)?;
            for (k, point) in points.iter().enumerate() {
                let part = &point.jacobian / (count.max(1) as f64).sqrt();
                b.rows_mut(3 * k, 3).copy_from(&part);
            }
        }
        Ok(Linear {
            names: free().map(|p| p.name.clone()).collect(),
            scale: DVector::from_iterator(model.free(), free().map(calib_core::Parameter::scale)),
            has_prior: free().map(|p| p.prior_sigma.is_some()).collect(),
            units: free().map(|p| p.unit).collect(),
            recorded,
            planned,
            task: b,
        })
    }

    /// The same for many candidates, a part after the other, with no more rows of each than their rank.
    ///
    /// # Errors
    /// [`PipelineError`] where the problem cannot be stated.
    pub fn linearize_in_parts(
        &self,
        planned: &[Candidate],
        subjects: &[Subject],
        task: &[Vec<f64>],
    ) -> Result<Linear, PipelineError> {
        let mut parts = planned.chunks(PART);
        let first = parts.next().unwrap_or_default();
        let mut all = self.linearize(first, subjects, task)?.compressed();
        for part in parts {
            let part = self.linearize(part, subjects, task)?.compressed();
            // What a part does not show may be no parameter of it.
            if part.names != all.names {
                return Ok(self.linearize(planned, subjects, task)?.compressed());
            }
            all.planned.extend(part.planned);
        }
        Ok(all)
    }

    /// What a fit found, by name; start values of the rest.
    #[must_use]
    pub fn values_of(&self, model: &Model) -> Values {
        let mut values = model.start();
        let parameters = model.problem().parameters().iter();
        for (value, parameter) in values.0.iter_mut().zip(parameters) {
            if let Some(found) = self.values.get(&parameter.name) {
                *value = *found;
            }
        }
        values
    }

    /// The inputs with two recordings more.
    fn with_planned(
        &self,
        planned: &[Candidate],
        subjects: &[Subject],
        task: &[Vec<f64>],
    ) -> Result<Inputs, PipelineError> {
        let model = &self.robot.model;
        let mut robot = self.robot.clone();
        let recorded = std::mem::take(&mut robot.profile.recordings);
        robot
            .profile
            .recordings
            .insert(PLANNED.to_owned(), planned_recording(Usage::Static));
        robot
            .profile
            .recordings
            .insert(TASK.to_owned(), planned_recording(Usage::Validation));
        robot.profile.plugins.clear();
        let postures: Vec<&Vec<f64>> = planned.iter().map(|c| &c.q).collect();
        let mut table = joint_table(model, &postures);
        let places: Vec<Vec<Isometry3<f64>>> = planned
            .iter()
            .map(|c| model.forward_kinematics(&c.q))
            .collect();
        for (i, subject) in subjects.iter().enumerate() {
            let at = |k: usize| self.start.tracker_from_root * places[k][subject.link];
            if let Some(marker) = &subject.marker {
                let seen = |k: usize| planned[k].seen[i].map(|_| at(k) * subject.at);
                let track = (0..planned.len()).map(seen).collect();
                table.markers.insert(marker.clone(), track);
            }
        }
        let task: Vec<&Vec<f64>> = task.iter().collect();
        let tables = BTreeMap::from([
            (PLANNED.to_owned(), table),
            (TASK.to_owned(), joint_table(model, &task)),
        ]);
        let mut inputs = of_tables(robot, tables, Plugins::Refused)?;
        if let Some(loaded) = inputs.recordings.get_mut(PLANNED) {
            for (i, subject) in subjects.iter().enumerate() {
                let Some(marker) = &subject.marker else {
                    continue;
                };
                let shapes: Vec<_> = planned.iter().map(|c| c.seen[i].flatten()).collect();
                if shapes.iter().any(Option::is_some) {
                    loaded.shapes.insert(marker.clone(), shapes);
                }
            }
        }
        inputs.robot.profile.recordings.extend(recorded);
        if let Some(before) = &self.inputs {
            inputs.recordings.extend(before.recordings.clone());
        }
        Ok(inputs)
    }
}

/// Samples of a recording; they stand side by side.
fn range(formulation: &Formulation, name: &str) -> Range<usize> {
    let of = |s: &(String, usize)| s.0 == name;
    let first = formulation.samples.iter().position(of);
    let count = formulation.samples.iter().filter(|s| of(s)).count();
    let first = first.unwrap_or(formulation.samples.len());
    first..first + count
}

/// The body at the end of the longest chain of joints; of one without a frame its first marker.
fn tool(inputs: &Inputs, formulation: &Formulation) -> Option<Target> {
    let model = &inputs.robot.model;
    let joints = |link: LinkId| {
        let chain = model.chain_to_root(link);
        chain
            .iter()
            .filter(|j| model.joint(**j).kind.axis().is_some())
            .count()
    };
    let bodies = inputs.robot.profile.bodies.iter();
    let (name, body) = bodies.max_by_key(|(_, b)| joints(b.link))?;
    let of_body = formulation.bodies.get(name).copied();
    let markers = formulation.points.get(name);
    let first = markers.and_then(|m| m.values().next().copied());
    let of_link = formulation.links[body.link.index()];
    of_body
        .map(Target::Frame)
        .or(first.map(Target::Point))
        .or(of_link.map(Target::Frame))
}

fn link_pose(model: &RobotModel, q: &[f64], link: usize) -> Isometry3<f64> {
    let id = model.link_ids().nth(link);
    id.map_or_else(Isometry3::identity, |id| model.root_from_link(q, id))
}

/// How a profile states a recording that exists only in a plan.
#[must_use]
pub fn planned_recording(usage: Usage) -> RecordingSpec {
    RecordingSpec {
        file: "planned".to_owned(),
        usage,
        ranges: BTreeMap::new(),
        hold: BTreeMap::new(),
        group: None,
        reader: None,
        reader_parameters: BTreeMap::new(),
        columns: None,
        robot_log: None,
        timing: None,
        place: 0,
    }
}

/// A table of joint positions.
#[must_use]
pub fn joint_table(model: &RobotModel, postures: &[&Vec<f64>]) -> Poses {
    let mut table = Poses {
        rows: (0..postures.len() as u64).collect(),
        ..Poses::default()
    };
    for id in model.independent_joints() {
        let joint = model.joint(id);
        let unit = if joint.kind.turns() {
            JointUnit::Angle
        } else {
            JointUnit::Length
        };
        table.joint_units.insert(joint.name.clone(), unit);
        let column = postures.iter().map(|q| Some(q[id.index()])).collect();
        table.joints.insert(joint.name.clone(), column);
    }
    table
}
