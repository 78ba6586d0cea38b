//! Streams with a time become a table of poses: the clocks are brought together, then the holds are found or rows taken.
//!
//! ```text
//! t_tracker = t_robot + δ + ρ (t_robot − t̄)                                                           (1)
//! ```
//!
//! One clock: nothing to do. Two clocks that the profile declares to be one: δ = ρ = 0. Else δ and ρ come from the angular
//! speed of a tracking body against that of its link ([`calib_checks::sync`]), which needs no calibration; where they
//! cannot be told, the recording is refused. A body without orientation tells them by the place of a marker instead. Then
//! either every hold gives one static pose (an error of δ costs nothing), or rows are taken from the motion, and the fit
//! estimates what is left of δ and ρ ([`mod@crate::formulate::clock`], [`mod@crate::formulate::realign`]); of one clock it
//! estimates δ, by which joint values that were read late are late.

use std::collections::BTreeMap;
use std::sync::Arc;

use calib_checks::model::alignment;
use calib_checks::sync::OffsetOutcome;
use calib_checks::{Expectations, checks};
use calib_finding::{About, Fact, Finding, Severity, Subject, catalog};
use calib_profile::{Clocks, RecordingSpec, TimedPoses, Timing};
use calib_recording::{Poses, Recording};

use crate::error::{DataProblem, PipelineError};

use crate::prepare::aligned::{Aligned, Alignment, ClockState, SAME_TIME};
use crate::prepare::blanks;
use crate::prepare::fresh::only_fresh;
use crate::prepare::ghosts;
use crate::prepare::inputs::RobotProfile;
use crate::prepare::levers::as_seen;
use crate::prepare::repeats::JITTER;
use crate::prepare::row_noise::RowNoise;
use crate::prepare::settled::settle;
use crate::prepare::streams::Scalars;
use crate::prepare::timelines::{estimate, tracker_table, tracker_timeline};
use crate::prepare::untracked;

/// Half of the time over which a joint's speed is measured, s: several samples of any controller.
pub(crate) const HALF_CHORD: f64 = 0.02;

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
    let file = || robot.folder.join(&spec.file).display().to_string();
    aligned(robot, name, spec, timing, recording)
        .map_err(|problem| PipelineError::data(file(), problem))
}

/// Offsets, s, that the fit finds from nothing: the motion within them is nearly straight. It found all of 40 ms, and not all of 60 ms.
const SMALL_LAG: f64 = 0.03;
/// Largest offset, s, of joint values that were read late.
const LARGEST_LAG: f64 = 1.0;

/// By how much the tracker's times are later than those of the joints of the same rows, s, where that is too much for a fit to start from 0. 0 where
/// the motion does not tell.
fn large_lag(
    robot: &RobotProfile,
    spec: &RecordingSpec,
    timing: &Timing,
    (table, joints): (&Poses, &BTreeMap<String, Scalars>),
) -> f64 {
    let within = Timing {
        max_offset: timing.max_offset.min(LARGEST_LAG),
        ..timing.clone()
    };
    let found = estimate(robot, spec, &within, table, joints).ok();
    let told = found
        .map(|(_, map)| map)
        .filter(|map| map.offset.abs() > SMALL_LAG.max(5.0 * map.offset_sigma));
    told.map_or(0.0, |map| map.offset)
}

/// Speed of each joint per row, rad/s or m/s.
type Velocities = BTreeMap<String, Vec<Option<f64>>>;

/// The streams of a recording and the tracker's times.
struct Streams<'a> {
    recording: &'a Recording,
    /// The tracker's time line.
    line: usize,
    times: Vec<f64>,
    joints: BTreeMap<String, Scalars>,
    tracker_clock: &'a str,
    robot_clock: &'a str,
}

fn aligned(
    robot: &RobotProfile,
    name: &str,
    spec: &RecordingSpec,
    timing: &Timing,
    recording: &Recording,
) -> Result<Aligned, DataProblem> {
    let mut streams = Streams::of(recording)?;
    streams.were_late(robot, timing)?;
    let joints = streams.joints.iter();
    blanks::none_is_empty(joints.map(|(joint, stream)| (joint, stream.values.as_slice())))?;
    let mut full =
        tracker_table(recording, streams.line, &streams.times).map_err(DataProblem::NotATrack)?;
    let repeated = streams.drop_repeated_frames(name, &mut full);
    let mut findings: Vec<Finding> = checks(&full, &Expectations::default())
        .into_iter()
        .filter(|f| f.severity != Severity::Error)
        .map(|f| f.in_recording(name))
        .chain(blanks::of_streams(name, &streams.joints, streams.line))
        .chain(repeated)
        .collect();
    if let Some(finding) = untracked::shows_none(&robot.profile, name, &full) {
        return Err(DataProblem::NoBody {
            recording: name.to_owned(),
            why: Box::new(finding),
        });
    }
    let (seen, reflections) = ghosts::of_stream(&robot.profile, &full);
    let clocks = match streams.stated_clocks(timing) {
        Some(ClockState::OneWithLag { .. }) => ClockState::OneWithLag {
            start: large_lag(robot, spec, timing, (&seen, &streams.joints)),
        },
        Some(stated) => stated,
        None => {
            let (body, map) =
                estimate(robot, spec, timing, &seen, &streams.joints).map_err(|why| {
                    DataProblem::Clocks {
                        recording: name.to_owned(),
                        why,
                    }
                })?;
            let found = alignment(&OffsetOutcome::Found(map), SAME_TIME);
            findings.extend(found.map(|mut finding| {
                finding.subject = Subject::body(&body).in_recording(name);
                finding
            }));
            ClockState::Found { body, map }
        }
    };
    // Rows of a motion are checked one by one; a mean would contain what is false in its samples.
    if timing.poses == TimedPoses::Settle && !reflections.is_empty() {
        full = seen.into_owned();
        findings.extend(reflections.into_iter().map(|f| f.in_recording(name)));
    }
    streams.meet(name, &clocks)?;
    let velocities = streams.add_robot(&mut full, &clocks);
    keep_jumps_beside_joints(&full, &mut findings);
    let mut aligned = Aligned {
        poses: Poses::default(),
        velocities: BTreeMap::new(),
        shapes: BTreeMap::new(),
        row_noise: RowNoise::default(),
        alignment: Alignment {
            tracker_clock: streams.tracker_clock.to_owned(),
            robot_clock: streams.robot_clock.to_owned(),
            clocks,
            holds: None,
            samples: streams.times.len(),
            joints: Arc::default(),
            refined: None,
        },
        findings,
        excluded: Vec::new(),
    };
    match timing.poses {
        TimedPoses::Settle => {
            let inverse = &recording.meta.inverse_bodies;
            let tracker = as_seen(&robot.profile.tracker, &full, inverse);
            settle(name, timing, &tracker, &full, &mut aligned);
            if aligned.poses.is_empty() {
                return Err(DataProblem::NothingStandsStill {
                    recording: name.to_owned(),
                    hold: timing.hold,
                });
            }
        }
        TimedPoses::Continuous => {
            aligned.alignment.joints = Arc::new(streams.joints.clone());
            let rows = thinned(&full, &streams.times, timing.rate);
            aligned.poses = full.select(&rows);
            aligned.velocities = velocities
                .into_iter()
                .map(|(joint, v)| (joint, rows.iter().map(|&i| v[i]).collect()))
                .collect();
        }
    }
    Ok(aligned)
}

/// A robot that starts, stops or turns fast is no jump of the track: its joints say so once both are on one time line.
fn keep_jumps_beside_joints(full: &Poses, findings: &mut Vec<Finding>) {
    if findings.iter().all(|f| f.id != catalog::JUMP) {
        return;
    }
    let again = checks(full, &Expectations::default());
    findings.retain(|f| {
        let same = |a: &Finding| a.id == f.id && a.subject.about == f.subject.about;
        f.id != catalog::JUMP || again.iter().any(same)
    });
}

impl<'a> Streams<'a> {
    fn of(recording: &'a Recording) -> Result<Self, DataProblem> {
        let line = tracker_timeline(recording).ok_or(DataProblem::NothingTracked)?;
        let timelines = &recording.timelines;
        let tracker = timelines.get(line).ok_or(DataProblem::NoTimeline)?;
        let times = tracker.t.clone().ok_or(DataProblem::NoTrackerTime)?;
        let joints = Scalars::of_joints(recording);
        if joints.values().any(|j| j.t.is_empty()) {
            return Err(DataProblem::NoJointTime);
        }
        let of_robot = joints.values().next();
        let robot_clock = of_robot
            .and_then(|j| timelines.get(j.timeline))
            .map_or(&tracker.clock, |line| &line.clock);
        Ok(Self {
            recording,
            line,
            times,
            joints,
            tracker_clock: &tracker.clock,
            robot_clock,
        })
    }

    /// Puts joints whose values were read late at the times that they are of.
    fn were_late(&mut self, robot: &RobotProfile, timing: &Timing) -> Result<(), DataProblem> {
        for (joint, late) in &timing.late {
            let joint = robot.model.joint(*joint).name.clone();
            match self.joints.get_mut(&joint) {
                Some(stream) => stream.was_late(*late),
                None => return Err(DataProblem::LateJointNotRecorded { joint }),
            }
        }
        Ok(())
    }

    /// Leaves the rows in which the tracker measured; what was found.
    fn drop_repeated_frames(&mut self, name: &str, full: &mut Poses) -> Option<Finding> {
        let one_line = |j: &&Scalars| j.timeline == self.line;
        let joints: Vec<&Scalars> = self.joints.values().filter(one_line).collect();
        let moves = |a: usize, b: usize| {
            let moved = |j: &&Scalars| {
                let [a, b] = [a, b].map(|row| j.at(self.times[row]));
                a.zip(b).is_some_and(|(a, b)| (a - b).abs() > JITTER)
            };
            (!joints.is_empty()).then(|| joints.iter().any(moved))
        };
        let (kept, finding) = only_fresh(name, full, moves);
        if finding.is_some() {
            *full = full.select(&kept);
            self.times = kept.iter().map(|&row| self.times[row]).collect();
        }
        finding
    }

    /// What is known of the clocks without looking at the motion.
    fn stated_clocks(&self, timing: &Timing) -> Option<ClockState> {
        let of_robot = self.joints.values().next();
        let one_line = of_robot.is_none_or(|j| j.timeline == self.line);
        if one_line || self.robot_clock == self.tracker_clock {
            let estimated = timing.poses == TimedPoses::Continuous
                && timing.clock == Clocks::Estimate
                && !self.joints.is_empty();
            Some(match estimated {
                true => ClockState::OneWithLag { start: 0.0 },
                false => ClockState::One,
            })
        } else if timing.clock == Clocks::Shared {
            Some(ClockState::Declared)
        } else {
            None
        }
    }

    /// That times which were stated to be of one clock have something in common.
    fn meet(&self, name: &str, clocks: &ClockState) -> Result<(), DataProblem> {
        match self.disjoint(clocks) {
            Some(why) => Err(DataProblem::Clocks {
                recording: name.to_owned(),
                why: Box::new(why.in_recording(name)),
            }),
            None => Ok(()),
        }
    }

    fn disjoint(&self, clocks: &ClockState) -> Option<Finding> {
        let longest = self.joints.values().max_by_key(|j| j.t.len())?;
        let ends = |t: &[f64]| Some((*t.first()?, *t.last()?));
        let ((from, to), (first, last)) = (ends(&self.times)?, ends(&longest.t)?);
        let stated = matches!(clocks, ClockState::Declared | ClockState::One);
        (stated && (to < first || last < from)).then(|| {
            Finding::of_kind(catalog::CLOCK_LAG, "disjoint", About::Clocks)
                .with("gap", Fact::seconds(from - first))
                .with("lasts", Fact::seconds((to - from).max(last - first)))
                .with(
                    "needed",
                    Fact::count(((from - first).abs() + (to - from)).ceil() as usize),
                )
        })
    }

    /// Adds joint positions, torques and temperatures at the tracker's times to its table; gives the joints' speeds.
    fn add_robot(&self, full: &mut Poses, clocks: &ClockState) -> Velocities {
        let mut velocities = BTreeMap::new();
        let at_robot = |t: &f64| clocks.at_robot(*t);
        for (joint, stream) in &self.joints {
            let q = self.times.iter().map(|t| stream.at(at_robot(t))).collect();
            full.joints.insert(joint.clone(), q);
            if let Some(unit) = stream.unit {
                full.joint_units.insert(joint.clone(), unit);
            }
            let times = self.times.iter();
            let speed = times.map(|t| stream.speed(at_robot(t), HALF_CHORD));
            velocities.insert(joint.clone(), speed.collect());
        }
        for (joint, stream) in Scalars::of_torques(self.recording) {
            let torque = self.times.iter().map(|t| stream.at(at_robot(t))).collect();
            full.torques.insert(joint, torque);
        }
        for (joint, stream) in Scalars::of_temperatures(self.recording) {
            let celsius = self.times.iter().map(|t| stream.at(at_robot(t))).collect();
            full.temperatures.insert(joint, celsius);
        }
        velocities
    }
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
