//! k-fold cross-validation: refits on all but one fold, predictions on that fold.

use crate::analysis::estimate::solve;
use crate::analysis::settings::Settings;
use crate::analysis::validate::CrossValidation;
use crate::graph::error::Error;
use crate::graph::problem::Problem;

/// Fold of every sample that has an observation and is not held out already: shuffled by a fixed
/// sequence, the same on every machine.
#[must_use]
pub fn folds(problem: &Problem, k: usize) -> Vec<Vec<usize>> {
    let mut used: Vec<usize> = problem
        .measurements
        .iter()
        .flat_map(|h| h.kind.of().samples())
        .filter(|s| !problem.held_out.contains(s))
        .collect();
    used.sort_unstable();
    used.dedup();
    // Fisher–Yates with Knuth's 64-bit linear congruential generator.
    let mut state: u64 = 1;
    for i in (1..used.len()).rev() {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let j = ((state >> 33) as usize) % (i + 1);
        used.swap(i, j);
    }
    let k = k.clamp(1, used.len().max(1));
    let mut folds = vec![Vec::new(); k];
    for (i, s) in used.into_iter().enumerate() {
        folds[i % k].push(s);
    }
    for f in &mut folds {
        f.sort_unstable();
    }
    folds
}

/// Predictions of every sample from fits that did not see its fold.
///
/// # Errors
/// [`Error`] when the problem cannot be stated.
pub fn k_fold(problem: &Problem, settings: &Settings, k: usize) -> Result<CrossValidation, Error> {
    let mut out = CrossValidation::default();
    // Every fold starts where the fit of all samples ended: a start value is no information, the minimum
    // is the fold's own, and it is near.
    let whole = solve(problem, settings)?;
    let mut near = problem.clone();
    for (parameter, value) in near.parameters.iter_mut().zip(&whole.values.0) {
        parameter.start = *value;
    }
    for fold in folds(problem, k) {
        let mut part = near.clone();
        let before = part.held_out.clone();
        part.held_out.extend(fold.iter().copied());
        let solution = solve(&part, settings)?;
        if let Some(predicted) = solution.held_out() {
            out.samples.extend(
                predicted
                    .samples
                    .into_iter()
                    .filter(|p| !before.contains(&p.sample)),
            );
            out.indispensable.extend(predicted.indispensable);
        }
    }
    out.samples.sort_by_key(|s| s.sample);
    Ok(out)
}
