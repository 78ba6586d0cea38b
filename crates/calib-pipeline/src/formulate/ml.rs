//! The robot, its bodies and its recordings as one estimation problem for `calib-core`.

use std::collections::BTreeMap;

use calib_core::effect::Source;
use calib_core::{
    Axis, Chart, EFFECTS, EdgeId, EffectKind, FrameId, GroupId, JointState, MarkerObservation,
    NoiseKind, PointId, PoseNoise, PoseObservation, Problem, Role, Settings, Solution,
};
use calib_profile::{BodyKind, ContactBase, Free, JointFreeSet, OriginFreeSet, Profile, Usage};
use calib_urdf::{JointId, JointKind, RobotModel};
use nalgebra::{Isometry3, Point3};

use crate::error::PipelineError;
use crate::estimate::start::Start;
use crate::formulate::contacts::add_contacts;
use crate::formulate::kinematics::{Calibration, JointEffects, Loads, joint_state};
use crate::prepare::conditions::{Conditions, conditions};
use crate::prepare::load::Inputs;
use crate::prepare::tracks::BodyTrack;

/// What to free in a solve: the profile's choice, or the bodies and the robot's place only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FreeSet {
    /// What the profile says.
    Profile,
    /// Mounts and `tracker_from_root` only: the baseline.
    RegistrationOnly,
}

/// Marker noise that estimation starts from where the profile states none, m.
const MARKER_SIGMA: f64 = 0.5e-3;
/// Body position noise that estimation starts from, m.
const BODY_SIGMA: f64 = 0.5e-3;
/// Body orientation noise that estimation starts from, rad (0.2°).
const BODY_SIGMA_RAD: f64 = 3.5e-3;
/// Joint noise that estimation starts from, rad (0.01°).
const JOINT_SIGMA: f64 = 1.7e-4;
/// A revolute joint that moves less than this in the fitted recordings did not move, rad.
const MOVED: f64 = 1e-3;

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
    crate::prepare::clock::add_clocks(&mut formulation, inputs, free_set);
    formulation
}

/// One sample: indicated positions, and what else is known of it.
struct Row<'a> {
    q: &'a [f64],
    under: &'a Conditions,
    loads: Loads,
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

/// Joints between the root and any link that something is attached to or reported at, parents first.
fn used_joints(inputs: &Inputs, model: &RobotModel) -> Vec<JointId> {
    let profile = &inputs.robot.profile;
    let mut links: Vec<_> = profile.bodies.values().map(|b| b.link).collect();
    links.extend(profile.origins.values().map(|o| o.link));
    links.extend(
        profile
            .transforms
            .values()
            .flat_map(|t| [t.parent, t.child]),
    );
    links.extend(profile.points.values().map(|p| p.link));
    links.extend(profile.contacts.values().filter_map(|c| match c.on {
        ContactBase::Link(link) => Some(link),
        ContactBase::Tracker => None,
    }));
    let mut joints: Vec<JointId> = Vec::new();
    for link in links {
        for step in model.chain(model.root(), link) {
            if !joints.contains(&step.joint) {
                joints.push(step.joint);
            }
        }
    }
    joints.sort_by_key(|j| {
        (
            model.chain(model.root(), model.joint(*j).child).len(),
            j.index(),
        )
    });
    joints
}

fn joint_noise_group(problem: &mut Problem, profile: &Profile) -> Option<GroupId> {
    let noise = profile.solve.noise;
    match noise.joint {
        Some(0.0) => None,
        Some(sigma) => Some(problem.noise_group("joint", NoiseKind::Joint, sigma, !noise.known)),
        None => Some(problem.noise_group("joint", NoiseKind::Joint, JOINT_SIGMA, true)),
    }
}

fn add_joint(
    formulation: &mut Formulation,
    inputs: &Inputs,
    joint: JointId,
    rows: &[Row<'_>],
    noise: Option<GroupId>,
    free_set: FreeSet,
) {
    let profile = &inputs.robot.profile;
    let model = &inputs.robot.model;
    let j = model.joint(joint);
    let Some(parent) = formulation.links[j.parent.index()] else {
        return;
    };
    let readings: Vec<f64> = rows.iter().map(|r| model.position(r.q, joint)).collect();
    let fitted = readings
        .iter()
        .enumerate()
        .filter(|(i, _)| !formulation.problem.held_out.contains(i))
        .map(|(_, q)| *q);
    let (low, high) = fitted.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| {
        (l.min(q), h.max(q))
    });
    let moved = high - low > MOVED;
    let slides = matches!(j.kind, JointKind::Prismatic { .. });
    let free = match free_set {
        FreeSet::Profile => profile.solve.free_set(joint, moved, slides),
        FreeSet::RegistrationOnly => profile.solve.free_set(joint, false, slides).held(),
    };
    let problem = &mut formulation.problem;
    let chart = match (free.origin, j.kind.axis()) {
        (OriginFreeSet::Held, _) | (OriginFreeSet::Axis, None) => Chart::none(),
        (OriginFreeSet::Axis, Some(axis)) => Chart::axis_line(&axis),
        (OriginFreeSet::Full, _) => Chart::full(),
    };
    let fixed = j.kind == JointKind::Fixed;
    let child = problem.frame(&model.link(j.child).name);
    let origin_child = if fixed {
        child
    } else {
        problem.frame(&format!("{}.origin", j.name))
    };
    let name = format!("{}.origin", j.name);
    let origin = problem.unknown(&name, parent, origin_child, j.parent_link_from_joint, chart);
    problem.set_role(origin, Role::JointOrigin, Some(&j.name));
    if free.origin != OriginFreeSet::Held {
        problem.set_prior(origin, Some(free.angle_sigma), Some(free.position_sigma));
    }
    for (coordinate, parameter) in problem.edge_parameters(origin) {
        let within = if coordinate < 3 {
            free.angle_within
        } else {
            free.position_within
        };
        problem.parameter_mut(parameter).bounds = within.map(|w| (-w, w));
    }
    formulation.origins[joint.index()] = Some(origin);
    formulation.links[j.child.index()] = Some(child);
    let Some(axis) = j.kind.axis() else { return };
    let motion = if slides {
        Axis::Prismatic(axis)
    } else {
        Axis::Revolute(axis)
    };
    let edge = problem.joint(&j.name, origin_child, child, motion, readings);
    formulation.joints[joint.index()] = Some(edge);
    formulation.loaded |= add_effects(problem, profile, model, joint, edge, &free, rows);
    if let Some(group) = noise
        && moved
        && !slides
    {
        problem.joint_noise(edge, group);
    }
}

/// Frees the effects of a joint and offers the others to the test for missing physics; returns whether a prediction
/// needs its load or another joint's reading.
fn add_effects(
    problem: &mut Problem,
    profile: &Profile,
    model: &RobotModel,
    joint: JointId,
    edge: EdgeId,
    free: &JointFreeSet,
    rows: &[Row<'_>],
) -> bool {
    let states: Vec<JointState> = rows
        .iter()
        .map(|r| joint_state(model, joint, r.q, &r.loads, r.under))
        .collect();
    let mut loaded = false;
    for effect in EFFECTS.iter().filter(|e| e.profile.is_some()) {
        let wanted = free.effects.iter().find(|f| f.effect == *effect);
        if let Some(wanted) = wanted.filter(|_| (effect.estimable)(&states)) {
            for term in effect.terms {
                let p = problem.free_effect_at(edge, term.kind, &states, wanted.sigma);
                problem.parameter_mut(p).bounds = wanted.within.map(|w| (-w, w));
                loaded |= term.source == Source::Load;
            }
        } else if wanted.is_none() && effect.testable.is_some_and(|test| test(&states)) {
            // Terms of the reading alone are tested in any case.
            let terms = effect.terms.iter().filter(|t| t.source != Source::Reading);
            for term in terms {
                if let Some(values) = term.kind.regressors(&states) {
                    problem.candidate(edge, term.kind, values);
                }
            }
        }
    }
    let coupling = EffectKind::Coupling;
    let slides = !model.joint(joint).kind.turns();
    for other in &free.coupled_to {
        loaded = true;
        let coupled: Vec<JointState> = rows
            .iter()
            .zip(&states)
            .map(|(r, state)| JointState {
                other: model.position(r.q, *other),
                ..*state
            })
            .collect();
        let sigma = profile.solve.prior.of(coupling.effect(), slides);
        problem.free_effect_at(edge, coupling, &coupled, sigma);
    }
    loaded
}

fn add_bodies(
    formulation: &mut Formulation,
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    start: &Start,
) {
    let profile = &inputs.robot.profile;
    let known = profile.solve.noise.known;
    let tracker = &profile.tracker;
    let as_pose =
        |name: &String| profile.bodies[name].kind == BodyKind::Pose || tracks[name].is_computed();
    let uses = |pose: bool| profile.bodies.keys().any(|name| as_pose(name) == pose);
    let problem = &mut formulation.problem;
    let marker_noise = uses(false).then(|| {
        problem.noise_group(
            "marker",
            NoiseKind::Position,
            tracker.marker_sigma.unwrap_or(MARKER_SIGMA),
            !known,
        )
    });
    let body_noise = uses(true).then(|| PoseNoise::Split {
        orientation: problem.noise_group(
            "body orientation",
            NoiseKind::Orientation,
            tracker.body_sigma_rad.unwrap_or(BODY_SIGMA_RAD),
            !known,
        ),
        position: problem.noise_group(
            "body position",
            NoiseKind::Position,
            tracker.body_sigma.unwrap_or(BODY_SIGMA),
            !known,
        ),
    });
    for (name, body) in &profile.bodies {
        let Some(link) = formulation.links[body.link.index()] else {
            continue;
        };
        let track = &tracks[name];
        let has_frame = body.kind == BodyKind::Pose || track.template.is_some();
        let frame = if has_frame {
            let frame = formulation.problem.frame(name);
            let (value, chart) = match body.mount {
                Some(mount) => (mount, Chart::none()),
                None => (
                    start
                        .mounts
                        .get(name)
                        .copied()
                        .unwrap_or_else(Isometry3::identity),
                    Chart::full(),
                ),
            };
            let mount =
                formulation
                    .problem
                    .unknown(&format!("{name}.mount"), link, frame, value, chart);
            formulation.problem.set_role(mount, Role::Mount, None);
            formulation.mounts.insert(name.clone(), mount);
            formulation.bodies.insert(name.clone(), frame);
            frame
        } else {
            link
        };
        match (&body.kind, marker_noise, body_noise) {
            (_, _, Some(noise)) if as_pose(name) => {
                let seen = formulation.samples.iter().enumerate().filter_map(
                    |(sample, (recording, row))| {
                        let pose = (*track.in_recording(recording).get(*row)?)?;
                        Some(PoseObservation { sample, pose })
                    },
                );
                let seen = seen.collect();
                formulation
                    .problem
                    .poses(name, formulation.tracker, frame, noise, seen);
            }
            (BodyKind::Markers { names, .. }, Some(noise), _) => {
                let points = add_points(&mut formulation.problem, names, track, start, name, frame);
                let mut seen = Vec::new();
                for (sample, (recording, row)) in formulation.samples.iter().enumerate() {
                    for (marker, point) in &points {
                        let loaded = &inputs.recordings[recording];
                        let track = loaded.poses.markers.get(marker);
                        if let Some(position) = track.and_then(|t| t[*row]) {
                            let shapes = loaded.shapes.get(marker);
                            seen.push(MarkerObservation {
                                sample,
                                point: *point,
                                position,
                                shape: shapes.and_then(|s| s.get(*row).copied().flatten()),
                            });
                        }
                    }
                }
                formulation
                    .problem
                    .markers(name, formulation.tracker, frame, noise, seen);
                formulation
                    .points
                    .insert(name.clone(), points.into_iter().collect());
            }
            _ => {}
        }
    }
}

/// Points of a marker body. A given template is known. A learned one is estimated with the fit, held to the frame's
/// convention: first marker at the origin, second on x, the third that is off that line in the xy plane.
fn add_points(
    problem: &mut Problem,
    names: &[String],
    track: &BodyTrack,
    start: &Start,
    body: &str,
    frame: FrameId,
) -> Vec<(String, PointId)> {
    /// Off the x axis by more than this counts as the marker that defines the plane, m.
    const OFF_AXIS: f64 = 1e-9;
    let mut points = Vec::new();
    let mut plane_defined = false;
    for (i, marker) in names.iter().enumerate() {
        let Some(template) = &track.template else {
            let place = start
                .points
                .get(body)
                .and_then(|p| p.get(marker))
                .copied()
                .unwrap_or_else(Point3::origin);
            points.push((
                marker.clone(),
                problem.unknown_point(marker, frame, place, None),
            ));
            continue;
        };
        let place = template.points[i];
        if !track.learned || i == 0 {
            points.push((marker.clone(), problem.known_point(marker, frame, place)));
            continue;
        }
        let defines_plane =
            i >= 2 && !plane_defined && place.z.abs() < OFF_AXIS && place.y > OFF_AXIS;
        let held: &[usize] = match (i, defines_plane) {
            (1, _) => &[1, 2],
            (_, true) => &[2],
            _ => &[],
        };
        plane_defined |= defines_plane;
        let point = problem.unknown_point(marker, frame, place, None);
        let coordinates = problem.points()[point.index()].parameters;
        for &axis in held {
            if let Some(ids) = coordinates {
                problem.parameter_mut(ids[axis]).fixed = true;
            }
        }
        points.push((marker.clone(), point));
    }
    points
}

/// The robot that a solution describes.
fn calibration(formulation: &Formulation, solution: &Solution, inputs: &Inputs) -> Calibration {
    calibration_at(formulation, &solution.model, &solution.values, inputs)
}

/// The robot that any values of the parameters describe.
pub(crate) fn calibration_at(
    formulation: &Formulation,
    solved: &calib_core::Model,
    values: &calib_core::Values,
    inputs: &Inputs,
) -> Calibration {
    let model = &inputs.robot.model;
    let pose = |edge: EdgeId| {
        solved
            .edge_pose(edge, values)
            .unwrap_or_else(Isometry3::identity)
    };
    let mut robot = Calibration::nominal(model, pose(formulation.root));
    for joint in model.joint_ids() {
        if let Some(edge) = formulation.origins[joint.index()] {
            robot.model = robot.model.with_origin(joint, pose(edge));
        }
        if let Some(edge) = formulation.joints[joint.index()] {
            robot.effects[joint.index()] = effects(formulation, values, inputs, joint, edge);
        }
    }
    robot.mounts = formulation
        .mounts
        .iter()
        .map(|(name, edge)| (name.clone(), pose(*edge)))
        .collect();
    for (body, points) in &formulation.points {
        let link_from_body = robot
            .mounts
            .get(body)
            .copied()
            .unwrap_or_else(Isometry3::identity);
        let on_link = points.iter().map(|(marker, point)| {
            let p = solved.point_position(point.index(), values);
            (marker.clone(), link_from_body * p)
        });
        robot.points.insert(body.clone(), on_link.collect());
    }
    for (name, point) in &formulation.contact_points {
        let at = solved.point_position(point.index(), values);
        robot.contact_points.insert(name.clone(), at);
    }
    for (name, place) in &formulation.contacts {
        robot.places.insert(name.clone(), pose(*place));
    }
    robot
}

fn effects(
    formulation: &Formulation,
    values: &calib_core::Values,
    inputs: &Inputs,
    joint: JointId,
    edge: EdgeId,
) -> JointEffects {
    let mut effects = JointEffects::default();
    let calib_core::EdgeKind::Joint(j) = &formulation.problem.edges()[edge.index()].kind else {
        return effects;
    };
    let mut coupled = inputs
        .robot
        .profile
        .solve
        .joints
        .get(&joint)
        .map_or(&[][..], |e| &e.coupled_to)
        .iter();
    for effect in &j.effects {
        let c = values.0[effect.parameter.index()];
        match effect.kind.term().source {
            Source::OtherJoint => {
                if let Some(other) = coupled.next() {
                    effects.coupling.insert(other.index(), c);
                }
            }
            // The clocks belong to the recordings, not to the robot.
            Source::Velocity | Source::Caller => {}
            _ => {
                effects.coefficients.insert(effect.kind, c);
            }
        }
    }
    effects
}
