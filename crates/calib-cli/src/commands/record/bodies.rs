//! Bodies and markers: the profile's names and the tracker's.

use std::collections::BTreeMap;

use calib_capture::{Screen, Survey, Watched, WatchedKind, map_names};
use calib_pipeline::prepare::load::RobotProfile;
use calib_profile::BodyKind;

use super::RecordError;

/// The bodies and markers of the profile with the tracker's names for them.
pub(super) fn watched(
    robot: &RobotProfile,
    map: &[String],
    heard: &Survey,
    screen: &mut dyn Screen,
) -> Result<Vec<Watched>, RecordError> {
    let mut wanted = Vec::new();
    for (body, spec) in &robot.profile.bodies {
        match &spec.kind {
            BodyKind::Pose => wanted.push((body.clone(), WatchedKind::Body)),
            BodyKind::Markers { names, .. } => {
                wanted.extend(names.iter().map(|n| (n.clone(), WatchedKind::Marker)));
            }
        }
    }
    let mut given = BTreeMap::new();
    for text in map {
        let Some((name, from)) = text.split_once('=') else {
            return Err(RecordError::Map(text.clone()));
        };
        given.insert(name.to_string(), from.to_string());
    }
    let watched = map_names(&wanted, &given, &heard.tracker).map_err(RecordError::Names)?;
    let unseen: Vec<&str> = watched
        .iter()
        .filter(|w| !heard.tracker.contains(&w.from))
        .map(|w| w.name.as_str())
        .collect();
    if !unseen.is_empty() {
        screen.line(&format!("not yet seen: {}", unseen.join(", ")));
    }
    let left: Vec<&str> = wanted
        .iter()
        .map(|(name, _)| name.as_str())
        .filter(|name| !watched.iter().any(|w| w.name == *name))
        .collect();
    if !left.is_empty() {
        screen.line(&format!("no column for {} (--map)", left.join(", ")));
    }
    let names: Vec<String> = watched
        .iter()
        .map(|w| {
            if w.name == w.from {
                w.name.clone()
            } else {
                format!("{} ({})", w.name, w.from)
            }
        })
        .collect();
    screen.line(&format!("recorded: {}", names.join(", ")));
    Ok(watched)
}
