//! Files become recordings: which log belongs to which tracker's file, what is a stream, what is swept, and what is held out.

use std::collections::{BTreeMap, BTreeSet};

use calib_checks::sync::{HoldSettings, holds};
use calib_recording::{Poses, Recording, Timeline};
use calib_urdf::{JointId, RobotModel};

use crate::error::InitError;
use crate::fact::{About, Fact, Place};
use crate::name;
use crate::source::Source;

/// Where the poses of a stream come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stream {
    /// From the holds.
    Settle,
    /// From the motion.
    Continuous,
}

/// What a recording is for.
#[derive(Debug, Clone, PartialEq)]
pub enum Use {
    /// These joints over these ranges, rad or m.
    Sweep(Vec<(JointId, (f64, f64))>),
    /// Poses to fit.
    Static,
    /// Held out.
    Validation,
}

/// A recording of the profile.
#[derive(Debug, Clone)]
pub struct Draft {
    /// Its name.
    pub name: String,
    /// The tracker's file, or the only one: an index into the sources.
    pub source: usize,
    /// The robot's own log. Without a stream its rows are the tracker's.
    pub log: Option<usize>,
    /// `None`: every row is a pose.
    pub stream: Option<Stream>,
    /// Largest offset between the clocks that is looked for, s, where the usual one is too small.
    pub max_offset: Option<f64>,
    /// What it is for.
    pub usage: Use,
}

/// Recordings that a profile has already.
#[derive(Debug, Clone, Default)]
pub struct Others {
    /// All of their names.
    pub names: BTreeSet<String>,
    /// The recording that has a file, by the file as [`File::path`](crate::File::path) names it.
    pub by_file: BTreeMap<String, String>,
    /// Names of those that have no file yet and do not say how to read one.
    pub waiting: BTreeSet<String>,
    /// One of those with a file is fitted.
    pub fitted: bool,
    /// One of those with a file is held out.
    pub held_out: bool,
}

/// Longest time between two rows of a stream, s: slower tables are poses that somebody numbered by time.
const STREAM_STEP: f64 = 0.25;
/// Rows that make a stream.
const STREAM_ROWS: usize = 60;
/// Holds that make a stream one of static poses.
const FEW_HOLDS: usize = 4;
/// A joint moves if its readings differ by more, rad or m: encoders and controllers shake by less.
const MOVES: (f64, f64) = (5e-3, 1e-3);

/// Tracker's files with the logs that belong to them, named.
///
/// # Errors
/// [`InitError`] where a file has no joints and no log, or a log has no tracker's file.
pub fn drafts(
    model: &RobotModel,
    sources: &[Source],
    others: &Others,
) -> Result<(Vec<Draft>, Vec<Fact>), InitError> {
    let only_joints: Vec<usize> = (0..sources.len())
        .filter(|i| sources[*i].has_joints() && !sources[*i].has_tracked())
        .collect();
    let only_tracked: Vec<usize> = (0..sources.len())
        .filter(|i| !sources[*i].has_joints() && sources[*i].has_tracked())
        .collect();
    if let Some(i) =
        (0..sources.len()).find(|i| !sources[*i].has_joints() && !sources[*i].has_tracked())
    {
        return Err(InitError::NothingTracked {
            file: sources[i].file.shown.clone(),
            columns: sources[i].names.clone(),
        });
    }
    let pairs = paired(sources, &only_tracked, &only_joints);
    if let Some(i) = only_tracked
        .iter()
        .find(|i| !pairs.iter().any(|pair| pair.0 == **i))
    {
        return Err(without_joints(model, &sources[*i]));
    }
    if let Some(i) = only_joints
        .iter()
        .find(|i| !pairs.iter().any(|pair| pair.1 == **i))
    {
        return Err(InitError::NothingTracked {
            file: sources[*i].file.shown.clone(),
            columns: sources[*i].names.clone(),
        });
    }
    let mut taken = others.names.clone();
    let mut drafts = Vec::new();
    let mut facts = Vec::new();
    for (i, source) in sources.iter().enumerate() {
        if only_joints.contains(&i) {
            continue;
        }
        let pair = pairs.iter().find(|pair| pair.0 == i);
        let log = pair.map(|pair| pair.1);
        let name = match others.by_file.get(&source.file.path) {
            Some(name) => name.clone(),
            None if waits(others, source, &drafts) => base_name(source.stem()),
            None => free_name(source.stem(), &mut taken),
        };
        let place = || Place::Recording(name.clone());
        let read = source
            .facts
            .iter()
            .chain(log.iter().flat_map(|l| &sources[*l].facts));
        facts.extend(read.map(|about| Fact::new(place(), about.clone())));
        let joints = &sources[log.unwrap_or(i)].recording;
        let two = match log {
            Some(log) => !is_by_rows(source, &sources[log])?,
            None => false,
        };
        if let Some(log) = log {
            let file = sources[log].file.path.clone();
            let named = pair.is_some_and(|pair| pair.2);
            let rows = (!two).then(|| rows_of(&sources[log].recording));
            facts.push(Fact::new(place(), About::Log { file, named, rows }));
        }
        let stream = match log {
            Some(_) if !two => None,
            _ => stream(&source.recording, joints, two),
        };
        if let Some((kind, holds)) = stream {
            let about = match kind {
                Stream::Settle => About::Holds { holds },
                Stream::Continuous => About::Continuous,
            };
            facts.push(Fact::new(place(), about));
        }
        drafts.push(Draft {
            name,
            source: i,
            log,
            stream: stream.map(|s| s.0),
            max_offset: None,
            usage: Use::Static,
        });
    }
    Ok((drafts, facts))
}

/// Why a file without joints is no recording.
fn without_joints(model: &RobotModel, source: &Source) -> InitError {
    let file = source.file.shown.clone();
    if let [first, second] = source.recording.bodies.as_slice() {
        return InitError::HandEye {
            file,
            first: first.name.clone(),
            second: second.name.clone(),
        };
    }
    let joints = model.independent_joints();
    InitError::NoJoints {
        file,
        columns: source.names.clone(),
        joints: joints.map(|j| model.joint(j).name.clone()).collect(),
    }
}

/// Tracker's files and logs: those whose names share most words, else in the order given; and whether the names decide.
fn paired(sources: &[Source], tracked: &[usize], logs: &[usize]) -> Vec<(usize, usize, bool)> {
    let common = |a: usize, b: usize| {
        let words = name::words(sources[a].stem());
        let others = name::words(sources[b].stem());
        words.iter().filter(|w| others.contains(w)).count()
    };
    let mut open: Vec<usize> = logs.to_vec();
    let mut pairs = Vec::new();
    for &file in tracked {
        let best = open.iter().enumerate();
        let best = best.max_by_key(|(at, log)| (common(file, **log), std::cmp::Reverse(*at)));
        if let Some((at, log)) = best {
            let most = common(file, *log);
            let named = logs.iter().filter(|l| common(file, **l) >= most).count() == 1;
            pairs.push((file, open.remove(at), named));
        }
    }
    pairs
}

/// Rows of the longest time line.
fn rows_of(recording: &Recording) -> usize {
    let lines = recording.timelines.iter().map(Timeline::len);
    lines.max().unwrap_or(0)
}

/// Both files have one row for every posture; `false`: both flow, each by its own clock.
fn is_by_rows(tracked: &Source, log: &Source) -> Result<bool, InitError> {
    let flow = |source: &Source| source.recording.timelines.iter().any(flows);
    if flow(tracked) || flow(log) {
        return Ok(false);
    }
    let (rows, of_log) = (rows_of(&tracked.recording), rows_of(&log.recording));
    match rows == of_log {
        true => Ok(true),
        false => {
            let unread = [tracked, log].into_iter().find_map(Source::times_not_read);
            Err(unread.unwrap_or_else(|| InitError::RowsDiffer {
                file: tracked.file.shown.clone(),
                log: log.file.shown.clone(),
                rows: (rows, of_log),
            }))
        }
    }
}

/// Many rows with steps of a fraction of a second.
fn flows(line: &Timeline) -> bool {
    let Some(t) = &line.t else { return false };
    let span = t.last().copied().unwrap_or(0.0) - t.first().copied().unwrap_or(0.0);
    t.len() >= STREAM_ROWS && span / t.len() as f64 <= STREAM_STEP
}

/// A stream has time, many rows, and steps of a fraction of a second; or two clocks.
fn stream(tracked: &Recording, joints: &Recording, two: bool) -> Option<(Stream, usize)> {
    let timed = |r: &Recording| r.timelines.iter().any(|line| line.t.is_some());
    let several = two || tracked.timelines.len() > 1;
    if !timed(tracked) || !(several || tracked.timelines.iter().any(flows)) {
        return None;
    }
    let line = joints.joints.first().map(|s| s.timeline)?;
    let mut poses = joints
        .poses_of(line, calib_recording::Filled::Exclude)
        .ok()?;
    poses.markers.clear();
    poses.bodies.clear();
    poses.joints.retain(|_, q| q.iter().any(Option::is_some));
    let found = holds(&poses, &HoldSettings::default()).len();
    let kind = if found >= FEW_HOLDS {
        Stream::Settle
    } else {
        Stream::Continuous
    };
    Some((kind, found))
}

/// A recording of the profile has the file's name, and no file yet.
fn waits(others: &Others, source: &Source, drafts: &[Draft]) -> bool {
    let name = base_name(source.stem());
    others.waiting.contains(&name) && !drafts.iter().any(|draft| draft.name == name)
}

/// A file's name as that of a recording.
fn base_name(stem: &str) -> String {
    let base: String = stem
        .chars()
        .map(|c| {
            if c.is_alphanumeric() || c == '-' {
                c
            } else {
                '_'
            }
        })
        .collect();
    match base.trim_matches('_') {
        "" => "recording".to_owned(),
        base => base.to_owned(),
    }
}

fn free_name(stem: &str, taken: &mut BTreeSet<String>) -> String {
    let base = base_name(stem);
    let numbered = (2..).map(|n| format!("{base}_{n}"));
    let mut names = std::iter::once(base.clone()).chain(numbered);
    let name = names.find(|name| !taken.contains(name)).unwrap_or(base);
    taken.insert(name.clone());
    name
}

/// Joints that move in a table, with their range, rad or m.
#[must_use]
pub fn moved(model: &RobotModel, poses: &Poses) -> Vec<(JointId, (f64, f64))> {
    let mut found = Vec::new();
    for (name, values) in &poses.joints {
        let Ok(joint) = model.joint_id(name) else {
            continue;
        };
        let limit = if model.joint(joint).kind.turns() {
            MOVES.0
        } else {
            MOVES.1
        };
        let values = || values.iter().flatten().copied();
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        if high - low > limit {
            found.push((joint, (low, high)));
        }
    }
    found
}

/// Words in the name of a recording that is held out.
const HELD_OUT: [&str; 9] = [
    "validation",
    "valid",
    "val",
    "checks",
    "check",
    "test",
    "tests",
    "verify",
    "heldout",
];
/// Poses that a validation needs.
const VALIDATION_ROWS: usize = 5;

/// What each recording is for: by its name, by what it moves, and by its size, beside those of a profile that is edited.
#[must_use]
pub fn uses(
    model: &RobotModel,
    drafts: &mut [Draft],
    tables: &[Poses],
    others: &Others,
) -> Vec<Fact> {
    let mut facts = Vec::new();
    let (fitted, held_out) = (others.fitted, others.held_out);
    let word = |name: &str| {
        let words = name::words(name);
        let joined = words.concat();
        HELD_OUT.into_iter().find(|w| {
            words.iter().any(|have| have == w) || joined.contains("heldout") && *w == "heldout"
        })
    };
    let moved: Vec<_> = tables.iter().map(|poses| moved(model, poses)).collect();
    let is_sweep = |i: usize| (1..=2).contains(&moved[i].len());
    let by_name: Vec<Option<&'static str>> = drafts.iter().map(|d| word(&d.name)).collect();
    let all_named = !fitted && by_name.iter().all(Option::is_some);
    let named = |i: usize| by_name[i].filter(|_| !all_named);
    let poses: Vec<usize> = (0..drafts.len()).filter(|i| !is_sweep(*i)).collect();
    let total: usize = poses.iter().map(|i| tables[*i].len()).sum();
    let any_named = held_out || (0..drafts.len()).any(|i| named(i).is_some());
    // The smallest of several recordings of many joints, if most poses stay for the fit.
    let smallest = poses
        .iter()
        .copied()
        .min_by_key(|i| (tables[*i].len(), std::cmp::Reverse(*i)))
        .filter(|i| {
            poses.len() > 1
                && !any_named
                && tables[*i].len() >= VALIDATION_ROWS
                && 2 * tables[*i].len() <= total
        });
    for i in 0..drafts.len() {
        let rows = tables[i].len();
        let (usage, about) = match named(i) {
            Some(word) => (Use::Validation, About::ValidationByName { word, rows }),
            None if smallest == Some(i) => (Use::Validation, About::ValidationSmallest { rows }),
            None if is_sweep(i) => {
                let joints = moved[i]
                    .iter()
                    .map(|(j, _)| model.joint(*j).name.clone())
                    .collect();
                (Use::Sweep(moved[i].clone()), About::Sweep { joints, rows })
            }
            None => {
                let moved = moved[i].len();
                (Use::Static, About::Static { rows, moved })
            }
        };
        drafts[i].usage = usage;
        facts.push(Fact::new(Place::Recording(drafts[i].name.clone()), about));
    }
    if !held_out && !drafts.iter().any(|d| d.usage == Use::Validation) {
        facts.push(Fact::new(Place::Recordings, About::LeftOutInTurn));
    }
    facts
}
