//! Score tests with the level of the noise chosen again for each effect, where samples are few.
//!
//! ```text
//! U ← U − bᵀC g,   F ← F − gᵀC g                 one Gauss–Newton step to the minimum at this level
//! t² = ν (exp(T/ν) − 1)  ~  F(1, ν)                                                                  (1)
//! ```
//!
//! T as in `less_noise`. With the ratio of the noise levels known (1) is exact.

use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::Candidate;
use crate::analysis::less_noise::{Level, profiled};
use crate::analysis::solution::Solution;
use crate::solve::equations::NormalEquations;
use crate::solve::normal::add_prior;
use crate::solve::whitened::covariance_of;

/// What one effect takes of the cost at one level.
#[derive(Debug, Clone, Copy)]
struct Taken {
    gain: f64,
    estimate: f64,
}

/// One effect, at the level that suits it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Profiled {
    /// t² of equation (1), and its probability.
    pub t2: f64,
    pub p_value: f64,
    pub estimate: f64,
    pub explains: f64,
}

impl Solution {
    /// Every candidate, in their order; `None` where the noise is known well enough.
    pub(super) fn profiled_tests(&self, candidates: &[Candidate]) -> Option<Vec<Profiled>> {
        let used = self.used_samples();
        let lower = self.with_less_noise(used.len());
        if lower.is_empty() {
            return None;
        }
        let all = std::iter::once(self).chain(&lower);
        let levels: Vec<(Level, f64, Vec<Taken>)> = all
            .map(|s| s.level(candidates, &used))
            .collect::<Option<_>>()?;
        let freedom = levels[0].1;
        let f = FisherSnedecor::new(1.0, freedom).ok()?;
        let of: Vec<Level> = levels.iter().map(|l| l.0).collect();
        let tested = (0..candidates.len()).map(|k| {
            let each = levels.iter().enumerate().map(|(at, (level, _, taken))| {
                (profiled(freedom, &of, at, taken[k].gain), level, taken[k])
            });
            let (t, level, taken) = each.max_by(|a, b| a.0.total_cmp(&b.0))?;
            let t2 = freedom * (t / freedom).exp_m1();
            Some(Profiled {
                t2,
                p_value: f.sf(t2),
                estimate: taken.estimate,
                explains: (taken.gain / level.cost.max(f64::MIN_POSITIVE)).min(1.0),
            })
        });
        tested.collect()
    }

    /// Level, ν, and what every candidate takes.
    fn level(&self, candidates: &[Candidate], used: &[usize]) -> Option<(Level, f64, Vec<Taken>)> {
        let model = &self.model;
        let (n, count) = (model.free(), candidates.len());
        let mut h = DMatrix::zeros(n, n);
        let mut g = DVector::zeros(n);
        let mut b = DMatrix::zeros(n, count);
        let (mut u, mut raw) = (vec![0.0; count], vec![0.0; count]);
        let (mut cost, mut rows, mut log_det) = (0.0, 0.0, 0.0);
        self.each_sample(candidates, used, |s, alpha| {
            s.a.add_gram(1.0, &mut h);
            s.a.add_transposed_vector(&s.w, &mut g);
            s.a.add_transposed_times(1.0, alpha, &mut b);
            for (k, own) in alpha.column_iter().enumerate() {
                u[k] += own.dot(&s.w);
                raw[k] += own.norm_squared();
            }
            cost += s.w.norm_squared();
            rows += s.w.len() as f64;
            log_det += s.log_det;
        });
        let mut system = NormalEquations::of(&h, &g);
        add_prior(model, &self.values, &mut system);
        let system = self.held(system);
        let covariance = covariance_of(&system)?;
        let gradient = DVector::from_row_slice(&system.g);
        let step = -(&covariance * &gradient);
        cost += system.prior + gradient.dot(&step);
        let parameters = model.columns.iter().map(|p| &model.problem.parameters[*p]);
        let priors = parameters.filter(|p| p.prior_sigma.is_some()).count() as f64;
        let factor = Cholesky::new(covariance.clone())?;
        let of_covariance: f64 = factor
            .l_dirty()
            .diagonal()
            .iter()
            .map(|x| 2.0 * x.ln())
            .sum();
        let taken = &covariance * &b;
        let of = |k: usize| {
            let information = raw[k] - b.column(k).dot(&taken.column(k));
            let u = u[k] + b.column(k).dot(&step);
            // An effect that the parameters already imitate cannot be tested.
            let tested = information > IMITATED * raw[k] && raw[k] > 0.0;
            Taken {
                gain: if tested { u * u / information } else { 0.0 },
                estimate: if tested { -u / information } else { 0.0 },
            }
        };
        let level = Level {
            cost,
            log_det: log_det - of_covariance,
        };
        let freedom = (rows + priors - n as f64).max(1.0);
        Some((level, freedom, (0..count).map(of).collect()))
    }
}

/// An effect with less than this share of its own information is one that the parameters imitate.
const IMITATED: f64 = 1e-4;
