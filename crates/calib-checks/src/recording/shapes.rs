//! Bodies whose shape is another one in another recording.

use std::collections::BTreeMap;

use calib_finding::{Fact, Finding};
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
            let scale = body.scale(most);
            let unlike = scale.map_or(Vec::new(), |scale| body.unlike(most, scale));
            let worst = unlike.iter().max_by(|a, b| a.change.total_cmp(&b.change));
            let Some(worst) = worst.filter(|worst| worst.change > worst.least) else {
                continue;
            };
            // The scale of few distances is bent by the one that changed: first as if the tracker's were the same.
            let (marker, change) = match body.moved(&body.unlike(most, 1.0)) {
                Some((marker, change)) => (Some(marker), change),
                None => (body.moved(&unlike).map(|(marker, _)| marker), worst.change),
            };
            findings.push(
                body.redefined_by(marker, worst.pair, ["marker_between", "between"])
                    .with("change", Fact::meters(change))
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
    /// What is no fault, m.
    limit: f64,
}

impl Body<'_> {
    /// The distances known here and elsewhere.
    fn both<'b>(&'b self, other: &'b Self) -> Vec<(&'b Pair, &'b Pair)> {
        let same: BTreeMap<_, _> = other.pairs.iter().map(|p| ((p.i, p.j), p)).collect();
        let both = |p: &'b Pair| Some((p, *same.get(&(p.i, p.j))?));
        self.pairs.iter().filter_map(both).collect()
    }

    /// The tracker's scale against that of the same body elsewhere; `None` where the unit is another one, which is said elsewhere.
    fn scale(&self, other: &Self) -> Option<f64> {
        let both = self.both(other).into_iter();
        let ratio = median(both.map(|(a, b)| a.distance / b.distance).collect())?;
        let same_unit = (1.0 - UNIT..1.0 + UNIT).contains(&ratio);
        same_unit.then(|| ratio.clamp(1.0 - SCALE, 1.0 + SCALE))
    }

    /// The distances that are steady here and elsewhere, at a scale of the tracker.
    fn unlike<'b>(&'b self, other: &'b Self, scale: f64) -> Vec<Unlike<'b>> {
        let least = self.least_step().max(other.least_step());
        let steady = |sigma: f64| sigma < least;
        self.both(other)
            .into_iter()
            .filter(|(a, b)| steady(a.sigma) && steady(b.sigma))
            .map(|(a, b)| Unlike {
                pair: a,
                change: (a.distance - scale * b.distance).abs(),
                least,
                limit: self.limit(a.rows, b.rows),
            })
            .collect()
    }

    /// The only marker whose distances changed, and by how much at most, m.
    fn moved(&self, unlike: &[Unlike<'_>]) -> Option<(usize, f64)> {
        let changed = unlike.iter().filter(|pair| pair.change > pair.limit);
        let most = changed.clone().map(|pair| pair.change).fold(0.0, f64::max);
        let pairs: Vec<&Pair> = changed.map(|unlike| unlike.pair).collect();
        Body::only_of_one(&pairs).map(|marker| (marker, most))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::collections::BTreeMap;

    use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Markers in random poses with noise of 0.3 mm, lengths times `scale`.
    pub(in crate::recording) fn recording(
        markers: &[Vector3<f64>],
        rows: usize,
        scale: f64,
        rng: &mut ChaCha8Rng,
    ) -> Poses {
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
                let marker = found[0].facts.get("marker");
                assert_eq!(marker, Some(&Fact::name("m1")), "{count} {seed}: {found:?}");
            }
        }
    }
}
