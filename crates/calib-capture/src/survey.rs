//! What the tracker sends, before the columns are decided.

use crate::session::CaptureError;
use crate::{Ended, Input, JointListener, Screen, Source, Watched, WatchedKind};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// Names that were received.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Survey {
    /// Bodies and markers of the tracker.
    pub tracker: BTreeSet<String>,
    /// Those of them that have a pose: bodies.
    pub bodies: BTreeSet<String>,
    /// Most markers of one frame that have no name of their own.
    pub unnamed: usize,
    /// Joints of the robot.
    pub joints: BTreeSet<String>,
}

/// Listens for `seconds` after the first frame, at most `patience` s without any; with `joints`, until the robot has sent
/// a joint too, or for `patience`.
///
/// # Errors
/// [`CaptureError::Source`]; an early end is `Ok(Err(Ended))`.
pub fn survey(
    source: &mut Source,
    listener: &mut Option<JointListener>,
    clock: &dyn Fn() -> f64,
    (seconds, patience): (f64, f64),
    joints: bool,
    screen: &mut dyn Screen,
) -> Result<Result<Survey, Ended>, CaptureError> {
    let began = clock();
    let mut first = None;
    let mut warned = began;
    let mut found = Survey::default();
    let mut foreign = None;
    loop {
        let input = source.next(Duration::from_millis(50))?;
        let now = clock();
        if let Some(listener) = listener {
            listener.take(now);
            found
                .joints
                .extend(listener.names().into_iter().map(str::to_string));
        }
        match input {
            Input::Frames(frames) => {
                for frame in frames {
                    first.get_or_insert(now);
                    found.unnamed = found.unnamed.max(frame.unlabeled);
                    found.bodies.extend(frame.bodies.keys().cloned());
                    found.tracker.extend(frame.bodies.into_keys());
                    found.tracker.extend(frame.markers.into_keys());
                }
            }
            Input::Foreign(why) if foreign.is_none() => {
                screen.line(&format!("ignored: {why}"));
                foreign = Some(why);
            }
            Input::Closed if first.is_none() => return Ok(Err(Ended::Closed)),
            Input::Closed => return Ok(Ok(found)),
            Input::Foreign(_) | Input::Nothing => {}
        }
        let silent = now - began;
        let waits = joints && found.joints.is_empty() && silent < patience;
        if first.is_some_and(|first| now - first >= seconds) && !waits {
            return Ok(Ok(found));
        }
        if first.is_none() && silent >= patience {
            return Ok(Err(match foreign {
                Some(why) => Ended::Unreadable(why),
                None => Ended::Silent(silent),
            }));
        }
        if first.is_none() && now - warned >= 5.0 {
            warned = now;
            screen.line(&format!("no data from the tracker for {silent:.0} s"));
        }
        if first.is_some() && waits && now - warned >= 5.0 {
            warned = now;
            screen.line(&format!("no joint values from the robot for {silent:.0} s"));
        }
    }
}

/// The tracker's name of each requested body or marker: as given, otherwise the same name.
///
/// # Errors
/// A message with the names that the tracker sends and what to do: map them, or state in the profile what the tracker sends.
pub fn map_names(
    wanted: &[(String, WatchedKind)],
    given: &BTreeMap<String, String>,
    heard: &Survey,
) -> Result<Vec<Watched>, String> {
    let seen = &heard.tracker;
    let list = |names: &mut dyn Iterator<Item = &str>| {
        let all: Vec<&str> = names.collect();
        if all.is_empty() {
            "nothing".to_string()
        } else {
            all.join(", ")
        }
    };
    let profile = || list(&mut wanted.iter().map(|(name, _)| name.as_str()));
    if let Some(name) = given.keys().find(|n| !wanted.iter().any(|(w, _)| w == *n)) {
        return Err(format!(
            "--map: `{name}` is not in the profile, which has {}\n  help: the names are case-sensitive",
            profile()
        ));
    }
    let mut from_names = BTreeMap::new();
    let mut watched = Vec::new();
    for (name, kind) in wanted {
        let from = match given.get(name) {
            Some(from) => from,
            None if seen.contains(name) => name,
            None => continue,
        };
        if let Some(other) = from_names.insert(from.clone(), name.clone()) {
            return Err(format!(
                "`{from}` is mapped to `{other}` and to `{name}`\n  help: map each to a name of its own"
            ));
        }
        watched.push(Watched {
            name: name.clone(),
            from: from.clone(),
            kind: *kind,
        });
    }
    if watched.is_empty() {
        return Err(unmapped(wanted, heard, &list, &profile()));
    }
    Ok(watched)
}

/// Why nothing of the profile is among what the tracker sends.
fn unmapped(
    wanted: &[(String, WatchedKind)],
    heard: &Survey,
    list: &dyn Fn(&mut dyn Iterator<Item = &str>) -> String,
    profile: &str,
) -> String {
    let seen = &heard.tracker;
    if seen.is_empty() && heard.unnamed > 0 {
        return format!(
            "the tracker sends {} single markers without names and no body, the profile has {profile}\n  help: define the markers as a body in the tracker's \
             program, which then sends its pose, and write `pose: true` in place of `markers` in the profile",
            heard.unnamed
        );
    }
    if seen.is_empty() {
        return format!(
            "the tracker is measuring, but it sees no body and no marker; the profile has {profile}\n  help: uncover them, bring them into its volume, and check \
             that its program sends them"
        );
    }
    let sent = list(&mut seen.iter().map(String::as_str));
    let kind = match wanted.iter().all(|(_, kind)| *kind == WatchedKind::Marker) {
        true => WatchedKind::Marker,
        false => WatchedKind::Body,
    };
    let of_kind = |name: &&String| heard.bodies.contains(*name) == (kind == WatchedKind::Body);
    let first = wanted.iter().find(|(_, of)| *of == kind);
    let first = first.map_or("BODY", |(name, _)| name.as_str());
    match seen.iter().find(of_kind) {
        Some(example) => format!(
            "the tracker sends {sent}, the profile has {profile}. Map the names: --map {first}={example}\n  help: the names are case-sensitive"
        ),
        None if kind == WatchedKind::Marker => format!(
            "the tracker sends the poses of {sent}, the profile has the markers {profile}\n  help: write `pose: true` in place of `markers` in the profile, or let \
             the tracker send named markers"
        ),
        None => format!(
            "the tracker sends the markers {sent}, the profile has {profile} with poses\n  help: write `markers: [NAMES]` in place of `pose: true` in the profile, or \
             let the tracker send bodies"
        ),
    }
}
