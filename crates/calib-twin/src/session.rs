//! A session: postures, gaps, noise and freed parameters, from recordings that exist or would exist.

use calib_core::ChanceOfChanges;
use calib_pipeline::PipelineError;
use calib_pipeline::estimated::{Estimated, estimated, estimated_again};
use calib_pipeline::formulate::formulation::MlFit;
use calib_pipeline::formulate::ml::calibration_at;
use calib_pipeline::prepare::inputs::Inputs;
use calib_pipeline::run::RunOptions;
use calib_pipeline::verify::causes::{Causes, causes};
use calib_pipeline::verify::changes;
use calib_pipeline::verify::residuals::left_out;
use calib_profile::{BodyKind, Method, Usage};
use rand::SeedableRng;
use rand_chacha::ChaCha12Rng;

use crate::error::TwinError;
use crate::likeness::Likeness;
use crate::noise::Noise;
use crate::note::Note;
use crate::quantity::{Off, errors};
use crate::truth::{About, Draws, Truth};

/// Postures at which positions are compared, at most.
const PLACES: usize = 12;

/// A session that can be replayed.
#[derive(Debug)]
pub struct Session {
    /// The calibration of the recordings themselves.
    pub own: Estimated,
    /// What it says of its residuals.
    pub causes: Causes,
    /// Its own residuals, fitted as the trials are, for comparison with theirs.
    pub likeness: Likeness,
    /// What it promises: σ of each quantity; errors are 0.
    pub promised: Vec<Off>,
    /// The chance of changes in recordings as these, for all trials that are fitted as these were.
    pub chance: Option<ChanceOfChanges>,
    /// Recordings with the gaps of the session; what the fit rejected is a gap.
    pub rows: Inputs,
    /// The noise that was found.
    pub noise: Noise,
    /// Postures at which positions are compared: of the validation where there is one.
    pub places: Vec<Vec<f64>>,
    /// Where true robots are drawn.
    pub about: About,
    /// What was assumed.
    pub notes: Vec<Note>,
    options: RunOptions,
    draws: Draws,
}

impl Session {
    /// The session of some recordings, with the noise that is stated instead of found. Real faults among them do not stop it: they are a result.
    ///
    /// # Errors
    /// [`TwinError::Pipeline`] where they cannot be calibrated, [`TwinError::NoLikelihood`] and [`TwinError::Contacts`] for profiles without
    /// a twin.
    pub fn new(
        inputs: Inputs,
        about: About,
        noise: Option<Noise>,
        mut notes: Vec<Note>,
    ) -> Result<Self, TwinError> {
        let profile = &inputs.robot.profile;
        let file = || inputs.robot.file.clone();
        if profile.solve.method != Method::Ml {
            return Err(TwinError::NoLikelihood { file: file() });
        }
        if !profile.contacts.is_empty() {
            return Err(TwinError::Contacts { file: file() });
        }
        let options = RunOptions {
            force: true,
            ..RunOptions::default()
        };
        let own = estimated(inputs, Vec::new(), &options, None, &mut |_| {})?;
        let Some(fit) = own.solved.fit.as_ref() else {
            let file = own.inputs.robot.file.clone();
            return Err(TwinError::NoLikelihood { file });
        };
        let causes = causes(&own.inputs, fit, &own.checked.findings, None);
        let places = places(&own.inputs);
        let truth = Truth::of(&own, fit, fit.calibration.clone(), &fit.solution.values);
        let promised = errors(&own, fit, &truth, &places);
        let covariance = &fit.solution.information.covariance;
        let solution = &fit.solution;
        let draws = Draws::new(&solution.model, &solution.values, covariance, about);
        let rows = rows(&own.inputs, fit, &mut notes);
        // As the trials are fitted, so that both differ by what is recorded alone.
        let again = estimated_again(rows.clone(), &own);
        let chance = changes::chance(fit);
        let of_estimated = |of| Likeness::of_estimated(of, chance.as_ref());
        let likeness = again.as_ref().and_then(of_estimated);
        Ok(Self {
            likeness: likeness.unwrap_or_else(|| Likeness::of(&own, fit, &causes)),
            noise: noise.unwrap_or_else(|| Noise::found(fit, &own.inputs.robot.model)),
            promised,
            causes,
            chance,
            rows,
            places,
            about,
            notes,
            draws,
            options: RunOptions {
                force: false,
                ..options
            },
            own,
        })
    }

    /// The fit of the recordings themselves.
    #[must_use]
    pub fn fit(&self) -> Option<&MlFit> {
        self.own.solved.fit.as_ref()
    }

    /// The random numbers of a trial.
    #[must_use]
    pub fn numbers(seed: u64, stream: u64) -> ChaCha12Rng {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        rng
    }

    /// Draws a true robot.
    #[must_use]
    pub fn draw(&self, rng: &mut ChaCha12Rng) -> Truth {
        let Some(fit) = self.fit() else {
            // A session has a fit: see `new`.
            return Truth {
                robot: self.own.solved.robot.clone(),
                values: std::collections::BTreeMap::new(),
            };
        };
        let values = self.draws.draw(rng);
        let model = &fit.solution.model;
        let robot = calibration_at(&fit.formulation, model, &values, &self.own.inputs);
        Truth::of(&self.own, fit, robot, &values)
    }

    /// Calibrates recordings as the profile asks for it.
    ///
    /// # Errors
    /// [`PipelineError`] for everything that stops a run.
    pub fn calibrate(&self, inputs: Inputs) -> Result<Estimated, PipelineError> {
        estimated(inputs, Vec::new(), &self.options, None, &mut |_| {})
    }
}

/// Postures of the validation, else of all recordings, evenly over their rows.
fn places(inputs: &Inputs) -> Vec<Vec<f64>> {
    let all = |usage: &dyn Fn(Usage) -> bool| -> Vec<Vec<f64>> {
        let recordings = inputs.recordings.values().filter(|r| usage(r.spec.usage));
        recordings
            .flat_map(|r| r.q.iter().flatten().cloned())
            .collect()
    };
    let mut postures = all(&|usage| usage == Usage::Validation);
    if postures.is_empty() {
        postures = all(&|_| true);
    }
    let step = postures.len().div_ceil(PLACES).max(1);
    postures.into_iter().step_by(step).collect()
}

/// The rows that the fit saw, without what it rejected.
fn rows(inputs: &Inputs, fit: &MlFit, notes: &mut Vec<Note>) -> Inputs {
    let mut rows = inputs.clone();
    rows.findings.clear();
    rows.excluded.clear();
    rows.taken_out.clear();
    let streams: Vec<String> = rows
        .recordings
        .values_mut()
        .filter_map(|loaded| loaded.alignment.take().map(|_| loaded.name.clone()))
        .collect();
    for loaded in rows.recordings.values_mut() {
        if streams.contains(&loaded.name) {
            loaded.velocities.clear();
            loaded.poses.t = None;
        }
    }
    if !streams.is_empty() {
        notes.push(Note::StreamsAsRows {
            recordings: streams,
        });
    }
    // Bodies that were split are two already.
    for body in rows.robot.profile.bodies.values_mut() {
        body.split = None;
    }
    let rejected = left_out(fit);
    for (recording, row, subject) in &rejected {
        let Some(loaded) = rows.recordings.get_mut(recording) else {
            continue;
        };
        let poses = &mut loaded.poses;
        let mut names = vec![subject.clone()];
        if let Some(body) = rows.robot.profile.bodies.get(subject)
            && let BodyKind::Markers { names: own, .. } = &body.kind
        {
            names.extend(own.iter().cloned());
        }
        for name in &names {
            if let Some(seen) = poses.markers.get_mut(name).and_then(|t| t.get_mut(*row)) {
                *seen = None;
            }
            if let Some(seen) = poses.bodies.get_mut(name).and_then(|t| t.get_mut(*row)) {
                *seen = None;
            }
        }
    }
    if !rejected.is_empty() {
        notes.push(Note::RejectedAreGaps {
            count: rejected.len(),
        });
    }
    rows
}
