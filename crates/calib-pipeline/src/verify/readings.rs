//! Do the readings of a joint scatter while the joint is at rest?
//!
//! Where a joint stands over several rows, q − q̄ of its rest is what its readings err by if they scatter, and 0 if the joint moves as they say. As an
//! effect of the joint this has the coefficient −1 in the first case. Backlash looks alike: a reading that errs upwards seems to have been approached
//! from below.

use calib_core::{Contest, EdgeId, EffectKind, Suspect};
use calib_finding::{Fact, Finding, Subject, catalog};

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::Inputs;

/// A joint rests while its readings stay within this, rad; thrice σ of what scatters widely on either side.
const AT_REST: f64 = 0.03;
/// The same of joints that slide, m per rad.
const SLIDING: f64 = 0.1;
/// Rows of a rest at the least.
const ROWS: usize = 4;
/// Rows at rest at the least, of all rests.
const IN_ALL: usize = 12;
/// Less scatter harms nothing, rad.
const LEAST: f64 = 1e-4;
/// Share of χ² that the scatter explains at least.
const RELEVANT: f64 = 0.02;
/// A suspect of which the scatter explains more than this part is no cause of its own.
pub(super) const OWN: f64 = 0.5;
/// What the coefficient is where readings scatter and the joint stands.
const COEFFICIENT: std::ops::Range<f64> = -1.4..-0.6;

/// A joint whose readings vary while it rests.
struct Jitter {
    /// Its number in the robot model.
    number: usize,
    joint: EdgeId,
    /// q − q̄ of the rest in each sample, rad or m.
    values: Vec<f64>,
    /// Standard deviation, rad or m.
    sigma: f64,
}

/// A joint whose readings scatter.
pub struct Scattered {
    /// The joint, and by how much.
    pub finding: Finding,
    /// Whether each suspect explains something beside it.
    pub holds: Vec<bool>,
}

/// The joint whose readings scatter while it is at rest, beside suspects. `chance`: of one false name.
#[must_use]
pub fn scattered_readings(
    inputs: &Inputs,
    fit: &MlFit,
    suspects: &[Suspect<'_>],
    chance: f64,
) -> Option<Scattered> {
    let jitters: Vec<Jitter> = (0..inputs.robot.model.joints().len())
        .filter_map(|number| jitter(inputs, fit, number))
        .collect();
    if jitters.is_empty() {
        return None;
    }
    let others = suspects.len();
    let all: Vec<Suspect<'_>> = suspects
        .iter()
        .cloned()
        .chain(jitters.iter().map(Jitter::suspect))
        .collect();
    let borders = fit.formulation.borders();
    let contest = fit.solution.contest(&all, None, &borders)?;
    let least = contest.threshold(chance, 1);
    let found = (others..all.len())
        .filter(|k| scatters(&contest, *k, others, least))
        .max_by(|a, b| contest.explains(&[*a]).total_cmp(&contest.explains(&[*b])))?;
    let holds = |k: usize| {
        let beside = contest.score(k, &[found]).0;
        beside > least.max(OWN * contest.score(k, &[]).0)
    };
    Some(Scattered {
        finding: jitters[found - others].finding(inputs),
        holds: (0..others).map(holds).collect(),
    })
}

/// Whether the readings of a suspect scatter: alone, and beside each other suspect.
fn scatters(contest: &Contest, own: usize, others: usize, least: f64) -> bool {
    let beside = |k: usize| contest.score(own, &[k]).0 > least;
    COEFFICIENT.contains(&contest.estimate(own))
        && contest.explains(&[own]) > RELEVANT
        && contest.score(own, &[]).0 > least
        && (0..others).all(beside)
}

fn jitter(inputs: &Inputs, fit: &MlFit, number: usize) -> Option<Jitter> {
    let joint = fit.formulation.joints[number]?;
    let model = &inputs.robot.model;
    let own = &model.joints()[number];
    let unit = if own.kind.turns() { 1.0 } else { SLIDING };
    let id = model.joint_id(&own.name).ok()?;
    let samples = &fit.formulation.samples;
    let readings: Vec<Option<f64>> = samples
        .iter()
        .map(|(recording, row)| {
            let q = inputs.recordings[recording].q[*row].as_ref()?;
            Some(model.position(q, id))
        })
        .collect();
    let mut values = vec![0.0; samples.len()];
    let (mut rows, mut rests, mut squares) = (0, 0, 0.0);
    let mut first = 0;
    while first < samples.len() {
        let end = end_of_rest(samples, &readings, first, AT_REST * unit);
        let q: Vec<f64> = readings[first..end].iter().flatten().copied().collect();
        if q.len() >= ROWS {
            let mean = q.iter().sum::<f64>() / q.len() as f64;
            for (value, q) in values[first..end].iter_mut().zip(&readings[first..end]) {
                *value = q.map_or(0.0, |q| q - mean);
                squares += *value * *value;
            }
            rows += q.len();
            rests += 1;
        }
        first = end;
    }
    let sigma = (squares / (rows - rests).max(1) as f64).sqrt();
    (rows >= IN_ALL && sigma > LEAST * unit).then_some(Jitter {
        number,
        joint,
        values,
        sigma,
    })
}

/// One past the last sample of the rest that begins at `first`.
fn end_of_rest(
    samples: &[(String, usize)],
    readings: &[Option<f64>],
    first: usize,
    range: f64,
) -> usize {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut end = first;
    while end < samples.len() && samples[end].0 == samples[first].0 {
        let q = readings[end].into_iter();
        let (l, h) = q.fold((low, high), |(l, h), q| (l.min(q), h.max(q)));
        if h - l > range && end > first {
            break;
        }
        (low, high) = (l, h);
        end += 1;
    }
    end
}

impl Jitter {
    fn suspect(&self) -> Suspect<'_> {
        Suspect::Effect {
            // Turns the joint by the value.
            kind: EffectKind::Backlash,
            joints: vec![(self.joint, self.values.clone())],
        }
    }

    fn finding(&self, inputs: &Inputs) -> Finding {
        let joint = &inputs.robot.model.joints()[self.number];
        let sigma = match joint.kind.turns() {
            true => Fact::radians(self.sigma),
            false => Fact::meters(self.sigma),
        };
        let subject = Subject::joint(joint.name.clone());
        Finding::of_kind(catalog::JOINT_SCATTERS, "readings", subject)
            .with("joint", Fact::name(joint.name.clone()))
            .with("sigma", sigma)
    }
}
