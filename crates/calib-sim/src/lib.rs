//! Recordings with known truth, from a robot profile.
//!
//! The true robot differs from its nominal URDF by random errors; the tracker and the joints add noise:
//!
//! ```text
//! parent_from_joint' = parent_from_joint · exp(ξ),   ξ across the joint's axis          (1)
//! q_true = q_indicated + offset + c · g(q_indicated) + N(0, σ_q²)                       (2)
//! marker = tracker_from_root · FK'(q_true) · link_from_body' · p_body + N(0, σ_m² Σ)     (3)
//! body   = tracker_from_root · FK'(q_true) · link_from_body' · exp(N(0, diag(σ_r², σ_t²))) (4)
//! ```
//!
//! Σ is the identity; with cameras in the profile (`plan: {cameras: …}`) it is the covariance of their triangulation, 1 per coordinate on average.
//! σ_m, σ_r and σ_t may be larger by a stated factor in a recording, or where it repeats its poses (cameras that are occluded there).
//! `g` is the torque that gravity exerts about the joint (N m), so that c > 0 gives way: from the masses of the URDF (uniform rods where
//! it has none) and the payloads of the profile.
//! (1) has no errors of an origin along or about its own axis: a zero offset and the choice of a frame on the axis
//! describe them already. The same profile and seed give the same bytes.
//!
//! [`simulate_streams`] simulates two machines with two clocks. This crate does not simulate occlusion by place, nor marker swaps.
//!
//! ```
//! use calib_profile::{check, parse};
//! use calib_urdf::RobotModel;
//!
//! let robots = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots");
//! let text = std::fs::read_to_string(format!("{robots}/ripley.yaml"))?;
//! let raw = parse(&text, "ripley.yaml")?;
//! let model = RobotModel::from_urdf_file(format!("{robots}/{}", raw.robot.urdf).as_ref())?;
//! let profile = check(&raw, &text, "ripley.yaml", &model)?;
//! let simulated = calib_sim::simulate(&profile, &model, Some(1))?;
//! assert!(simulated.recordings.keys().all(|name| profile.recordings.contains_key(name)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod protocol;
mod robot;
mod streams;
mod timed;
mod tracker;
mod truth;

use std::collections::BTreeMap;

use calib_profile::Profile;
use calib_recording::{JointUnit, Poses};
use calib_urdf::{Joint, RobotModel};
use nalgebra::Vector3;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

pub use nalgebra;
pub use protocol::{Commanded, commanded_poses};
pub use robot::TrueRobot;
pub use streams::{Motion, StreamPlan, Streams, simulate_streams};
pub use timed::timed;
pub use truth::{Truth, TruthTransform};

use tracker::Tracker;

/// Recordings by name, and the truth behind them.
#[derive(Debug, Clone)]
pub struct Simulated {
    /// One table per simulated recording.
    pub recordings: BTreeMap<String, Poses>,
    /// What was drawn.
    pub truth: Truth,
}

/// Why a profile cannot be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// The profile does not say how.
    #[error(
        "the profile has no `simulate` section\n  help: add one; those of `robots/ripley.yaml` and `robots/justin.yaml` show how"
    )]
    NoSection,
    /// Markers of a body do not span a frame.
    #[error(
        "body `{body}`: {source}\n  help: give its simulated markers other places (`simulate: {{mounts: …}}`)"
    )]
    Body {
        /// The body.
        body: String,
        /// Why.
        source: calib_checks::rigid_body::NotABody,
    },
}

/// Simulates all recordings of the profile's `simulate` section.
///
/// # Errors
/// [`SimError`] when the section is absent or a body's markers span no frame.
pub fn simulate(
    profile: &Profile,
    model: &RobotModel,
    seed: Option<u64>,
) -> Result<Simulated, SimError> {
    simulate_again(profile, model, seed, 0)
}

/// The robot of [`simulate`] in given postures (joint positions by joint index, rad or m, by recording); recordings that are not named are those
/// of the section.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_postures(
    profile: &Profile,
    model: &RobotModel,
    seed: Option<u64>,
    postures: &BTreeMap<String, Vec<Vec<f64>>>,
) -> Result<Simulated, SimError> {
    /// Streams of their own, that no recording of a section has.
    const GIVEN: u64 = 1 << 16;
    let plan = profile.simulate.as_ref().ok_or(SimError::NoSection)?;
    let mut simulated = simulate(profile, model, seed)?;
    let seed = seed.unwrap_or(plan.seed);
    let robot = TrueRobot::draw(profile, plan, model, seed);
    let tracker = Tracker::before(profile, plan, &robot, postures.values().flatten());
    for (index, (name, q)) in postures.iter().enumerate() {
        let mut rng = stream(seed, GIVEN + index as u64);
        let protocol = plan.recordings.get(name);
        // Given postures stand at none of the values of `repeat_at`: only a factor of the whole recording holds for them.
        let times = protocol.map_or(&[][..], |protocol| &protocol.tracker_noise_times);
        let times = match times {
            [first, rest @ ..] if rest.iter().all(|other| other == first) => *first,
            _ => 1.0,
        };
        let commanded = Commanded {
            q: q.clone(),
            groups: Vec::new(),
            tracker_noise_times: vec![times; q.len()],
        };
        let all: Vec<String> = profile.bodies.keys().cloned().collect();
        let bodies = protocol.map_or(&all, |protocol| &protocol.bodies);
        let tracker = tracker.clone().in_recording(name);
        let poses = measure(&tracker, model, &commanded, bodies, &mut rng);
        simulated.recordings.insert(name.clone(), poses);
    }
    Ok(simulated)
}

/// The robot of [`simulate`] recorded once more: the same robot, mounts and tracker, other random poses and other noise. Repetition 0 is
/// [`simulate`].
///
/// # Errors
/// As [`simulate`].
pub fn simulate_again(
    profile: &Profile,
    model: &RobotModel,
    seed: Option<u64>,
    repetition: u64,
) -> Result<Simulated, SimError> {
    /// Streams of one repetition: more recordings than any profile has, and the streams of motions beside them.
    const STREAMS: u64 = 1 << 20;
    let plan = profile.simulate.as_ref().ok_or(SimError::NoSection)?;
    let seed = seed.unwrap_or(plan.seed);
    let robot = TrueRobot::draw(profile, plan, model, seed);
    let mut all = Vec::new();
    for (index, (name, protocol)) in plan.recordings.iter().enumerate() {
        // A stream of its own per recording: adding one leaves the others as they were.
        let mut rng = stream(seed, repetition * STREAMS + 1 + index as u64);
        let commanded = commanded_poses(protocol, model, &mut rng);
        all.push((name, protocol, commanded, rng));
    }
    let postures = all.iter().flat_map(|(_, _, commanded, _)| &commanded.q);
    let tracker = Tracker::before(profile, plan, &robot, postures);
    let mut recordings = BTreeMap::new();
    for (name, protocol, commanded, mut rng) in all {
        let tracker = tracker.clone().in_recording(name);
        let mut poses = measure(&tracker, model, &commanded, &protocol.bodies, &mut rng);
        if !commanded.groups.is_empty() {
            let group = profile.recordings.get(name).and_then(|r| r.group.clone());
            let column = group.unwrap_or_else(|| "group".to_owned());
            poses.labels.insert(column, commanded.groups);
        }
        recordings.insert(name.clone(), poses);
    }
    let truth = Truth::of(profile, model, &robot, seed)?;
    Ok(Simulated { recordings, truth })
}

pub(crate) fn stream(seed: u64, stream: u64) -> ChaCha12Rng {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

pub(crate) fn normal3(rng: &mut impl Rng, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal) * sigma)
}

/// Eqs. (2)–(4) for every commanded pose.
fn measure(
    tracker: &Tracker<'_>,
    model: &RobotModel,
    commanded: &Commanded,
    bodies: &[String],
    rng: &mut ChaCha12Rng,
) -> Poses {
    let mut poses = Poses {
        rows: (0..commanded.q.len() as u64).collect(),
        ..Poses::default()
    };
    for id in model.independent_joints() {
        let joint = model.joint(id);
        poses.joint_units.insert(joint.name.clone(), unit_of(joint));
        let column = commanded.q.iter().map(|q| Some(q[id.index()])).collect();
        poses.joints.insert(joint.name.clone(), column);
    }
    for (q, times) in commanded.q.iter().zip(&commanded.tracker_noise_times) {
        let sigma = tracker.plan.noise.joint;
        let root_from_link = tracker.robot.forward_kinematics(q, sigma, rng);
        tracker.observe(bodies, &root_from_link, *times, &mut poses, rng);
    }
    poses
}

/// The unit of a joint's column.
pub(crate) fn unit_of(joint: &Joint) -> JointUnit {
    if joint.kind.turns() {
        JointUnit::Angle
    } else {
        JointUnit::Length
    }
}
