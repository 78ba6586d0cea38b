//! What is known before the first planned posture: from the profile, and from the recordings that exist.

use std::collections::{BTreeMap, BTreeSet};

use calib_checks::rigid_body::Template;
use calib_core::Settings;
use calib_geometry::registration::rigid_registration;
use calib_pipeline::PipelineError;
use calib_pipeline::estimate::start::Start;
use calib_pipeline::formulate::along_sight;
use calib_pipeline::formulate::cameras::{self, Outcome};
use calib_pipeline::formulate::checked::check_data;
use calib_pipeline::formulate::formulation::FreeSet;
use calib_pipeline::formulate::ml;
use calib_pipeline::options::Plugins;
use calib_pipeline::prepare::inputs::{Inputs, RobotProfile};
use calib_pipeline::prepare::load::load_recordings;
use calib_pipeline::prepare::tracks::BodyTrack;
use calib_profile::{Body, BodyKind, Profile, RecordingSpec, Usage};
use calib_urdf::JointId;
use nalgebra::{Isometry3, Point3};

use crate::note::{JointNoiseOf, Note};

/// What is known beforehand.
#[derive(Debug, Clone)]
pub struct Known {
    /// The robot; its profile lists the recordings that exist.
    pub robot: RobotProfile,
    /// The recordings that exist, where they could be used.
    pub inputs: Option<Inputs>,
    /// Markers of the bodies, and where they were.
    pub tracks: BTreeMap<String, BodyTrack>,
    /// Where the robot stands and where the bodies are mounted.
    pub start: Start,
    /// Values of the parameters that a fit found, by name.
    pub values: BTreeMap<String, f64>,
    /// Noise levels that a fit found, by the name of their group.
    pub noise: BTreeMap<String, f64>,
    /// Joints that stood still in all recordings, and where.
    pub still: Vec<(JointId, f64)>,
    /// Whether it is known where the robot stands before the tracker.
    pub placed: bool,
    /// Bodies and markers that will not be recorded, though they can be seen.
    pub unrecorded: BTreeSet<String>,
    /// Bodies that see the tracker, as the columns of any recording of the profile say: the noise is of that pose.
    pub inverse: BTreeSet<String>,
    /// What was assumed.
    pub notes: Vec<Note>,
}

/// How the noise of markers follows the cameras of the profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CameraNoise {
    /// So that σ is that of the postures to choose from, on average.
    Stated,
    /// By this factor, so that σ is that of the recordings, on average.
    Scaled(f64),
    /// Not at all: recordings show it equal in all directions.
    Equal,
}

/// Distance of the first marker of an assumed layout from the body's origin, m.
const LAYOUT: f64 = 0.05;

impl Known {
    /// Reads the recordings of the profile that exist, and fits them; those with errors are not used, and a note says why.
    ///
    /// # Errors
    /// [`PipelineError`] for a recording that exists and cannot be read.
    pub fn of(mut robot: RobotProfile, plugins: Plugins) -> Result<Self, PipelineError> {
        let mut notes = Vec::new();
        let recordings = robot.profile.recordings.values();
        let inverse = recordings.flat_map(RecordingSpec::inverse_bodies).collect();
        let missing = without_missing(&mut robot);
        let exist = &robot.profile.recordings;
        let any_fitted = exist.values().any(|r| r.usage != Usage::Validation);
        if !missing.is_empty() {
            notes.push(Note::NotRecordedYet {
                recordings: missing,
            });
        }
        if any_fitted {
            let inputs = load_recordings(robot.clone(), plugins)?;
            match Self::fitted(&robot, inputs) {
                Ok(known) => {
                    return Ok(Self {
                        notes: [notes, known.notes].concat(),
                        inverse,
                        ..known
                    });
                }
                Err(error) => notes.push(Note::RecordingsUnused {
                    why: error.to_string(),
                }),
            }
        }
        Ok(Self {
            inverse,
            ..Self::of_profile(robot, notes)
        })
    }

    /// How the noise of markers follows the cameras.
    #[must_use]
    pub fn camera_noise(&self) -> CameraNoise {
        let Some(inputs) = &self.inputs else {
            return CameraNoise::Stated;
        };
        let mut recorded = inputs
            .recordings
            .values()
            .flat_map(|r| r.poses.markers.values());
        let any = recorded.any(|track| track.iter().any(Option::is_some));
        match cameras::scale(inputs) {
            Some(scale) => CameraNoise::Scaled(scale),
            None if any => CameraNoise::Equal,
            None => CameraNoise::Stated,
        }
    }

    /// σ of a joint's reading, rad, and where it is taken from; the largest, where joints have their own.
    #[must_use]
    pub fn joint_noise(&self) -> (f64, JointNoiseOf) {
        if self.inputs.is_none() {
            return joint_noise(&self.robot.profile);
        }
        let of_joints = self
            .noise
            .iter()
            .filter(|(name, _)| name.starts_with(JOINTS));
        let largest = of_joints.map(|(_, sigma)| *sigma).reduce(f64::max);
        largest.map_or((0.0, JointNoiseOf::Solve), |sigma| {
            (sigma, JointNoiseOf::Recordings)
        })
    }

    /// From recordings: a fit of everything that the profile frees.
    fn fitted(robot: &RobotProfile, mut inputs: Inputs) -> Result<Self, PipelineError> {
        // Recordings with errors would plan for another robot than this one.
        let checked = check_data(&mut inputs, Vec::new(), false)?;
        let mut settings = Settings::default();
        settings.robust.enabled = robot.profile.solve.robust;
        let state =
            |inputs: &Inputs| ml::state(inputs, &checked.tracks, &checked.start, FreeSet::Profile);
        let mut fit = ml::fit(state(&inputs), &inputs, &settings)?;
        // The noise of the cameras, as in a run.
        if cameras::take(&mut inputs) {
            let with = ml::fit(state(&inputs), &inputs, &settings).ok();
            let outcome = cameras::outcome(with.as_ref(), &fit, &settings);
            match with.filter(|_| outcome == Outcome::Taken) {
                Some(with) => fit = with,
                None => cameras::make_equal(&mut inputs),
            }
        }
        // And that along the line of sight.
        if let Some(told) = along_sight::told(&inputs, &fit) {
            let before = std::mem::replace(&mut inputs.sights, told);
            let with = ml::fit(state(&inputs), &inputs, &settings).ok();
            let seen = (&inputs, &checked.tracks);
            match with.filter(|with| along_sight::is_better(seen, with, &fit, &settings)) {
                Some(with) => fit = with,
                None => inputs.sights = before,
            }
        }
        let found = fit.solution.parameters.iter();
        let groups = fit.formulation.problem.groups().iter();
        let levels = groups.zip(&fit.solution.noise);
        let still = still(&inputs);
        let mut notes = Vec::new();
        if !still.is_empty() {
            let name = |s: &(JointId, f64)| robot.model.joint(s.0).name.clone();
            let joints = still.iter().map(name).collect();
            notes.push(Note::JointsStill { joints });
        }
        Ok(Self {
            robot: robot.clone(),
            values: found.map(|p| (p.name.clone(), p.value)).collect(),
            noise: levels.map(|(g, n)| (g.name.clone(), n.sigma)).collect(),
            still,
            placed: true,
            unrecorded: BTreeSet::new(),
            inverse: BTreeSet::new(),
            notes,
            tracks: checked.tracks,
            start: checked.start,
            inputs: Some(inputs),
        })
    }

    /// From the profile alone: what it states, else its `simulate` section, else a usual layout.
    fn of_profile(robot: RobotProfile, mut notes: Vec<Note>) -> Self {
        let profile = &robot.profile;
        let measured = profile.tracker.from_root.as_ref().map(|m| m.pose);
        let simulated = profile.simulate.as_ref();
        let place = measured.or(simulated.map(|s| s.tracker_from_root));
        if simulated.is_some() {
            notes.push(Note::FromSimulation);
        }
        let mut start = Start {
            tracker_from_root: place.unwrap_or_else(Isometry3::identity),
            mounts: BTreeMap::new(),
            points: BTreeMap::new(),
        };
        let mut tracks = BTreeMap::new();
        for (name, body) in &profile.bodies {
            let track = assumed(&robot, name, body, &mut start, &mut notes);
            tracks.insert(name.clone(), track);
        }
        let marked = profile.bodies.values();
        let unstated = marked.filter(|b| match b.kind {
            BodyKind::Pose => profile.tracker.body_sigma.is_none(),
            BodyKind::Markers { .. } => profile.tracker.marker_sigma.is_none(),
        });
        if unstated.count() > 0 {
            notes.push(Note::NoiseAssumed);
        }
        let (sigma, of) = joint_noise(profile);
        notes.push(Note::JointNoise { sigma, of });
        Self {
            placed: place.is_some(),
            unrecorded: BTreeSet::new(),
            inverse: BTreeSet::new(),
            inputs: None,
            tracks,
            start,
            values: BTreeMap::new(),
            noise: BTreeMap::from([(JOINTS.to_owned(), sigma)]),
            still: Vec::new(),
            notes,
            robot,
        }
    }
}

/// Name of the noise group of the joints.
const JOINTS: &str = "joint";

/// σ of a joint's reading where nothing is recorded, rad, and where it is taken from.
fn joint_noise(profile: &Profile) -> (f64, JointNoiseOf) {
    let simulated = profile.simulate.as_ref().map(|s| s.noise.joint);
    match (profile.solve.noise.joint, simulated.filter(|s| *s > 0.0)) {
        (Some(sigma), _) => (sigma, JointNoiseOf::Solve),
        (None, Some(sigma)) => (sigma, JointNoiseOf::Simulation),
        (None, None) => (ml::JOINT_SIGMA, JointNoiseOf::Program),
    }
}

/// Takes the recordings whose files do not exist out of a profile, and what was touched in them; their names.
pub fn without_missing(robot: &mut RobotProfile) -> Vec<String> {
    let folder = robot.folder.clone();
    let recordings = robot.profile.recordings.iter();
    let missing = recordings.filter(|(_, spec)| !folder.join(&spec.file).is_file());
    let missing: Vec<String> = missing.map(|(name, _)| name.clone()).collect();
    for name in &missing {
        robot.profile.recordings.remove(name);
    }
    let exist = &robot.profile.recordings;
    for contact in robot.profile.contacts.values_mut() {
        contact.recordings.retain(|name| exist.contains_key(name));
    }
    missing
}

/// A body that nobody has recorded: its markers, and where it is on its link.
fn assumed(
    robot: &RobotProfile,
    name: &String,
    body: &Body,
    start: &mut Start,
    notes: &mut Vec<Note>,
) -> BodyTrack {
    let simulated = robot.profile.simulate.as_ref();
    let simulated = simulated.and_then(|s| s.mounts.get(name));
    let mut mount = body.mount.or(simulated.map(|s| s.link_from_body));
    let mut track = BodyTrack {
        name: name.clone(),
        template: None,
        learned: false,
        marker_sigma: None,
        is_computed: false,
        poses: BTreeMap::new(),
        inverse: BTreeSet::new(),
    };
    if mount.is_none() {
        notes.push(Note::MountAssumed { body: name.clone() });
    }
    if let BodyKind::Markers { names, template } = &body.kind {
        let known = simulated.and_then(|s| {
            let all = names.iter().map(|m| s.markers.get(m).copied());
            all.collect::<Option<Vec<_>>>()
        });
        if template.is_none() && known.is_none() {
            notes.push(Note::LayoutAssumed { body: name.clone() });
        }
        let at = template
            .clone()
            .or(known)
            .unwrap_or_else(|| layout(names.len()));
        if names.len() < 3 {
            let link_from_body = mount.unwrap_or_else(Isometry3::identity);
            let on_link = names.iter().zip(&at);
            let on_link = on_link.map(|(m, p)| (m.clone(), link_from_body * p));
            start.points.insert(name.clone(), on_link.collect());
        } else if template.is_some() {
            track.template = Template::given(names.clone(), at).ok();
        } else {
            track.learned = true;
            // The frame that a fit gives the body: first marker at its origin, and so on.
            let tracks: Vec<[Option<Point3<f64>>; 1]> = at.iter().map(|p| [Some(*p)]).collect();
            let rows: Vec<&[Option<Point3<f64>>]> = tracks.iter().map(<[_; 1]>::as_slice).collect();
            track.template = Template::learn(names, &rows).ok().map(|found| Template {
                names: names.clone(),
                points: found.points,
            });
            if let (Some(template), None) = (&track.template, body.mount)
                && let Ok(moved) = rigid_registration(&template.points, &at, None)
            {
                let link_from_layout = mount.unwrap_or_else(Isometry3::identity);
                mount = Some(link_from_layout * moved.b_from_a);
            }
        }
    }
    start
        .mounts
        .insert(name.clone(), mount.unwrap_or_else(Isometry3::identity));
    track
}

/// Markers of a body of usual size: no two distances alike, not in one plane.
fn layout(markers: usize) -> Vec<Point3<f64>> {
    let at = |i: usize| {
        let i = i as f64;
        // The golden angle: no two directions are near each other.
        let (sin, cos) = (2.399_963 * i).sin_cos();
        let reach = LAYOUT * (1.0 + 0.13 * i);
        Point3::new(reach * cos, reach * sin, 0.2 * LAYOUT * i)
    };
    (0..markers).map(at).collect()
}

/// Joints that are in all recordings that are fitted and moved in none.
fn still(inputs: &Inputs) -> Vec<(JointId, f64)> {
    /// A joint that moves less stood still, rad or m.
    const STILL: f64 = 1e-3;
    let model = &inputs.robot.model;
    let of = |joint: JointId| {
        let rows = inputs
            .recordings
            .values()
            .flat_map(|r| r.q.iter().flatten());
        let mut at = rows.map(|q| q[joint.index()]);
        let first = at.next()?;
        let moved = at.any(|q| (q - first).abs() > STILL);
        (!moved).then_some((joint, first))
    };
    model.independent_joints().filter_map(of).collect()
}
