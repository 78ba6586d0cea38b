//! Joints that follow another one by a ratio that the URDF states and nobody measured.
//!
//! A wrong ratio looks like a wrong length: a finger whose last joint turns 0.9 times as far as the one before reaches the same points with a longer
//! link, to within the noise. The fit takes the ratio as exact, and states how well it knows the length under that condition. Here the ratio is freed, with
//! a prior as wide as couplings of real hands are off, and everything is fitted again: what changes then is said.

use std::collections::BTreeMap;

use calib_core::{EffectKind, ParameterEstimate, ParameterKind, Physics, ScoreTest, Settings};
use calib_finding::{Fact, Finding, Severity, Subject, Unit, catalog};
use calib_report::RobotChange;
use calib_urdf::{JointId, RobotModel};
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use crate::formulate::checked::Checked;
use crate::formulate::formulation::{FreeSet, MlFit};
use crate::formulate::ml;
use crate::prepare::inputs::Inputs;
use crate::verify::information::data_information;
use crate::verify::robot_changes::robot_changes;

/// Prior σ of a ratio, as a share of it: tendons and linkages of hands.
const WIDE: f64 = 0.25;
/// Chance that any ratio of a robot is called another though all are right.
const CHANCE: f64 = 0.01;
/// A ratio this many standard deviations from the stated one refutes the URDF: lengths and zeros that were fitted with it are not those of the robot.
const REFUTED: f64 = 5.0;
/// A standard deviation that grows by this factor was one of a condition, and so was a number that changes by as many of them.
const WIDER: f64 = 3.0;
/// Changes that matter, m and rad.
const MATTERS: (f64, f64) = (1e-4, 1e-3);

/// What ratios that nobody measured do to the robot's numbers.
#[derive(Debug, Default)]
pub struct Ratios {
    /// One finding for each joint whose ratio the numbers depend on.
    pub findings: Vec<Finding>,
    /// σ with the ratios free, by the number's name, where the σ of the fit holds only for the stated ratios: m or rad.
    pub sigmas: BTreeMap<String, f64>,
}

/// Fits the ratios that the fit held. `missing`: effects of joints that the model lacks; where a compliance explains the errors nearly as
/// well, a ratio is no cause that is named before it.
pub(super) fn ratios(
    inputs: &Inputs,
    checked: &Checked,
    fit: &MlFit,
    missing: &[ScoreTest],
) -> Ratios {
    let followers = followers(inputs, fit);
    if followers.is_empty() {
        return Ratios::default();
    }
    let before = changes(inputs, fit);
    let Some((wide, freed)) = with_ratios(inputs, checked, &followers) else {
        return Ratios::default();
    };
    let after = changes(&wide, &freed);
    let model = &inputs.robot.model;
    // Gain, coupling and eccentricity of a joint that follows are what a wrong ratio looks like.
    let yields = |test: &&ScoreTest| matches!(test.physics, Physics::Effect(kind) if kind.term().class == "torque_compliance");
    let of_effects = missing.iter().filter(yields).map(|test| test.z2);
    let of_effects = of_effects.fold(0.0, f64::max);
    let clear = clear(followers.len()).max((BEYOND_EFFECTS * of_effects).sqrt());
    let of_joint = |joint: &JointId| {
        let found = of_follower(model, *joint, (&freed, clear), (&before, &after));
        found.or_else(|| alone(inputs, *joint, (&freed, clear)))
    };
    let wider = before.iter().filter_map(|b| {
        let sigma = after.iter().find(|a| a.name == b.name)?.sigma?;
        (sigma > WIDER * b.sigma?).then(|| (b.name.clone(), sigma))
    });
    Ratios {
        findings: followers.iter().filter_map(of_joint).collect(),
        sigmas: wider.collect(),
    }
}

/// A ratio is named beside missing effects where its z² is that of any of them this many times.
const BEYOND_EFFECTS: f64 = 2.0;

/// How many standard deviations from the stated one make a ratio another, where so many are asked.
fn clear(ratios: usize) -> f64 {
    let of_one = ChiSquared::new(1.0).ok();
    let limit = of_one.map(|d| d.inverse_cdf(1.0 - CHANCE / ratios.max(1) as f64));
    limit.map_or(REFUTED, f64::sqrt)
}

/// Joints that mimic another, have no readings of their own, and whose ratio the fit holds.
fn followers(inputs: &Inputs, fit: &MlFit) -> Vec<JointId> {
    let model = &inputs.robot.model;
    let read = |name: &String| {
        inputs
            .recordings
            .values()
            .any(|r| r.poses.joints.contains_key(name))
    };
    let follows = |joint: &JointId| {
        let joint = model.joint(*joint);
        joint.mimic.is_some()
            && !read(&joint.name)
            && gain_of(&fit.solution.parameters, &joint.name).is_none()
    };
    model.joint_ids().filter(follows).collect()
}

fn gain_of<'p>(parameters: &'p [ParameterEstimate], joint: &str) -> Option<&'p ParameterEstimate> {
    let is_gain = |p: &&ParameterEstimate| is_gain(&p.kind) && p.joint.as_deref() == Some(joint);
    parameters.iter().find(is_gain)
}

fn is_gain(kind: &ParameterKind) -> bool {
    matches!(kind, ParameterKind::Effect(kind) if kind.term().class == "gain")
}

fn changes(inputs: &Inputs, fit: &MlFit) -> Vec<RobotChange> {
    robot_changes(inputs, fit, &data_information(inputs, fit))
}

/// The fit with the ratios free.
fn with_ratios(
    inputs: &Inputs,
    checked: &Checked,
    followers: &[JointId],
) -> Option<(Inputs, MlFit)> {
    let mut inputs = inputs.clone();
    let model = &inputs.robot.model;
    let solve = &mut inputs.robot.profile.solve;
    let gain = EffectKind::Gain.effect();
    for joint in followers {
        let free = solve.free_with(*joint, !model.joint(*joint).kind.turns(), gain);
        solve.joints.entry(*joint).or_default().free = Some(free);
    }
    let mut settings = Settings::default();
    settings.robust.enabled = inputs.robot.profile.solve.robust;
    let mut stated = ml::state(&inputs, &checked.tracks, &checked.start, FreeSet::Profile);
    let name = |joint: &JointId| inputs.robot.model.joint(*joint).name.as_str();
    let of_followers = |joint: Option<&str>| followers.iter().any(|f| Some(name(f)) == joint);
    let widths: Vec<_> = stated
        .widths
        .iter()
        .flat_map(|kind| kind.parameters.clone())
        .collect();
    for id in widths {
        let parameter = stated.problem.parameter_mut(id);
        if is_gain(&parameter.kind) && of_followers(parameter.joint.as_deref()) {
            parameter.prior_sigma = Some(WIDE);
        }
    }
    let fit = ml::fit(stated, &inputs, &settings).ok()?;
    Some((inputs, fit))
}

/// A joint whose ratio is another one, where no other number depends on it: what slides is as far off as its ratio says.
fn alone(inputs: &Inputs, joint: JointId, (freed, clear): (&MlFit, f64)) -> Option<Finding> {
    let model = &inputs.robot.model;
    let joint = model.joint(joint);
    let mimic = joint.mimic?;
    let gain = gain_of(&freed.solution.parameters, &joint.name)?;
    let sigma = gain.sigma?;
    let (low, high) = inputs.range(joint.law.source)?;
    let (least, unit) = match joint.kind.turns() {
        true => (MATTERS.1, Unit::Radian),
        false => (MATTERS.0, Unit::Meter),
    };
    let size = (gain.value * joint.law.multiplier * (high - low)).abs();
    if !(gain.value.abs() > REFUTED.max(clear) * sigma && size > least) {
        return None;
    }
    Some(
        Finding::of_kind(catalog::MIMIC_RATIO, "alone", Subject::joint(&joint.name))
            .with_severity(Severity::Error)
            .with("joint", Fact::name(&joint.name))
            .with("source", Fact::name(&model.joint(mimic.joint).name))
            .with("stated", Fact::ratio(mimic.multiplier))
            .with("ratio", Fact::ratio(mimic.multiplier * (1.0 + gain.value)))
            .with("sigma", Fact::ratio(mimic.multiplier.abs() * sigma))
            .with("size", Fact::number(size, unit)),
    )
}

/// What is to be said of one joint.
fn of_follower(
    model: &RobotModel,
    joint: JointId,
    (freed, clear): (&MlFit, f64),
    (before, after): (&[RobotChange], &[RobotChange]),
) -> Option<Finding> {
    let joint = model.joint(joint);
    let mimic = joint.mimic?;
    let source = &model.joint(mimic.joint).name;
    let gain = gain_of(&freed.solution.parameters, &joint.name)?;
    let sigma = gain.sigma?;
    let about = |name: &str| {
        name.split('.')
            .any(|part| part == joint.name || part == *source)
    };
    let both = before.iter().filter(|b| about(&b.name)).filter_map(|b| {
        let a = after.iter().find(|a| a.name == b.name)?;
        Some((b, a, b.sigma.filter(|s| *s > 0.0)?, a.sigma?))
    });
    let matters = |unit: Unit, size: f64| {
        let least = if unit == Unit::Meter {
            MATTERS.0
        } else {
            MATTERS.1
        };
        size.abs() > least
    };
    let both: Vec<_> = both.collect();
    let is_another = gain.value.abs() > clear * sigma;
    let moved = both
        .iter()
        .map(|&(b, a, stated, now)| ((a.value - b.value).abs() / stated, (b, a, stated, now)));
    let moved = moved
        .filter(|(by, (b, a, ..))| is_another && *by > WIDER && matters(b.unit, a.value - b.value));
    let moved = moved.max_by(|x, y| x.0.total_cmp(&y.0));
    let wider = both
        .iter()
        .map(|&(b, a, stated, now)| (now / stated, (b, a, stated, now)));
    // A number that the priors of the robot decide besides is no claim.
    let wider =
        wider.filter(|(by, (b, .., now))| b.measured && *by > WIDER && matters(b.unit, *now));
    let wider = wider.max_by(|x, y| x.0.total_cmp(&y.0));
    let (kind, (b, a, stated, now)) = match (moved, wider) {
        (Some((_, found)), _) => ("another", found),
        (None, Some((_, found))) => ("taken", found),
        (None, None) => return None,
    };
    let finding = Finding::of_kind(catalog::MIMIC_RATIO, kind, Subject::joint(&joint.name));
    let finding = match kind == "another" && gain.value.abs() > REFUTED * sigma {
        true => finding.with_severity(Severity::Error),
        false => finding,
    };
    Some(
        finding
            .with("joint", Fact::name(&joint.name))
            .with("source", Fact::name(source))
            .with("stated", Fact::ratio(mimic.multiplier))
            .with("ratio", Fact::ratio(mimic.multiplier * (1.0 + gain.value)))
            .with("sigma", Fact::ratio(mimic.multiplier.abs() * sigma))
            .with("quantity", Fact::name(&b.text))
            .with("before", Fact::number(b.value, b.unit))
            .with("before_sigma", Fact::number(stated, b.unit))
            .with("value", Fact::number(a.value, b.unit))
            .with("value_sigma", Fact::number(now, b.unit)),
    )
}
