//! A body that moved on its link at a known row: the rows before it become a body of their own, with a mount of its own.

use std::collections::BTreeMap;

use calib_profile::{Body, BodyKind, Split};
use nalgebra::{Isometry3, Point3};

use crate::prepare::inputs::Inputs;

/// Ending of the name of the body before the change, and of its markers.
pub(crate) const BEFORE: &str = "_before";

/// Carries out every `split` of the profile.
pub fn split(inputs: &mut Inputs) {
    let bodies = inputs.robot.profile.bodies.clone();
    for (name, body) in bodies {
        if let Some(at) = &body.split {
            split_body(inputs, &name, &body, at);
        }
    }
}

fn split_body(inputs: &mut Inputs, name: &str, body: &Body, at: &Split) {
    let profile = &mut inputs.robot.profile;
    let before = format!("{name}{BEFORE}");
    // A mount that is known by construction is the one before the body moved.
    profile.bodies.insert(
        before.clone(),
        Body {
            kind: renamed(&body.kind),
            split: None,
            ..body.clone()
        },
    );
    if let Some(after) = profile.bodies.get_mut(name) {
        after.mount = None;
    }
    for origin in profile.origins.values_mut() {
        if origin.body == name && at.before.contains(&origin.sweep) {
            origin.body.clone_from(&before);
        }
    }
    for (recording, loaded) in &mut inputs.recordings {
        let rows = loaded.poses.rows.clone();
        let earlier = |row: usize| {
            at.before.contains(recording) || (*recording == at.recording && rows[row] < at.at_row)
        };
        let poses = &mut loaded.poses;
        match &body.kind {
            BodyKind::Markers { names, .. } => {
                for marker in names {
                    divide::<Point3<f64>>(&mut poses.markers, marker, earlier);
                }
            }
            BodyKind::Pose => divide::<Isometry3<f64>>(&mut poses.bodies, name, earlier),
        }
    }
}

fn renamed(kind: &BodyKind) -> BodyKind {
    match kind {
        BodyKind::Markers { names, template } => BodyKind::Markers {
            names: names.iter().map(|n| format!("{n}{BEFORE}")).collect(),
            template: template.clone(),
        },
        BodyKind::Pose => BodyKind::Pose,
    }
}

/// Moves the earlier rows of a track to a track of their own; a track without rows is none.
fn divide<T: Clone>(
    tracks: &mut BTreeMap<String, Vec<Option<T>>>,
    name: &str,
    earlier: impl Fn(usize) -> bool,
) {
    let Some(all) = tracks.remove(name) else {
        return;
    };
    let part = |wanted: bool| -> Vec<Option<T>> {
        let of_row = |(row, x): (usize, &Option<T>)| x.clone().filter(|_| earlier(row) == wanted);
        all.iter().enumerate().map(of_row).collect()
    };
    let any = |wanted: bool| (0..all.len()).any(|row| earlier(row) == wanted);
    if any(true) {
        tracks.insert(format!("{name}{BEFORE}"), part(true));
    }
    if any(false) {
        tracks.insert(name.to_owned(), part(false));
    }
}
