//! The choice made again without each of some folds, which it then predicts: the error to be stated for a chosen model.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use crate::analysis::folds::folds;
use crate::analysis::select::NestedError;
use crate::analysis::select::linear::{Linear, Linearization};
use crate::analysis::select::sample::Sample;
use crate::analysis::select::step::{Stage, additions, candidates, simplest};
use crate::analysis::select::task::{EXCHANGES, Task};

/// Samples of a fold at least: fewer say nothing of an error.
const LEAST: usize = 3;

/// Squares of position errors, and how many.
type Squares = (f64, usize);

/// What one fold gives.
struct Fold {
    first: Squares,
    chosen: Squares,
    nested: Squares,
    added: BTreeSet<usize>,
}

/// Errors in folds, by linearized fits.
pub(super) fn nested(
    task: &Task<'_>,
    linear: &Linearization,
    chosen: &BTreeSet<usize>,
) -> Option<NestedError> {
    let folds = folds(task.problem, task.rule.folds);
    let of_sample: BTreeMap<usize, usize> = folds
        .iter()
        .enumerate()
        .flat_map(|(fold, samples)| samples.iter().map(move |s| (*s, fold)))
        .collect();
    let fold_of = |sample: usize| of_sample.get(&sample).copied();
    if linear.samples().len() < LEAST * folds.len() || folds.len() < 2 {
        return None;
    }
    let trainings = linear.without_folds(folds.len(), fold_of);
    let each = |(fold, training): (usize, &Linear<'_>)| {
        let samples = linear.samples().iter();
        let held: Vec<&Sample> = samples
            .filter(|s| fold_of(s.number) == Some(fold))
            .collect();
        let found = choose(task, linear, training)?;
        let error = |parts: &BTreeSet<usize>| {
            let fitted = training.fit(task.active(linear, parts))?;
            let each = held.iter().map(|s| squares(linear, s, &fitted.residual(s)));
            Some(each.fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1)))
        };
        Some(Fold {
            first: error(task.first)?,
            chosen: error(chosen)?,
            nested: error(&found)?,
            added: found.difference(task.first).copied().collect(),
        })
    };
    let found: Vec<Option<Fold>> = trainings.par_iter().enumerate().map(each).collect();
    let found: Vec<Fold> = found.into_iter().collect::<Option<_>>()?;
    let rms = |of: fn(&Fold) -> Squares| {
        let all = found.iter().map(of);
        let (sum, count) = all.fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        (sum / count.max(1) as f64).sqrt()
    };
    let mut added = vec![0; task.parts.len()];
    for fold in &found {
        fold.added.iter().for_each(|&part| added[part] += 1);
    }
    Some(NestedError {
        folds: found.len(),
        rms: rms(|fold| fold.nested),
        rms_first: rms(|fold| fold.first),
        rms_chosen: rms(|fold| fold.chosen),
        lost_error: lost_error(&found),
        added,
    })
}

/// Standard error, over the folds, of what the mean square grows by when the choice is repeated without the fold, m².
fn lost_error(folds: &[Fold]) -> f64 {
    let mean = |(sum, count): Squares| sum / count.max(1) as f64;
    let lost: Vec<f64> = folds
        .iter()
        .map(|fold| mean(fold.nested) - mean(fold.chosen))
        .collect();
    let n = lost.len() as f64;
    let middle = lost.iter().sum::<f64>() / n;
    let squares: f64 = lost.iter().map(|l| (l - middle).powi(2)).sum();
    (squares / (n - 1.0) / n).sqrt()
}

/// The choice on some samples.
fn choose(
    task: &Task<'_>,
    linear: &Linearization,
    training: &Linear<'_>,
) -> Option<BTreeSet<usize>> {
    let columns = task.columns(linear);
    let mut chosen = task.first.clone();
    let mut used = BTreeSet::new();
    for k in 0..task.rule.steps {
        let active = task.active(linear, &chosen);
        let mut possible = additions(&columns, &active);
        possible.retain(|a| !used.contains(&a.part));
        let stage = Stage::after(k, task.rule);
        let (found, _) = candidates(training, &active, &possible, stage)?;
        let mut proposed = task.proposed(&found, false);
        proposed.retain(|c| c.predicts_better());
        if proposed.is_empty() {
            proposed = task.proposed(&found, true);
            proposed.retain(|c| c.predicts_better());
        }
        let Some((part, _)) = simplest(training, &active, &proposed, task.parts, task.rule) else {
            break;
        };
        used.insert(part.part);
        chosen = task.with_part(linear, training, &chosen, part.part).0;
    }
    for _ in 0..EXCHANGES {
        let Some((out, into)) = task.exchange(linear, training, &chosen) else {
            break;
        };
        chosen.remove(&out);
        chosen.insert(into);
    }
    Some(chosen)
}

/// Position error of what a linearized fit predicts from the other samples, root mean square, m.
pub(super) fn left_out_rms(
    task: &Task<'_>,
    linearization: &Linearization,
    linear: &Linear<'_>,
    chosen: &BTreeSet<usize>,
) -> Option<f64> {
    let fitted = linear.fit(task.active(linearization, chosen))?;
    let predicted = fitted.predicted();
    let of = |(s, e): (&&Sample, &Option<_>)| Some(squares(linearization, s, e.as_ref()?));
    let each = linear.samples.iter().zip(&predicted).filter_map(of);
    let (sum, count) = each.fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    Some((sum / count.max(1) as f64).sqrt())
}

/// Position errors of one sample.
fn squares(linear: &Linearization, s: &Sample, whitened: &nalgebra::DVector<f64>) -> Squares {
    let model = linear.model();
    let e = &s.l * whitened;
    let each = s.blocks.iter().filter_map(|&(o, first, rows)| {
        let kind = &model.problem.measurements[model.observations[o].measurement].kind;
        let own = e.rows(first, rows).into_owned();
        kind.of().deviation(own.as_slice()).position
    });
    each.fold((0.0, 0), |sum, p| (sum.0 + p * p, sum.1 + 1))
}
