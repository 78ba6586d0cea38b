//! Bodies whose shape is another one in another recording.

use std::collections::BTreeMap;

use calib_finding::{Fact, Finding, catalog};
use calib_recording::Poses;

use super::Expectations;
use super::rigidity::{Body, Pair};
use crate::statistics::median;

/// By so much the scale of a tracker changes between two recordings at most.
const SCALE: f64 = 0.006;

/// A body whose distances are all longer or shorter by more of them is in another unit, or another body.
const UNIT: f64 = 0.2;

/// Distances of a body between markers that are steady in two recordings and differ, for each recording against the one with most rows;
/// what one factor explains for all of them is the tracker's scale and no body.
#[must_use]
pub fn other_shapes(recordings: &[(&str, &Poses)], expected: &Expectations) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, markers) in &expected.bodies {
        let seen = recordings.iter().filter(|(_, poses)| {
            let mut columns = markers.iter();
            columns.all(|marker| poses.markers.contains_key(marker))
        });
        let mut bodies: Vec<(&str, usize, Body<'_>)> = seen
            .filter_map(|(recording, poses)| {
                let body = Body::new(name, markers, poses, expected)?;
                Some((*recording, poses.len(), body))
            })
            .collect();
        bodies.sort_by_key(|(_, rows, _)| std::cmp::Reverse(*rows));
        let Some(((reference, _, most), others)) = bodies.split_first() else {
            continue;
        };
        for (recording, _, body) in others {
            let unlike = body.unlike(most);
            let worst = unlike.iter().max_by(|a, b| a.change.total_cmp(&b.change));
            let Some(worst) = worst.filter(|worst| worst.change > worst.least) else {
                continue;
            };
            let changed = unlike.iter().filter(|pair| pair.change > pair.limit);
            let changed: Vec<&Pair> = changed.map(|unlike| unlike.pair).collect();
            let finding = match Body::only_of_one(&changed) {
                Some(marker) => body
                    .finding_of(catalog::BODY_REDEFINED, "marker_between")
                    .with("marker", Fact::name(body.markers[marker])),
                None => body
                    .finding_of(catalog::BODY_REDEFINED, "between")
                    .with("first", Fact::name(body.markers[worst.pair.j]))
                    .with("second", Fact::name(body.markers[worst.pair.i])),
            };
            findings.push(
                finding
                    .with("change", Fact::meters(worst.change))
                    .with("other", Fact::name(*reference))
                    .in_recording(*recording),
            );
        }
    }
    findings
}

/// A steady distance, against that of the same body elsewhere.
struct Unlike<'a> {
    pair: &'a Pair,
    /// m.
    change: f64,
    /// From which on it is another body, m.
    least: f64,
    /// What noise does to it, m.
    limit: f64,
}

impl Body<'_> {
    /// The distances that are steady here and elsewhere; none where the unit is another one.
    fn unlike(&self, other: &Self) -> Vec<Unlike<'_>> {
        let same: BTreeMap<_, _> = other.pairs.iter().map(|p| ((p.i, p.j), p)).collect();
        let both = self.pairs.iter();
        let both: Vec<_> = both
            .filter_map(|p| Some((p, *same.get(&(p.i, p.j))?)))
            .collect();
        let ratios = both.iter().map(|(a, b)| a.distance / b.distance);
        // Another unit is said to be one.
        let Some(ratio) =
            median(ratios.collect()).filter(|ratio| (1.0 - UNIT..1.0 + UNIT).contains(ratio))
        else {
            return Vec::new();
        };
        let ratio = ratio.clamp(1.0 - SCALE, 1.0 + SCALE);
        let least = self.least_step().max(other.least_step());
        let steady = |sigma: f64| sigma < least;
        both.into_iter()
            .filter(|(a, b)| steady(a.sigma) && steady(b.sigma))
            .map(|(a, b)| Unlike {
                pair: a,
                change: (a.distance - ratio * b.distance).abs(),
                least,
                limit: self.limit(a.rows, b.rows),
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Markers in random poses with noise of 0.3 mm, lengths times `scale`.
    fn recording(markers: &[Vector3<f64>], rows: usize, scale: f64, rng: &mut ChaCha8Rng) -> Poses {
        let normal =
            |rng: &mut ChaCha8Rng| Vector3::from_fn(|_, _| -> f64 { StandardNormal.sample(rng) });
        let mut poses = Poses {
            rows: (1..=rows as u64).collect(),
            ..Poses::default()
        };
        for _ in 0..rows {
            let place = Isometry3::from_parts(
                Translation3::from(normal(rng)),
                UnitQuaternion::from_scaled_axis(normal(rng)),
            );
            for (k, p) in markers.iter().enumerate() {
                let seen = (place * Point3::from(*p)) * scale + 3e-4 * normal(rng);
                let track = poses.markers.entry(format!("m{k}")).or_default();
                track.push(Some(seen));
            }
        }
        poses
    }

    #[test]
    fn a_marker_that_moved_between_recordings_is_named_and_nothing_else() {
        let at = [
            Vector3::new(0.0, 0.0, 0.0),
            Vector3::new(0.08, 0.0, 0.0),
            Vector3::new(0.02, 0.06, 0.0),
            Vector3::new(0.03, 0.02, 0.05),
        ];
        for count in [3, 4] {
            for seed in 0..20 {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let mut moved = at[..count].to_vec();
                moved[1] += Vector3::new(3e-3, 0.0, 0.0);
                let long = recording(&at[..count], 60, 1.0, &mut rng);
                let same = recording(&at[..count], 12, 1.0, &mut rng);
                // 0.5 % is 0.4 mm here and the tracker's.
                let scaled = recording(&at[..count], 30, 1.005, &mut rng);
                let other = recording(&moved, 12, 1.0, &mut rng);
                let names = (0..count).map(|k| format!("m{k}")).collect();
                let expected = Expectations {
                    bodies: BTreeMap::from([("hand".to_owned(), names)]),
                    marker_sigma: Some(3e-4),
                    ..Expectations::default()
                };
                let all = [
                    ("long", &long),
                    ("same", &same),
                    ("scaled", &scaled),
                    ("other", &other),
                ];
                let found = other_shapes(&all, &expected);
                let of: Vec<_> = found.iter().map(|f| &f.subject.recordings).collect();
                assert_eq!(of, [&["other".to_owned()]], "{count} {seed}: {found:?}");
                // One of two distances of a triangle can change by less than the limit: the other one names two markers.
                let named = ["marker", "first", "second"].map(|k| found[0].facts.get(k));
                let at = named
                    .iter()
                    .position(|name| *name == Some(&Fact::name("m1")));
                assert!(at.is_some(), "{count} {seed}: {found:?}");
                assert!(count == 3 || at == Some(0), "{count} {seed}: {found:?}");
            }
        }
    }
}
