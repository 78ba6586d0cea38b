//! Bodies that a recording has to show and does not name: its rows would count for nothing, without a word.

use calib_finding::{Fact, Finding, Subject, catalog, nearest_word};
use calib_profile::{Body, BodyKind, Profile, Usage};
use calib_recording::Poses;

use crate::prepare::inputs::{Inputs, Loaded};

/// What the profile asks of a recording and none of its columns is named like.
///
/// A recording may lack a body, as cameras do not see all of them from everywhere. It must show the body whose sweep it is, and it must show some
/// body where it shows anything at all.
pub(super) fn missing_bodies(inputs: &Inputs, loaded: &Loaded) -> Vec<Finding> {
    let profile = &inputs.robot.profile;
    let poses = &loaded.poses;
    if columns(poses).next().is_none() {
        return Vec::new();
    }
    let has = |name: &String| has_column(poses, name);
    let touched = is_touched(profile, &loaded.name);
    let shown = |name: &String, body: &Body| names(name, body).any(has);
    let free = free(profile, poses);
    let finding = |kind, subject, bodies: &[_]| missing((kind, subject), bodies, poses, &free);
    // What no fitted recording shows is named with its cause where its tracks are needed.
    let fitted = |r: &&Loaded| r.spec.usage != Usage::Validation;
    let elsewhere = |(name, body): &(&String, &Body)| {
        let mut others = inputs.recordings.values().filter(fitted);
        others.any(|r| names(name, body).any(|n| has_column(&r.poses, n)))
    };
    let bodies: Vec<(&String, &Body)> = profile.bodies.iter().filter(elsewhere).collect();
    if !bodies.is_empty() && !touched && !bodies.iter().any(|(name, body)| shown(name, body)) {
        return vec![finding("all", Subject::default(), &bodies)];
    }
    let is_swept = |name: &String| {
        let mut origins = profile.origins.values();
        origins.any(|origin| origin.sweep == loaded.name && origin.body == *name)
    };
    let unseen = bodies.iter().filter(|(name, body)| !shown(name, body));
    unseen
        .filter_map(|&(name, body)| {
            let kind = match () {
                () if is_swept(name) => "swept",
                () if renamed(names(name, body), &free) => "renamed",
                () => return None,
            };
            Some(finding(kind, Subject::body(name), &[(name, body)]))
        })
        .collect()
}

/// What to say of a stream that shows no body of the profile, before anything is asked of its motion; `None` where it shows one, or nothing at all.
pub(super) fn shows_none(profile: &Profile, name: &str, stream: &Poses) -> Option<Finding> {
    if is_touched(profile, name) {
        return None;
    }
    let bodies: Vec<(&String, &Body)> = profile.bodies.iter().collect();
    let mut all = bodies.iter().flat_map(|(name, body)| names(name, body));
    let is_blind = columns(stream).next().is_none() || bodies.is_empty();
    if is_blind || all.any(|name| has_column(stream, name)) {
        return None;
    }
    let free = free(profile, stream);
    Some(missing(("all", Subject::default()), &bodies, stream, &free))
}

/// Whether the recording is one of contacts, which need no tracker.
fn is_touched(profile: &Profile, recording: &str) -> bool {
    let mut contacts = profile.contacts.values();
    contacts.any(|contact| contact.recordings.iter().any(|name| name == recording))
}

fn columns(poses: &Poses) -> impl Iterator<Item = &String> {
    poses.markers.keys().chain(poses.bodies.keys())
}

/// Columns of no body of the profile: a column of another body is not what was meant.
fn free<'a>(profile: &Profile, poses: &'a Poses) -> Vec<&'a str> {
    let bodies = &profile.bodies;
    let all = || bodies.iter().flat_map(|(name, body)| names(name, body));
    let is_free = |column: &&String| !all().any(|name| name == *column);
    let free = columns(poses).filter(is_free);
    free.map(String::as_str).collect()
}

fn missing(
    (kind, subject): (&'static str, Subject),
    bodies: &[(&String, &Body)],
    poses: &Poses,
    free: &[&str],
) -> Finding {
    let near = |(name, body): &(&String, &Body)| {
        let first = names(name, body).next()?;
        let longer = || free.iter().copied().find(|c| c.ends_with(first.as_str()));
        nearest_word(first, free.iter().copied()).or_else(longer)
    };
    let near: Vec<&str> = bodies.iter().filter_map(near).collect();
    let bodies = bodies.iter().map(|(name, _)| name.as_str());
    Finding::of_kind(catalog::MISSING_BODY, kind, subject)
        .with("bodies", Fact::names(bodies))
        .with("known", Fact::names(columns(poses).map(String::as_str)))
        .with_some("nearest", (!near.is_empty()).then(|| Fact::names(near)))
}

/// Whether all these names are there with one and the same text before or behind them, as trackers put that of a subject or a session.
fn renamed<'a>(names: impl Iterator<Item = &'a String>, free: &[&str]) -> bool {
    let names: Vec<&String> = names.collect();
    let has = |before: &str, behind: &str| {
        let there = |name: &&String| free.contains(&format!("{before}{name}{behind}").as_str());
        names.iter().all(there)
    };
    let Some(first) = names.first() else {
        return false;
    };
    free.iter().any(|column| {
        let before = column.strip_suffix(first.as_str());
        let behind = column.strip_prefix(first.as_str());
        before.is_some_and(|before| has(before, "")) || behind.is_some_and(|behind| has("", behind))
    })
}

fn has_column(of: &Poses, name: &String) -> bool {
    of.markers.contains_key(name) || of.bodies.contains_key(name)
}

/// What columns of a body are named.
fn names<'a>(name: &'a String, body: &'a Body) -> Box<dyn Iterator<Item = &'a String> + 'a> {
    match &body.kind {
        BodyKind::Markers { names, .. } => Box::new(names.iter()),
        BodyKind::Pose => Box::new(std::iter::once(name)),
    }
}
