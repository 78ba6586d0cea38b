//! A gain of a joint that slides and a tracker whose lengths are off by as much look alike: only the lengths of the robot, which are not known as well, tell
//! one from the other.

use calib_core::ParameterKind;
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::BodyKind;

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::Inputs;

/// A gain of this many standard deviations is there.
const CLEAR: f64 = 3.0;
/// Gains of two joints that differ by more than so many are not one scale of all lengths.
const ALIKE: f64 = 4.0;
/// What it moves over the range of the joint, m, from which on it matters.
const MOVES: f64 = 1e-4;

/// The gain of a joint that slides.
struct Gain {
    joint: String,
    value: f64,
    sigma: f64,
}

/// Gains that the tracker's scale would explain as well, where no length is known to the tracker: at most one finding, of the clearest.
pub(crate) fn findings(inputs: &Inputs, fit: &MlFit) -> Option<Finding> {
    let bodies = inputs.robot.profile.bodies.values();
    if bodies.len() == 0 {
        return None;
    }
    let mut stated = bodies.filter_map(|body| match &body.kind {
        BodyKind::Markers { template, .. } => template.as_ref(),
        _ => None,
    });
    if stated.next().is_some() {
        return None;
    }
    let gains = gains(inputs, fit);
    let sureness = |gain: &Gain| (gain.value / gain.sigma).abs();
    let best = gains
        .iter()
        .max_by(|a, b| sureness(a).total_cmp(&sureness(b)))?;
    let agrees =
        |other: &Gain| (other.value - best.value).abs() < ALIKE * other.sigma.hypot(best.sigma);
    if sureness(best) < CLEAR || !gains.iter().all(agrees) {
        return None;
    }
    let model = &inputs.robot.model;
    let law = model.joint(model.joint_id(&best.joint).ok()?).law;
    let (low, high) = inputs.range(law.source)?;
    let moves = (best.value * law.multiplier * (high - low)).abs();
    (moves > MOVES).then(|| {
        Finding::new(catalog::GAIN_OR_SCALE, Subject::joint(&best.joint))
            .with("joint", Fact::name(best.joint.clone()))
            .with("excess", Fact::ratio(best.value))
            .with("sigma", Fact::ratio(best.sigma))
            .with("moves", Fact::meters(moves))
    })
}

fn gains(inputs: &Inputs, fit: &MlFit) -> Vec<Gain> {
    let model = &inputs.robot.model;
    let slides = |name: &str| {
        let mut joints = model.joints().iter();
        joints.any(|joint| joint.name == name && !joint.kind.turns())
    };
    let of = fit.solution.parameters.iter().filter_map(|p| {
        let is_gain = matches!(p.kind, ParameterKind::Effect(kind) if kind.term().class == "gain");
        let joint = p.joint.as_ref().filter(|joint| is_gain && slides(joint))?;
        Some(Gain {
            joint: joint.clone(),
            value: p.value,
            sigma: p.sigma.filter(|sigma| *sigma > 0.0)?,
        })
    });
    of.collect()
}
