//! The robot, its bodies and its recordings as one estimation problem for `calib-core`.

use std::collections::BTreeMap;

use bodies::add_bodies;
use calib_core::{Chart, EdgeId, FrameId, PointId, Problem, Role, Settings, Solution};
use calib_profile::{Free, Usage};
use calibration::calibration;
use joints::{Row, add_joint, joint_noise_group, used_joints};

use crate::error::PipelineError;
use crate::estimate::start::Start;
use crate::formulate::contacts::add_contacts;
use crate::formulate::kinematics::{Calibration, Loads};
use crate::prepare::conditions::{Conditions, conditions};
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;

mod bodies;
mod calibration;
mod joints;

pub(crate) use calibration::calibration_at;

/// What to free in a solve: the profile's choice, or the bodies and the robot's place only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FreeSet {
    /// What the profile says.
    Profile,
    /// Mounts and `tracker_from_root` only: the baseline.
    RegistrationOnly,
}

/// A stated problem, and how its parts are called there.
#[derive(Debug, Clone)]
pub struct Formulation {
    /// The problem.
    pub problem: Problem,
    /// Recording and row of each sample.
    pub samples: Vec<(String, usize)>,
    /// Frame of the tracker.
    pub tracker: FrameId,
    /// Frame per link index; `None` for links that no path uses.
    pub links: Vec<Option<FrameId>>,
    /// Frame per body that has one.
    pub bodies: BTreeMap<String, FrameId>,
    /// Joint edge per joint index.
    pub joints: Vec<Option<EdgeId>>,
    /// Origin edge per joint index, where it can change.
    pub origins: Vec<Option<EdgeId>>,
    /// `tracker_from_root`.
    pub root: EdgeId,
    /// Mount edge per body that has one.
    pub mounts: BTreeMap<String, EdgeId>,
    /// Points by body and marker.
    pub points: BTreeMap<String, BTreeMap<String, PointId>>,
    /// Touching points by name.
    pub contact_points: BTreeMap<String, PointId>,
    /// Places of what is touched, by contact.
    pub contacts: BTreeMap<String, EdgeId>,
    /// Regressors are needed at predictions (compliance or coupling is free).
    pub loaded: bool,
}

/// A solved problem.
#[derive(Debug, Clone)]
pub struct MlFit {
    /// The problem's names.
    pub formulation: Formulation,
    /// What was found.
    pub solution: Solution,
    /// The robot that follows.
    pub calibration: Calibration,
}

/// States the problem of a profile.
#[must_use]
pub fn state(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    start: &Start,
    free_set: FreeSet,
) -> Formulation {
    let profile = &inputs.robot.profile;
    let model = &inputs.robot.model;
    let samples = samples(inputs);
    let conditions_of: BTreeMap<&str, Vec<Conditions>> = inputs
        .recordings
        .iter()
        .map(|(name, r)| (name.as_str(), conditions(r, model, profile.solve.load)))
        .collect();
    let rows: Vec<Row<'_>> = samples
        .iter()
        .filter_map(|(r, row)| {
            let q = inputs.recordings[r].q[*row].as_ref()?;
            let under = &conditions_of[r.as_str()][*row];
            Some(Row {
                q,
                under,
                loads: Loads::under(model, q, under),
            })
        })
        .collect();
    let mut problem = Problem::new(samples.len());
    for (i, (recording, _)) in samples.iter().enumerate() {
        if inputs.recordings[recording].spec.usage == Usage::Validation {
            problem.held_out.insert(i);
        }
    }
    let tracker = problem.frame(&profile.tracker.frame);
    let root_frame = problem.frame(&model.link(model.root()).name);
    let tracker_free = !profile.bodies.is_empty()
        && (profile.solve.free.contains(&Free::Tracker) || free_set == FreeSet::RegistrationOnly);
    let chart = if tracker_free {
        Chart::full()
    } else {
        Chart::none()
    };
    let root = problem.unknown(
        "tracker_from_root",
        tracker,
        root_frame,
        start.tracker_from_root,
        chart,
    );
    problem.set_role(root, Role::World, None);
    let mut formulation = Formulation {
        problem,
        tracker,
        links: vec![None; model.links().len()],
        bodies: BTreeMap::new(),
        joints: vec![None; model.joints().len()],
        origins: vec![None; model.joints().len()],
        root,
        mounts: BTreeMap::new(),
        points: BTreeMap::new(),
        contact_points: BTreeMap::new(),
        contacts: BTreeMap::new(),
        loaded: false,
        samples,
    };
    formulation.links[model.root().index()] = Some(root_frame);
    let joint_noise = joint_noise_group(&mut formulation.problem, profile);
    for joint in used_joints(inputs, model) {
        add_joint(
            &mut formulation,
            inputs,
            joint,
            &rows,
            joint_noise,
            free_set,
        );
    }
    add_bodies(&mut formulation, inputs, tracks, start);
    add_contacts(&mut formulation, inputs);
    crate::formulate::clock::add_clocks(&mut formulation, inputs, free_set);
    formulation
}

/// Solves a stated problem.
///
/// # Errors
/// [`PipelineError::Solve`] when the problem cannot be stated so.
pub fn fit(
    formulation: Formulation,
    inputs: &Inputs,
    settings: &Settings,
) -> Result<MlFit, PipelineError> {
    let solution = calib_core::solve(&formulation.problem, settings)?;
    let calibration = calibration(&formulation, &solution, inputs);
    Ok(MlFit {
        formulation,
        solution,
        calibration,
    })
}

/// All rows with known joint positions, recording after recording.
fn samples(inputs: &Inputs) -> Vec<(String, usize)> {
    let mut samples = Vec::new();
    for (name, loaded) in &inputs.recordings {
        samples.extend(
            loaded
                .q
                .iter()
                .enumerate()
                .filter(|(_, q)| q.is_some())
                .map(|(row, _)| (name.clone(), row)),
        );
    }
    samples
}
