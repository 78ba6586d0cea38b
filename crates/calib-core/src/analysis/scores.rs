//! What several fits predict of the same poses that they left out, beside each other.

use std::collections::BTreeMap;

use crate::analysis::validate::CrossValidation;

/// (1) and (2) of the choice of noise ([`weigh`](crate::analysis::weigh)) for every pose that all trials could predict.
pub(crate) struct Scores {
    pub squares: Vec<Vec<f64>>,
    pub surprises: Vec<Vec<f64>>,
}

impl Scores {
    pub fn of(trials: &[&CrossValidation]) -> Self {
        let by_sample: Vec<BTreeMap<usize, (f64, f64)>> =
            trials.iter().map(|loo| of_samples(loo)).collect();
        let everywhere = |sample: &&usize| by_sample.iter().all(|s| s.contains_key(*sample));
        let first = by_sample.first();
        let common: Vec<usize> = first
            .map(|s| s.keys().filter(everywhere).copied().collect())
            .unwrap_or_default();
        let column = |of: fn(&(f64, f64)) -> f64| -> Vec<Vec<f64>> {
            let scores = by_sample.iter();
            scores
                .map(|s| common.iter().map(|sample| of(&s[sample])).collect())
                .collect()
        };
        Self {
            squares: column(|s| s.0),
            surprises: column(|s| s.1),
        }
    }
}

/// (1) and (2) by sample.
fn of_samples(loo: &CrossValidation) -> BTreeMap<usize, (f64, f64)> {
    let predicted = loo.samples.iter().filter(|s| !s.vectors.is_empty());
    predicted
        .map(|s| {
            let squares = s.vectors.iter();
            let sum: f64 = squares
                .map(|v| v.position.or(v.rotation).unwrap_or(0.0).powi(2))
                .sum();
            (s.sample, (sum / s.vectors.len() as f64, -s.log_density))
        })
        .collect()
}

/// The mean; 0 of nothing.
pub(crate) fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len().max(1) as f64
}

/// (3): mean of the differences and its standard error.
pub(crate) fn paired(a: &[f64], b: &[f64]) -> (f64, f64) {
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    let middle = mean(&differences);
    let squares = differences.iter().map(|d| (d - middle).powi(2));
    let n = differences.len().max(2) as f64;
    (middle, (squares.sum::<f64>() / (n - 1.0) / n).sqrt())
}
