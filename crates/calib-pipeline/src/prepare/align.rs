//! Streams with a time become a table of poses: the clocks are brought together, then the holds are found or rows taken.
//!
//! ```text
//! t_tracker = t_robot + δ + ρ (t_robot − t̄)                                                           (1)
//! ```
//!
//! One clock: nothing to do. Two clocks that the profile declares to be one: δ = ρ = 0. Else δ and ρ come from the angular
//! speed of a tracking body against that of its link ([`calib_checks::sync`]), which needs no calibration; where they
//! cannot be told, the recording is refused. Then either every hold gives one static pose (an error of δ costs
//! nothing), or rows are taken from the motion, and the fit estimates what is left of δ and ρ
//! ([`mod@crate::formulate::clock`]).

use std::collections::BTreeMap;

use calib_checks::model::alignment;
use calib_checks::sync::{ClockMap, OffsetOutcome};
use calib_checks::{Expectations, checks};
use calib_finding::{Finding, Severity, Subject};
use calib_profile::{Clocks, RecordingSpec, TimedPoses, Timing};
use calib_recording::{Poses, Recording};

use crate::error::PipelineError;
use crate::prepare::aligned::{Aligned, Alignment};
use crate::prepare::inputs::RobotProfile;
use crate::prepare::settled::settle;
use crate::prepare::streams::Scalars;
use crate::prepare::timelines::{estimate, tracker_table, tracker_timeline};

/// An offset below this, s, is none: at 0.5 rad/s and 1 m it is a tenth of a millimeter.
pub(crate) const SAME_TIME: f64 = 2e-4;

/// Half of the time over which a joint's speed is measured, s: several samples of any controller.
const HALF_CHORD: f64 = 0.02;

/// What is known of two clocks.
#[derive(Debug, Clone, PartialEq)]
pub enum ClockState {
    /// They are one: the streams name the same clock.
    One,
    /// The profile declares them to be one.
    Declared,
    /// Found from the motion of a body.
    Found {
        /// The body.
        body: String,
        /// Equation (1), tracker from robot.
        map: ClockMap,
    },
}

/// The table of a timed recording, and of the robot's own log where that is another file.
///
/// # Errors
/// [`PipelineError::Data`] when there is no time, the clocks cannot be brought together, or nothing stood still.
pub fn align(
    robot: &RobotProfile,
    name: &str,
    spec: &RecordingSpec,
    timing: &Timing,
    recording: &Recording,
) -> Result<Aligned, PipelineError> {
    let fail = |finding: String, remedy: &str| PipelineError::Data {
        file: robot.folder.join(&spec.file).display().to_string(),
        finding,
        remedy: remedy.to_owned(),
    };
    let tracker_line = tracker_timeline(recording).ok_or_else(|| {
        fail(
            "no stream of a marker or body".to_owned(),
            "name the tracker's file under `file`",
        )
    })?;
    let tracker = recording
        .timelines
        .get(tracker_line)
        .ok_or_else(|| fail("a stream has no time line".to_owned(), "correct the reader"))?;
    let times = tracker.t.clone().ok_or_else(|| {
        fail(
            "`timing` is given, the tracker's rows have no time".to_owned(),
            "add a column `t_s`, or remove `timing`: static poses need none",
        )
    })?;
    let joints = Scalars::of_joints(recording);
    let robot_line = joints.values().map(|j| j.timeline).next();
    let robot_clock = robot_line
        .and_then(|line| recording.timelines.get(line))
        .map_or_else(|| tracker.clock.clone(), |line| line.clock.clone());
    if joints.values().any(|j| j.t.is_empty()) {
        return Err(fail(
            "the joints' rows have no time".to_owned(),
            "add a column `t_s` to the robot's log",
        ));
    }
    let mut full = tracker_table(recording, tracker_line, &times)
        .map_err(|e| fail(e, "give every stream a name of its own"))?;
    let mut findings: Vec<Finding> = checks(&full, &Expectations::default())
        .into_iter()
        .filter(|f| f.severity != Severity::Error)
        .map(|f| f.in_recording(name))
        .collect();
    let one_line = robot_line.is_none_or(|line| line == tracker_line);
    let clocks = if one_line || robot_clock == tracker.clock {
        ClockState::One
    } else if timing.clock == Clocks::Shared {
        ClockState::Declared
    } else {
        let (body, map) = estimate(robot, spec, timing, &full, &joints)
            .map_err(|f| fail(format!("recording `{name}`: {}", f.text()), &f.remedy()))?;
        findings.extend(
            alignment(&OffsetOutcome::Found(map), SAME_TIME).map(|mut finding| {
                finding.subject = Subject::body(&body).in_recording(name);
                finding
            }),
        );
        ClockState::Found { body, map }
    };
    let at_robot = |t: f64| match &clocks {
        ClockState::Found { map, .. } => map.to_b(t),
        ClockState::One | ClockState::Declared => t,
    };
    let mut velocities = BTreeMap::new();
    for (joint, stream) in &joints {
        let q = times.iter().map(|t| stream.at(at_robot(*t))).collect();
        full.joints.insert(joint.clone(), q);
        if let Some(unit) = stream.unit {
            full.joint_units.insert(joint.clone(), unit);
        }
        let speed = times.iter().map(|t| stream.speed(at_robot(*t), HALF_CHORD));
        velocities.insert(joint.clone(), speed.collect::<Vec<_>>());
    }
    for (joint, stream) in Scalars::of_torques(recording) {
        let torque = times.iter().map(|t| stream.at(at_robot(*t))).collect();
        full.torques.insert(joint, torque);
    }
    let mut aligned = Aligned {
        poses: Poses::default(),
        velocities: BTreeMap::new(),
        shapes: BTreeMap::new(),
        alignment: Alignment {
            tracker_clock: tracker.clock.clone(),
            robot_clock,
            clocks,
            holds: None,
            samples: times.len(),
        },
        findings,
        excluded: Vec::new(),
    };
    match timing.poses {
        TimedPoses::Settle => {
            settle(name, timing, &robot.profile.tracker, &full, &mut aligned);
            if aligned.poses.is_empty() {
                return Err(fail(
                    format!(
                        "recording `{name}`: nothing stands still for {} s",
                        timing.hold
                    ),
                    "hold each posture for a second, or take rows of the motion: `timing: {poses: continuous}`",
                ));
            }
        }
        TimedPoses::Continuous => {
            let rows = thinned(&full, &times, timing.rate);
            aligned.poses = full.select(&rows);
            aligned.velocities = velocities
                .into_iter()
                .map(|(joint, v)| (joint, rows.iter().map(|&i| v[i]).collect()))
                .collect();
        }
    }
    Ok(aligned)
}

/// Rows at the wanted rate, of those with all joints and anything tracked.
fn thinned(full: &Poses, times: &[f64], rate: f64) -> Vec<usize> {
    let usable = |row: &usize| {
        full.joints.values().all(|q| q[*row].is_some())
            && (full.markers.values().any(|m| m[*row].is_some())
                || full.bodies.values().any(|b| b[*row].is_some()))
    };
    let mut next = f64::NEG_INFINITY;
    let mut rows = Vec::new();
    for row in (0..full.len()).filter(usable) {
        // Half a microsecond of rounding must not cost a row.
        if times[row] >= next - 5e-7 {
            rows.push(row);
            next = if next.is_finite() && times[row] < next + 1.0 / rate {
                next + 1.0 / rate
            } else {
                times[row] + 1.0 / rate
            };
        }
    }
    rows
}
