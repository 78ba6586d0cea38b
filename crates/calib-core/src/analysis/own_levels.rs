//! A noise level for each body, or for a marker, instead of one for all, by evidence.
//!
//! Two bodies are seldom seen equally well: one is farther from the cameras, smaller, or at their border; so is a marker that is
//! loose, scratched or half hidden. Levels of their own, found by REML, are used where left-out poses are likelier under them, by more than
//! chance and what the choice allows, and where they predict no worse: physics that is missing behind one of the bodies also makes it look
//! noisy.
//!
//! A gain of G nats is the sum over the poses of differences that scatter by about √(2 G): it exceeds twice its standard error from G = 8 on. A step of
//! scoring promises less, to second order, but by a factor of four only where one variance is a hundredth of the other, and there ten poses
//! promise more than 8. A promise below 2 is not followed: it saves the fit where levels are alike.
//!
//! Before a marker is given a level, what its body shows of it is asked, which costs no fit. d_k is its residual minus the mean of the m
//! markers that were seen at the same pose, which holds nothing of the robot but rotations of the body (Grubbs 1948):
//!
//! ```text
//! q_k = (|d_k|²/3 − S/m²) / (1 − 2/m),   S = Σ_j |d_j|²/3 / (1 − 1/m),      E q_k = σ_k²
//! ```

use std::collections::{BTreeMap, BTreeSet};

use calib_geometry::statistics::median;

use crate::analysis::estimate::solve;
use crate::analysis::refit::{Start, refitted};
use crate::analysis::scores::{Scores, mean, paired};
use crate::analysis::settings::Settings;
use crate::analysis::solution::Solution;
use crate::analysis::validate::{VectorError, predictions};
use crate::graph::ids::PointId;
use crate::graph::measurement::MeasurementKind;
use crate::graph::problem::OwnNoise;
use crate::model::cache::State;
use crate::model::layout::{Model, Observation};
use crate::model::path::Derivatives;
use crate::model::values::Values;
use crate::solve::equations::{Objective, Workspace};
use crate::solve::noise::score;

/// Poses that are left out in turn at most, evenly over all.
const POSES: usize = 200;
/// Fewer left-out poses do not tell levels apart.
const FEWEST: usize = 10;
/// The levels must make left-out poses likelier by this many standard errors (paired over the poses).
const SHOWN: f64 = 2.0;
/// Nats that a step of scoring must promise before levels are fitted.
const PROMISED: f64 = 2.0;
/// Below this ratio of rms errors nobody can tell weights apart.
const SAME: f64 = 1.005;
/// Fewer markers do not show which of them is the noisy one.
const MARKERS: usize = 3;
/// Of good markers the gate rejects one in a thousand observations.
const MANY: f64 = 0.05;
/// No marker scatters by less, m: a level to begin with.
const LEAST: f64 = 1e-6;
/// Levels below this part of the largest are not distinguished.
const SMALLEST: f64 = 0.05;
/// A marker is tried where its q differs from that of the others by so many standard errors over the poses: four good markers are tried for
/// nothing in one of a hundred fits.
const ASKED: f64 = 3.0;

impl Solution {
    /// The same observations with a level for each body, where they speak for it; `None` where the common level stays.
    #[must_use]
    pub fn with_levels_by_body(&self, settings: &Settings) -> Option<Self> {
        self.with_levels(&self.model.problem().with_noise_by_body()?, settings)
    }

    /// The same observations with a level of their own for the markers that scatter unlike the others of their body, and which those are;
    /// `None` where the common level stays. Where the gate rejected many of theirs for being unlike the others, the fit starts over.
    #[must_use]
    pub fn with_levels_by_marker(&self, settings: &Settings) -> Option<(Self, Vec<PointId>)> {
        let scatter = self.scatter_of_markers();
        let apart: BTreeMap<PointId, f64> = scatter.iter().flat_map(|poses| apart(poses)).collect();
        let markers: Vec<PointId> = apart.keys().copied().collect();
        let mut own = self.model.problem().with_noise_by_marker(&markers)?;
        let rejected = self.rejected_part(&markers);
        if rejected <= MANY {
            return Some((self.with_levels(&own, settings)?, markers));
        }
        let measurements = std::sync::Arc::clone(&own.problem.measurements);
        for measurement in measurements.iter() {
            if let MeasurementKind::Markers(seen) = &measurement.kind {
                for (marker, level) in &seen.own {
                    own.problem.group_mut(*level).sigma = apart[marker];
                }
            }
        }
        let found = solve(&own.problem, settings).ok()?;
        // Under levels that are right, the gate has no more to reject.
        let usable = found.status.is_converged()
            && found.rejected_part(&markers) < rejected
            && found.predicts_no_worse(self, &markers)?;
        usable.then_some((found, markers))
    }

    /// Measurement and sample of poses most of whose vectors the gate rejected: the body was off there, not one of its markers.
    fn bodies_off(&self) -> BTreeSet<(usize, usize)> {
        let poses = self.model.of_measurement.iter().enumerate();
        let poses = poses.flat_map(|(m, list)| list.iter().map(move |(s, all)| ((m, *s), all)));
        poses
            .filter(|(_, all)| {
                let rejected = self.weights[all.start..all.end]
                    .iter()
                    .filter(|w| **w == 0.0)
                    .count();
                2 * rejected > all.len()
            })
            .map(|(pose, _)| pose)
            .collect()
    }

    /// Part of what was seen of these markers that the gate rejected, where it kept the body.
    fn rejected_part(&self, markers: &[PointId]) -> f64 {
        let off = self.bodies_off();
        let (mut seen, mut rejected) = (0u32, 0u32);
        for (o, weight) in self.model.observations.iter().zip(&self.weights) {
            let kind = &self.model.problem.measurements[o.measurement].kind;
            if let MeasurementKind::Markers(of) = kind
                && markers.contains(&of.observations[o.item].point)
                && !self.model.is_held_out(o.sample)
                && !off.contains(&(o.measurement, o.sample))
            {
                seen += 1;
                rejected += u32::from(*weight == 0.0);
            }
        }
        f64::from(rejected) / f64::from(seen.max(1))
    }

    /// Whether left-out vectors of all markers but these are predicted no worse than by `other`, by more than chance. Of these markers
    /// the other fit kept what agrees with it.
    fn predicts_no_worse(&self, other: &Self, markers: &[PointId]) -> Option<bool> {
        let (own, others) = (
            self.left_out_squares(markers)?,
            other.left_out_squares(markers)?,
        );
        let both = own
            .iter()
            .filter_map(|(key, square)| Some((*square, *others.get(key)?)));
        let (own, others): (Vec<f64>, Vec<f64>) = both.unzip();
        let (worse, error) = paired(&own, &others);
        Some(own.len() >= FEWEST && worse <= error)
    }

    /// Squared error of every left-out vector of all markers but these, by sample, measurement and item.
    fn left_out_squares(
        &self,
        markers: &[PointId],
    ) -> Option<BTreeMap<(usize, usize, usize), f64>> {
        let step = self.model.problem().samples().div_ceil(POSES).max(1);
        let left_out = self.leave_out(|sample| sample.is_multiple_of(step))?;
        let of_these =
            |v: &VectorError| match &self.model.problem.measurements[v.measurement.index()].kind {
                MeasurementKind::Markers(of) => markers.contains(&of.observations[v.item].point),
                _ => false,
            };
        let mut out = BTreeMap::new();
        for s in &left_out.samples {
            for v in s.vectors.iter().filter(|v| !of_these(v)) {
                if let Some(position) = v.position {
                    out.insert(
                        (s.sample, v.measurement.index(), v.item),
                        position * position,
                    );
                }
            }
        }
        Some(out)
    }

    /// Nats that levels of their own promise to be worth, to second order, from where this fit ended.
    fn promised(&self, own: &OwnNoise) -> Option<f64> {
        let model = Model::new(&own.problem).ok()?;
        let objective = Objective {
            model: &model,
            weights: &self.weights,
            theta: &own.levels(&self.theta),
        };
        let step = score(objective, &self.values, &mut Workspace::new(&model))?;
        Some(step.gain)
    }

    fn with_levels(&self, own: &OwnNoise, settings: &Settings) -> Option<Self> {
        if self.promised(own)? < PROMISED {
            return None;
        }
        let start = Start {
            values: self.values.clone(),
            weights: self.weights.clone(),
            theta: own.levels(&self.theta),
            iterations: self.iterations,
        };
        let found = refitted(&own.problem, start, settings).ok()?;
        let step = self.model.problem().samples().div_ceil(POSES).max(1);
        let left_out = |objective: Objective, values: &Values| {
            let wanted = |sample: usize| sample.is_multiple_of(step);
            predictions(objective, values, objective.weights, true, &wanted)
        };
        let (own, common) = rayon::join(
            || left_out(found.objective(), found.values()),
            || left_out(self.objective(), &self.values),
        );
        let (own, common) = (own?, common?);
        let scores = Scores::of(&[&own, &common]);
        let (less, error) = paired(&scores.surprises[1], &scores.surprises[0]);
        let ratio = (mean(&scores.squares[0]) / mean(&scores.squares[1])).sqrt();
        let enough = scores.squares[0].len() >= FEWEST;
        let better = enough && less > SHOWN * error && ratio <= SAME;
        better.then(|| found.finished().ok()).flatten()
    }

    /// q of every marker at every pose, per measurement of three markers and more whose noise is in question.
    fn scatter_of_markers(&self) -> Vec<Vec<BTreeMap<PointId, f64>>> {
        let problem = self.model.problem();
        let of_interest = |m: usize| match &problem.measurements[m].kind {
            MeasurementKind::Markers(markers) => {
                let points: BTreeSet<_> = markers.observations.iter().map(|o| o.point).collect();
                points.len() >= MARKERS && problem.groups[markers.noise.index()].estimate
            }
            _ => false,
        };
        let asked: Vec<bool> = (0..problem.measurements.len()).map(of_interest).collect();
        if !asked.contains(&true) {
            return Vec::new();
        }
        let mut at: Vec<BTreeMap<usize, Vec<Seen>>> = vec![BTreeMap::new(); asked.len()];
        // What the gate rejected belongs to a marker's scatter: one that scatters much is rejected often. A body that is off as a whole
        // is turned, and shows that.
        let off = self.bodies_off();
        let fitted = |o: &Observation| f64::from(u8::from(!self.model.is_held_out(o.sample)));
        let everything: Vec<f64> = self.model.observations.iter().map(fitted).collect();
        let mut work = Workspace::new(&self.model);
        work.cache.update(problem, &self.values);
        let state = State::new(problem, &work.cache, &self.values);
        for sample in 0..problem.samples {
            let rows = &mut work.rows;
            rows.fill(&self.model, state, &everything, sample, Derivatives::None);
            for &(o, first, _) in rows
                .blocks
                .iter()
                .filter(|b| asked[self.model.observations[b.0].measurement])
            {
                let o = self.model.observations[o];
                if let MeasurementKind::Markers(markers) = &problem.measurements[o.measurement].kind
                    && !off.contains(&(o.measurement, sample))
                {
                    let error = problem.measurements[o.measurement]
                        .kind
                        .stated(o.item, &rows.r[first..]);
                    let seen = (markers.observations[o.item].point, error.into());
                    at[o.measurement].entry(sample).or_default().push(seen);
                }
            }
        }
        at.into_iter()
            .filter(|poses| !poses.is_empty())
            .map(|poses| {
                poses
                    .into_values()
                    .filter_map(|seen| grubbs(&seen))
                    .collect()
            })
            .collect()
    }
}

/// A marker and its residual at a pose, m.
type Seen = (PointId, [f64; 3]);

/// q of the markers that were seen at one pose; `None` of fewer than three.
fn grubbs(seen: &[Seen]) -> Option<BTreeMap<PointId, f64>> {
    if seen.len() < MARKERS {
        return None;
    }
    let m = seen.len() as f64;
    let middle = |axis: usize| seen.iter().map(|(_, e)| e[axis]).sum::<f64>() / m;
    let middle = [0, 1, 2].map(middle);
    let squares = seen.iter().map(|(point, e)| {
        let d2: f64 = (0..3).map(|axis| (e[axis] - middle[axis]).powi(2)).sum();
        (*point, d2 / 3.0)
    });
    let squares: Vec<(PointId, f64)> = squares.collect();
    let sum = squares.iter().map(|(_, d2)| d2).sum::<f64>() / (1.0 - 1.0 / m);
    let q = |(point, d2): (PointId, f64)| (point, (d2 - sum / (m * m)) / (1.0 - 2.0 / m));
    Some(squares.into_iter().map(q).collect())
}

/// Markers of a body whose scatter is unlike that of the others, with the level that their q shows, m.
fn apart(poses: &[BTreeMap<PointId, f64>]) -> Vec<(PointId, f64)> {
    let mut own = BTreeSet::new();
    while let Some(next) = most_unlike(poses, &own) {
        own.insert(next);
    }
    let level = |marker| (marker, level(poses, marker));
    own.into_iter().map(level).collect()
}

/// σ of a marker that its q shows, m.
fn level(poses: &[BTreeMap<PointId, f64>], marker: PointId) -> f64 {
    let its = poses.iter().filter_map(|q| q.get(&marker).copied());
    mean(&its.collect::<Vec<f64>>()).max(LEAST * LEAST).sqrt()
}

/// The marker whose level is farthest from the median of the others, where its q differs from theirs by more than chance; those in `own` are
/// not asked anymore.
fn most_unlike(poses: &[BTreeMap<PointId, f64>], own: &BTreeSet<PointId>) -> Option<PointId> {
    let all: BTreeSet<PointId> = poses.iter().flat_map(|q| q.keys().copied()).collect();
    let left: Vec<PointId> = all.difference(own).copied().collect();
    // Of two nobody can tell which is the unlike one.
    if left.len() < MARKERS {
        return None;
    }
    let mut levels: Vec<f64> = left.iter().map(|marker| level(poses, *marker)).collect();
    // Beside one that scatters much, q of a good marker is uncertain and may be below 0.
    let most = levels.iter().copied().fold(0.0, f64::max);
    levels.iter_mut().for_each(|l| *l = l.max(SMALLEST * most));
    let unlike = |k: usize| {
        let others = (0..left.len()).filter(|i| *i != k).map(|i| levels[i].ln());
        (levels[k].ln() - median(others.collect()).unwrap_or(0.0)).abs()
    };
    let most = (0..left.len()).max_by(|a, b| unlike(*a).total_cmp(&unlike(*b)))?;
    let marker = left[most];
    let at = |q: &BTreeMap<PointId, f64>| {
        let others = left.iter().filter(|other| **other != marker);
        let others: Vec<f64> = others.filter_map(|other| q.get(other).copied()).collect();
        (!others.is_empty()).then_some((*q.get(&marker)?, mean(&others)))
    };
    let (its, others): (Vec<f64>, Vec<f64>) = poses.iter().filter_map(at).unzip();
    let (more, error) = paired(&its, &others);
    (its.len() >= FEWEST && more.abs() > ASKED * error).then_some(marker)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grubbs_finds_the_variances_of_markers() {
        // Over all signs of errors of fixed size the mean of q is the variance.
        let sizes = [1.0, 2.0, 0.5, 3.0];
        let mut sums = [0.0; 4];
        for signs in 0..16 {
            let error = |k: usize| {
                if signs >> k & 1 == 0 {
                    sizes[k]
                } else {
                    -sizes[k]
                }
            };
            let seen: Vec<Seen> = (0..4)
                .map(|k| (PointId::of(k), [7.0 + error(k), error(k) - 4.0, error(k)]))
                .collect();
            let q = grubbs(&seen).expect("four");
            (0..4).for_each(|k| sums[k] += q[&PointId::of(k)] / 16.0);
        }
        for (sum, size) in sums.iter().zip(sizes) {
            assert!((sum - size * size).abs() < 1e-12, "{sum} for {size}");
        }
    }
}
