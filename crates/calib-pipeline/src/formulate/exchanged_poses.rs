//! Bodies that have each other's names in many rows, where no mistake of whole recordings explains what contradicts the nominal robot.
//!
//! With three rows in ten exchanged no registration of all rows fits, so that no single row can be judged by it. The motions between the rows of one body
//! still tell which of them belong together. The explanation counts if the recordings fit the robot once the names are put right.

use std::collections::BTreeMap;

use calib_finding::{Finding, Severity, catalog};
use calib_profile::BodyKind;

use crate::formulate::row_checks::{Exchanged, exchanged_rows};
use crate::formulate::structural::{Structural, structural};
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;

/// Recordings with the names put right, and what is said of them then.
pub(super) struct PutRight {
    /// The rows.
    pub(super) findings: Vec<Finding>,
    /// The recordings.
    pub(super) inputs: Inputs,
    /// The bodies in them.
    pub(super) tracks: BTreeMap<String, BodyTrack>,
    /// The hypotheses about them.
    pub(super) structural: Structural,
}

/// The explanation by exchanged names, where nothing else explains all of what is wrong.
pub(super) fn put_right(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    found: &Structural,
) -> Option<PutRight> {
    // A name that leaves more than nominal errors explain is no explanation of all.
    let is_open = |f: &Finding| {
        let leaves_more = f.facts.get("best").is_some() && f.facts.get("limit").is_some();
        f.id == catalog::MODEL_DISAGREES || f.severity == Severity::Error && leaves_more
    };
    let disagrees = |of: &Structural| of.findings.iter().any(is_open);
    let names = inputs.recordings.keys();
    let seen = |name: &String| {
        let bodies = tracks.values();
        bodies
            .filter(|track| !track.in_recording(name).is_empty())
            .count()
    };
    if !disagrees(found) || names.map(seen).all(|bodies| bodies < 2) {
        return None;
    }
    let unexplained = Structural {
        findings: Vec::new(),
        ..found.clone()
    };
    let exchanged = exchanged_rows(inputs, tracks, &unexplained);
    if exchanged.is_empty() {
        return None;
    }
    let (mut right, mut of_right) = (inputs.clone(), tracks.clone());
    for of in &exchanged {
        exchange(&mut right, &mut of_right, of);
    }
    let structural = structural(&right, &of_right);
    (!disagrees(&structural)).then(|| PutRight {
        findings: exchanged.iter().map(|of| of.finding(inputs)).collect(),
        inputs: right,
        tracks: of_right,
        structural,
    })
}

/// Exchanges the names of two bodies in some rows.
fn exchange(inputs: &mut Inputs, tracks: &mut BTreeMap<String, BodyTrack>, of: &Exchanged<'_>) {
    let name = &of.loaded.name;
    let markers = of
        .bodies
        .map(|body| match &inputs.robot.profile.bodies[body].kind {
            BodyKind::Pose => Vec::new(),
            BodyKind::Markers { names, .. } => names.clone(),
        });
    if let Some(loaded) = inputs.recordings.get_mut(name) {
        in_rows(&mut loaded.poses.bodies, of.bodies, of);
        for (first, second) in markers[0].iter().zip(&markers[1]) {
            in_rows(&mut loaded.poses.markers, [first, second], of);
        }
    }
    let mut poses = of.bodies.map(|body| {
        let track = tracks.get_mut(body);
        track.and_then(|track| track.poses.remove(name))
    });
    if let [Some(first), Some(second)] = &mut poses {
        for &row in &of.rows {
            std::mem::swap(&mut first[row], &mut second[row]);
        }
    }
    for (body, poses) in of.bodies.into_iter().zip(poses) {
        if let Some((track, poses)) = tracks.get_mut(body).zip(poses) {
            track.poses.insert(name.clone(), poses);
        }
    }
}

/// Exchanges what two names have in some rows.
fn in_rows<T>(
    of_names: &mut BTreeMap<String, Vec<Option<T>>>,
    [first, second]: [&str; 2],
    of: &Exchanged<'_>,
) {
    if !of_names.contains_key(second) {
        return;
    }
    let Some(mut a) = of_names.remove(first) else {
        return;
    };
    if let Some(b) = of_names.get_mut(second) {
        for &row in &of.rows {
            std::mem::swap(&mut a[row], &mut b[row]);
        }
    }
    of_names.insert(first.to_owned(), a);
}
