//! Joint readings that were held: the robot moved on, and its log repeated the readings of an earlier row.
//!
//! A log that hangs, or that is slower than the tracker, writes the same readings into several rows. A run of such rows is suspicious where a body moves within
//! it by a tenth of a usual step or more, to three places, what stands still does not move with it, and everything that the robot reports stays the same to the last bit. Which
//! row of a run has the readings that are right is asked of the nominal robot: with `S_first` the squared residuals of the registration that has
//! the first row of every run beside the rows of no run, `S_last` that with the last, `N` samples each,
//!
//! ```text
//! S_last − S_first > 9 S_first / N                                                                                    (1)
//! ```
//!
//! says that the robot moved on. Were the readings those of where it was going (positions that were asked for), it is the other way round; something
//! that moved without a column (a passive joint, the stand) makes neither of them better. Then all rows stay.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use calib_checks::structural::{Options, registration_residual};
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_geometry::statistics::{median, upper_median};
use calib_profile::{Body, BodyKind, Usage};
use calib_report::RejectedFor;
use calib_urdf::{JointId, JointKind};

use crate::formulate::structural::{Layout, chain};
use crate::prepare::excluded::Excluded;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::body_tracks;

/// Two rows of a body at rest differ by less than this many σ of a marker.
const AT_REST_SIGMAS: f64 = 8.0;
/// Least motion that is no sway, sag or backlash of a robot at rest, m.
const LEAST_MOTION: f64 = 2e-3;
/// The same as a part of the usual step from one reading to the next.
const PART_OF_STEP: f64 = 0.1;
/// Lever that makes a rotation a length, m: the size of a tracked body.
const LEVER: f64 = 0.1;
/// Places to which a body must have moved under held readings: once or twice, it was bumped, or the tracker was.
const PLACES: usize = 3;
/// Rows with new readings that tell how large a step is.
const STEPS: usize = 4;
/// Readings of streams are interpolated between equal ones: they differ by rounding, rad or m.
const INTERPOLATED: f64 = 1e-9;
/// Readings that go on by less than this many of their smallest step were rounded, not held.
const COUNTS: f64 = 1.5;
/// Readings with larger steps are of positions that a program asked for, rad or m: no encoder is as coarse.
const COARSEST: (f64, f64) = (0.02, 2e-3);
/// Evidence of equation (1), in squared residuals of one sample.
const EVIDENCE: f64 = 9.0;
/// Rows of each recording, on average, that the registration is found from.
const ROWS: usize = 200;

/// The rows of a recording that repeat the readings of the row before while a body moved.
struct Held {
    recording: String,
    /// A run begins with the row that had the readings first.
    runs: Vec<Range<usize>>,
    /// Rows in which a body had left the place that the readings belong to.
    rows: Vec<usize>,
    /// The bodies that the robot carries.
    bodies: Vec<String>,
    /// Largest motion under held readings, m.
    moved: f64,
}

/// Takes the rows with held readings out; a finding for each recording that has some.
#[must_use]
pub fn take_out(inputs: &mut Inputs) -> Vec<Finding> {
    let all = inputs.recordings.values();
    let suspected: Vec<Held> = all.filter_map(|r| held(inputs, r)).collect();
    let mut findings = Vec::new();
    for held in &suspected {
        let Some((first, last)) = residuals(inputs, held, &suspected) else {
            continue;
        };
        let loaded = &inputs.recordings[&held.recording];
        let rows = held.rows.iter();
        findings.push(
            Finding::new(
                catalog::JOINT_READINGS_HELD,
                Subject::recording(held.recording.clone()),
            )
            .with("rows", Fact::count(held.rows.len()))
            .with("of", Fact::count(loaded.q.len()))
            .with("distance", Fact::meters(held.moved))
            .with("first", Fact::meters(first))
            .with("last", Fact::meters(last))
            .at_rows(rows.map(|row| loaded.poses.rows[*row])),
        );
        let places = held.rows.iter().flat_map(|row| {
            let bodies = held.bodies.iter();
            bodies.map(|body| (*row, body.clone()))
        });
        let excluded = places.map(|(row, body)| Excluded {
            recording: held.recording.clone(),
            row,
            body,
            cause: RejectedFor::HeldReadings,
        });
        inputs.exclude(excluded.collect());
    }
    findings
}

/// The rows of a recording that may have held readings; `None` where the recording itself says that it has none.
fn held(inputs: &Inputs, loaded: &Loaded) -> Option<Held> {
    let runs = runs(loaded);
    if runs.is_empty() {
        return None;
    }
    let bodies: Vec<(&String, &Body)> = inputs.robot.profile.bodies.iter().collect();
    let mut moving = BTreeSet::new();
    let (carried, standing): (Vec<_>, Vec<_>) = bodies.into_iter().partition(|(_, body)| {
        let joints = moving_joints(inputs, body);
        moving.extend(joints.iter().copied());
        !joints.is_empty()
    });
    let has_column = |joint: &JointId| {
        let name = &inputs.robot.model.joint(*joint).name;
        loaded.poses.joints.contains_key(name) || loaded.spec.hold.contains_key(joint)
    };
    if !moving.iter().all(has_column) {
        return None;
    }
    let sigma = inputs.robot.profile.tracker.marker_coordinate();
    let at_rest = AT_REST_SIGMAS * sigma.unwrap_or(Options::default().sigma);
    let largest = |bodies: &[(&String, &Body)], a: usize, b: usize| {
        let moved = bodies.iter().filter_map(|of| displaced(loaded, *of, a, b));
        moved.reduce(f64::max)
    };
    let steps = (1..loaded.q.len()).filter(|&row| differ(loaded, row - 1, row));
    let steps: Vec<f64> = steps
        .filter_map(|row| largest(&carried, row - 1, row))
        .collect();
    if steps.len() < STEPS {
        return None;
    }
    let step = median(steps)?;
    let least = (PART_OF_STEP * step).max(LEAST_MOTION).max(at_rest);
    let stands = |a: usize, b: usize| largest(&standing, a, b).is_none_or(|moved| moved < at_rest);
    let mut found = Held {
        recording: loaded.name.clone(),
        runs: Vec::new(),
        rows: Vec::new(),
        bodies: carried.iter().map(|(name, _)| (*name).clone()).collect(),
        moved: 0.0,
    };
    let mut places = 0;
    for run in runs {
        let mut place = run.start;
        let mut still = run.start;
        for row in run.start + 1..run.end {
            let from_start = largest(&carried, run.start, row);
            if from_start.is_some_and(|moved| moved < at_rest) {
                still = row;
            }
            let moved = largest(&carried, place, row).is_some_and(|moved| moved >= least);
            if moved && from_start >= Some(least) && stands(run.start, row) {
                place = row;
                places += 1;
                found.moved = found.moved.max(from_start.unwrap_or(0.0));
            }
        }
        if place > run.start {
            found.rows.extend(still + 1..run.end);
            found.runs.push(run);
        }
    }
    let rounded = is_rounded(inputs, loaded, &found.runs);
    (places >= PLACES && !rounded).then_some(found)
}

/// The independent joints between the root and a body.
fn moving_joints(inputs: &Inputs, body: &Body) -> BTreeSet<JointId> {
    let model = &inputs.robot.model;
    let chain = model.chain(model.root(), body.link).into_iter();
    chain
        .map(|step| model.joint(step.joint).law.source)
        .filter(|joint| model.joint(*joint).kind != JointKind::Fixed)
        .collect()
}

/// Rows that repeat what the robot reported in the row before, with the row that reported it first.
fn runs(loaded: &Loaded) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for row in 1..loaded.q.len() {
        if !repeats(loaded, row - 1, row) {
            continue;
        }
        match runs.last_mut() {
            Some(run) if run.end == row => run.end = row + 1,
            _ => runs.push(row - 1..row + 1),
        }
    }
    runs
}

/// Whether the robot reported the same in two rows: positions and torques of its joints.
fn repeats(loaded: &Loaded, a: usize, b: usize) -> bool {
    let mut torques = loaded.poses.torques.values();
    let positions = loaded.q[a].is_some() && loaded.q[b].is_some() && !differ(loaded, a, b);
    positions && torques.all(|torque| torque[a] == torque[b])
}

/// Whether both rows have joint values, and other ones.
fn differ(loaded: &Loaded, a: usize, b: usize) -> bool {
    let (Some(a), Some(b)) = (&loaded.q[a], &loaded.q[b]) else {
        return false;
    };
    let rounding = match loaded.alignment {
        Some(_) => INTERPOLATED,
        None => 0.0,
    };
    a.iter().zip(b).any(|(a, b)| (a - b).abs() > rounding)
}

/// How far a body moved between two rows, m; `None` where one of them does not show it.
fn displaced(loaded: &Loaded, (name, body): (&String, &Body), a: usize, b: usize) -> Option<f64> {
    match &body.kind {
        BodyKind::Markers { names, .. } => {
            let tracks = names.iter().filter_map(|m| loaded.poses.markers.get(m));
            let moved = tracks.filter_map(|track| Some((track[b]? - track[a]?).norm()));
            upper_median(&mut moved.collect::<Vec<f64>>())
        }
        BodyKind::Pose => {
            let track = loaded.poses.bodies.get(name)?;
            let motion = track[a]?.inv_mul(&track[b]?);
            let moved = motion.translation.vector.norm();
            Some(moved.max(LEVER * motion.rotation.angle()))
        }
    }
}

/// Whether the readings go on after their runs by a step of their encoder: then they were rounded, and the middle of a run is right.
fn is_rounded(inputs: &Inputs, loaded: &Loaded, runs: &[Range<usize>]) -> bool {
    let counts: Vec<Option<f64>> = inputs
        .robot
        .model
        .joint_ids()
        .map(|joint| {
            let values = loaded.q.iter().flatten().map(|q| q[joint.index()]);
            let mut values: Vec<f64> = values.collect();
            values.sort_by(f64::total_cmp);
            let steps = values.windows(2).map(|pair| pair[1] - pair[0]);
            let count = steps.filter(|step| *step > INTERPOLATED).reduce(f64::min)?;
            let coarsest = match inputs.robot.model.joint(joint).kind {
                JointKind::Prismatic { .. } => COARSEST.1,
                _ => COARSEST.0,
            };
            (count < coarsest).then_some(count)
        })
        .collect();
    let steps = runs.iter().filter_map(|run| {
        let (from, to) = (loaded.q[run.start].as_ref()?, loaded.q.get(run.end)?);
        let steps = from.iter().zip(to.as_ref()?).zip(&counts);
        let of_counts = steps.map(|((from, to), count)| match count {
            Some(count) => (to - from).abs() / count,
            None if from == to => 0.0,
            None => f64::INFINITY,
        });
        of_counts.reduce(f64::max)
    });
    let steps: Vec<f64> = steps.collect();
    let small = steps.iter().filter(|step| **step < COUNTS).count();
    2 * small > steps.len()
}

/// Residuals of the registration with the first and with the last row of every run, rms, m; `None` where equation (1) does not hold. Runs of other
/// recordings that are suspected, too, are left out.
fn residuals(inputs: &Inputs, held: &Held, suspected: &[Held]) -> Option<(f64, f64)> {
    let tracks = body_tracks(inputs, &mut Vec::new()).ok()?;
    let (chain, _) = chain(inputs, &tracks)?;
    let validation = inputs.recordings[&held.recording].spec.usage == Usage::Validation;
    let layout = Layout::new(inputs, &tracks, &chain, validation);
    let name = |i: usize| layout.recordings[layout.data.recording[i].0].name.as_str();
    let elsewhere = suspected.iter().filter(|s| s.recording != held.recording);
    let elsewhere: BTreeSet<(&str, usize)> = elsewhere
        .flat_map(|other| {
            let rows = other.runs.iter().cloned().flatten();
            rows.map(|row| (other.recording.as_str(), row))
        })
        .collect();
    let all = (0..layout.rows.len()).filter(|i| !elsewhere.contains(&(name(*i), layout.rows[*i])));
    let (own, others): (Vec<usize>, Vec<usize>) = all.partition(|i| name(*i) == held.recording);
    let runs = held.runs.iter();
    let run_of: BTreeMap<usize, &Range<usize>> = runs
        .flat_map(|run| run.clone().map(move |row| (row, run)))
        .collect();
    let (in_runs, beside): (Vec<usize>, Vec<usize>) = own
        .into_iter()
        .partition(|i| run_of.contains_key(&layout.rows[*i]));
    let most = ROWS * layout.recordings.len();
    let beside: Vec<usize> = beside.into_iter().chain(others).collect();
    let with = |which: fn(&Range<usize>) -> usize| {
        let is_it = |i: &usize| {
            let row = layout.rows[*i];
            run_of.get(&row).is_some_and(|run| which(run) == row)
        };
        let of_runs: Vec<usize> = in_runs.iter().copied().filter(is_it).collect();
        let mut rows: Vec<usize> = spread(&of_runs, ROWS)
            .chain(spread(&beside, most))
            .collect();
        rows.sort_unstable();
        let data = layout.data.select(&rows);
        let samples = rows.len() * data.bodies.len();
        let rms = registration_residual(&data).ok()?;
        Some((rms, samples as f64))
    };
    let (first, samples) = with(|run| run.start)?;
    let (last, _) = with(|run| run.end - 1)?;
    let square = |x: f64| x * x;
    let gained = samples * (square(last) - square(first));
    (gained > EVIDENCE * square(first)).then_some((first, last))
}

/// At most so many of the rows, evenly spread.
fn spread(rows: &[usize], most: usize) -> impl Iterator<Item = usize> {
    let every = rows.len().div_ceil(most).max(1);
    rows.iter().copied().step_by(every)
}
