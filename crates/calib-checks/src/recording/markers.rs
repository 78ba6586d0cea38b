//! Single markers: lost ones coded as zero, columns written twice, frozen and computed points, the unit of length.

use super::Expectations;
use crate::rigid_body::{computed_below, decimal_grid};
use crate::statistics::{median, range};
use calib_finding::{About, Fact, Finding, Subject, catalog};
use calib_recording::Poses;
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;

/// Rows of exactly equal values that make a frozen marker: two may happen by rounding.
const FROZEN_ROWS: usize = 3;
/// A step of this many times the written resolution does not vanish by rounding.
const SHOWN: f64 = 10.0;
/// Steps among which the smallest is the resolution.
const MANY_STEPS: usize = 200;
/// Movement of anything else, m, in which a marker cannot stand exactly still.
const MOVED: f64 = 1e-3;
/// Rows from which the scatter of a distance is known well enough.
const ROWS_FOR_SCATTER: usize = 5;
/// Rows that are looked at, evenly spread, where all would take long and tell no more.
const ENOUGH_ROWS: usize = 1000;
/// Nothing is tracked from farther away, m: laser trackers reach 160 m. More is millimeters taken for meters.
const LARGEST_VOLUME: f64 = 200.0;
/// Ratio of what two bodies of one robot move, from which they are in different units.
const ANOTHER_UNIT: f64 = 50.0;

type Track = [Option<Point3<f64>>];

pub(super) fn zeros(poses: &Poses) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, track) in &poses.markers {
        let rows: Vec<u64> = (0..poses.len())
            .filter(|&i| track[i] == Some(Point3::origin()))
            .map(|i| poses.rows[i])
            .collect();
        if !rows.is_empty() {
            findings.push(
                Finding::of_kind(catalog::ALL_ZERO_TRIPLET, "kept", Subject::marker(name))
                    .with("samples", Fact::count(rows.len()))
                    .at_rows(rows),
            );
        }
    }
    findings
}

/// What a marker or body shows of the unit it is written in.
struct Extent<'a> {
    name: &'a str,
    places: Vec<Vector3<f64>>,
}

impl Extent<'_> {
    /// Largest range of a coordinate, m.
    fn spread<'e>(extents: impl Iterator<Item = &'e Extent<'e>> + Clone) -> f64 {
        let along = |axis: usize| {
            let places = extents.clone().flat_map(|e| &e.places);
            range(places.map(|p| p[axis]))
        };
        let ranges = (0..3).filter_map(along).map(|(low, high)| high - low);
        ranges.fold(0.0, f64::max)
    }

    /// Largest distance from the tracker's origin, m.
    fn farthest(&self) -> f64 {
        self.places.iter().map(Vector3::norm).fold(0.0, f64::max)
    }
}

pub(super) fn length_unit(poses: &Poses, expected: &Expectations) -> Option<Finding> {
    let points = poses.markers.iter().map(|(name, track)| Extent {
        name,
        places: track.iter().flatten().map(|p| p.coords).collect(),
    });
    let poses_at = poses.bodies.iter().map(|(name, track)| Extent {
        name,
        places: track
            .iter()
            .flatten()
            .map(|p| p.translation.vector)
            .collect(),
    });
    let all: Vec<Extent<'_>> = points.chain(poses_at).collect();
    let farthest = all.iter().map(Extent::farthest).fold(0.0, f64::max);
    let finding = |kind| Finding::of_kind(catalog::UNIT_MISMATCH, kind, About::Lengths);
    let is_too_far = |spread: f64, farthest: f64| {
        expected.reach.is_some_and(|reach| spread > 20.0 * reach) || farthest > LARGEST_VOLUME
    };
    let spread = Extent::spread(all.iter());
    if is_too_far(spread, farthest) {
        // Markers or bodies that move by far more than the others are in another unit.
        let own = |e: &Extent<'_>| Extent::spread(std::iter::once(e));
        let (far, near): (Vec<&Extent<'_>>, Vec<&Extent<'_>>) = all
            .iter()
            .filter(|e| !e.places.is_empty())
            .partition(|e| is_too_far(own(e), e.farthest()));
        let of_near = Extent::spread(near.iter().copied());
        let of_far = Extent::spread(far.iter().copied());
        if of_near > MOVED && of_far > ANOTHER_UNIT * of_near {
            return Some(
                finding("some_millimeters")
                    .with("names", Fact::names(far.iter().map(|e| e.name)))
                    .with("spread", Fact::meters(of_far))
                    .with("others", Fact::meters(of_near)),
            );
        }
        return Some(
            finding("millimeters")
                .with("spread", Fact::meters(spread))
                .with("farthest", Fact::meters(farthest)),
        );
    }
    // Below 1 cm from the tracker's origin at all times: meters divided by a thousand.
    let places = all.iter().map(|e| e.places.len()).sum::<usize>();
    if places >= 3 && farthest < 1e-2 && farthest > 0.0 {
        return Some(finding("meters").with("farthest", Fact::meters(farthest)));
    }
    None
}

/// Markers that are equal wherever both are seen.
pub(super) fn duplicates(poses: &Poses) -> Vec<Finding> {
    let tracks: Vec<(&String, &Vec<Option<Point3<f64>>>)> = poses.markers.iter().collect();
    let mut findings = Vec::new();
    for (i, (a, track_a)) in tracks.iter().enumerate() {
        for (b, track_b) in &tracks[..i] {
            let stride = poses.len() / ENOUGH_ROWS + 1;
            let both = |row: usize| Some((track_a[row]?, track_b[row]?));
            if stride > 1
                && !(0..poses.len())
                    .step_by(stride)
                    .filter_map(both)
                    .any(|(p, q)| p == q)
            {
                continue;
            }
            let seen = (0..poses.len()).filter_map(|row| both(row).map(|(p, q)| (row, p == q)));
            let (mut count, mut rows) = (0, Vec::new());
            for (row, same) in seen {
                count += 1;
                if same {
                    rows.push(poses.rows[row]);
                }
            }
            let equal = rows.len();
            if equal >= 2 && 2 * equal >= count {
                findings.push(
                    Finding::new(catalog::DUPLICATE_COLUMN, Subject::marker(*a))
                        .with("other", Fact::name(*b))
                        .with("equal", Fact::count(equal))
                        .with("shared", Fact::count(count))
                        .at_rows(rows),
                );
            }
        }
    }
    findings
}

/// Runs of exactly equal values while another marker of the body (or, without bodies, any other) moves.
pub(super) fn frozen(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, track) in &poses.markers {
        let siblings: Vec<&str> = expected
            .bodies
            .values()
            .filter(|markers| markers.contains(name))
            .flatten()
            .map(String::as_str)
            .filter(|other| other != name)
            .collect();
        let others: Vec<&Track> = poses
            .markers
            .iter()
            .filter(|(other, _)| {
                *other != name && (siblings.is_empty() || siblings.contains(&other.as_str()))
            })
            .map(|(_, track)| track.as_slice())
            .collect();
        let moves = travel(track, 0, track.len()) >= MOVED;
        // One that never changes, while others of its body move, has no steps to show.
        let always = !siblings.is_empty() && runs(track).len() == 1;
        if (siblings.is_empty() && !moves) || !(always || steps_show(track)) {
            continue;
        }
        let mut rows = Vec::new();
        for (start, end) in runs(track) {
            let moved = others
                .iter()
                .map(|other| travel(other, start, end))
                .fold(0.0, f64::max);
            if end - start >= FROZEN_ROWS && moved > MOVED {
                rows.extend((start..end).map(|i| poses.rows[i]));
            }
        }
        if !rows.is_empty() {
            findings.push(
                Finding::of_kind(catalog::FROZEN, "marker", Subject::marker(name))
                    .with("rows", Fact::count(rows.len()))
                    .at_rows(rows),
            );
        }
    }
    findings.extend(frozen_bodies(poses));
    findings
}

fn frozen_bodies(poses: &Poses) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, track) in &poses.bodies {
        let own: Vec<Option<Point3<f64>>> = track
            .iter()
            .map(|pose| pose.map(|pose| pose.translation.vector.into()))
            .collect();
        if travel(&own, 0, own.len()) < MOVED {
            continue;
        }
        let others: Vec<Vec<Option<Point3<f64>>>> = poses
            .bodies
            .iter()
            .filter(|(other, _)| *other != name)
            .map(|(_, track)| {
                track
                    .iter()
                    .map(|pose| pose.map(|pose| pose.translation.vector.into()))
                    .collect()
            })
            .collect();
        let mut rows = Vec::new();
        let mut start = 0;
        for i in 1..=track.len() {
            if i < track.len() && track[i].is_some() && track[i] == track[start] {
                continue;
            }
            let joints = poses
                .joints
                .values()
                .filter_map(|q| range(q[start..i].iter().flatten().copied()));
            let moved = others.iter().any(|other| travel(other, start, i) > MOVED)
                || joints.map(|(low, high)| high - low).any(|turn| turn > 0.02);
            if track[start].is_some() && i - start >= FROZEN_ROWS && moved {
                rows.extend((start..i).map(|i| poses.rows[i]));
            }
            start = i;
        }
        if !rows.is_empty() {
            findings.push(
                Finding::of_kind(catalog::FROZEN, "body", Subject::body(name))
                    .with("rows", Fact::count(rows.len()))
                    .at_rows(rows),
            );
        }
    }
    findings
}

/// Whether the marker's usual step from row to row is well above the resolution it is written with: a pin that creeps by
/// a micrometer a row repeats its value without being frozen.
fn steps_show(track: &Track) -> bool {
    let steps: Vec<f64> = track
        .windows(2)
        .filter_map(|w| Some((w[1]? - w[0]?).amax()))
        .collect();
    let resolution = decimal_grid(track.iter().flatten()).unwrap_or_else(|| {
        // Not decimal (integers times a scale): with many steps the smallest is the grid's.
        let smallest = steps
            .iter()
            .copied()
            .filter(|&step| step > 0.0)
            .fold(f64::INFINITY, f64::min);
        if steps.len() >= MANY_STEPS {
            smallest
        } else {
            0.0
        }
    });
    median(steps).is_some_and(|usual| usual > SHOWN * resolution)
}

/// Maximal runs `start..end` of equal points.
fn runs(track: &Track) -> Vec<(usize, usize)> {
    let mut runs = Vec::new();
    let mut start = 0;
    for i in 1..=track.len() {
        if i == track.len() || track[i] != track[start] {
            if track[start].is_some() {
                runs.push((start, i));
            }
            start = i;
        }
    }
    runs
}

/// Largest distance from the first point seen in `start..end`, m.
fn travel(track: &Track, start: usize, end: usize) -> f64 {
    let mut seen = track[start..end.min(track.len())].iter().flatten();
    let Some(first) = seen.next() else { return 0.0 };
    seen.map(|point| (point - first).norm()).fold(0.0, f64::max)
}

/// Groups of three or more moving markers whose distances do not scatter: points of a fitted body, not measurements.
pub(super) fn virtual_points(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    let tracks: Vec<(&String, &Vec<Option<Point3<f64>>>)> = poses
        .markers
        .iter()
        .filter(|(_, track)| travel(track, 0, track.len()) > 10.0 * MOVED)
        .collect();
    let stride = poses.len() / ENOUGH_ROWS + 1;
    let seen = tracks.iter().flat_map(|(_, track)| track.iter().flatten());
    // A computed distance scatters no more than a coordinate: it is a difference of two, but only along itself.
    let too_constant = computed_below(seen, expected.marker_sigma);
    // Markers joined by a distance that does not scatter.
    let mut group: Vec<usize> = (0..tracks.len()).collect();
    let mut worst: BTreeMap<usize, f64> = BTreeMap::new();
    for i in 0..tracks.len() {
        for j in 0..i {
            let both = |row: usize| Some((tracks[i].1[row]? - tracks[j].1[row]?).norm());
            let distances: Vec<f64> = (0..poses.len()).step_by(stride).filter_map(both).collect();
            if distances.len() < ROWS_FOR_SCATTER || distances.iter().all(|&d| d == 0.0) {
                continue;
            }
            let mean = distances.iter().sum::<f64>() / distances.len() as f64;
            let squares: f64 = distances.iter().map(|d| (d - mean).powi(2)).sum();
            let sigma = (squares / (distances.len() - 1) as f64).sqrt();
            if sigma < too_constant {
                let (from, to) = (group[i], group[j]);
                group
                    .iter_mut()
                    .filter(|g| **g == from)
                    .for_each(|g| *g = to);
                let before = worst.remove(&from).unwrap_or(0.0);
                let entry = worst.entry(to).or_insert(0.0);
                *entry = entry.max(before).max(sigma);
            }
        }
    }
    let mut findings = Vec::new();
    for g in 0..tracks.len() {
        let members: Vec<&str> = (0..tracks.len())
            .filter(|&i| group[i] == g)
            .map(|i| tracks[i].0.as_str())
            .collect();
        if members.len() >= 3 {
            let scatter = worst.get(&g).copied().unwrap_or(0.0);
            let names = members.iter().map(|name| (*name).to_owned()).collect();
            findings.push(
                Finding::new(catalog::VIRTUAL_POINTS, About::Markers(names))
                    .with("markers", Fact::names(members))
                    .with("scatter", Fact::meters(scatter)),
            );
        }
    }
    findings
}
