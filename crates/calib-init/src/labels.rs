//! Labels that a tracker exchanged in single rows, put right as a run does it, so that the markers of a body are found together.

use std::collections::{BTreeMap, BTreeSet};

use calib_checks::rigid_body::{BodyPoses, Distances, NotABody, body_poses, rigid_groups};
use calib_pipeline::prepare::relabel::{Relabeled, Tracks, put_right};
use calib_recording::Poses;
use nalgebra::Point3;

use crate::fact::{About, Fact, Place};

/// Scatter of a coordinate, m, above which markers do not keep their distances: no tracker has so much noise.
pub const LOOSE: f64 = 5e-3;
/// Markers beyond which sets of loose ones are not searched.
const MOST: usize = 16;

/// Puts the labels in these tracks right where that leaves rigid bodies, and says for which markers.
pub fn in_tracks(tracks: &mut Tracks) -> Vec<Fact> {
    let mut facts = Vec::new();
    for set in sets(tracks) {
        let of_set = set
            .iter()
            .filter_map(|m| Some((m.clone(), tracks.get(m)?.clone())));
        let mut corrected: Tracks = of_set.collect();
        let changed = put_right(&mut [&mut corrected], &set, None);
        if changed.is_empty() || !is_one_body(&corrected, &set) {
            continue;
        }
        facts.push(fact(&changed));
        tracks.extend(corrected);
    }
    facts
}

/// Puts the labels of bodies, each the names of its markers, right in the tables.
pub fn in_tables<'m>(tables: &mut [Poses], bodies: impl Iterator<Item = &'m [String]>) {
    for markers in bodies.filter(|markers| markers.len() >= 3) {
        let mut all: Vec<&mut Tracks> = tables.iter_mut().map(|t| &mut t.markers).collect();
        put_right(&mut all, markers, None);
    }
}

fn fact(changed: &[Relabeled]) -> Fact {
    let markers: BTreeSet<&String> = changed.iter().flat_map(|row| &row.exchanged).collect();
    let about = About::LabelsExchanged {
        markers: markers.into_iter().cloned().collect(),
        rows: changed.len(),
    };
    Fact::new(Place::Recordings, about)
}

/// Markers that may be of one body: those that keep their distances in most rows, and of the others those that are named alike, and all.
fn sets(tracks: &Tracks) -> Vec<Vec<String>> {
    let names: Vec<&String> = tracks.keys().collect();
    let slices: Vec<&[Option<Point3<f64>>]> = tracks.values().map(Vec::as_slice).collect();
    let groups: Vec<Vec<String>> = rigid_groups(&slices, None)
        .iter()
        .map(|group| group.iter().map(|m| names[*m].clone()).collect())
        .collect();
    let (mut sets, small): (Vec<Vec<String>>, Vec<Vec<String>>) =
        groups.into_iter().partition(|group| group.len() >= 3);
    let mut loose: Vec<String> = small.concat();
    let wide = sets.iter().filter(|set| !is_one_body(tracks, set));
    loose.extend(wide.flatten().cloned());
    loose.sort();
    let mut alike: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for name in &loose {
        let stem = name.trim_end_matches(|c: char| !c.is_alphabetic());
        alike.entry(stem).or_default().push(name.clone());
    }
    let more: Vec<Vec<String>> = alike.into_values().chain([loose.clone()]).collect();
    for set in more {
        if (3..=MOST).contains(&set.len()) && !sets.contains(&set) {
            sets.push(set);
        }
    }
    sets
}

/// The poses of a body by its usual samples: single wild ones are no noise.
///
/// # Errors
/// As [`body_poses`].
pub fn usual_poses(
    names: &[String],
    tracks: &[&[Option<Point3<f64>>]],
) -> Result<BodyPoses, NotABody> {
    let usual = Distances::of(tracks, None).without_gross(tracks);
    let usual: Vec<&[Option<Point3<f64>>]> = usual.iter().map(Vec::as_slice).collect();
    body_poses(names, &usual, None, None)
}

fn is_one_body(tracks: &Tracks, set: &[String]) -> bool {
    let slices: Vec<&[Option<Point3<f64>>]> = set
        .iter()
        .filter_map(|m| tracks.get(m).map(Vec::as_slice))
        .collect();
    let one = rigid_groups(&slices, None).len() == 1;
    one && usual_poses(set, &slices)
        .is_ok_and(|poses| poses.sigma.is_none_or(|sigma| sigma < LOOSE))
}
