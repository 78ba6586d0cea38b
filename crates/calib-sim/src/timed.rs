//! Postures as a stream with times, for recordings of profiles that have `timing`: the robot goes from posture to posture and holds each.

use calib_profile::{Profile, TimedPoses, Timing};
use calib_recording::Poses;
use calib_urdf::RobotModel;
use calib_urdf::range::resting_positions;
use rand::RngExt;
use rand_distr::StandardNormal;

use crate::protocol::commanded_poses;
use crate::robot::TrueRobot;
use crate::tracker::Tracker;
use crate::{SimError, stream};

/// Rate of the rows, Hz.
const RATE: f64 = 50.0;
/// A hold lasts so many times the shortest one that counts.
const HOLD: f64 = 1.5;
/// Time from one posture to the next, s: while the robot is to be seen at rest, and while it is to be seen moving.
const TRAVEL: (f64, f64) = (1.0, 2.0);
/// Streams of random numbers that no recording of a section has.
const STREAMS: u64 = 1 << 17;

/// The stream in which a recording's postures (joint positions, rad or m, one row each) are taken one after the other. Tracker and joints have one clock.
///
/// # Errors
/// [`SimError`] when the profile has no `simulate` section.
pub fn timed(
    profile: &Profile,
    model: &RobotModel,
    seed: Option<u64>,
    name: &str,
    postures: &Poses,
    timing: &Timing,
) -> Result<Poses, SimError> {
    let plan = profile.simulate.as_ref().ok_or(SimError::NoSection)?;
    let seed = seed.unwrap_or(plan.seed);
    let robot = TrueRobot::draw(profile, plan, model, seed);
    let index = plan.recordings.keys().position(|own| own == name);
    let index = index.unwrap_or(plan.recordings.len()) as u64;
    let protocol = plan.recordings.get(name);
    // As many times worse as the tracker is in each posture.
    let commanded = protocol.map(|p| commanded_poses(p, model, &mut stream(seed, 1 + index)));
    let worse = |row: usize| match &commanded {
        Some(c) if c.q.len() == postures.len() => c.tracker_noise_times[row],
        _ => 1.0,
    };
    let all: Vec<String> = profile.bodies.keys().cloned().collect();
    let bodies = protocol.map_or(&all, |p| &p.bodies);
    let mut rng = stream(seed, STREAMS + index);
    // Indicated positions, and how far the true ones are off while the robot stands there.
    let posture = |row: usize| -> Vec<f64> {
        let mut q = resting_positions(model);
        for id in model.independent_joints() {
            let column = postures.joints.get(&model.joint(id).name);
            q[id.index()] = column.and_then(|c| c[row]).unwrap_or(q[id.index()]);
        }
        q
    };
    let indicated: Vec<Vec<f64>> = (0..postures.len()).map(posture).collect();
    let tracker = Tracker::before(profile, plan, &robot, indicated.iter()).in_recording(name);
    let mut off = || -> Vec<f64> {
        let joints = 0..model.joints().len();
        let draw = |_| rng.sample::<f64, _>(StandardNormal) * plan.noise.joint;
        joints.map(draw).collect()
    };
    let errors: Vec<Vec<f64>> = indicated.iter().map(|_| off()).collect();
    let (hold, travel) = match timing.poses {
        TimedPoses::Settle => (HOLD * timing.hold, TRAVEL.0),
        TimedPoses::Continuous => (0.0, TRAVEL.1),
    };
    let mut poses = Poses {
        joint_units: postures.joint_units.clone(),
        ..Poses::default()
    };
    let mut times = Vec::new();
    let last = postures.len().saturating_sub(1);
    let duration = postures.len() as f64 * hold + last as f64 * travel;
    for i in 0..=(duration * RATE) as usize {
        let t = i as f64 / RATE;
        let from = ((t / (hold + travel)) as usize).min(last);
        let to = (from + 1).min(last);
        let share = ((t - from as f64 * (hold + travel) - hold) / travel).clamp(0.0, 1.0);
        // Starts and ends without a jolt.
        let share = share * share * (3.0 - 2.0 * share);
        let between = |at: &[Vec<f64>], joint: usize| {
            at[from][joint] + share * (at[to][joint] - at[from][joint])
        };
        let mut q = resting_positions(model);
        for id in model.independent_joints() {
            let shown = between(&indicated, id.index());
            q[id.index()] = shown + between(&errors, id.index());
            let column = poses.joints.entry(model.joint(id).name.clone());
            column.or_default().push(Some(shown));
        }
        let there = if share > 0.5 { to } else { from };
        for (label, texts) in &postures.labels {
            let column = poses.labels.entry(label.clone()).or_default();
            column.push(texts[there].clone());
        }
        let root_from_link = robot.forward_kinematics(&q, 0.0, &mut rng);
        tracker.observe(bodies, &root_from_link, worse(there), &mut poses, &mut rng);
        poses.rows.push(i as u64);
        times.push(t);
    }
    poses.t = Some(times);
    Ok(poses)
}
