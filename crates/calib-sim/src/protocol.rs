//! The commanded joint positions of a recording.

use std::iter::repeat;

use calib_profile::Protocol;
use calib_urdf::RobotModel;
use calib_urdf::range::resting_positions;
use rand::RngExt;
use rand_chacha::ChaCha12Rng;

/// Commanded poses in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Commanded {
    /// Joint positions per pose, indexed by joint id, rad or m.
    pub q: Vec<Vec<f64>>,
    /// Group text per pose; empty without groups.
    pub groups: Vec<String>,
    /// What the tracker's noise is multiplied by, per pose.
    pub tracker_noise_times: Vec<f64>,
}

/// Expands a protocol: the grid or the random poses, repeated at each value of the repeated joint. Joints that it does not name stand as near to
/// 0 as their limits allow.
pub fn commanded_poses(
    protocol: &Protocol,
    model: &RobotModel,
    rng: &mut ChaCha12Rng,
) -> Commanded {
    let mut base = resting_positions(model);
    for (joint, value) in &protocol.hold {
        base[joint.index()] = *value;
    }
    let mut poses = vec![base];
    for (joint, steps) in &protocol.grid {
        let values: Vec<f64> = (0..steps.poses)
            .map(|i| {
                steps.from + (steps.to - steps.from) * i as f64 / (steps.poses.max(2) - 1) as f64
            })
            .collect();
        poses = poses
            .iter()
            .flat_map(|q| {
                values.iter().map(|value| {
                    let mut q = q.clone();
                    q[joint.index()] = *value;
                    q
                })
            })
            .collect();
    }
    if !protocol.random.is_empty() {
        let base = poses[0].clone();
        poses = (0..protocol.poses)
            .map(|_| {
                let mut q = base.clone();
                for (joint, (low, high)) in &protocol.random {
                    q[joint.index()] = low + (high - low) * rng.random::<f64>();
                }
                q
            })
            .collect();
    }
    let Some((joint, values)) = &protocol.repeat_at else {
        let times = protocol.tracker_noise_times.first().unwrap_or(&1.0);
        return Commanded {
            tracker_noise_times: vec![*times; poses.len()],
            q: poses,
            groups: Vec::new(),
        };
    };
    let mut repeated = Commanded {
        q: Vec::new(),
        groups: Vec::new(),
        tracker_noise_times: Vec::new(),
    };
    let robot_joint = model.joint(*joint);
    let times = protocol.tracker_noise_times.iter().chain(repeat(&1.0));
    for (i, (value, times)) in values.iter().zip(times).enumerate() {
        let shown = if robot_joint.kind.turns() {
            format!("{:.0} deg", value.to_degrees())
        } else {
            format!("{:.0} mm", value * 1e3)
        };
        for q in &poses {
            let mut q = q.clone();
            q[joint.index()] = *value;
            repeated.q.push(q);
            repeated.tracker_noise_times.push(*times);
            repeated
                .groups
                .push(format!("{}: {} {shown}", i + 1, robot_joint.name));
        }
    }
    repeated
}
