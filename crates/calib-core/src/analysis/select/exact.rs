//! Models fitted in full, and the comparison of their predictions.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Cholesky, DVector};

use crate::analysis::compare::mean_and_error;
use crate::analysis::estimate::solve;
use crate::analysis::select::linear::{Linearization, measured_covariance};
use crate::analysis::select::task::Task;
use crate::analysis::solution::Solution;
use crate::analysis::validate::VectorError;
use crate::graph::error::Error;
use crate::graph::ids::MeasurementId;
use crate::graph::problem::Problem;
use crate::model::layout::Model;

/// Sample, measurement, item.
type Key = (usize, MeasurementId, usize);

/// One vector, predicted from the other samples.
struct Predicted {
    /// eᵀD⁻¹e.
    square: f64,
    rows: usize,
    /// m.
    position: Option<f64>,
}

/// A model fitted in full.
pub(super) struct Fitted {
    pub solution: Solution,
    /// σ² of D per noise group: those of the first model.
    levels: Vec<f64>,
    predicted: BTreeMap<Key, Predicted>,
}

/// Two models on the vectors that both predict.
pub(super) struct Compared {
    /// Mean loss that the second saves, relative to that of the first, and its standard error.
    pub gain: (f64, f64),
    /// Position error of both, root mean square, m.
    pub rms: (f64, f64),
}

impl Compared {
    pub(super) fn is_better(&self) -> bool {
        self.gain.0 > self.gain.1
    }
}

impl Task<'_> {
    /// The problem with these parts free, the others at their nominal values.
    fn with(&self, chosen: &BTreeSet<usize>, near: Option<&Fitted>) -> Problem {
        let mut problem = self.problem.clone();
        let values = near.map_or(&[][..], |fit| &fit.solution.values.0);
        for (parameter, value) in problem.parameters.iter_mut().zip(values) {
            parameter.start = *value;
        }
        let free = self.parameters_of(chosen);
        for id in self.parts.iter().flat_map(|part| &part.parameters) {
            let parameter = problem.parameter_mut(*id);
            if !free.contains(&id.index()) {
                parameter.fixed = true;
                parameter.start = parameter.nominal;
            }
        }
        problem
    }

    /// A model fitted in full, from the values of another one where there is one.
    pub(super) fn fitted(
        &self,
        chosen: &BTreeSet<usize>,
        near: Option<&Fitted>,
    ) -> Result<Fitted, Error> {
        let solution = solve(&self.with(chosen, near), self.settings)?;
        let levels = near.map_or_else(|| solution.theta.clone(), |first| first.levels.clone());
        let step = self.step();
        let left_out = solution.leave_out(|sample| sample % step == 0);
        let mut predicted = BTreeMap::new();
        for sample in left_out.ok_or(Error::NotEvaluable)?.samples {
            for v in &sample.vectors {
                let key = (sample.sample, v.measurement, v.item);
                if let Some(found) = Predicted::of(&solution.model, &levels, sample.sample, v) {
                    predicted.insert(key, found);
                }
            }
        }
        Ok(Fitted {
            solution,
            levels,
            predicted,
        })
    }

    /// Linearized in everything that a part can free.
    pub(super) fn linearized(&self, at: &Fitted) -> Result<Linearization, Error> {
        let model = Model::new(self.problem)?;
        let linear = Linearization::at(&at.solution, model, &at.levels, self.step());
        linear.ok_or(Error::NotEvaluable)
    }
}

impl Predicted {
    fn of(model: &Model, levels: &[f64], sample: usize, v: &VectorError) -> Option<Self> {
        let mut observations = model.of_sample[sample].clone();
        let observation = observations.find(|&o| {
            let o = model.observations[o];
            o.measurement == v.measurement.index() && o.item == v.item
        })?;
        let rows = v.error.len();
        let d = measured_covariance(model, observation, rows, levels);
        let e = DVector::from_column_slice(&v.error);
        let square = match Cholesky::new(d) {
            Some(d) => e.dot(&d.solve(&e)),
            // Without noise of its own there is no other measure than the error itself.
            None => e.norm_squared(),
        };
        square.is_finite().then_some(Self {
            square,
            rows,
            position: v.position,
        })
    }
}

impl Fitted {
    /// This model against another one, which comes after it.
    pub(super) fn against(&self, after: &Self) -> Compared {
        // sample → (squares before, after, rows)
        let mut samples: BTreeMap<usize, (f64, f64, usize)> = BTreeMap::new();
        let mut positions = (0.0, 0.0, 0);
        for (key, a) in &self.predicted {
            let Some(b) = after.predicted.get(key) else {
                continue;
            };
            let sample = samples.entry(key.0).or_default();
            sample.0 += a.square;
            sample.1 += b.square;
            sample.2 += a.rows;
            if let (Some(a), Some(b)) = (a.position, b.position) {
                positions.0 += a * a;
                positions.1 += b * b;
                positions.2 += 1;
            }
        }
        let per_row = |square: f64, rows: usize| square / rows.max(1) as f64;
        let losses = samples.values();
        let before: Vec<f64> = losses.clone().map(|s| per_row(s.0, s.2)).collect();
        let saved: Vec<f64> = losses.map(|s| per_row(s.0 - s.1, s.2)).collect();
        let (mean, _) = mean_and_error(&before);
        let (gain, error) = mean_and_error(&saved);
        let scale = if mean > 0.0 { 1.0 / mean } else { 0.0 };
        let rms = |sum: f64| (sum / f64::from(positions.2.max(1))).sqrt();
        Compared {
            gain: (gain * scale, error * scale),
            rms: (rms(positions.0), rms(positions.1)),
        }
    }

    /// Position error of what it predicts, root mean square, m.
    pub(super) fn rms(&self) -> f64 {
        self.against(self).rms.0
    }
}
