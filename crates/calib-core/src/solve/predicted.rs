//! What the gate rejects though nothing contradicts it: all other observations say little of it.
//!
//! ```text
//! d₋² = eᵀ (V + J C Jᵀ)⁻¹ e       (C = H⁻¹ of what takes part, priors included)                           (1)
//! keep where  d₋² ≤ ⅔ d²  and  d₋² ≤ m F_m,ν(1 − 0.1 %/N)                                                (2)
//! ```
//!
//! `e` and `V` are those of the one vector of m numbers alone: its noise and its joints' noise. A row that alone determines a direction is missed there
//! by more than its noise. Where the uncertainty of the prediction is a third of the whole or more, only what no chance among all N vectors explains is
//! an outlier; ν is the number of rows less that of unknowns, for the noise is estimated from them. One at a time is kept, and all others are judged
//! again beside it.

use calib_geometry::decompose::symmetric_eigen;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::model::cache::State;
use crate::model::path::Derivatives;
use crate::model::values::Values;
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::normal::accumulate;
use crate::solve::robust::{Limits, RobustSettings, distances, gate, inflation};
use crate::solve::whitened::covariance_of;

/// Equation (1) for each observation of `which`, none of which takes part; `None` where it cannot be had.
fn predicted_distances(
    objective: Objective,
    values: &Values,
    which: &[usize],
    work: &mut Workspace,
) -> Option<Vec<f64>> {
    let Objective { model, theta, .. } = objective;
    let n = model.free();
    let mut system = NormalEquations::new(n);
    if !accumulate(objective, values, work, &mut system) {
        return None;
    }
    let c = covariance_of(&system)?;
    let mut alone = vec![0.0; model.observations.len()];
    which
        .iter()
        .map(|&o| {
            alone[o] = 1.0;
            let sample = model.observations[o].sample;
            let Workspace { cache, rows, .. } = &mut *work;
            let at = State::new(&model.problem, cache, values);
            rows.fill(model, at, &alone, sample, Derivatives::All);
            rows.covariance(model, &alone, theta);
            alone[o] = 0.0;
            let m = rows.m;
            let j = DMatrix::from_fn(m, n, |i, k| rows.j[i * rows.n + k]);
            let v = DMatrix::from_fn(m, m, |i, k| rows.v[i.max(k) * m + i.min(k)]);
            let e = DVector::from_fn(m, |i, _| rows.r[i]);
            let spread = symmetric_eigen(&(v + &j * &c * j.transpose()));
            let along = spread.vectors.tr_mul(&e);
            let terms = along.iter().zip(spread.values.iter());
            (spread.values[0] > 0.0).then(|| terms.map(|(y, l)| y * y / l).sum())
        })
        .collect()
}

/// The gate and equation (2) at the fit of `objective`, whose weights say what took part in it.
pub(crate) fn gate_beside(
    objective: Objective,
    values: &Values,
    mask: &[f64],
    settings: &RobustSettings,
    work: &mut Workspace,
) -> Option<Vec<f64>> {
    let Objective { model, theta, .. } = objective;
    let mut kept = gate(model, values, theta, mask, settings, work)?;
    if settings.uncontradicted
        && let Some(o) = uncontradicted(objective, values, (mask, &kept), settings, work)
    {
        kept[o] = 1.0;
    }
    Some(kept)
}

/// Equation (2): what is contradicted least of all that takes no part and that the gate rejects. With it in the fit, the others are predicted better
/// or contradicted: one at a time.
pub(crate) fn uncontradicted(
    objective: Objective,
    values: &Values,
    (mask, kept): (&[f64], &[f64]),
    settings: &RobustSettings,
    work: &mut Workspace,
) -> Option<usize> {
    /// Share of d² that the prediction's own uncertainty leaves where it counts.
    const LEFT: f64 = 2.0 / 3.0;
    let Objective {
        model,
        weights,
        theta,
    } = objective;
    let out = |o: &usize| mask[*o] > 0.0 && weights[*o] == 0.0 && kept[*o] == 0.0;
    let which: Vec<usize> = (0..kept.len()).filter(out).collect();
    if which.is_empty() {
        return None;
    }
    let limits = Limits::new(settings);
    let d2 = distances(model, values, theta, mask, work)?;
    let scale = inflation(model, &d2, mask, &limits);
    let all = mask.iter().filter(|w| **w > 0.0).count() as f64;
    let predicted = predicted_distances(objective, values, &which, work)?;
    let part = model.observations.iter().zip(weights);
    let rows: usize = part.filter(|(_, w)| **w > 0.0).map(|(o, _)| o.rows).sum();
    let freedom = rows.saturating_sub(model.free()).max(1) as f64;
    let chance = (1.0 - settings.gate) / all;
    let share = |(o, predicted): (usize, f64)| {
        let rows = model.observations[o].rows as f64;
        let limit = rows
            * FisherSnedecor::new(rows, freedom)
                .ok()?
                .inverse_cdf(1.0 - chance);
        let counts = predicted <= LEFT * d2[o] && predicted <= limit * scale;
        counts.then_some((predicted / limit, o))
    };
    let candidates = which.into_iter().zip(predicted).filter_map(share);
    let least = candidates.min_by(|a, b| a.0.total_cmp(&b.0));
    least.map(|(_, o)| o)
}
