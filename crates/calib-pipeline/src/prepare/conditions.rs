//! What a joint reading alone does not say: from which side each joint came, which torques were measured, and how warm it was.

use calib_core::effect::{Effect, Source};
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::Load;
use calib_recording::WHOLE_ROBOT;
use calib_urdf::JointId;

use crate::prepare::inputs::{Inputs, Loaded, RobotProfile};

/// A joint that moves less than this from one row to the next keeps its direction of approach, rad or m.
pub(crate) const STILL: f64 = 1e-5;

/// The circumstances of one row. The default knows nothing: every joint in the middle of its backlash, loads by gravity.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Conditions {
    /// Direction in which each joint moved last, by joint index: +1, −1, or 0 where nothing tells.
    pub approach: Vec<f64>,
    /// Measured torque that each joint holds about its axis, N m, by joint index; `None`: gravity loads it.
    pub torque: Option<Vec<f64>>,
    /// Temperature of the link before each joint above that at which the nominal lengths hold, K, by joint index; empty: none.
    pub warmth: Vec<f64>,
}

impl Conditions {
    /// How much warmer than the reference the link before a joint is, K.
    #[must_use]
    pub fn warmth_of(&self, joint: usize) -> f64 {
        self.warmth.get(joint).copied().unwrap_or(0.0)
    }

    /// Direction of approach of one joint.
    #[must_use]
    pub fn approach_of(&self, joint: usize) -> f64 {
        self.approach.get(joint).copied().unwrap_or(0.0)
    }
}

/// Joints whose growth is free, in recordings without a temperature of theirs.
#[must_use]
pub fn missing_temperatures(inputs: &Inputs) -> Vec<Finding> {
    let robot = &inputs.robot;
    let grows = |joint: &JointId| {
        let set = robot.profile.solve.free_set(*joint, true, false);
        let by_temperature = |e: &Effect| e.terms.iter().any(|t| t.source == Source::Temperature);
        set.effects.iter().any(|free| by_temperature(free.effect))
    };
    let growing: Vec<JointId> = robot.model.independent_joints().filter(grows).collect();
    let mut findings = Vec::new();
    for (name, loaded) in &inputs.recordings {
        let of = &loaded.poses.temperatures;
        let measured = |joint: &str| {
            let own = of.get(joint).or_else(|| of.get(WHOLE_ROBOT));
            own.is_some_and(|column| column.iter().any(Option::is_some))
        };
        let joints = growing.iter().map(|j| robot.model.joint(*j).name.as_str());
        let without: Vec<&str> = joints.filter(|j| !measured(j)).collect();
        if !without.is_empty() {
            findings.push(
                Finding::new(catalog::TEMPERATURE_MISSING, Subject::recording(name))
                    .with("joints", Fact::names(without)),
            );
        }
    }
    findings
}

/// Joints that moved in a recording whose load is to be measured, and was not.
#[must_use]
pub fn missing_torques(inputs: &Inputs) -> Vec<Finding> {
    if inputs.robot.profile.solve.load != Load::Measured {
        return Vec::new();
    }
    let mut findings = Vec::new();
    for (name, loaded) in &inputs.recordings {
        let recorded = loaded.poses.joints.keys();
        let without: Vec<&str> = recorded
            .filter(|j| !loaded.poses.torques.contains_key(*j))
            .map(String::as_str)
            .collect();
        if !without.is_empty() {
            findings.push(
                Finding::new(catalog::TORQUE_MISSING, Subject::recording(name))
                    .with("joints", Fact::names(without)),
            );
        }
    }
    findings
}

/// Circumstances of every row of a recording, whose rows are taken in the order in which they were recorded.
#[must_use]
pub fn conditions(loaded: &Loaded, robot: &RobotProfile, load: Load) -> Vec<Conditions> {
    let model = &robot.model;
    let warmth = warmth(loaded, robot);
    let n = model.joints().len();
    let known = |joint| loaded.starts.get(&joint).copied().unwrap_or(0.0);
    let mut approach: Vec<f64> = (0..n).map(known).collect();
    let mut before: Option<&Vec<f64>> = None;
    let mut out = Vec::with_capacity(loaded.q.len());
    for (row, q) in loaded.q.iter().enumerate() {
        if let (Some(q), Some(before)) = (q, before) {
            for (direction, (now, then)) in approach.iter_mut().zip(q.iter().zip(before)) {
                if (now - then).abs() > STILL {
                    *direction = (now - then).signum();
                }
            }
        }
        if let Some(q) = q {
            before = Some(q);
        }
        let torque = (load == Load::Measured).then(|| {
            let mut torque = vec![0.0; n];
            for (joint, column) in &loaded.poses.torques {
                if let (Ok(id), Some(Some(value))) = (model.joint_id(joint), column.get(row)) {
                    torque[id.index()] = *value;
                }
            }
            torque
        });
        out.push(Conditions {
            approach: approach.clone(),
            torque,
            warmth: warmth.get(row).cloned().unwrap_or_default(),
        });
    }
    out
}

/// Warmth of every row by joint; empty where the recording has no temperature. Temperatures change slowly: a cell that is empty has
/// that of the last one before it, or of the first.
fn warmth(loaded: &Loaded, robot: &RobotProfile) -> Vec<Vec<f64>> {
    let temperatures = &loaded.poses.temperatures;
    if temperatures.is_empty() {
        return Vec::new();
    }
    let reference = robot.profile.load.reference_temperature_c;
    let mut out = vec![vec![0.0; robot.model.joints().len()]; loaded.q.len()];
    for (index, joint) in robot.model.joints().iter().enumerate() {
        let source = &robot.model.joint(joint.law.source).name;
        let names = [joint.name.as_str(), source, WHOLE_ROBOT];
        let Some(column) = names.iter().find_map(|name| temperatures.get(*name)) else {
            continue;
        };
        let Some(mut last) = column.iter().flatten().next().copied() else {
            continue;
        };
        for (row, celsius) in out.iter_mut().zip(column) {
            last = celsius.unwrap_or(last);
            row[index] = last - reference;
        }
    }
    out
}
