//! Markers whose labels were exchanged by the tracker, found by the distances between them.
//!
//! The distance of two markers of one body does not depend on where the body is. Its median over the
//! samples is the reference; a sample whose distances disagree is compared under every permutation of
//! its labels. A layout with equal distances cannot be resolved and is left alone.

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::graph::ids::{MeasurementId, PointId};
use crate::graph::measurement::{Markers, MeasurementKind};
use crate::graph::problem::Problem;

/// Bodies with more markers than this are only searched by exchanging two (7! is 5040).
const ALL_PERMUTATIONS: usize = 7;
/// The right labels must fit this many times better than the next best.
const UNAMBIGUOUS: f64 = 3.0;

/// A sample whose labels were put right.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Relabeled {
    /// Sample.
    pub sample: usize,
    /// Measurement.
    pub measurement: MeasurementId,
    /// (index of the observation within the measurement, its new point).
    pub changes: Vec<(usize, PointId)>,
}

/// Puts exchanged marker labels right, in place. `tolerance`: largest deviation of a distance that
/// noise explains (m), for instance 6 σ.
pub fn relabel(problem: &mut Problem, tolerance: f64) -> Vec<Relabeled> {
    let mut out = Vec::new();
    let samples = problem.samples;
    for (m, measurement) in problem.measurements_mut().iter_mut().enumerate() {
        if let MeasurementKind::Markers(Markers { observations, .. }) = &mut measurement.kind {
            let mut by_sample: Vec<Vec<usize>> = vec![Vec::new(); samples];
            for (i, o) in observations.iter().enumerate() {
                if o.sample < samples {
                    by_sample[o.sample].push(i);
                }
            }
            let seen: Vec<Vec<(usize, PointId, Point3<f64>)>> = by_sample
                .iter()
                .map(|items| {
                    items
                        .iter()
                        .map(|&i| (i, observations[i].point, observations[i].position))
                        .collect()
                })
                .collect();
            let Some(reference) = Reference::of(&seen) else {
                continue;
            };
            for (sample, markers) in seen.iter().enumerate() {
                if let Some(order) = reference.better_labels(markers, tolerance) {
                    let changes: Vec<(usize, PointId)> = markers
                        .iter()
                        .zip(&order)
                        .filter(|((_, old, _), new)| old != *new)
                        .map(|((i, _, _), new)| (*i, *new))
                        .collect();
                    for &(i, new) in &changes {
                        observations[i].point = new;
                    }
                    out.push(Relabeled {
                        sample,
                        measurement: MeasurementId::of(m),
                        changes,
                    });
                }
            }
        }
    }
    out
}

/// Median distances between the points of a body.
struct Reference {
    points: Vec<PointId>,
    distance: Vec<Vec<Option<f64>>>,
}

impl Reference {
    fn of(seen: &[Vec<(usize, PointId, Point3<f64>)>]) -> Option<Self> {
        let mut points: Vec<PointId> = seen.iter().flatten().map(|m| m.1).collect();
        points.sort_unstable();
        points.dedup();
        if points.len() < 3 {
            return None;
        }
        let n = points.len();
        let index = |p: PointId| points.binary_search(&p).unwrap_or(0);
        let mut all = vec![vec![Vec::new(); n]; n];
        for markers in seen {
            for (i, a) in markers.iter().enumerate() {
                for b in &markers[i + 1..] {
                    let (p, q) = (index(a.1).min(index(b.1)), index(a.1).max(index(b.1)));
                    all[p][q].push((a.2 - b.2).norm());
                }
            }
        }
        let distance = all
            .iter_mut()
            .map(|row| {
                row.iter_mut()
                    .map(|d| {
                        if d.is_empty() {
                            return None;
                        }
                        let middle = d.len() / 2;
                        Some(*d.select_nth_unstable_by(middle, f64::total_cmp).1)
                    })
                    .collect()
            })
            .collect();
        Some(Self { points, distance })
    }

    fn between(&self, a: usize, b: usize) -> Option<f64> {
        self.distance[a.min(b)][a.max(b)]
    }

    /// Largest deviation from the reference when marker i carries label `labels[i]`.
    fn misfit(&self, positions: &[Point3<f64>], labels: &[usize]) -> f64 {
        let mut worst: f64 = 0.0;
        for i in 0..positions.len() {
            for j in i + 1..positions.len() {
                if let Some(d) = self.between(labels[i], labels[j]) {
                    worst = worst.max(((positions[i] - positions[j]).norm() - d).abs());
                }
            }
        }
        worst
    }

    /// New labels when the given ones do not fit and exactly one arrangement does.
    fn better_labels(
        &self,
        markers: &[(usize, PointId, Point3<f64>)],
        tolerance: f64,
    ) -> Option<Vec<PointId>> {
        let n = markers.len();
        if n < 3 {
            return None;
        }
        let positions: Vec<Point3<f64>> = markers.iter().map(|m| m.2).collect();
        let given: Vec<usize> = markers
            .iter()
            .map(|m| self.points.binary_search(&m.1).unwrap_or(0))
            .collect();
        if self.misfit(&positions, &given) <= tolerance {
            return None;
        }
        let mut best: Option<(f64, Vec<usize>)> = None;
        let mut second = f64::INFINITY;
        let mut consider = |labels: &[usize]| {
            let m = self.misfit(&positions, labels);
            match &best {
                Some((b, _)) if m >= *b => second = second.min(m),
                _ => {
                    if let Some((b, _)) = &best {
                        second = second.min(*b);
                    }
                    best = Some((m, labels.to_vec()));
                }
            }
        };
        if n <= ALL_PERMUTATIONS {
            let mut labels = given.clone();
            permute(&mut labels, 0, &mut consider);
        } else {
            for i in 0..n {
                for j in i + 1..n {
                    let mut labels = given.clone();
                    labels.swap(i, j);
                    consider(&labels);
                }
            }
        }
        let (misfit, labels) = best?;
        (misfit <= tolerance && second > UNAMBIGUOUS * misfit.max(tolerance / UNAMBIGUOUS))
            .then(|| labels.iter().map(|&l| self.points[l]).collect())
    }
}

/// Every arrangement of `items[k..]`.
fn permute(items: &mut [usize], k: usize, see: &mut impl FnMut(&[usize])) {
    if k == items.len() {
        see(items);
        return;
    }
    for i in k..items.len() {
        items.swap(k, i);
        permute(items, k + 1, see);
        items.swap(k, i);
    }
}
