//! Markers that keep their distances are a body; a tracked pose is one by itself.

use std::collections::{BTreeMap, BTreeSet};

use calib_checks::rigid_body::{is_pose_of, rigid_groups_of_files};
use calib_recording::{BodyStream, ColumnMap, Filled, MarkerStream};
use calib_urdf::RobotModel;
use nalgebra::Point3;

use crate::error::InitError;
use crate::fact::{About, Fact, Place};
use crate::labels;
use crate::source::Source;

/// A body, before its link is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Its name.
    pub name: String,
    /// Its markers; empty: a tracked pose.
    pub markers: Vec<String>,
}

/// Rows of each file that distances are taken from.
const ROWS: usize = 400;
/// Rows that two markers must share before their distance says anything.
const SHARED: usize = 4;
/// Markers closer than this in every row are one, m: a printed digit.
const SAME: f64 = 1e-9;
/// Scatter of distances below which points were calculated, m: as in the checks of recordings.
const CALCULATED: f64 = 1.5e-6;

/// Positions of a marker in the rows that are looked at.
type Track = Vec<Option<Point3<f64>>>;

/// The bodies of all files together, with the noise that their markers show. Bodies of markers have names that no link of the robot has, nor any
/// body of a profile that is edited (`known`).
#[must_use]
pub fn bodies(
    model: &RobotModel,
    sources: &[Source],
    known: &BTreeSet<String>,
) -> (Vec<Found>, Vec<Fact>) {
    let mut facts = Vec::new();
    let (mut tracks, begins) = tracks(sources);
    facts.extend(seldom(&mut tracks));
    facts.extend(duplicates(&mut tracks));
    facts.extend(labels::in_tracks(&mut tracks));
    let names: Vec<&String> = tracks.keys().collect();
    let slices: Vec<&[Option<Point3<f64>>]> = tracks.values().map(Vec::as_slice).collect();
    // A tracked pose keeps its name.
    let mut posed: BTreeSet<String> = streams(sources).map(|body| body.name.clone()).collect();
    let mut taken = posed.clone();
    taken.extend(known.iter().cloned());
    let mut found = Vec::new();
    let mut noise: Option<(f64, usize)> = None;
    let mut calculated = false;
    for group in rigid_groups_of_files(&slices, None, &begins)
        .iter()
        .flat_map(|g| seen_together(g, &slices))
    {
        let mut markers: Vec<String> = group.iter().map(|m| names[*m].clone()).collect();
        let of_group: Vec<&[Option<Point3<f64>>]> = group.iter().map(|m| slices[*m]).collect();
        let pose = pose_of(sources, &markers).filter(|pose| !known.contains(pose));
        if let Some(pose) = pose.filter(|pose| posed.remove(pose)) {
            taken.remove(&pose);
            facts.push(Fact::new(
                Place::Recordings,
                About::PoseOfMarkers { body: pose },
            ));
        }
        let own = device_body(sources, &markers).unwrap_or_else(|| body_name(&markers));
        let name = free(model, own, &mut taken);
        let place = Place::Body(name.clone());
        let about = if markers.len() < 3 {
            About::Points {
                markers: markers.len(),
            }
        } else if let Ok(poses) = labels::usual_poses(&markers, &of_group) {
            let sigma = poses.sigma.filter(|s| *s > CALCULATED);
            calculated |= poses.sigma.is_some_and(|s| s <= CALCULATED);
            let rows = poses.rows.iter().filter(|r| r.is_ok()).count();
            if let Some(sigma) = sigma.filter(|s| *s < labels::LOOSE)
                && noise.is_none_or(|(_, known)| rows > known)
            {
                noise = Some((sigma, rows));
            }
            About::Rigid {
                markers: markers.len(),
                sigma,
            }
        } else {
            About::Flat {
                left_out: markers.split_off(2),
            }
        };
        facts.push(Fact::new(place, about));
        found.push(Found { name, markers });
    }
    for name in posed {
        facts.push(Fact::new(Place::Body(name.clone()), About::Pose));
        found.push(Found {
            name,
            markers: Vec::new(),
        });
    }
    let about = match noise {
        Some((sigma, rows)) => About::MarkerSigma { sigma, rows },
        None if calculated => About::Calculated,
        None => of_still_bodies(sources).unwrap_or(About::SigmaUnknown),
    };
    facts.push(Fact::new(Place::Tracker, about));
    (found, facts)
}

/// The body that the tracker counts all these markers to.
fn device_body(sources: &[Source], markers: &[String]) -> Option<String> {
    let all = sources.iter().flat_map(|s| &s.recording.markers);
    let own = all.filter(|m| markers.contains(&m.name) && !m.unlabeled);
    let mut bodies = own.map(|m| m.body.as_ref());
    let first = bodies.next()??;
    bodies
        .all(|body| body == Some(first))
        .then(|| first.clone())
}

/// The tracked pose that was computed from these markers: the tracker counts them to it, or the pose is their least-squares fit.
fn pose_of(sources: &[Source], markers: &[String]) -> Option<String> {
    if markers.len() < 3 {
        return None;
    }
    let by_name = device_body(sources, markers);
    let mut names: BTreeSet<&String> = streams(sources).map(|body| &body.name).collect();
    names.retain(|name| {
        by_name.as_ref() == Some(name) || sources.iter().any(|source| is_fit(source, name, markers))
    });
    names.first().map(|name| (*name).clone())
}

/// Whether the pose is the least-squares fit of the markers in this file.
fn is_fit(source: &Source, pose: &str, markers: &[String]) -> bool {
    let recording = &source.recording;
    let Some(body) = recording.bodies.iter().find(|b| b.name == *pose) else {
        return false;
    };
    let track = |name: &String| {
        let marker = recording.markers.iter().find(|m| m.name == *name)?;
        let of_body = marker.timeline == body.timeline;
        let points = marker.samples.iter().map(|s| s.point(Filled::Exclude));
        of_body.then(|| points.collect::<Track>())
    };
    let tracks: Option<Vec<Track>> = markers.iter().map(track).collect();
    tracks.is_some_and(|tracks| {
        let slices: Vec<&[Option<Point3<f64>>]> = tracks.iter().map(Vec::as_slice).collect();
        is_pose_of(&body.tracker_from_body, &slices)
    })
}

fn streams(sources: &[Source]) -> impl Iterator<Item = &BodyStream> {
    let bodies = sources.iter().flat_map(|s| &s.recording.bodies);
    bodies.filter(|b| b.tracker_from_body.iter().flatten().count() >= SHARED)
}

/// All markers, file after file.
fn tracks(sources: &[Source]) -> (BTreeMap<String, Track>, Vec<usize>) {
    let labeled = |m: &&MarkerStream| !m.unlabeled;
    let all = sources.iter().flat_map(|s| &s.recording.markers);
    let names: BTreeSet<&String> = all.filter(labeled).map(|m| &m.name).collect();
    let mut tracks: BTreeMap<String, Track> = names
        .into_iter()
        .map(|name| (name.clone(), Track::new()))
        .collect();
    let (mut begins, mut all_rows) = (Vec::new(), 0);
    for source in sources {
        let markers = &source.recording.markers;
        let most = markers.iter().map(|m| m.samples.len()).max().unwrap_or(0);
        let stride = most / ROWS + 1;
        let rows = most.div_ceil(stride);
        begins.push(all_rows);
        all_rows += rows;
        for (name, track) in &mut tracks {
            let marker = markers.iter().find(|m| m.name == *name && !m.unlabeled);
            let at = |row: usize| marker?.samples.get(row * stride)?.point(Filled::Exclude);
            track.extend((0..rows).map(at));
        }
    }
    (tracks, begins)
}

/// Removes markers that hardly any row shows.
fn seldom(tracks: &mut BTreeMap<String, Track>) -> Option<Fact> {
    let is_seldom = |track: &Track| track.iter().flatten().count() < SHARED;
    let markers: Vec<String> = tracks
        .iter()
        .filter(|(_, t)| is_seldom(t))
        .map(|(n, _)| n.clone())
        .collect();
    tracks.retain(|_, track| !is_seldom(track));
    (!markers.is_empty()).then(|| Fact::new(Place::Recordings, About::Seldom { markers }))
}

/// Removes markers that repeat another one in every row.
fn duplicates(tracks: &mut BTreeMap<String, Track>) -> Vec<Fact> {
    let names: Vec<String> = tracks.keys().cloned().collect();
    let repeats = |a: &Track, b: &Track| {
        let mut both = 0;
        let same = a.iter().zip(b).all(|(a, b)| match (a, b) {
            (Some(a), Some(b)) => {
                both += 1;
                (a - b).norm() < SAME
            }
            _ => true,
        });
        same && both >= SHARED
    };
    let mut facts = Vec::new();
    for (i, marker) in names.iter().enumerate() {
        let of = names[..i]
            .iter()
            .filter_map(|other| Some((other, tracks.get(other)?)))
            .find(|(_, other)| repeats(other, &tracks[marker]));
        if let Some((of, _)) = of {
            let (marker, of) = (marker.clone(), of.clone());
            tracks.remove(&marker);
            facts.push(Fact::new(
                Place::Recordings,
                About::Duplicate { marker, of },
            ));
        }
    }
    facts
}

/// A rigid group in parts that are seen in the same rows: markers that are never seen together are rigid to one another by default.
fn seen_together(group: &[usize], tracks: &[&[Option<Point3<f64>>]]) -> Vec<Vec<usize>> {
    let together = |a: usize, b: usize| {
        let rows = tracks[a].iter().zip(tracks[b]);
        rows.filter(|(a, b)| a.is_some() && b.is_some()).count() >= SHARED
    };
    let mut parts: Vec<Vec<usize>> = Vec::new();
    for &marker in group {
        let (mut with, without): (Vec<_>, Vec<_>) = parts
            .into_iter()
            .partition(|part| part.iter().any(|other| together(*other, marker)));
        with.push(vec![marker]);
        parts = without;
        let mut joined = with.concat();
        joined.sort_unstable();
        parts.push(joined);
    }
    parts.sort();
    parts
}

/// What the names of the markers have in common, if that is a name.
fn body_name(markers: &[String]) -> String {
    let first = markers.first().map_or("", String::as_str);
    let common = markers.iter().fold(first, |common, name| {
        let same = common.chars().zip(name.chars()).take_while(|(a, b)| a == b);
        let bytes: usize = same.map(|(a, _)| a.len_utf8()).sum();
        &common[..bytes]
    });
    let trimmed = match markers.len() {
        1 => first,
        _ => common.trim_end_matches(|c: char| !c.is_alphabetic()),
    };
    // `Subject:Marker`: the marker's own part, if it is a name.
    let mut parts = trimmed
        .rsplit(':')
        .map(|part| part.trim_end_matches(|c: char| !c.is_alphanumeric()));
    let base = parts.find(|part| part.chars().count() >= 2);
    base.unwrap_or("body").to_owned()
}

/// A name for a body that no link of the robot has: `calib predict` and others ask for both by one name.
pub(crate) fn unlike_links(model: &RobotModel, mut name: String) -> String {
    while model.link_id(&name).is_ok() {
        name += "_markers";
    }
    name
}

/// The name, or the next one like it, that neither a body nor a link has.
fn free(model: &RobotModel, base: String, taken: &mut BTreeSet<String>) -> String {
    let base = unlike_links(model, base);
    let mut names = std::iter::once(base.clone()).chain((2..).map(|n| format!("{base}_{n}")));
    let is_free = |name: &String| !taken.contains(name) && model.link_id(name).is_err();
    let name = names.find(is_free).unwrap_or(base);
    taken.insert(name.clone());
    name
}

/// Bodies whose two markers are not one after all, as a body for each marker.
#[must_use]
pub fn split(
    model: &RobotModel,
    found: Vec<Found>,
    facts: &mut Vec<Fact>,
    apart: &[usize],
    known: &BTreeSet<String>,
) -> Vec<Found> {
    let mut taken: BTreeSet<String> = found.iter().map(|body| body.name.clone()).collect();
    taken.extend(known.iter().cloned());
    let mut new = Vec::new();
    for (i, body) in found.into_iter().enumerate() {
        if !apart.contains(&i) {
            new.push(body);
            continue;
        }
        facts.retain(|fact| fact.place != Place::Body(body.name.clone()));
        for marker in body.markers {
            let name = free(model, marker.clone(), &mut taken);
            let about = About::Points { markers: 1 };
            facts.push(Fact::new(Place::Body(name.clone()), about));
            new.push(Found {
                name,
                markers: vec![marker],
            });
        }
    }
    new
}

/// Sources without the markers that were left out, where a column map can leave them out.
///
/// # Errors
/// As [`Source::with_columns`].
pub fn without_left_out(
    model: &RobotModel,
    sources: &mut [Source],
    facts: &[Fact],
) -> Result<(), InitError> {
    let left_out = facts.iter().flat_map(|fact| match &fact.about {
        About::Duplicate { marker, .. } => std::slice::from_ref(marker),
        About::Seldom { markers } | About::Computed { markers, .. } => markers,
        _ => &[],
    });
    let left_out: BTreeSet<&String> = left_out.collect();
    let bodies = facts.iter().filter_map(|fact| match &fact.about {
        About::Computed { body, markers, .. } if markers.is_empty() => Some(body),
        _ => None,
    });
    let bodies: BTreeSet<&String> = bodies.collect();
    for source in sources {
        let Some(mut map) = source.columns.clone() else {
            continue;
        };
        let count = |map: &ColumnMap| map.markers.len() + map.bodies.len();
        let before = count(&map);
        map.markers.retain(|name, _| !left_out.contains(name));
        map.bodies.retain(|name, _| !bodies.contains(name));
        if count(&map) < before {
            *source = source.with_columns(model, map)?;
        }
    }
    Ok(())
}

/// Scatter of a pose that stays where it is: a body beside the robot.
fn of_still_bodies(sources: &[Source]) -> Option<About> {
    /// A body that moves no more than this is still, m and rad.
    const STILL: (f64, f64) = (5e-3, 0.02);
    /// Rows that tell a scatter.
    const ENOUGH: usize = 8;
    streams(sources).find_map(|body| {
        let poses: Vec<_> = body.tracker_from_body.iter().flatten().collect();
        let first = poses.first()?;
        let relative: Vec<_> = poses.iter().map(|pose| first.inverse() * **pose).collect();
        let is_still = relative
            .iter()
            .all(|p| p.translation.vector.norm() < STILL.0 && p.rotation.angle() < STILL.1);
        if poses.len() < ENOUGH || !is_still {
            return None;
        }
        let sigma = |values: Vec<f64>| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64
        };
        let axes = |of: &dyn Fn(usize) -> Vec<f64>| {
            ((0..3).map(|k| sigma(of(k))).sum::<f64>() / 3.0).sqrt()
        };
        let position = axes(&|k| relative.iter().map(|p| p.translation.vector[k]).collect());
        let orientation = axes(&|k| {
            relative
                .iter()
                .map(|p| p.rotation.scaled_axis()[k])
                .collect()
        });
        (position > 0.0 && orientation > 0.0).then_some(About::BodySigma {
            position,
            orientation,
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_from_what_the_markers_share() {
        let urdf = "<robot name=\"r\"><link name=\"table\"/></robot>";
        let model = RobotModel::from_urdf_text(urdf, "r.urdf").expect("a robot");
        let mut taken = BTreeSet::new();
        let named = |markers: &[&str], taken: &mut BTreeSet<String>| {
            let markers: Vec<String> = markers.iter().map(|m| (*m).to_owned()).collect();
            free(&model, body_name(&markers), taken)
        };
        assert_eq!(named(&["gripM_1", "gripM_2"], &mut taken), "gripM");
        assert_eq!(named(&["m1", "m2", "m3"], &mut taken), "body");
        assert_eq!(named(&["a", "b"], &mut taken), "body_2");
        assert_eq!(named(&["left_marker"], &mut taken), "left_marker");
        assert_eq!(named(&["Sub:P1", "Sub:P2"], &mut taken), "Sub");
        assert_eq!(named(&["table_1", "table_2"], &mut taken), "table_markers");
    }

    #[test]
    fn markers_of_different_files_are_different_bodies() {
        let p = Some(Point3::origin());
        let early: Track = [vec![p; 5], vec![None; 5]].concat();
        let late: Track = [vec![None; 5], vec![p; 5]].concat();
        let tracks = [early.as_slice(), late.as_slice(), early.as_slice()];
        assert_eq!(seen_together(&[0, 1, 2], &tracks), [vec![0, 2], vec![1]]);
    }
}
