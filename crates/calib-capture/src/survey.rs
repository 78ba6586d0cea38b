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
    /// Joints of the robot.
    pub joints: BTreeSet<String>,
}

/// Listens for `seconds` after the first frame, at most `patience` s without any.
///
/// # Errors
/// [`CaptureError::Source`]; an early end is `Ok(Err(Ended))`.
pub fn survey(
    source: &mut Source,
    listener: &mut Option<JointListener>,
    clock: &dyn Fn() -> f64,
    seconds: f64,
    patience: f64,
    screen: &mut dyn Screen,
) -> Result<Result<Survey, Ended>, CaptureError> {
    let began = clock();
    let mut first = None;
    let mut warned = began;
    let mut found = Survey::default();
    let mut foreign = false;
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
                    found.tracker.extend(frame.bodies.into_keys());
                    found.tracker.extend(frame.markers.into_keys());
                }
            }
            Input::Foreign(why) if !std::mem::replace(&mut foreign, true) => {
                screen.line(&format!("ignored: {why}"));
            }
            Input::Closed if first.is_none() => return Ok(Err(Ended::Closed)),
            Input::Closed => return Ok(Ok(found)),
            Input::Foreign(_) | Input::Nothing => {}
        }
        if first.is_some_and(|first| now - first >= seconds) {
            return Ok(Ok(found));
        }
        let silent = now - began;
        if first.is_none() && silent >= patience {
            return Ok(Err(Ended::Silent(silent)));
        }
        if first.is_none() && now - warned >= 5.0 {
            warned = now;
            screen.line(&format!("no data from the tracker for {silent:.0} s"));
        }
    }
}

/// The tracker's name of each requested body or marker: as given, otherwise the same name.
///
/// # Errors
/// A message with the names that the tracker sends and how to map them.
pub fn map_names(
    wanted: &[(String, WatchedKind)],
    given: &BTreeMap<String, String>,
    seen: &BTreeSet<String>,
) -> Result<Vec<Watched>, String> {
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
            "--map: `{name}` is not in the profile, which has {}",
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
            return Err(format!("`{from}` is mapped to `{other}` and to `{name}`"));
        }
        watched.push(Watched {
            name: name.clone(),
            from: from.clone(),
            kind: *kind,
        });
    }
    if watched.is_empty() {
        let (first, example) = (
            wanted.first().map_or("BODY", |(name, _)| name.as_str()),
            seen.iter().next().map_or("body_0", String::as_str),
        );
        return Err(format!(
            "the tracker sends {}, the profile has {}. Map the names: --map {first}={example}",
            list(&mut seen.iter().map(String::as_str)),
            profile()
        ));
    }
    Ok(watched)
}
