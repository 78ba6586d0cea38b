//! Does a joint that scatters explain what looks like changes or like missing effects?
//!
//! Scans and tests know one σ for all joints. Where one of them stops off its reading by more than the others, a stretch of rows in which it
//! stopped on one side by chance looks like a step, and its readings, which err with it, seem to come from the side that they err to: like backlash.
//! The errors of that joint, one draw in every row or in every stop, are beside the change or the effect then, G their columns:
//!
//! ```text
//! 2 ln L(τ) = −ν ln(F − Uᵀ (K + τ⁻²)⁻¹ U) − ln|I + τ² K| − Σ ln|V| − ln|H|,   K = Σ G̃ᵀG̃ − Eᵀ C E,   E = Σ Aᵀ G̃       (1)
//! T' = max 2 ln L(with what is suspected) − max 2 ln L(without)                                                (2)
//! ```
//!
//! each over τ, over the joint that scatters or none, and over the noise of all joints as it was found and a tenth of it. U, F, ν, V, H
//! and C as in the scan; with a joint that scatters 2 ln L is lowered by 10, as so many are tried. What remains of T is what the suspect explains beside
//! the best of them. Where a change alone, or all missing effects together, explain clearly more than any joint's scatter alone, nothing is taken from
//! them.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::columns::Candidates;
use super::contest::{Suspect, add_priors, side_by_side};
use super::{Change, ChangeScan};
use crate::analysis::looked_at::looked_at;
use crate::analysis::solution::Solution;
use crate::graph::axis::Axis;
use crate::graph::edge::EdgeKind;
use crate::graph::ids::EdgeId;
use crate::solve::equations::{NormalEquations, Workspace};
use crate::solve::normal::add_prior;
use crate::solve::whitened::{Whitened, root_of};

mod compared;
mod draws;

use compared::{Compared, Fits};
use draws::Draws;

/// Samples that are looked at.
const SAMPLES: usize = 240;
/// Changes, or missing effects, that are looked at, most significant first.
const SUSPECTS: usize = 8;
/// Fewer stops are no scatter: one draw more is a step.
const STOPS: usize = 6;
/// In fewer rows one draw for each is as good as any smooth effect of the reading: of ten poses, an eccentric gear was called scatter in 2 of 5.
const ROWS: usize = 20;
/// Scatters that are tried, rad.
const TRIED: [f64; 7] = [1.5e-4, 3e-4, 6e-4, 1.2e-3, 2.5e-3, 5e-3, 1e-2];
/// The same of joints that slide, m per rad.
const SLIDING: f64 = 0.1;
/// A joint rests while its reading stays within this, rad.
const AT_REST: f64 = 2e-3;
/// What 2 ln L must be larger by for a joint to scatter: some eighty combinations of joint, size and draws are tried.
const SHOWN: f64 = 10.0;
/// So many draws must be seen to be larger than half of their σ, as two of three are: one or two of them are a step.
const DRAWS: usize = 4;
/// The noise of all joints beside one that scatters, as a share of the one that was found with it.
const OTHERS: f64 = 0.1;

/// A joint that stops off its readings by more than the others.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Scatter {
    /// Which.
    pub joint: EdgeId,
    /// One draw for each stop, and not for each row.
    pub by_stop: bool,
    /// Standard deviation of the draws, rad or m.
    pub sigma: f64,
    /// By how much 2 ln L is larger with it, without what was suspected, beyond what is expected of the best of so many.
    pub score: f64,
}

/// Suspects beside a joint that scatters.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct BesideScatter {
    /// The joint that scatters.
    pub scatter: Scatter,
    /// What is left of each suspect, in their order; of those beyond the eighth nothing is known.
    pub left: Vec<Left>,
}

/// What a suspect explains.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Left {
    /// 2 ln of the likelihood ratio alone.
    pub score: f64,
    /// The part of it that is left beside the scatter, 0 to 1.
    pub part: f64,
}

impl Left {
    /// Whether chance would leave as much to an effect that is absent with less than this probability.
    #[must_use]
    pub fn is_significant(&self, probability: f64) -> bool {
        // χ² of one degree of freedom, as T is for many rows.
        let threshold = ChiSquared::new(1.0).map(|d| d.inverse_cdf(1.0 - probability));
        threshold.is_ok_and(|threshold| self.score * self.part > threshold)
    }
}

/// One sample in whitened form.
struct Sample {
    rows: Arc<Whitened>,
    /// Columns G̃ of the joints, in the order of [`Level::joints`], and ÃᵀG̃.
    joints: DMatrix<f64>,
    a_joints: DMatrix<f64>,
    /// Columns of the suspects.
    suspects: DMatrix<f64>,
}

/// Sums that do not depend on the joint that scatters, at one level of the noise of all joints.
struct Level {
    /// Numbers of the samples.
    numbers: Vec<usize>,
    samples: Vec<Sample>,
    /// Whitened residuals at the minimum.
    residuals: Vec<DVector<f64>>,
    joints: Vec<EdgeId>,
    /// Columns of each suspect.
    ranges: Vec<Range<usize>>,
    /// Rᵀ of C = R Rᵀ, and Rᵀ E of the suspects.
    root: DMatrix<f64>,
    along: DMatrix<f64>,
    /// U and I of all suspects.
    u: DVector<f64>,
    information: DMatrix<f64>,
    cost: f64,
    freedom: f64,
    log_det: f64,
}

impl Solution {
    /// Takes from the significant changes of a scan what a joint that scatters explains.
    pub(super) fn beside_scatter(&self, mut scan: ChangeScan, borders: &[usize]) -> ChangeScan {
        let least = scan.threshold;
        let significant = scan.changes.iter().filter(|c| c.excess > least);
        let list: Vec<Change> = significant.take(SUSPECTS).cloned().collect();
        let suspects: Vec<Suspect<'_>> = list.iter().map(Suspect::Change).collect();
        let Some(found) = self.compared(&suspects, borders) else {
            return scan;
        };
        let alone_by = found
            .alone
            .with
            .iter()
            .map(|with| found.alone.without - with);
        if !found.explains(alone_by.fold(0.0, f64::max)) {
            return scan;
        }
        for (k, change) in scan.changes.iter_mut().take(list.len()).enumerate() {
            let quantile = change.score - change.excess;
            change.score *= found.left(k).part;
            change.excess = change.score - quantile;
        }
        let order = |a: &Change, b: &Change| {
            let by_excess = b.excess.total_cmp(&a.excess);
            by_excess.then(a.moved.cmp(&b.moved))
        };
        scan.changes.sort_by(order);
        scan.scatter = found.best;
        scan
    }

    /// What suspects explain beside a joint that scatters; `None` where no joint does, where all of them together explain clearly more than
    /// that or are no trace of it, or of fewer than 20 samples. `borders`: the first sample of every recording but the first.
    #[must_use]
    pub fn suspects_beside_scatter(
        &self,
        suspects: &[Suspect<'_>],
        borders: &[usize],
    ) -> Option<BesideScatter> {
        if self.used_samples().len() < ROWS {
            return None;
        }
        let suspects = &suspects[..suspects.len().min(SUSPECTS)];
        let found = self.compared(suspects, borders)?;
        let all = found.alone.without - found.alone.all;
        if !found.explains(all) || found.leaves_suspects() {
            return None;
        }
        Some(BesideScatter {
            scatter: found.best?,
            left: (0..suspects.len()).map(|k| found.left(k)).collect(),
        })
    }

    /// Sets suspects beside the scatter of each joint. `None` where there is nothing to compare.
    fn compared(&self, suspects: &[Suspect<'_>], borders: &[usize]) -> Option<Compared> {
        if suspects.is_empty() {
            return None;
        }
        let of = |solution: &Self| Level::new(solution, suspects, borders);
        let lower = self.with_pose_noise_times(OTHERS);
        let levels: Vec<Level> = [Some(self), lower.as_ref()]
            .into_iter()
            .flatten()
            .filter_map(of)
            .collect();
        let alone = levels
            .iter()
            .map(Level::without_scatter)
            .reduce(Fits::least)?;
        let mut cases: Vec<(usize, usize, Vec<usize>, bool)> = Vec::new();
        for (l, level) in levels.iter().enumerate() {
            for (j, joint) in level.joints.iter().enumerate() {
                let rows: Vec<usize> = (0..level.samples.len()).collect();
                let stops = self.stops(*joint, &level.numbers, borders);
                if (STOPS..rows.len()).contains(&count(&stops)) {
                    cases.push((l, j, stops, true));
                }
                cases.push((l, j, rows, false));
            }
        }
        let tried = cases
            .par_iter()
            .flat_map_iter(|(l, j, groups, by_stop)| {
                let level = &levels[*l];
                let joint = level.joints[*j];
                let unit = self.unit_of(joint);
                let fits = level.scattering(*j, groups, unit);
                fits.into_iter().map(move |(sigma, fits)| {
                    let scatter = Scatter {
                        joint,
                        by_stop: *by_stop,
                        sigma,
                        score: alone.without - fits.without - SHOWN,
                    };
                    (scatter, fits)
                })
            })
            .collect::<Vec<_>>();
        let better = |a: &Option<Scatter>, b: &Scatter| a.is_none_or(|a| b.score > a.score);
        let (mut best, mut least) = (None, alone.clone());
        for (scatter, fits) in tried {
            if scatter.score > 0.0 && better(&best, &scatter) {
                best = Some(scatter);
            }
            least.without = least.without.min(fits.without + SHOWN);
            least.all = least.all.min(fits.all + SHOWN);
            for (least, own) in least.with.iter_mut().zip(&fits.with) {
                *least = least.min(own + SHOWN);
            }
        }
        Some(Compared { alone, least, best })
    }

    /// 1 of joints that turn.
    fn unit_of(&self, joint: EdgeId) -> f64 {
        match &self.model.problem.edges[joint.index()].kind {
            EdgeKind::Joint(joint) if matches!(joint.axis, Axis::Prismatic(_)) => SLIDING,
            _ => 1.0,
        }
    }

    /// The stop that each sample belongs to: a new one where the reading changes or a recording begins.
    fn stops(&self, joint: EdgeId, samples: &[usize], borders: &[usize]) -> Vec<usize> {
        let EdgeKind::Joint(own) = &self.model.problem.edges[joint.index()].kind else {
            return Vec::new();
        };
        let tolerance = AT_REST * self.unit_of(joint);
        let recording = |s: usize| borders.partition_point(|b| *b <= s);
        let (mut stop, mut first) = (0, None);
        let mut of = |&s: &usize| {
            let here = (recording(s), own.q[s]);
            let same = first
                .is_some_and(|(r, q): (usize, f64)| r == here.0 && (q - here.1).abs() <= tolerance);
            if !same {
                stop += usize::from(first.is_some());
                first = Some(here);
            }
            stop
        };
        samples.iter().map(&mut of).collect()
    }
}

/// Groups in a list that numbers them from 0 on.
fn count(groups: &[usize]) -> usize {
    groups.last().map_or(0, |last| last + 1)
}

impl Level {
    fn new(solution: &Solution, suspects: &[Suspect<'_>], borders: &[usize]) -> Option<Self> {
        let model = &solution.model;
        let candidates = Candidates::new(solution);
        let used = solution.used_samples();
        let tested = match suspects.iter().any(|s| matches!(s, Suspect::Tested(_))) {
            true => solution.candidates(),
            false => Vec::new(),
        };
        let (effects, columns) = solution.columns_of(suspects, &candidates, &tested, borders)?;
        let ranges = side_by_side(&columns);
        let width = ranges.last().map_or(0, |r| r.end);
        let (joints, places) = candidates.joint_columns();
        let n = model.free();
        let (mut h, mut g) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let (mut e, mut own) = (DMatrix::zeros(n, width), DMatrix::zeros(width, width));
        let mut out = Self {
            numbers: Vec::new(),
            samples: Vec::new(),
            residuals: Vec::new(),
            joints,
            ranges,
            root: DMatrix::zeros(0, 0),
            along: DMatrix::zeros(0, 0),
            u: DVector::zeros(width),
            information: DMatrix::zeros(0, 0),
            cost: 0.0,
            freedom: 0.0,
            log_det: 0.0,
        };
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &solution.values);
        for sample in looked_at(&used, borders, SAMPLES).samples {
            let Some(rows) = solution.rows_of(sample, &mut work) else {
                continue;
            };
            let all = candidates.whitened(solution, sample, &rows, &work);
            let own_rows =
                solution.effect_rows(&effects, sample, &rows.blocks, rows.w.len(), &work);
            let tested = &rows.l_inverse * own_rows;
            let at = (sample, &*rows, &tested);
            let b = solution.columns_at(&candidates, &columns, &out.ranges, at, &work);
            rows.a.add_gram(1.0, &mut h);
            rows.a.add_transposed_vector(&rows.w, &mut g);
            rows.a.add_transposed_times(1.0, &b, &mut e);
            own.gemm_tr(1.0, &b, &b, 1.0);
            out.cost += rows.w.norm_squared();
            out.freedom += rows.w.len() as f64;
            out.log_det += rows.log_det;
            out.numbers.push(sample);
            out.residuals.push(rows.w.clone());
            let joints = all.select_columns(&places);
            out.samples.push(Sample {
                a_joints: rows.a.transposed_times(&joints),
                rows,
                joints,
                suspects: b,
            });
        }
        let mut system = NormalEquations::of(&h, &g);
        add_prior(model, &solution.values, &mut system);
        let system = solution.held(system);
        let root = root_of(&system)?;
        // ln|H| = −ln|C|
        out.log_det -= root.diagonal().iter().map(|x| 2.0 * x.ln()).sum::<f64>();
        out.root = root.transpose();
        let gradient = DVector::from_column_slice(&system.g);
        let step = -(root * (&out.root * &gradient));
        out.cost += system.prior + gradient.dot(&step);
        for (w, sample) in out.residuals.iter_mut().zip(&out.samples) {
            *w += sample.rows.a.times_vector(&step);
            out.u.gemv_tr(1.0, &sample.suspects, w, 1.0);
        }
        out.along = &out.root * &e;
        out.information = own - out.along.transpose() * &out.along;
        add_priors(&mut out.information, &candidates, &columns, &out.ranges)?;
        let parameters = model.columns.iter().map(|p| &model.problem.parameters[*p]);
        let priors = parameters.filter(|p| p.prior_sigma.is_some()).count();
        out.freedom = (out.freedom + priors as f64 - n as f64).max(1.0);
        (out.cost.is_finite() && out.cost > 0.0).then_some(out)
    }

    /// −2 ln L of equation (1), where `gain` of the cost is explained.
    fn surprise(&self, gain: f64, log_det: f64) -> f64 {
        /// Exact data have no noise to compare with.
        const LEFT: f64 = 1e-12;
        let left = (self.cost - gain).max(self.cost * LEFT);
        self.freedom * left.ln() + self.log_det + log_det
    }

    /// No joint scatters.
    fn without_scatter(&self) -> Fits {
        self.fits(0.0, 0.0, &self.u, &self.information)
    }

    /// Given what the scatter explains, and U and I of the suspects beside it.
    fn fits(&self, gain: f64, log_det: f64, u: &DVector<f64>, information: &DMatrix<f64>) -> Fits {
        let of = |range: Range<usize>| {
            let (first, width) = (range.start, range.len());
            let own = information
                .view((first, first), (width, width))
                .into_owned();
            let u = u.rows(first, width).into_owned();
            let more = Cholesky::new(own).map_or(0.0, |factor| u.dot(&factor.solve(&u)));
            self.surprise(gain + more, log_det)
        };
        let with: Vec<f64> = self.ranges.iter().cloned().map(of).collect();
        Fits {
            without: self.surprise(gain, log_det),
            // Where suspects imitate each other their information has no factor; together they explain no less than one.
            all: with.iter().copied().fold(of(0..u.len()), f64::min),
            with,
        }
    }

    /// One joint scatters, with one draw for every group of samples: by σ, in `unit` rad.
    fn scattering(&self, joint: usize, groups: &[usize], unit: f64) -> Vec<(f64, Fits)> {
        let (n, m) = (self.root.nrows(), count(groups));
        let width = self.u.len();
        let mut e = DMatrix::zeros(n, m);
        let mut diagonal = DVector::<f64>::zeros(m);
        // U of the draws, and their products with the suspects.
        let mut seen = DMatrix::<f64>::zeros(m, 1 + width);
        for ((sample, w), &group) in self.samples.iter().zip(&self.residuals).zip(groups) {
            let own = sample.joints.column(joint);
            let mut to = e.column_mut(group);
            to += sample.a_joints.column(joint);
            seen[(group, 0)] += own.dot(w);
            diagonal[group] += own.norm_squared();
            let beside = sample.suspects.tr_mul(&own);
            for c in 0..width {
                seen[(group, 1 + c)] += beside[c];
            }
        }
        let f = &self.root * &e;
        let mut cross = seen.columns_range_mut(1..);
        cross -= f.tr_mul(&self.along);
        let (u, cross) = (seen.column(0), seen.columns_range(1..));
        let draws = Draws::new(diagonal, f);
        // σ² of one unit of whitened noise.
        let s2 = self.cost / self.freedom;
        let of = |&sigma: &f64| {
            let tau2 = (sigma * unit).powi(2) / s2;
            let factored = draws.with(tau2)?;
            let all = factored.solve(&seen);
            let (solved, crossed) = (all.column(0), all.columns_range(1..));
            let gain = u.dot(&solved);
            let beside = &self.u - cross.tr_mul(&solved);
            let information = &self.information - cross.tr_mul(&crossed);
            let log_det = factored.log_det + m as f64 * tau2.ln();
            let fits = self.fits(gain, log_det, &beside, &information);
            let s2 = ((self.cost - gain) / self.freedom).max(0.0);
            let sigma = (tau2 * s2).sqrt();
            let draws = solved.iter().filter(|draw| draw.abs() > 0.5 * sigma);
            (draws.count() >= DRAWS).then_some((sigma, fits))
        };
        TRIED.iter().filter_map(of).collect()
    }
}
