//! One joint whose values are later than those of the others: what the fit is asked for, and what is said of it.

use std::collections::{BTreeMap, BTreeSet};

use calib_core::EffectKind;
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::Usage;
use calib_urdf::RobotModel;

use crate::formulate::formulation::Formulation;
use crate::prepare::aligned::SAME_TIME;
use crate::prepare::inputs::{Inputs, Loaded};

/// Offers the latency of every joint to the test for missing physics; where one joint alone moves it is the offset of the clock.
pub(super) fn add_latencies(formulation: &mut Formulation, inputs: &Inputs) {
    let moves = |speed: &Option<f64>| speed.is_some_and(|speed| speed != 0.0);
    let fitted = || {
        let all = inputs.recordings.values();
        all.filter(|loaded| loaded.spec.usage != Usage::Validation)
    };
    let moving: BTreeSet<&String> = fitted()
        .flat_map(|loaded| &loaded.velocities)
        .filter(|(_, speeds)| speeds.iter().any(moves))
        .map(|(joint, _)| joint)
        .collect();
    for joint in moving.iter().filter(|_| moving.len() > 1) {
        let id = inputs.robot.model.joint_id(joint).ok();
        let Some(edge) = id.and_then(|id| formulation.joints[id.index()]) else {
            continue;
        };
        let speeds = speeds(inputs, formulation, joint);
        let problem = &mut formulation.problem;
        problem.candidate(edge, EffectKind::Latency, speeds);
    }
}

/// The speed of a joint in every sample; 0 where it is not known.
pub(crate) fn speeds(inputs: &Inputs, formulation: &Formulation, joint: &str) -> Vec<f64> {
    let speed = |(recording, row): &(String, usize)| -> f64 {
        let loaded = inputs.recordings.get(recording);
        let speeds = loaded.and_then(|loaded| loaded.velocities.get(joint));
        let speed = speeds.and_then(|speeds| speeds.get(*row).copied().flatten());
        speed.unwrap_or(0.0)
    };
    formulation.samples.iter().map(speed).collect()
}

/// A finding with a joint whose values are later by `seconds` than was stated, and with what is to be stated instead.
pub(crate) fn with_late_joint(
    finding: Finding,
    inputs: &Inputs,
    joint: &str,
    seconds: f64,
) -> Finding {
    let stated = stated(inputs, joint);
    finding
        .with("joint", Fact::name(joint))
        .with("late", Fact::seconds(stated.unwrap_or(0.0) + seconds))
        .with_some("stated", stated.map(Fact::seconds))
}

/// The same of joints that are late together; without what is to be stated where the profile states different times for them.
pub(crate) fn with_late_joints(
    finding: Finding,
    inputs: &Inputs,
    joints: &[&str],
    seconds: f64,
) -> Finding {
    let first = joints.first().map(|joint| stated(inputs, joint));
    let alike = joints.iter().all(|j| Some(stated(inputs, j)) == first);
    let stated = first.filter(|_| alike);
    let late = stated.map(|stated| stated.unwrap_or(0.0) + seconds);
    finding
        .with("joints", Fact::names(joints.iter().copied()))
        .with_some("late", late.map(Fact::seconds))
        .with_some("stated", stated.flatten().map(Fact::seconds))
}

/// By how much the profile says that a joint is late, s.
fn stated(inputs: &Inputs, joint: &str) -> Option<f64> {
    let id = inputs.robot.model.joint_id(joint).ok()?;
    let timings = inputs.recordings.values();
    let mut timings = timings.filter_map(|r| r.spec.timing.as_ref());
    timings.find_map(|timing| timing.late.get(&id).copied())
}

/// The only joint that moves in a recording.
fn only_mover(loaded: &Loaded, model: &RobotModel) -> Option<String> {
    /// Readings of a joint that stands stay within this, rad or m.
    fn rests(turns: bool) -> f64 {
        if turns { 0.05 } else { 0.005 }
    }
    let range = |values: &[Option<f64>]| {
        let values = || values.iter().flatten().copied();
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    let mut moving = loaded.poses.joints.iter().filter(|(joint, values)| {
        let id = model.joint_id(joint);
        id.is_ok_and(|id| range(values) > rests(model.joint(id).kind.turns()))
    });
    let (joint, _) = moving.next()?;
    moving.next().is_none().then(|| joint.clone())
}

/// A recording in which one joint alone moves has another lag than those in which it does not move alone: the lag may be the joint's.
pub(super) fn of_one_joint(
    inputs: &Inputs,
    lags: &BTreeMap<&str, (f64, f64)>,
    name: &str,
) -> Option<Finding> {
    let model = &inputs.robot.model;
    let joint = only_mover(inputs.recordings.get(name)?, model)?;
    let is_other = |other: &&str| {
        let loaded = inputs.recordings.get(*other);
        loaded.is_some_and(|loaded| only_mover(loaded, model).as_ref() != Some(&joint))
    };
    let others = lags.iter().filter(|(other, _)| is_other(other));
    let mut others: Vec<(f64, f64)> = others.map(|(_, lag)| *lag).collect();
    others.sort_by(|a, b| a.0.total_cmp(&b.0));
    let &(usual, usual_sigma) = others.get(others.len() / 2)?;
    let &(lag, sigma) = lags.get(name)?;
    let late = lag - usual;
    if late.abs() <= SAME_TIME.max(4.0 * sigma.hypot(usual_sigma)) {
        return None;
    }
    let kind = match late > 0.0 {
        true => "sweep_behind",
        false => "sweep_ahead",
    };
    let timed = inputs
        .recordings
        .values()
        .filter(|r| !r.velocities.is_empty());
    let subject = Subject::joint(&joint).in_recording(name);
    let finding = Finding::of_kind(catalog::CLOCK_LAG, kind, subject)
        .with("recording", Fact::name(name))
        .with("offset", Fact::seconds(late.abs()))
        .with("sigma", Fact::seconds(sigma.hypot(usual_sigma)))
        .with("recordings", Fact::names(timed.map(|r| &r.name)));
    Some(with_late_joint(finding, inputs, &joint, late))
}
