//! Recordings with known truth, from a robot profile.
//!
//! The true robot differs from its description by drawn errors; the tracker and the joints add noise:
//!
//! ```text
//! parent_from_joint' = parent_from_joint · exp(ξ),   ξ across the joint's axis          (1)
//! q_true = q_indicated + offset + c · g(q_indicated) + N(0, σ_q²)                       (2)
//! marker = tracker_from_root · FK'(q_true) · link_from_body' · p_body + N(0, σ_m² I)     (3)
//! body   = tracker_from_root · FK'(q_true) · link_from_body' · exp(N(0, diag(σ_r², σ_t²))) (4)
//! ```
//!
//! `g` is the gravity torque about the joint (N m) from the masses of the URDF, gravity along −z of the root.
//! Errors of an origin along or about its own axis are not drawn in (1): they are what a zero offset and the
//! choice of a frame on the axis mean already. The same profile and seed give the same bytes.
//!
//! Two machines with two clocks: [`simulate_streams`]. What this crate does not simulate: cameras, marker swaps.

mod protocol;
mod robot;
mod streams;
mod truth;

use std::collections::BTreeMap;

use calib_geometry::{Twist, se3};
use calib_profile::{BodyKind, Profile, Simulation};
use calib_recording::{JointUnit, Poses};
use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

pub use protocol::{Commanded, commanded_poses};
pub use robot::TrueRobot;
pub use streams::{Motion, StreamPlan, Streams, simulate_streams};
pub use truth::{Truth, TruthTransform};

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
    let plan = profile.simulate.as_ref().ok_or(SimError::NoSection)?;
    let seed = seed.unwrap_or(plan.seed);
    let robot = TrueRobot::draw(profile, plan, model, seed);
    let mut recordings = BTreeMap::new();
    for (index, (name, protocol)) in plan.recordings.iter().enumerate() {
        // A stream of its own per recording: adding one leaves the others as they were.
        let mut rng = stream(seed, 1 + index as u64);
        let commanded = commanded_poses(protocol, model, &mut rng);
        let group = profile.recordings.get(name).and_then(|r| r.group.clone());
        let poses = measure(
            profile,
            plan,
            model,
            &robot,
            &commanded,
            &protocol.bodies,
            group,
            &mut rng,
        );
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
#[allow(clippy::too_many_arguments)] // one call site; a struct would only rename the arguments
fn measure(
    profile: &Profile,
    plan: &Simulation,
    model: &RobotModel,
    robot: &TrueRobot,
    commanded: &Commanded,
    bodies: &[String],
    group: Option<String>,
    rng: &mut ChaCha12Rng,
) -> Poses {
    let mut poses = Poses {
        rows: (0..commanded.q.len() as u64).collect(),
        ..Poses::default()
    };
    for id in model.independent_joints() {
        let joint = model.joint(id);
        let unit = if joint.kind.turns() {
            JointUnit::Angle
        } else {
            JointUnit::Length
        };
        poses.joint_units.insert(joint.name.clone(), unit);
        let column = commanded.q.iter().map(|q| Some(q[id.index()])).collect();
        poses.joints.insert(joint.name.clone(), column);
    }
    for q in &commanded.q {
        let root_from_link = robot.forward_kinematics(q, plan.noise.joint, rng);
        for name in bodies {
            let body = &profile.bodies[name];
            let tracker_from_body =
                robot.tracker_from_root * root_from_link[body.link.index()] * robot.mounts[name];
            match &body.kind {
                BodyKind::Pose => {
                    let noise = Twist::new(
                        normal3(rng, plan.noise.body.angle),
                        normal3(rng, plan.noise.body.position),
                    );
                    let seen = visible(rng, plan.noise.occluded);
                    let sample: Option<Isometry3<f64>> =
                        seen.then(|| tracker_from_body * se3::exp(&noise));
                    poses.bodies.entry(name.clone()).or_default().push(sample);
                }
                BodyKind::Markers { names, .. } => {
                    for marker in names {
                        let p_body = plan.mounts[name].markers[marker];
                        let noise = normal3(rng, plan.noise.marker);
                        let seen = visible(rng, plan.noise.occluded);
                        let sample: Option<Point3<f64>> =
                            seen.then(|| tracker_from_body * p_body + noise);
                        poses
                            .markers
                            .entry(marker.clone())
                            .or_default()
                            .push(sample);
                    }
                }
            }
        }
    }
    if !commanded.groups.is_empty() {
        poses.labels.insert(
            group.unwrap_or_else(|| "group".to_owned()),
            commanded.groups.clone(),
        );
    }
    poses
}

fn visible(rng: &mut ChaCha12Rng, occluded: f64) -> bool {
    rng.random::<f64>() >= occluded
}
