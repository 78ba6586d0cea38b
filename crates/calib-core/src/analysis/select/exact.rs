//! Models fitted in full, and the comparison of their predictions.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Cholesky, DVector};

use crate::analysis::admit::{eligible, many_rejected};
use crate::analysis::compare::mean_and_error;
use crate::analysis::estimate::{Trial, try_out};
use crate::analysis::information::Information;
use crate::analysis::select::linear::Linearization;
use crate::analysis::select::sample::measured_covariance;
use crate::analysis::select::task::Task;
use crate::analysis::validate::{CrossValidation, VectorError, predictions};
use crate::analysis::weigh;
use crate::graph::edge::EdgeKind;
use crate::graph::error::Error;
use crate::graph::ids::{MeasurementId, ParameterId};
use crate::graph::problem::{NoiseModel, Problem};
use crate::model::layout::Model;

/// Square of an error a row, in units of the noise, beyond which a vector counts as gross: 3 σ. What is not physics then costs all models
/// the same, and what a model explains after all is its gain.
const LARGEST: f64 = 9.0;

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
    pub trial: Trial,
    /// What is random from pose to pose.
    pub noise: NoiseModel,
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

/// Takes out the effects that are held at nothing: they cost time at every evaluation.
fn without_idle_effects(problem: &mut Problem) {
    let parameters = &problem.parameters;
    let idle = |id: ParameterId| {
        let parameter = &parameters[id.index()];
        parameter.fixed && parameter.start == 0.0 && parameter.nominal == 0.0
    };
    for edge in &mut problem.edges {
        if let EdgeKind::Joint(joint) = &mut edge.kind {
            joint.effects.retain(|e| !idle(e.parameter));
            for effect in &mut joint.effects {
                effect.shares.retain(|s| !idle(s.parameter));
            }
        }
    }
}

impl Task<'_> {
    /// The problem with these parts free, the others at their nominal values.
    fn with(&self, chosen: &BTreeSet<usize>, near: Option<&Fitted>, noise: NoiseModel) -> Problem {
        let mut problem = self.under(noise);
        let values = near.map_or(&[][..], |fit| &fit.trial.values.0);
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
        without_idle_effects(&mut problem);
        problem
    }

    /// The problem, all parts free, with this noise from pose to pose.
    fn under(&self, noise: NoiseModel) -> Problem {
        let problem = match noise {
            NoiseModel::Joint => None,
            other => self.problem.with_noise_model(other),
        };
        problem.unwrap_or_else(|| self.problem.clone())
    }

    /// A model fitted in full, from the values of another one where there is one, under the same noise.
    pub(super) fn fitted(
        &self,
        chosen: &BTreeSet<usize>,
        near: Option<&Fitted>,
    ) -> Result<Fitted, Error> {
        let noise = near.map_or(NoiseModel::Joint, |fit| fit.noise);
        self.fitted_under(chosen, near, noise)
    }

    /// The same model under the noise that its left-out poses speak for; `None` where it is the one that it has.
    pub(super) fn renewed(
        &self,
        chosen: &BTreeSet<usize>,
        fit: &Fitted,
    ) -> Result<Option<Fitted>, Error> {
        if !self.rule.noise_by_evidence {
            return Ok(None);
        }
        let stated = self.with(chosen, Some(fit), NoiseModel::Joint);
        let reference = weigh::Fitted {
            objective: fit.trial.objective(),
            values: &fit.trial.values,
        };
        match reference.noise_of(&stated) {
            Some(noise) if noise != fit.noise => {
                self.fitted_under(chosen, Some(fit), noise).map(Some)
            }
            _ => Ok(None),
        }
    }

    fn fitted_under(
        &self,
        chosen: &BTreeSet<usize>,
        near: Option<&Fitted>,
        noise: NoiseModel,
    ) -> Result<Fitted, Error> {
        // Outliers are judged at the stated levels, as in a run.
        let same = near.filter(|near| near.noise == noise && !self.settings.robust.enabled);
        let found = same.map(|near| &near.trial.theta[..]);
        let trial = try_out(&self.with(chosen, near, noise), found, self.settings)?;
        let levels = near.map_or_else(|| trial.theta.clone(), |first| first.levels.clone());
        let step = self.step();
        let wanted = |sample: usize| sample.is_multiple_of(step);
        let (objective, values) = (trial.objective(), &trial.values);
        let left_out = predictions(objective, values, &trial.weights, true, &wanted);
        let left_out = left_out.ok_or(Error::NotEvaluable)?;
        let most = match self.settings.robust.enabled {
            true => LARGEST,
            false => f64::INFINITY,
        };
        let mut predicted = BTreeMap::new();
        for of in [Some(left_out), rejected(&trial, &wanted)].iter().flatten() {
            for sample in &of.samples {
                for v in &sample.vectors {
                    let key = (sample.sample, v.measurement, v.item);
                    if let Some(found) = Predicted::of(&trial.model, &levels, sample.sample, v) {
                        predicted.entry(key).or_insert(found.at_most(most));
                    }
                }
            }
        }
        Ok(Fitted {
            trial,
            noise,
            levels,
            predicted,
        })
    }

    /// Linearized in everything that a part can free.
    pub(super) fn linearized(&self, at: &Fitted) -> Result<Linearization, Error> {
        self.linearized_with(at, &at.trial.weights)
    }

    /// The same with the vectors that the gate rejected, where they are more than chance rejects: what a part explains cannot be seen in
    /// the others once the gate took it for gross errors.
    pub(super) fn linearized_with_rejected(
        &self,
        at: &Fitted,
    ) -> Result<Option<Linearization>, Error> {
        let everything = eligible(&at.trial.model, &at.trial.rejected);
        let many = many_rejected(&at.trial.weights, &everything).is_some();
        many.then(|| self.linearized_with(at, &everything))
            .transpose()
    }

    fn linearized_with(&self, at: &Fitted, weights: &[f64]) -> Result<Linearization, Error> {
        let model = Model::new(&self.under(at.noise))?;
        let linear = Linearization::at(&at.trial, weights, model, &at.levels, self.step());
        linear.ok_or(Error::NotEvaluable)
    }
}

/// What the gate rejected, predicted from what it kept: a better model may explain it.
fn rejected(trial: &Trial, wanted: &dyn Fn(usize) -> bool) -> Option<CrossValidation> {
    let pairs = eligible(&trial.model, &trial.rejected)
        .into_iter()
        .zip(&trial.weights);
    let rejected: Vec<f64> = pairs.map(|(e, w)| if *w > 0.0 { 0.0 } else { e }).collect();
    if rejected.iter().all(|r| *r == 0.0) {
        return None;
    }
    predictions(trial.objective(), &trial.values, &rejected, false, wanted)
}

impl Predicted {
    /// The same with a square of at most so much a row.
    fn at_most(self, most: f64) -> Self {
        Self {
            square: self.square.min(most * self.rows as f64),
            ..self
        }
    }

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

    /// Parameters that the data determine; 0 where the model cannot be evaluated.
    pub(super) fn rank(&self) -> usize {
        let trial = &self.trial;
        let found = Information::at(&trial.model, &trial.values, &trial.weights, &trial.theta);
        found.map_or(0, |information| information.rank)
    }

    /// Position error of what it predicts, root mean square, m.
    pub(super) fn rms(&self) -> f64 {
        self.against(self).rms.0
    }
}
