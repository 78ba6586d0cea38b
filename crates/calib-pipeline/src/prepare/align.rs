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
//! ([`mod@crate::prepare::clock`]).

use std::collections::BTreeMap;

use calib_checks::model::alignment;
use calib_checks::rigid_body::{Template, body_poses};
use calib_checks::sync::{
    ClockMap, HoldSettings, OffsetOutcome, OffsetSettings, RotationTrack, clock_offset, holds,
    static_poses,
};
use calib_checks::{Expectations, checks};
use calib_finding::{About, Fact, Finding, Severity, Subject, catalog};
use calib_profile::{BodyKind, Clocks, RecordingSpec, TimedPoses, Timing, Tracker};
use calib_recording::{Filled, Poses, Recording};
use nalgebra::{Isometry3, Matrix3, Point3};

use crate::error::PipelineError;
use crate::prepare::load::{Excluded, RobotProfile};
use crate::prepare::streams::{Scalars, interpolated_body, interpolated_point};

/// An offset below this, s, is none: at 0.5 rad/s and 1 m it is a tenth of a millimetre.
const SAME_TIME: f64 = 2e-4;
/// Half of the time over which a joint's speed is measured, s: several samples of any controller.
const HALF_CHORD: f64 = 0.02;
/// Variance of a hold, in units of the usual, from which it had not settled.
const RESTLESS: f64 = 16.0;
/// Scatter of a hold, m, that no tracker's noise reaches.
const RESTLESS_SIGMA: f64 = 2e-4;
/// Part of the holds that may be restless: beyond it the robot's stand shakes, and leaving out helps no more.
const MANY: f64 = 0.34;

/// How the clocks of one recording go together.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// The tracker's clock, in the reader's words.
    pub tracker_clock: String,
    /// The robot's clock.
    pub robot_clock: String,
    /// What is known of them.
    pub clocks: ClockState,
    /// Holds that became poses; `None` for rows of a motion.
    pub holds: Option<usize>,
    /// Rows of the tracker's stream.
    pub samples: usize,
}

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

impl Alignment {
    /// One line for people: where the poses come from, and how the clocks go together.
    #[must_use]
    pub fn text(&self) -> String {
        let poses = match self.holds {
            Some(holds) => format!("{holds} holds in {} samples", self.samples),
            None => format!("motion of {} samples", self.samples),
        };
        let clocks = match &self.clocks {
            ClockState::One => "one clock".to_owned(),
            ClockState::Declared => "clocks stated to be the same".to_owned(),
            ClockState::Found { body, map } => format!(
                "the tracker clock is offset by {:+.4} s ± {:.2} ms from the robot clock and runs {:+.0} ± {:.0} ppm fast (motion of `{body}`: correlation {:.3}, second peak {:.2})",
                map.offset,
                map.offset_sigma * 1e3,
                map.drift * 1e6,
                map.drift_sigma * 1e6,
                map.correlation,
                map.second
            ),
        };
        format!("{poses}; {clocks}")
    }
}

/// A recording with time as a table.
#[derive(Debug, Clone)]
pub struct Aligned {
    /// The table.
    pub poses: Poses,
    /// Speed of each recorded joint per row, rad/s or m/s; empty for holds.
    pub velocities: BTreeMap<String, Vec<Option<f64>>>,
    /// Shape of each marker's covariance per row, in units of the usual variance; only for holds.
    pub shapes: BTreeMap<String, Vec<Option<Matrix3<f64>>>>,
    /// How the clocks go together.
    pub alignment: Alignment,
    /// What was noticed on the way.
    pub findings: Vec<Finding>,
    /// Holds that had not settled.
    pub excluded: Vec<Excluded>,
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

/// The recording with the streams of the robot's own file added, under clocks of their own.
#[must_use]
pub fn with_robot_log(mut tracker: Recording, robot: Recording) -> Recording {
    let first = tracker.timelines.len();
    // The log's own joints count, not copies that the tracker's file may have.
    if !robot.joints.is_empty() {
        tracker.joints.clear();
    }
    tracker
        .timelines
        .extend(robot.timelines.into_iter().map(|mut line| {
            line.clock = format!("robot's file: {}", line.clock);
            line
        }));
    tracker.joints.extend(robot.joints.into_iter().map(|mut s| {
        s.timeline += first;
        s
    }));
    tracker
        .torques
        .extend(robot.torques.into_iter().map(|mut s| {
            s.timeline += first;
            s
        }));
    tracker.meta.conversions.extend(robot.meta.conversions);
    tracker.meta.findings.extend(robot.meta.findings);
    tracker
}

/// The time line with most samples among those of markers and bodies.
fn tracker_timeline(recording: &Recording) -> Option<usize> {
    let markers = recording.markers.iter().map(|m| m.timeline);
    let bodies = recording.bodies.iter().map(|b| b.timeline);
    markers.chain(bodies).max_by_key(|&line| {
        let samples = recording
            .timelines
            .get(line)
            .map_or(0, calib_recording::Timeline::len);
        (samples, std::cmp::Reverse(line))
    })
}

/// Markers and bodies at the tracker's times; streams on another line of the same device are interpolated.
fn tracker_table(recording: &Recording, line: usize, times: &[f64]) -> Result<Poses, String> {
    let own = &recording.timelines[line];
    let mut poses = Poses {
        rows: own.rows.clone(),
        t: Some(times.to_vec()),
        labels: own.labels.clone(),
        ..Poses::default()
    };
    let no_time = |what: &str| format!("`{what}` has no time");
    for marker in &recording.markers {
        let points: Vec<Option<Point3<f64>>> = marker
            .samples
            .iter()
            .map(|s| s.point(Filled::Exclude))
            .collect();
        let track = if marker.timeline == line {
            points
        } else {
            let known = recording.timelines.get(marker.timeline);
            let t = known
                .and_then(|l| l.t.as_ref())
                .ok_or_else(|| no_time(&marker.name))?;
            times
                .iter()
                .map(|&at| interpolated_point(t, &points, at))
                .collect()
        };
        if poses.markers.insert(marker.name.clone(), track).is_some() {
            return Err(format!("`{}` is the name of two streams", marker.name));
        }
    }
    for body in &recording.bodies {
        let track: Vec<Option<Isometry3<f64>>> = if body.timeline == line {
            body.tracker_from_body.clone()
        } else {
            let known = recording.timelines.get(body.timeline);
            let t = known
                .and_then(|l| l.t.as_ref())
                .ok_or_else(|| no_time(&body.name))?;
            let at = |&at: &f64| interpolated_body(t, &body.tracker_from_body, at);
            times.iter().map(at).collect()
        };
        if poses.bodies.insert(body.name.clone(), track).is_some() {
            return Err(format!("`{}` is the name of two streams", body.name));
        }
    }
    Ok(poses)
}

/// Equation (1) from the body that tells it best; else why not.
fn estimate(
    robot: &RobotProfile,
    spec: &RecordingSpec,
    timing: &Timing,
    table: &Poses,
    joints: &BTreeMap<String, Scalars>,
) -> Result<(String, ClockMap), Finding> {
    let settings = OffsetSettings {
        max_offset: timing.max_offset,
        ..OffsetSettings::default()
    };
    let longest = joints.values().max_by_key(|j| j.t.len());
    let robot_times: &[f64] = longest.map_or(&[], |j| &j.t);
    let mut best: Option<(String, ClockMap)> = None;
    let mut worst: Option<OffsetOutcome> = None;
    for (name, body) in &robot.profile.bodies {
        let Some(seen) = orientation(table, name, &body.kind) else {
            continue;
        };
        let link = robot_times.iter().map(|&t| {
            let mut q = robot.model.zero_positions();
            for (joint, value) in &spec.hold {
                q[joint.index()] = *value;
            }
            for (joint, stream) in joints {
                let id = robot.model.joint_id(joint).ok()?;
                q[id.index()] = stream.at(t)?;
            }
            Some(robot.model.root_from_link(&q, body.link).rotation)
        });
        let link = RotationTrack::new(robot_times.iter().copied().zip(link));
        match clock_offset(&seen, &link, &settings) {
            OffsetOutcome::Found(map) => {
                let better =
                    |(_, known): &(String, ClockMap)| map.offset_sigma < known.offset_sigma;
                if best.as_ref().is_none_or(better) {
                    best = Some((name.clone(), map));
                }
            }
            // A body that hardly moves says nothing; one that moves and does not fit says why.
            outcome @ (OffsetOutcome::NotExcited { .. } | OffsetOutcome::TooShort) => {
                worst = worst.or(Some(outcome));
            }
            outcome => worst = Some(outcome),
        }
    }
    let outcome = worst.unwrap_or(OffsetOutcome::TooShort);
    best.ok_or_else(|| {
        alignment(&outcome, SAME_TIME)
            .unwrap_or_else(|| Finding::of_kind(catalog::CLOCK_LAG, "too_short", About::Clocks))
    })
}

/// A body's orientation over the tracker's time, where it has one.
fn orientation(table: &Poses, name: &str, kind: &BodyKind) -> Option<RotationTrack> {
    let track = match kind {
        BodyKind::Pose => table.bodies.get(name)?.clone(),
        BodyKind::Markers { names, template } => {
            let tracks: Option<Vec<&[Option<Point3<f64>>]>> = names
                .iter()
                .map(|m| table.markers.get(m).map(Vec::as_slice))
                .collect();
            let given = template
                .as_ref()
                .and_then(|points| Template::given(names.clone(), points.clone()).ok());
            body_poses(names, &tracks?, given, None).ok()?.track()
        }
    };
    let times = table.t.as_ref()?;
    let turned = track.iter().map(|pose| pose.map(|p| p.rotation));
    Some(RotationTrack::new(times.iter().copied().zip(turned)))
}

/// Why a hold had not settled.
struct Restless {
    /// The marker or body that shows it.
    name: String,
    /// Its drift, or its scatter.
    facts: Vec<(&'static str, Fact)>,
}

/// One pose per hold, with the shapes of the markers' scatter; restless holds are listed.
fn settle(name: &str, timing: &Timing, tracker: &Tracker, full: &Poses, aligned: &mut Aligned) {
    let usual = HoldSettings::default();
    // Within a window of some twenty samples noise spreads over less than twelve σ.
    let spread = |sigma: Option<f64>| sigma.map_or(0.0, |s| 12.0 * s);
    let position = spread(tracker.marker_sigma).max(spread(tracker.body_sigma));
    let settings = HoldSettings {
        min_duration: timing.hold,
        point_range: usual.point_range.max(position),
        turn_range: usual.turn_range.max(spread(tracker.body_sigma_rad)),
        ..usual
    };
    let found = holds(full, &settings);
    let table = static_poses(full, &found);
    aligned.alignment.holds = Some(found.len());
    // Holds whose halves differ, and holds that scatter more than the others.
    let mut restless: BTreeMap<usize, Restless> = BTreeMap::new();
    for finding in table.findings {
        let first = finding.rows.first().copied();
        let hold = found
            .iter()
            .position(|h| first == Some(full.rows[h.rows.start]));
        if let Some(hold) = hold {
            restless.entry(hold).or_insert_with(|| Restless {
                name: finding.subject.to_string(),
                facts: ["drift", "time"]
                    .into_iter()
                    .filter_map(|key| Some((key, finding.facts.get(key)?.clone())))
                    .collect(),
            });
        }
    }
    let mut usual = Vec::new();
    for (marker, covariances) in &table.marker_covariance {
        let traces = covariances.iter().map(|c| c.map(|c| c.trace()));
        note_scatter(marker, traces.collect(), &mut usual, &mut restless);
    }
    for (body, covariances) in &table.body_covariance {
        let traces = covariances
            .iter()
            .map(|c| c.map(|c| c.fixed_view::<3, 3>(3, 3).trace()));
        note_scatter(body, traces.collect(), &mut Vec::new(), &mut restless);
    }
    // The part that changes from hold to hold and is constant within one (distortion, refraction) does not show in the
    // scatter: half of the weight is the same for all.
    usual.sort_by(f64::total_cmp);
    if let Some(variance) = usual.get(usual.len() / 2).map(|trace| trace / 3.0) {
        let shape = |c: &Option<Matrix3<f64>>| {
            c.filter(|_| variance > 0.0)
                .map(|c| (Matrix3::identity() + c / variance) * 0.5)
        };
        aligned.shapes = table
            .marker_covariance
            .iter()
            .map(|(marker, all)| (marker.clone(), all.iter().map(shape).collect()))
            .collect();
    }
    let many = restless.len() as f64 > MANY * found.len() as f64;
    let rows: Vec<u64> = restless.keys().map(|&h| table.poses.rows[h]).collect();
    if let Some(first) = restless.values().next() {
        let kind = if many { "holds_kept" } else { "holds" };
        let finding = Finding::of_kind(catalog::UNSETTLED_ROWS, kind, Subject::recording(name))
            .with("restless", Fact::count(restless.len()))
            .with("holds", Fact::count(found.len()))
            .with("name", Fact::name(&first.name));
        let finding = first.facts.iter().fold(finding, |finding, (key, fact)| {
            finding.with(key, fact.clone())
        });
        aligned.findings.push(finding.at_rows(rows));
    }
    if !many {
        let names = table.poses.markers.keys().chain(table.poses.bodies.keys());
        for stream in names {
            aligned
                .excluded
                .extend(restless.keys().map(|&row| Excluded {
                    recording: name.to_owned(),
                    row,
                    body: stream.clone(),
                    reason: "not settled: the hold drifts or scatters".to_owned(),
                }));
        }
    }
    aligned.poses = table.poses;
}

/// Adds the usual scatter of one stream and the holds that exceed it.
fn note_scatter(
    stream: &str,
    traces: Vec<Option<f64>>,
    usual: &mut Vec<f64>,
    restless: &mut BTreeMap<usize, Restless>,
) {
    let mut known: Vec<f64> = traces.iter().flatten().copied().collect();
    known.sort_by(f64::total_cmp);
    let Some(&middle) = known.get(known.len() / 2) else {
        return;
    };
    usual.push(middle);
    for (hold, trace) in traces.iter().enumerate() {
        if let Some(trace) = trace
            && *trace > RESTLESS * middle
            && trace.sqrt() > RESTLESS_SIGMA
        {
            restless.entry(hold).or_insert_with(|| Restless {
                name: stream.to_owned(),
                facts: vec![
                    ("scatter", Fact::meters(trace.sqrt())),
                    ("usual", Fact::meters(middle.sqrt())),
                ],
            });
        }
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
