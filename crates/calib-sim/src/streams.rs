//! A robot in motion, recorded by two machines with two clocks.
//!
//! ```text
//! t_tracker = t_robot + δ + ρ (t_robot − T/2)                                                         (1)
//! ```
//!
//! The motion is either a sum of incommensurate sines in every joint, or postures drawn at random and held. Errors of the
//! robot, mounts and noise are those of [`simulate`](crate::simulate); in holds a joint's noise is drawn once per hold.

use std::collections::BTreeMap;

use calib_profile::Profile;
use calib_recording::Poses;
use calib_urdf::{JointId, RobotModel};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::robot::TrueRobot;
use crate::tracker::Tracker;
use crate::truth::Truth;
use crate::{SimError, stream, unit_of};

/// How the robot moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// All joints all the time.
    Continuous,
    /// Postures at random: each held for `hold` s, reached in `travel` s.
    StopAndGo {
        /// s.
        hold: f64,
        /// s.
        travel: f64,
    },
}

/// What is recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct StreamPlan {
    /// How the robot moves.
    pub motion: Motion,
    /// Joints that move, and between what, rad or m; all others stand at zero.
    pub ranges: BTreeMap<JointId, (f64, f64)>,
    /// Bodies in view.
    pub bodies: Vec<String>,
    /// Length, s.
    pub duration: f64,
    /// Rate of the tracker, Hz.
    pub tracker_hz: f64,
    /// Rate of the robot's log, Hz.
    pub robot_hz: f64,
    /// δ of equation (1), s.
    pub offset: f64,
    /// ρ of equation (1).
    pub drift: f64,
}

/// Two streams and the truth behind them.
#[derive(Debug, Clone)]
pub struct Streams {
    /// What the tracker wrote, in its own time.
    pub tracker: Poses,
    /// What the robot wrote, in its own time.
    pub robot: Poses,
    /// What was drawn.
    pub truth: Truth,
}

/// A sum of sines within a range.
struct Waves {
    middle: f64,
    half: f64,
    /// Rate, rad/s, and phase, rad.
    waves: [(f64, f64); 3],
}

/// Joint positions over time.
struct Trajectory {
    motion: Motion,
    waves: BTreeMap<JointId, Waves>,
    /// Per hold and joint: indicated position, and the error of the true one.
    holds: Vec<BTreeMap<JointId, (f64, f64)>>,
}

impl Trajectory {
    fn draw(plan: &StreamPlan, joint_sigma: f64, rng: &mut ChaCha12Rng) -> Self {
        let mut waves_of = BTreeMap::new();
        for (joint, (low, high)) in &plan.ranges {
            let waves = [(); 3].map(|()| {
                (
                    rng.random_range(0.3..1.3),
                    rng.random_range(0.0..std::f64::consts::TAU),
                )
            });
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            waves_of.insert(
                *joint,
                Waves {
                    middle,
                    half,
                    waves,
                },
            );
        }
        let count = match plan.motion {
            Motion::Continuous => 0,
            Motion::StopAndGo { hold, travel } => (plan.duration / (hold + travel)) as usize + 2,
        };
        let holds = (0..count)
            .map(|_| {
                let mut posture = BTreeMap::new();
                for (joint, (low, high)) in &plan.ranges {
                    let noise = rng.sample::<f64, _>(StandardNormal) * joint_sigma;
                    posture.insert(*joint, (rng.random_range(*low..*high), noise));
                }
                posture
            })
            .collect();
        Self {
            motion: plan.motion,
            waves: waves_of,
            holds,
        }
    }

    /// Indicated position of each joint at `t`, and the error of the true one.
    fn at(&self, t: f64) -> BTreeMap<JointId, (f64, f64)> {
        match self.motion {
            Motion::Continuous => {
                let position = |w: &Waves| {
                    let share = [0.5, 0.3, 0.2];
                    let sum: f64 = w
                        .waves
                        .iter()
                        .zip(share)
                        .map(|((rate, phase), share)| share * (rate * t + phase).sin())
                        .sum();
                    (w.middle + w.half * sum, 0.0)
                };
                self.waves.iter().map(|(j, w)| (*j, position(w))).collect()
            }
            Motion::StopAndGo { hold, travel } => {
                let period = hold + travel;
                let k = (t.max(0.0) / period) as usize;
                let f = ((t.max(0.0) - k as f64 * period - hold) / travel).clamp(0.0, 1.0);
                // Starts and ends without a jolt.
                let f = f * f * (3.0 - 2.0 * f);
                let last = self.holds.len().saturating_sub(1);
                let (from, to) = (&self.holds[k.min(last)], &self.holds[(k + 1).min(last)]);
                from.iter()
                    .map(|(joint, (q, e))| {
                        let (q1, e1) = to[joint];
                        (*joint, (q + f * (q1 - q), e + f * (e1 - e)))
                    })
                    .collect()
            }
        }
    }
}

/// Simulates both streams.
///
/// # Errors
/// [`SimError`] when the profile has no `simulate` section or a body's markers span no frame.
pub fn simulate_streams(
    profile: &Profile,
    model: &RobotModel,
    plan: &StreamPlan,
    seed: u64,
) -> Result<Streams, SimError> {
    let section = profile.simulate.as_ref().ok_or(SimError::NoSection)?;
    let robot = TrueRobot::draw(profile, section, model, seed);
    let mut rng = stream(seed, 1000);
    let trajectory = Trajectory::draw(plan, section.noise.joint, &mut rng);
    let mut log = Poses::default();
    let mut times = Vec::new();
    for i in 0..(plan.duration * plan.robot_hz) as usize {
        let t = i as f64 / plan.robot_hz;
        times.push(t);
        log.rows.push(i as u64 + 1);
        for (joint, (q, _)) in trajectory.at(t) {
            let column = log.joints.entry(model.joint(joint).name.clone());
            column.or_default().push(Some(q));
        }
    }
    for joint in plan.ranges.keys() {
        let joint = model.joint(*joint);
        log.joint_units.insert(joint.name.clone(), unit_of(joint));
    }
    log.t = Some(times);
    let at = |t: f64| {
        let mut q = model.zero_positions();
        for (joint, (indicated, error)) in trajectory.at(t) {
            q[joint.index()] = indicated + error;
        }
        q
    };
    // Often enough for an average.
    let some: Vec<Vec<f64>> = (0..64)
        .map(|i| at(f64::from(i) / 64.0 * plan.duration))
        .collect();
    let tracker = Tracker::before(profile, section, &robot, some.iter());
    let mut seen = Poses::default();
    let mut times = Vec::new();
    for i in 0..(plan.duration * plan.tracker_hz) as usize {
        // Half a step of its own: the two never sample at the same instants.
        let t = (i as f64 + 0.37) / plan.tracker_hz;
        times.push(t + plan.offset + plan.drift * (t - 0.5 * plan.duration));
        seen.rows.push(i as u64 + 1);
        let q = at(t);
        let sigma = match plan.motion {
            Motion::Continuous => section.noise.joint,
            Motion::StopAndGo { .. } => 0.0,
        };
        let root_from_link = robot.forward_kinematics(&q, sigma, &mut rng);
        tracker.observe(&plan.bodies, &root_from_link, 1.0, &mut seen, &mut rng);
    }
    seen.t = Some(times);
    let truth = Truth::of(profile, model, &robot, seed)?;
    Ok(Streams {
        tracker: seen,
        robot: log,
        truth,
    })
}
