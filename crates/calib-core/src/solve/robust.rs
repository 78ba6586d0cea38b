//! Outliers: Huber, then graduated non-convexity, then a gate, then a plain fit of what is left.
//!
//! ```text
//! d² = eᵀ V⁻¹ e of one vector (marker, pose), V its own covariance with the joints' noise         (1)
//! Huber           w = min(1, k/d)                                                            (2)
//! Geman–McClure   w = ( μc² / (d² + μc²) )²,   μ: large → 1                                   (3)
//! gate            keep d² ≤ χ²_dim(99.9 %)                                                    (4)
//! ```
//!
//! A whole vector is weighted, never one coordinate, and never a prior. The last fit is unweighted, so
//! that its covariance means what it says. Where the residuals are larger than the stated noise over
//! the board (an unmodeled effect), d² is measured against their median: a model that is wrong
//! everywhere must not declare half of its data outliers.

use std::ops::Range;

use calib_geometry::statistics::upper_median;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::graph::ids::MeasurementId;
use crate::graph::measurement::MeasurementKind;
use crate::model::cache::State;
use crate::model::layout::Model;
use crate::model::path::Derivatives;
use crate::model::values::Values;
use crate::solve::chunks::{chunked, is_one_chunk};
use crate::solve::contraction::both;
use crate::solve::equations::{Objective, Workspace};
use crate::solve::minimize::{MinimizeSettings, Minimum, minimize_in};
use crate::solve::rows::SampleRows;

/// Why an observation does not take part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RejectReason {
    /// It lies where another marker of the same body should be.
    Swap,
    /// A measured pose on its path was lost.
    Occlusion,
    /// It is off by more than noise explains.
    Outlier,
    /// The whole body is off, markers together: the robot had not settled, or the reading is wrong.
    NotSettled,
}

/// An observation that does not take part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Rejection {
    /// Sample.
    pub sample: usize,
    /// Measurement.
    pub measurement: MeasurementId,
    /// Index within the measurement.
    pub item: usize,
    /// Why.
    pub reason: RejectReason,
    /// Mahalanobis distance at the final fit (σ).
    pub distance: f64,
}

/// How to treat outliers.
///
/// Non-exhaustive: start from [`RobustSettings::default`] or [`RobustSettings::off`] and change what differs.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct RobustSettings {
    /// Off: every observation counts fully.
    pub enabled: bool,
    /// Huber's corner on the norm of a 3-vector: 95 % efficient there. Other sizes get the same tail.
    pub huber: f64,
    /// Probability that a good observation passes the gate.
    pub gate: f64,
    /// μ shrinks by this factor per step of (3).
    pub anneal: f64,
    /// Whether observations are kept that the others contradict no more than chance does, however far they lie. Off, what the gate rejects stays out: for those who ask which observations are off.
    pub uncontradicted: bool,
}

impl Default for RobustSettings {
    fn default() -> Self {
        Self {
            enabled: true,
            huber: 2.8,
            gate: 0.999,
            anneal: 1.6,
            uncontradicted: true,
        }
    }
}

impl RobustSettings {
    /// Every observation counts fully.
    #[must_use]
    pub fn off() -> Self {
        Self {
            enabled: false,
            ..Self::default()
        }
    }

    /// The same without `uncontradicted`.
    #[must_use]
    pub fn gate_alone(self) -> Self {
        Self {
            uncontradicted: false,
            ..self
        }
    }
}

/// χ² quantile; the distributions are valid by construction (freedom ≥ 1).
fn chi2_quantile(dimension: usize, probability: f64) -> f64 {
    ChiSquared::new(dimension as f64).map_or(f64::INFINITY, |d| d.inverse_cdf(probability))
}

/// Limits per dimension 0..=6, looked up once.
pub(crate) struct Limits {
    pub gate: [f64; 7],
    huber: [f64; 7],
    median: [f64; 7],
}

impl Limits {
    pub(crate) fn new(settings: &RobustSettings) -> Self {
        let tail = ChiSquared::new(3.0).map_or(0.95, |d| d.cdf(settings.huber * settings.huber));
        let table =
            |p: f64| std::array::from_fn(|d| if d == 0 { 0.0 } else { chi2_quantile(d, p) });
        Self {
            gate: table(settings.gate),
            huber: table(tail),
            median: table(0.5),
        }
    }
}

/// d² of equation (1) for every observation (0 where `mask` is 0).
pub(crate) fn distances(
    model: &Model,
    values: &Values,
    theta: &[f64],
    mask: &[f64],
    work: &mut Workspace,
) -> Option<Vec<f64>> {
    work.cache.update(&model.problem, values);
    let at = State::new(&model.problem, &work.cache, values);
    let count = model.problem.samples;
    let mut out = vec![0.0; model.observations.len()];
    let add = |some: Vec<(usize, f64)>| some.into_iter().for_each(|(o, d2)| out[o] = d2);
    if is_one_chunk(count) {
        distances_of(model, at, (theta, mask), 0..count, &mut work.rows).map(add)?;
    } else {
        let of = |samples: Range<usize>| {
            let mut rows = SampleRows::new(model);
            distances_of(model, at, (theta, mask), samples, &mut rows)
        };
        chunked(count, of, add)?;
    }
    Some(out)
}

/// Those of some samples, each with its observation.
fn distances_of(
    model: &Model,
    at: State,
    (theta, mask): (&[f64], &[f64]),
    samples: Range<usize>,
    rows: &mut SampleRows,
) -> Option<Vec<(usize, f64)>> {
    let wanted = if model.slots.is_empty() {
        Derivatives::None
    } else {
        Derivatives::Random
    };
    let mut out = Vec::new();
    for sample in samples {
        if model.of_sample[sample].is_empty() {
            continue;
        }
        rows.fill(model, at, mask, sample, wanted);
        rows.covariance(model, mask, theta);
        let m = rows.m;
        for &(o, first, count) in &rows.blocks {
            let mut l = [0.0; 36];
            let mut y = [0.0; 6];
            for i in 0..count {
                y[i] = rows.r[first + i];
                for j in 0..=i {
                    let mut sum = rows.v[(first + i) * m + first + j];
                    for k in 0..j {
                        sum -= l[i * 6 + k] * l[j * 6 + k];
                    }
                    if i == j {
                        if sum <= 0.0 || !sum.is_finite() {
                            return None;
                        }
                        l[i * 6 + i] = sum.sqrt();
                    } else {
                        l[i * 6 + j] = sum / l[j * 6 + j];
                    }
                }
                for k in 0..i {
                    y[i] -= l[i * 6 + k] * y[k];
                }
                y[i] /= l[i * 6 + i];
            }
            out.push((o, y[..count].iter().map(|x| x * x).sum()));
        }
    }
    Some(out)
}

/// Factor by which the typical d² exceeds what its noise model says (≥ 1).
pub(crate) fn inflation(model: &Model, d2: &[f64], mask: &[f64], limits: &Limits) -> f64 {
    let mut ratio: Vec<f64> = model
        .observations
        .iter()
        .zip(d2)
        .zip(mask)
        .filter(|(_, w)| **w > 0.0)
        .map(|((o, d), _)| d / limits.median[o.rows])
        .collect();
    upper_median(&mut ratio).unwrap_or(1.0).max(1.0)
}

/// Linearizations between two reweightings.
const INNER: MinimizeSettings = MinimizeSettings {
    max_iterations: 4,
    decrement: 1e-3,
    damping: 1e-6,
    contraction: None,
};

/// As [`clean`], from values that are nearly right: the last round of GNC alone.
pub(crate) fn clean_near(
    model: &Model,
    near: &Values,
    mask: &[f64],
    theta: &[f64],
    settings: &RobustSettings,
    work: &mut Workspace,
) -> Option<(Values, Vec<f64>, usize)> {
    let limits = Limits::new(settings);
    let d2 = distances(model, near, theta, mask, work)?;
    let scale = inflation(model, &d2, mask, &limits);
    let weight = |o: usize| {
        let c2 = limits.gate[model.observations[o].rows] * scale;
        (c2 / (d2[o] + c2)).powi(2).max(LEAST_WEIGHT)
    };
    let weights: Vec<f64> = (0..mask.len())
        .map(|o| if mask[o] > 0.0 { weight(o) } else { mask[o] })
        .collect();
    let objective = Objective {
        model,
        weights: &weights,
        theta,
    };
    let fit = minimize_in(objective, near, &INNER, work);
    let kept = gate(model, &fit.values, theta, mask, settings, work)?;
    Some((fit.values, kept, fit.iterations))
}

/// Weights under this make V badly scaled and change nothing.
const LEAST_WEIGHT: f64 = 1e-6;

/// Huber and GNC from a start; returns values and the set that passed the gate (0/1 weights).
pub(crate) fn clean(
    model: &Model,
    start: &Minimum,
    mask: &[f64],
    theta: &[f64],
    settings: &RobustSettings,
    work: &mut Workspace,
) -> Option<(Values, Vec<f64>, usize)> {
    /// Reweighting rounds of (2): the weights settle to 1 % in fewer than ten.
    const HUBER_ROUNDS: usize = 12;
    let mut inner = MinimizeSettings {
        contraction: start.contraction,
        ..INNER
    };
    let limits = Limits::new(settings);
    let rows = |o: usize| model.observations[o].rows;
    let mut values = start.values.clone();
    let mut iterations = 0;
    let mut weights = mask.to_vec();
    for _ in 0..HUBER_ROUNDS {
        let d2 = distances(model, &values, theta, mask, work)?;
        let scale = inflation(model, &d2, mask, &limits);
        let mut change: f64 = 0.0;
        for o in 0..weights.len() {
            if mask[o] > 0.0 {
                let w = (limits.huber[rows(o)] * scale / d2[o]).sqrt().min(1.0);
                change = change.max((w - weights[o]).abs());
                weights[o] = w;
            }
        }
        if change < 0.01 {
            break;
        }
        let fit = {
            let objective = Objective {
                model,
                weights: &weights,
                theta,
            };
            minimize_in(objective, &values, &inner, work)
        };
        iterations += fit.iterations;
        inner.contraction = both(inner.contraction, fit.contraction);
        values = fit.values;
    }
    let d2 = distances(model, &values, theta, mask, work)?;
    let scale = inflation(model, &d2, mask, &limits);
    let worst = (0..d2.len())
        .filter(|&o| mask[o] > 0.0)
        .map(|o| d2[o] / (limits.gate[rows(o)] * scale))
        .fold(0.0, f64::max);
    if worst > 1.0 {
        // Huber has brought us near: beyond 1e3 the kernel is flat anyway.
        let mut mu = (2.0 * worst).min(1e3);
        loop {
            let d2 = distances(model, &values, theta, mask, work)?;
            let scale = inflation(model, &d2, mask, &limits);
            for o in 0..weights.len() {
                if mask[o] > 0.0 {
                    let c2 = mu * limits.gate[rows(o)] * scale;
                    weights[o] = (c2 / (d2[o] + c2)).powi(2).max(LEAST_WEIGHT);
                }
            }
            let fit = {
                let objective = Objective {
                    model,
                    weights: &weights,
                    theta,
                };
                minimize_in(objective, &values, &inner, work)
            };
            iterations += fit.iterations;
            inner.contraction = both(inner.contraction, fit.contraction);
            values = fit.values;
            if mu <= 1.0 {
                break;
            }
            mu = (mu / settings.anneal).max(1.0);
        }
    }
    let kept = gate(model, &values, theta, mask, settings, work)?;
    Some((values, kept, iterations))
}

/// Equation (4) at given values with a limit on d that is wider by a factor.
pub(crate) fn gate_of(
    model: &Model,
    values: &Values,
    theta: &[f64],
    mask: &[f64],
    factor: f64,
    work: &mut Workspace,
) -> Option<Vec<f64>> {
    let limits = Limits::new(&RobustSettings::default());
    let d2 = distances(model, values, theta, mask, work)?;
    let scale = inflation(model, &d2, mask, &limits) * factor * factor;
    let observations = model.observations.iter().enumerate();
    let passes = |o: usize, rows: usize| mask[o] > 0.0 && d2[o] <= limits.gate[rows] * scale;
    let passed = observations.map(|(o, observation)| passes(o, observation.rows));
    Some(passed.map(|p| f64::from(u8::from(p))).collect())
}

/// Equation (4) at given values.
pub(crate) fn gate(
    model: &Model,
    values: &Values,
    theta: &[f64],
    mask: &[f64],
    settings: &RobustSettings,
    work: &mut Workspace,
) -> Option<Vec<f64>> {
    let limits = Limits::new(settings);
    let d2 = distances(model, values, theta, mask, work)?;
    let scale = inflation(model, &d2, mask, &limits);
    Some(
        model
            .observations
            .iter()
            .enumerate()
            .map(|(o, observation)| {
                if mask[o] > 0.0 && d2[o] <= limits.gate[observation.rows] * scale {
                    1.0
                } else {
                    0.0
                }
            })
            .collect(),
    )
}

/// The rejected observations with their reasons.
pub(crate) fn explain(
    model: &Model,
    values: &Values,
    theta: &[f64],
    mask: &[f64],
    kept: &[f64],
    work: &mut Workspace,
) -> Vec<Rejection> {
    let Some(d2) = distances(model, values, theta, mask, work) else {
        return Vec::new();
    };
    let limits = Limits::new(&RobustSettings::default());
    let mut out = Vec::new();
    for (o, observation) in model.observations.iter().enumerate() {
        if mask[o] <= 0.0 || kept[o] > 0.0 {
            continue;
        }
        let same_body: Vec<usize> = model.of_sample[observation.sample]
            .clone()
            .filter(|&other| {
                model.observations[other].measurement == observation.measurement
                    && mask[other] > 0.0
            })
            .collect();
        let reason = if swapped(model, values, theta, observation, &limits, work) {
            RejectReason::Swap
        } else if same_body.len() >= 3 && same_body.iter().all(|&other| kept[other] == 0.0) {
            RejectReason::NotSettled
        } else {
            RejectReason::Outlier
        };
        out.push(Rejection {
            sample: observation.sample,
            measurement: MeasurementId::of(observation.measurement),
            item: observation.item,
            reason,
            distance: d2[o].sqrt(),
        });
    }
    out
}

/// Does the marker lie, within the gate, where another marker of its body should be?
fn swapped(
    model: &Model,
    values: &Values,
    theta: &[f64],
    observation: &crate::model::layout::Observation,
    limits: &Limits,
    work: &mut Workspace,
) -> bool {
    let MeasurementKind::Markers(markers) =
        &model.problem.measurements[observation.measurement].kind
    else {
        return false;
    };
    let seen = &markers.observations[observation.item];
    let path = &model.paths[observation.measurement];
    let mut buffer = path.buffer();
    let at = State::new(&model.problem, &work.cache, values);
    let pose = path.evaluate(at, observation.sample, Derivatives::None, &mut buffer);
    let frame = model.problem.measurements[observation.measurement].to;
    // Twice the gate: the joints' noise adds to the marker's.
    let noise = markers.noise_of(seen.point);
    let limit = (4.0 * limits.gate[3] * theta[noise.index()]).sqrt();
    let points = &model.problem.points;
    let name = &points[seen.point.index()].name;
    (0..points.len()).any(|p| {
        // Points of one name stand for one another in different samples.
        if points[p].frame != frame || points[p].name == *name {
            return false;
        }
        let at = pose.r * model.point_position(p, values).coords + pose.t;
        (seen.position.coords - at).norm() < limit
    })
}
