//! What a joint reading alone does not say: from which side each joint came, and which torques were measured.

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::Load;
use calib_urdf::RobotModel;

use crate::prepare::inputs::{Inputs, Loaded};

/// A joint that moves less than this from one row to the next keeps its direction of approach, rad or m.
pub(crate) const STILL: f64 = 1e-5;

/// The circumstances of one row. The default knows nothing: every joint in the middle of its backlash, loads by gravity.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Conditions {
    /// Direction in which each joint moved last, by joint index: +1, −1, or 0 where nothing tells.
    pub approach: Vec<f64>,
    /// Measured torque that each joint holds about its axis, N m, by joint index; `None`: gravity loads it.
    pub torque: Option<Vec<f64>>,
}

impl Conditions {
    /// Direction of approach of one joint.
    #[must_use]
    pub fn approach_of(&self, joint: usize) -> f64 {
        self.approach.get(joint).copied().unwrap_or(0.0)
    }
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
pub fn conditions(loaded: &Loaded, model: &RobotModel, load: Load) -> Vec<Conditions> {
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
        });
    }
    out
}
