//! Which model to believe: variants of one problem, ranked by how well each predicts samples that it
//! has not seen.
//!
//! ```text
//! loss_s(variant) = −log p(y_s | y₋ₛ)        (density; noise levels count, the more precise test)      (1)
//!              or = mean over vectors of |e₋ₛ|²   (position error, m²)                           (2)
//! worse by = mean_s loss_s − best,  ± its standard error over samples (paired)
//! ```
//!
//! The choice is the smallest variant (fewest parameters that the data determine) whose difference to the best
//! is within one standard error. Only vectors that every variant kept and could predict are compared.

use serde::{Deserialize, Serialize};

use crate::analysis::estimate::solve;
use crate::analysis::settings::Settings;
use crate::analysis::solution::Solution;
use crate::analysis::validate::{CrossValidation, SamplePrediction};
use crate::graph::error::Error;
use crate::graph::ids::{MeasurementId, ParameterId};
use crate::graph::problem::Problem;

/// By what variants are ranked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Criterion {
    /// Equation (1).
    #[default]
    LogDensity,
    /// Equation (2).
    PositionError,
}

/// One variant after comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RankedVariant {
    /// Its name.
    pub name: String,
    /// Free parameters that the data determine.
    pub parameters: usize,
    /// Root of the mean of (2): left-out position error per vector, m.
    pub loo_rms: f64,
    /// Sum over samples of the logarithm of the predictive density.
    pub log_density: f64,
    /// Mean loss minus that of the best variant (nats per sample, or m²).
    pub worse_by: f64,
    /// Standard error of `worse_by`.
    pub standard_error: f64,
    /// Parameters that are not significantly different from nominal (< 2 σ).
    pub noise_parameters: Vec<ParameterId>,
    /// The rule's choice.
    pub chosen: bool,
}

/// Solves every variant and ranks them, least loss first.
///
/// # Errors
/// [`Error`] of the first variant that cannot be stated.
pub fn compare(
    variants: &[(String, Problem)],
    settings: &Settings,
    criterion: Criterion,
) -> Result<Vec<RankedVariant>, Error> {
    compare_with(variants, settings, criterion, &mut |_| {})
}

/// As [`compare`]; `done(n)` is told when n variants are solved.
///
/// # Errors
/// As [`compare`].
pub fn compare_with(
    variants: &[(String, Problem)],
    settings: &Settings,
    criterion: Criterion,
    done: &mut dyn FnMut(usize),
) -> Result<Vec<RankedVariant>, Error> {
    let mut solved = Vec::new();
    for (name, problem) in variants {
        let solution = solve(problem, settings)?;
        let loo = solution.leave_one_out().ok_or(Error::NotEvaluable)?;
        solved.push((name, solution, loo));
        done(solved.len());
    }
    let common = common_vectors(&solved);
    let samples: std::collections::BTreeSet<usize> = common.iter().map(|(s, _, _)| *s).collect();
    let squares: Vec<Vec<f64>> = solved
        .iter()
        .map(|(_, _, loo)| sample_scores(loo, &common))
        .collect();
    let densities: Vec<Vec<f64>> = solved
        .iter()
        .map(|(_, _, loo)| {
            loo.samples
                .iter()
                .filter(|s| samples.contains(&s.sample))
                .map(|s| -s.log_density)
                .collect()
        })
        .collect();
    let scores = match criterion {
        Criterion::LogDensity => &densities,
        Criterion::PositionError => &squares,
    };
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let best = (0..scores.len())
        .min_by(|&a, &b| mean(&scores[a]).total_cmp(&mean(&scores[b])))
        .unwrap_or(0);
    let mut ranked: Vec<RankedVariant> = solved
        .iter()
        .enumerate()
        .map(|(i, (name, solution, _))| {
            let score = &scores[i];
            let difference: Vec<f64> = score
                .iter()
                .zip(&scores[best])
                .map(|(a, b)| a - b)
                .collect();
            let (m, standard_error) = mean_and_error(&difference);
            RankedVariant {
                name: (*name).clone(),
                parameters: solution.information.rank,
                loo_rms: mean(&squares[i]).sqrt(),
                worse_by: m,
                standard_error,
                log_density: -densities[i].iter().sum::<f64>(),
                noise_parameters: noise_parameters(solution),
                chosen: false,
            }
        })
        .collect();
    let choice = (0..ranked.len())
        .filter(|&i| ranked[i].worse_by <= ranked[i].standard_error)
        .min_by(|&a, &b| {
            (ranked[a].parameters, ranked[a].loo_rms)
                .partial_cmp(&(ranked[b].parameters, ranked[b].loo_rms))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
    if let Some(i) = choice {
        ranked[i].chosen = true;
    }
    ranked.sort_by(|a, b| a.worse_by.total_cmp(&b.worse_by));
    Ok(ranked)
}

/// Mean and its standard error.
pub(crate) fn mean_and_error(x: &[f64]) -> (f64, f64) {
    let n = x.len();
    let m = x.iter().sum::<f64>() / n.max(1) as f64;
    let n = n.max(2) as f64;
    let variance = x.iter().map(|x| (x - m) * (x - m)).sum::<f64>() / (n - 1.0);
    (m, (variance / n).sqrt())
}

/// Mean of a − b over the samples that both have, and its standard error.
pub(crate) fn paired(a: &[Option<f64>], b: &[Option<f64>]) -> (f64, f64) {
    let both = a.iter().zip(b).filter_map(|(a, b)| Some((*a)? - (*b)?));
    mean_and_error(&both.collect::<Vec<f64>>())
}

/// (sample, measurement, item) that every variant kept and could predict.
fn common_vectors(
    solved: &[(&String, Solution, CrossValidation)],
) -> std::collections::BTreeSet<(usize, MeasurementId, usize)> {
    let mut sets = solved.iter().map(|(_, _, loo)| {
        loo.samples
            .iter()
            .flat_map(|s| s.vectors.iter().map(|v| (s.sample, v.measurement, v.item)))
            .collect::<std::collections::BTreeSet<_>>()
    });
    let first = sets.next().unwrap_or_default();
    sets.fold(first, |a, b| a.intersection(&b).copied().collect())
}

/// Mean squared position error (rotation where there is none) per sample.
fn sample_scores(
    loo: &CrossValidation,
    common: &std::collections::BTreeSet<(usize, MeasurementId, usize)>,
) -> Vec<f64> {
    let score = |s: &SamplePrediction| {
        let squares: Vec<f64> = s
            .vectors
            .iter()
            .filter(|v| common.contains(&(s.sample, v.measurement, v.item)))
            .map(|v| v.position.or(v.rotation).unwrap_or(0.0).powi(2))
            .collect();
        (!squares.is_empty()).then(|| squares.iter().sum::<f64>() / squares.len() as f64)
    };
    loo.samples.iter().filter_map(score).collect()
}

fn noise_parameters(solution: &Solution) -> Vec<ParameterId> {
    /// Two σ: one parameter in twenty looks like more by chance.
    const NOISE: f64 = 2.0;
    solution
        .parameters
        .iter()
        .filter(|p| {
            p.prior_or_feature()
                && p.sigma
                    .is_some_and(|s| (p.value - p.nominal).abs() < NOISE * s)
        })
        .map(|p| p.id)
        .collect()
}
