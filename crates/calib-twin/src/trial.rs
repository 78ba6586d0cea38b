//! One trial: a true robot is drawn, recorded and calibrated, and the result is compared with it.

use calib_core::{EffectKind, Moved, Physics};
use calib_finding::catalog;
use calib_pipeline::estimated::{Estimated, estimated_again};
use calib_pipeline::formulate::formulation::MlFit;
use calib_pipeline::verify::causes::{Causes, causes};
use serde::{Deserialize, Serialize};

use crate::fault::Fault;
use crate::likeness::Likeness;
use crate::quantity::{Off, errors};
use crate::replay::Replay;
use crate::session::Session;

/// The outcome of a trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// Its number, from 0.
    pub number: u64,
    /// Whether it was calibrated as a run does it, from the data checks to the choice of the noise; else with the statement that the session's own
    /// calibration chose.
    pub whole: bool,
    /// Why it has no result: the message of the pipeline.
    pub refused: Option<String>,
    /// The result.
    pub done: Option<Done>,
}

/// What a trial found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Done {
    /// Whether the minimization converged.
    pub converged: bool,
    /// Errors.
    pub off: Vec<Off>,
    /// Numbers of the residuals.
    pub likeness: Likeness,
    /// Tests for effects that are not there.
    pub tests: Vec<Tested>,
    /// Whether something was named as wrong: a missing effect, a change.
    pub alarm: bool,
}

/// The test for one effect, in a trial without it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tested {
    /// Its name, as in the report.
    pub name: String,
    /// ĉ of the test.
    pub estimate: f64,
    /// z over ĉ: one coefficient is so many σ.
    pub per_sigma: f64,
    /// Share of χ² that the effect would remove over ĉ².
    pub explains: f64,
    /// Mean square of what the effect moves, in units of the noise, over ĉ².
    #[serde(default)]
    pub moves: f64,
}

/// A trial with something wrong.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Injected {
    /// Its number, from 0.
    pub number: u64,
    /// What was wrong: the name of a test, or a body.
    pub what: String,
    /// How large, SI.
    pub size: f64,
    /// Whether the calibration names it.
    pub named: bool,
    /// Whether it says that something is wrong.
    pub noticed: bool,
}

/// One trial of so many is calibrated as a run does it. What the others leave out, the checks and the choice of the noise, takes most of a run, and
/// finds in clean data of the same robot what it found in the session.
const WHOLE: u64 = 10;

impl Session {
    /// One trial without a fault, every tenth of them whole. `scale`: the noise times this.
    #[must_use]
    pub fn trial(&self, seed: u64, number: u64, scale: f64) -> Trial {
        let mut rng = Self::numbers(seed, number);
        let truth = self.draw(&mut rng);
        let noise = self.noise.clone().times(scale);
        let replay = Replay {
            inputs: &self.rows,
            tracks: &self.own.checked.tracks,
            robot: &truth.robot,
            noise: &noise,
            fault: None,
        };
        let recordings = replay.recordings(&mut rng);
        // Of other noise the priors are another part.
        let chance = self.chance.as_ref().filter(|_| scale == 1.0);
        let again = estimated_again(recordings.clone(), &self.own);
        let whole = again.is_none() || number.is_multiple_of(WHOLE);
        // Whole trials are compared with the recording as all others are.
        let likeness = again
            .as_ref()
            .filter(|_| whole)
            .and_then(|of| Likeness::of_estimated(of, chance));
        let again = again.filter(|_| !whole);
        let mut trial = Trial {
            number,
            whole,
            refused: None,
            done: None,
        };
        let of = match again.map_or_else(|| self.calibrate(recordings), Ok) {
            Ok(of) => of,
            Err(why) => {
                trial.refused = Some(why.to_string());
                return trial;
            }
        };
        if let Some(fit) = &of.solved.fit {
            let known = chance.filter(|_| !whole);
            let causes = causes(&of.inputs, fit, &of.checked.findings, known);
            trial.done = Some(Done {
                converged: fit.solution.status.is_converged(),
                off: errors(&of, fit, &truth, &self.places),
                likeness: likeness.unwrap_or_else(|| Likeness::of(&of, fit, &causes)),
                tests: tests(&causes),
                alarm: is_alarm(&of, &causes),
            });
        }
        trial
    }

    /// A trial with a fault, named `what` of this size.
    #[must_use]
    pub fn injected(&self, seed: u64, number: u64, of: (&Fault, &str, f64)) -> Injected {
        /// Streams of random numbers of the trials without faults.
        const TRIALS: u64 = 1 << 32;
        let (fault, what, size) = of;
        let mut rng = Self::numbers(seed, TRIALS + number);
        let truth = self.draw(&mut rng);
        let replay = Replay {
            inputs: &self.rows,
            tracks: &self.own.checked.tracks,
            robot: &truth.robot,
            noise: &self.noise,
            fault: Some(fault),
        };
        let recordings = replay.recordings(&mut rng);
        // An effect of a joint may be taken for noise; a slip is looked for in the residuals of the session's own statement.
        let again = matches!(fault, Fault::Slip { .. })
            .then(|| estimated_again(recordings.clone(), &self.own))
            .flatten();
        let known = again.as_ref().and(self.chance.as_ref());
        let of = again.map_or_else(|| self.calibrate(recordings), Ok);
        let (named, noticed) = match of {
            // What stops a run is noticed, and not by its name.
            Err(_) => (false, true),
            Ok(of) => of.solved.fit.as_ref().map_or((false, true), |fit| {
                let causes = causes(&of.inputs, fit, &of.checked.findings, known);
                let named = is_named(fault, what, fit, &causes);
                (named, named || is_alarm(&of, &causes))
            }),
        };
        Injected {
            number,
            what: what.to_owned(),
            size,
            named,
            noticed,
        }
    }
}

/// The tests of joint effects.
fn tests(causes: &Causes) -> Vec<Tested> {
    let tests = causes.goodness.iter().flat_map(|g| &g.tests);
    let of_joints = tests.filter(|t| matches!(t.physics, Physics::Effect(_)) && t.joint.is_some());
    let of = |t: &calib_core::ScoreTest| {
        let estimate = t.estimate.abs();
        let told = estimate > 0.0 && t.z2 > 0.0 && t.z2.is_finite() && estimate.is_finite();
        told.then(|| Tested {
            name: t.name.clone(),
            estimate: t.estimate,
            per_sigma: t.z2.sqrt() / estimate,
            explains: t.explains / (estimate * estimate),
            moves: t.moves / (estimate * estimate),
        })
    };
    let mut all: Vec<Tested> = of_joints.filter_map(of).collect();
    all.sort_by(|a, b| a.name.cmp(&b.name));
    all
}

/// Whether a run would name something that is wrong with robot or recordings.
fn is_alarm(of: &Estimated, causes: &Causes) -> bool {
    let missing = causes
        .goodness
        .as_ref()
        .is_some_and(|g| !g.missing.is_empty());
    let suspected = of.checked.findings.iter().any(|f| {
        let suspects = [catalog::JOINT_GAIN, catalog::JOINT_COUPLING];
        suspects.contains(&f.id) && !causes.explained.contains(f)
    });
    missing || suspected || causes.change.is_some()
}

/// Whether the causes hold the fault, by its name or as something that is as likely.
fn is_named(fault: &Fault, what: &str, fit: &MlFit, causes: &Causes) -> bool {
    match fault {
        Fault::Effect { kind, .. } => {
            let missing = causes.goodness.iter().flat_map(|g| &g.missing);
            let mut held = missing.map(|t| t.name.as_str());
            let mut alike = causes.alike.iter().flat_map(|(_, also)| also.iter());
            held.any(|name| is_same(name, what, *kind)) || alike.any(|name| name == what)
        }
        Fault::Slip { body, .. } => {
            let frame = fit.formulation.bodies.get(body).copied();
            let moved = causes.changed.as_ref().map(|c| c.moved);
            match (moved, frame) {
                (Some(Moved::Body(moved)), Some(frame)) => moved == frame,
                // Markers without a frame are points of their link.
                (Some(Moved::Body(_)), None) => true,
                _ => false,
            }
        }
    }
}

/// The name itself, or the other part of the same eccentricity.
fn is_same(name: &str, what: &str, kind: EffectKind) -> bool {
    let stem = |name: &str| name.rsplit_once('_').map(|(stem, _)| stem.to_owned());
    name == what || (kind.effect().terms.len() == 2 && stem(name) == stem(what))
}
