//! How far a choice of postures is from the best possible one.
//!
//! Weights between 0 and 1 in place of taken or not taken make the choice a concave problem whose best value no choice exceeds:
//!
//! ```text
//! M(w) = M₀ + Σ w_i Y_iᵀ Y_i,   0 ≤ w_i ≤ 1,   Σ w_i = n                                                               (1)
//! tr(H M(w')) ≤ tr(H M₀) + sum of the n largest tr(Y_i H Y_iᵀ)        for every w' of (1) and H at any M                (2)
//! efficiency ≥ tr(H M) / (right side of (2))                                                                            (3)
//! ```
//!
//! (3) because the criteria are concave and homogeneous in M: per parameter for the determinant and a subset, where `tr(H M)` is their number
//! (det^(1/p) by the inequality of the means), and in variance for the trace (Cauchy–Schwarz); in σ the square root of it. (3) holds at every
//! M and is tight at the best weights M* only, so that it is taken there, and the postures are compared with it:
//!
//! ```text
//! efficiency of M ≥ (3) at M* × (det K*/det K)^(1/p),   tr(L K*)/tr(L K)                                               (4)
//! ```
//!
//! The weights grow with their gains and are cut at 1: w_i ← min(1, c w_i g_i^a) with Σ w_i = n, a = 1 for a determinant and ½ for a trace (Yu
//! 2010). Where that stands still, g_i is the same for all weights between 0 and 1 and not less for those at 1: the conditions of the best.

use nalgebra::DMatrix;

use crate::design::{Criterion, Question, inverse};

/// Rounds in which the mixture takes new postures, how many each, and steps of the weights in each round.
const ADMISSIONS: usize = 4;
const ADMITTED: usize = 40;
const STEPS: usize = 50;

impl Question<'_> {
    /// The share of the best possible choice of as many different postures that some postures reach at least: equation (3) at the best
    /// weights, and (4) from there to the postures. Per parameter; of a trace and of the least determined combination in σ. `None` where M is singular.
    #[must_use]
    pub fn certificate(&self, chosen: &[usize]) -> Option<f64> {
        if let Criterion::Smallest(s) = self.criterion {
            return self.certificate_smallest(s, chosen);
        }
        let own = self.information(chosen);
        let mixture = self.mixture(chosen)?;
        let mut best = 0.0_f64;
        for (m, gains) in [(&own, self.gains(&own)?), (&mixture.m, mixture.gains)] {
            let k = inverse(m)?;
            let h = self.criterion.derivative(&k)?;
            let at_mixture = (h.dot(m) / self.bound(&h, gains, chosen.len())).min(1.0);
            best = best.max(at_mixture * self.criterion.ratio(&inverse(&own)?, &k)?);
        }
        Some(match self.criterion {
            Criterion::Trace(_) => best.min(1.0).sqrt(),
            _ => best.min(1.0),
        })
    }

    /// Equation (2).
    fn bound(&self, h: &DMatrix<f64>, mut gains: Vec<f64>, n: usize) -> f64 {
        gains.sort_by(|a, b| b.total_cmp(a));
        h.dot(self.before) + gains.iter().take(n).sum::<f64>()
    }

    /// Weights of equation (1) that are nearly the best.
    pub(crate) fn mixture(&self, chosen: &[usize]) -> Option<Mixture> {
        let n = chosen.len() as f64;
        let power = match self.criterion {
            Criterion::Trace(_) => 0.5,
            _ => 1.0,
        };
        let mut m = self.information(chosen);
        let mut gains = self.gains(&m)?;
        let mut weights: Vec<(usize, f64)> = chosen.iter().map(|i| (*i, 1.0)).collect();
        for _ in 0..ADMISSIONS {
            admit(&mut weights, &gains, n);
            let stack = Stack::new(self.rows, &weights);
            m = stack.information(self.before, &weights);
            for _ in 0..STEPS {
                let h = self.criterion.derivative(&inverse(&m)?)?;
                let gains = stack.gains(&h, weights.len());
                let grown = weights.iter().zip(gains);
                let grown: Vec<f64> = grown.map(|(w, g)| w.1 * g.max(0.0).powf(power)).collect();
                for (weight, cut) in weights.iter_mut().zip(cut_at_one(&grown, n)) {
                    weight.1 = cut;
                }
                m = stack.information(self.before, &weights);
            }
            gains = self.gains(&m)?;
        }
        Some(Mixture { weights, m, gains })
    }
}

/// Weights of equation (1).
pub(crate) struct Mixture {
    /// Postures that have a weight, and their weights.
    pub weights: Vec<(usize, f64)>,
    /// M.
    pub m: DMatrix<f64>,
    /// tr(Y_i H Y_iᵀ) of all postures there.
    pub gains: Vec<f64>,
}

/// The rows of some postures side by side, as columns, so that a step is two products of large matrices.
struct Stack {
    columns: DMatrix<f64>,
    rows: DMatrix<f64>,
    /// Place of the posture of each column.
    place: Vec<usize>,
}

impl Stack {
    fn new(rows: &[DMatrix<f64>], weights: &[(usize, f64)]) -> Self {
        let of = |(place, (i, _)): (usize, &(usize, f64))| vec![place; rows[*i].nrows()];
        let place: Vec<usize> = weights.iter().enumerate().flat_map(of).collect();
        let parameters = weights.first().map_or(0, |(i, _)| rows[*i].ncols());
        let mut stacked = DMatrix::zeros(place.len(), parameters);
        let mut at = 0;
        for (i, _) in weights {
            stacked.rows_mut(at, rows[*i].nrows()).copy_from(&rows[*i]);
            at += rows[*i].nrows();
        }
        Self {
            columns: stacked.transpose(),
            rows: stacked,
            place,
        }
    }

    fn information(&self, before: &DMatrix<f64>, weights: &[(usize, f64)]) -> DMatrix<f64> {
        let mut weighted = self.columns.clone();
        for (mut column, place) in weighted.column_iter_mut().zip(&self.place) {
            column *= weights[*place].1;
        }
        let mut m = before.clone();
        m.gemm(1.0, &weighted, &self.rows, 1.0);
        // Rounding must not make it unsymmetric.
        (&m + m.transpose()) * 0.5
    }

    /// tr(Y H Yᵀ) by place.
    fn gains(&self, h: &DMatrix<f64>, count: usize) -> Vec<f64> {
        let along = h * &self.columns;
        let mut gains = vec![0.0; count];
        let each = along.column_iter().zip(self.columns.column_iter());
        for ((a, y), place) in each.zip(&self.place) {
            gains[*place] += a.dot(&y);
        }
        gains
    }
}

/// Takes the postures with the largest gains among those that have a weight, and drops those without.
fn admit(weights: &mut Vec<(usize, f64)>, gains: &[f64], n: f64) {
    /// Part of all weight that the admitted get together.
    const SHARE: f64 = 0.2;
    /// A weight below this is dropped.
    const NOTHING: f64 = 1e-4;
    weights.retain(|w| w.1 > NOTHING);
    let mut by_gain: Vec<usize> = (0..gains.len()).collect();
    by_gain.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]).then(a.cmp(b)));
    let known: Vec<usize> = weights.iter().map(|w| w.0).collect();
    let new = by_gain.into_iter().filter(|i| !known.contains(i));
    let new: Vec<usize> = new.take(ADMITTED).collect();
    if new.is_empty() {
        return;
    }
    for weight in weights.iter_mut() {
        weight.1 *= 1.0 - SHARE;
    }
    let each = SHARE * n / new.len() as f64;
    weights.extend(new.into_iter().map(|i| (i, each.min(1.0))));
}

/// min(1, c w_i) with the sum n; all 1 where there are fewer than n.
fn cut_at_one(weights: &[f64], n: f64) -> Vec<f64> {
    let mut order: Vec<usize> = (0..weights.len()).collect();
    order.sort_by(|a, b| weights[*b].total_cmp(&weights[*a]).then(a.cmp(b)));
    let mut rest: f64 = weights.iter().sum();
    let mut cut = vec![1.0; weights.len()];
    let mut left = n;
    for (place, i) in order.iter().enumerate() {
        // All larger ones are 1.
        let c = left / rest;
        if c * weights[*i] <= 1.0 || rest <= 0.0 {
            for k in &order[place..] {
                cut[*k] = if rest > 0.0 { c * weights[*k] } else { 0.0 };
            }
            break;
        }
        rest -= weights[*i];
        left -= 1.0;
    }
    cut
}

impl Criterion {
    /// Equation (4): how much worse K is than another one.
    fn ratio(&self, k: &DMatrix<f64>, best: &DMatrix<f64>) -> Option<f64> {
        let (own, best) = (self.value(k)?, self.value(best)?);
        Some(match self {
            Self::Determinant => ((own - best) / k.nrows() as f64).exp(),
            Self::Subset(s) => ((own - best) / s.nrows() as f64).exp(),
            Self::Trace(_) => best / own,
            Self::Smallest(_) => own / best,
        })
    }
}
