//! Bodies and markers: the profile's names and the tracker's, and what the swept joints move.

use std::collections::{BTreeMap, BTreeSet};

use calib_capture::{Moved, Screen, Survey, Watched, WatchedKind, map_names};
use calib_pipeline::prepare::load::RobotProfile;
use calib_profile::{Body, BodyKind};
use calib_urdf::{JointId, LinkId, RobotModel};

use super::RecordError;
use crate::commands::names::names_of;

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
    let mut given: BTreeMap<String, String> = robot.profile.names.clone();
    // A name that is not sent now may be the profile's own in another laboratory.
    given.retain(|name, from| heard.tracker.contains(from) || !heard.tracker.contains(name));
    given.extend(names_of(map)?);
    let watched = map_names(&wanted, &given, heard).map_err(RecordError::Names)?;
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

/// Recorded bodies that the guided joints move.
pub(super) fn moved(
    robot: &RobotProfile,
    guided: &BTreeSet<JointId>,
    watched: &[Watched],
) -> Vec<Moved> {
    let of_body = |(name, body): (&String, &Body)| {
        let mut joints = joints_to(&robot.model, body.link);
        if !joints.any(|joint| guided.contains(&robot.model.joint(joint).law.source)) {
            return None;
        }
        let parts = watched.iter().enumerate();
        let parts = parts.filter(|(_, w)| match &body.kind {
            BodyKind::Pose => w.name == *name,
            BodyKind::Markers { names, .. } => names.contains(&w.name),
        });
        let parts: Vec<usize> = parts.map(|(part, _)| part).collect();
        (!parts.is_empty()).then(|| Moved {
            name: name.clone(),
            parts,
        })
    };
    robot.profile.bodies.iter().filter_map(of_body).collect()
}

/// Bodies and markers of the profile that are not recorded.
pub(super) fn unrecorded(robot: &RobotProfile, watched: &[Watched]) -> BTreeSet<String> {
    let of_body = |(name, body): (&String, &Body)| match &body.kind {
        BodyKind::Pose => vec![name.clone()],
        BodyKind::Markers { names, .. } => names.clone(),
    };
    let all = robot.profile.bodies.iter().flat_map(of_body);
    all.filter(|name| !watched.iter().any(|w| w.name == *name))
        .collect()
}

/// Joints that move a recorded body, in the order of the file.
pub(super) fn joints_of(robot: &RobotProfile, watched: &[Watched]) -> Vec<JointId> {
    let recorded = |(name, body): &(&String, &Body)| match &body.kind {
        BodyKind::Pose => watched.iter().any(|w| w.name == **name),
        BodyKind::Markers { names, .. } => watched.iter().any(|w| names.contains(&w.name)),
    };
    let bodies: Vec<LinkId> = robot
        .profile
        .bodies
        .iter()
        .filter(recorded)
        .map(|(_, body)| body.link)
        .collect();
    let moves = |joint: &JointId| {
        let mut chains = bodies.iter().map(|link| joints_to(&robot.model, *link));
        chains.any(|mut chain| chain.any(|other| other == *joint))
    };
    robot.model.independent_joints().filter(moves).collect()
}

/// Joints between a link and the root.
fn joints_to(model: &RobotModel, link: LinkId) -> impl Iterator<Item = JointId> + '_ {
    let joint_above = |link: LinkId| model.link(link).parent_joint;
    std::iter::successors(joint_above(link), move |joint| {
        joint_above(model.joint(*joint).parent)
    })
}
