//! Markers whose labels were exchanged by the tracker, found by the distances between them.
//!
//! The distance of two markers of one body does not depend on where the body is. Its median over the
//! samples is the reference; a sample whose distances disagree is compared under every permutation of
//! its labels. A layout with equal distances cannot be resolved and is left alone.

use calib_geometry::pairs::{self, is_compared};
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
    /// Places of two points among `points`, and their distance, m.
    distances: Vec<(usize, usize, f64)>,
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
        // Position of each point in each sample.
        let at: Vec<Vec<Option<Point3<f64>>>> = seen
            .iter()
            .map(|markers| {
                let mut at = vec![None; n];
                for (_, point, position) in markers {
                    at[index(*point)] = Some(*position);
                }
                at
            })
            .collect();
        let mut distances = Vec::new();
        for p in 0..n {
            for q in (p + 1..n).filter(|q| is_compared(p, *q, n)) {
                let all = at.iter().filter_map(|at| Some((at[p]? - at[q]?).norm()));
                let mut all: Vec<f64> = all.collect();
                if all.is_empty() {
                    continue;
                }
                let middle = all.len() / 2;
                let median = *all.select_nth_unstable_by(middle, f64::total_cmp).1;
                distances.push((p, q, median));
            }
        }
        Some(Self { points, distances })
    }

    /// Largest deviation from the reference when marker i carries label `labels[i]`, and the labels between which it is.
    fn worst(&self, positions: &[Point3<f64>], labels: &[usize]) -> (f64, [usize; 2]) {
        let mut at = vec![None; self.points.len()];
        for (label, position) in labels.iter().zip(positions) {
            at[*label] = Some(*position);
        }
        let mut worst = (0.0, [0, 0]);
        for &(p, q, distance) in &self.distances {
            if let (Some(a), Some(b)) = (at[p], at[q]) {
                let off = ((a - b).norm() - distance).abs();
                if off > worst.0 {
                    worst = (off, [p, q]);
                }
            }
        }
        worst
    }

    fn misfit(&self, positions: &[Point3<f64>], labels: &[usize]) -> f64 {
        self.worst(positions, labels).0
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
        let (off, between) = self.worst(&positions, &given);
        if off <= tolerance {
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
        let many = n > pairs::ALL;
        if n <= ALL_PERMUTATIONS {
            let mut labels = given.clone();
            permute(&mut labels, 0, &mut consider);
        } else {
            for i in 0..n {
                // An exchange of two others leaves the worst distance as it is.
                let is_worst = |k: usize| between.contains(&given[k]);
                for j in (i + 1..n).filter(|j| !many || is_worst(i) || is_worst(*j)) {
                    let mut labels = given.clone();
                    labels.swap(i, j);
                    consider(&labels);
                }
            }
        }
        if many {
            second = second.min(off);
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
