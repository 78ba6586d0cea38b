//! Before the first recording: postures to record, and a simulation of them.

use calib_urdf::{JointId, RobotModel, doubt};

use crate::robot;

/// Widest range of a joint that is simulated, rad: beyond, cables and cameras are the limit.
const WIDEST: f64 = 2.0;
/// Share of a limited range that is used.
const SHARE: f64 = 0.8;
/// Range of a prismatic joint without limits, m.
const SLIDE: f64 = 0.3;
/// Swept joints: the last of the chain.
const SWEPT: usize = 2;

/// Joints and their ranges.
pub type Ranges = Vec<(JointId, (f64, f64))>;

/// What is to be recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Skeleton {
    /// The last joints of the chain, swept one against the other; a marker near their axes shows where these are.
    pub sweep: Ranges,
    /// All joints that carry a body, rad or m.
    pub random: Ranges,
}

/// Postures for the joints that carry the bodies and whose limits leave a range.
#[must_use]
pub fn skeleton(model: &RobotModel, joints: &[JointId]) -> Skeleton {
    let with_range = joints.iter().filter(|j| !robot::has_no_range(model, **j));
    let random: Ranges = with_range
        .map(|joint| (*joint, range(model, *joint)))
        .collect();
    let turning = random
        .iter()
        .rev()
        .filter(|(j, _)| model.joint(*j).kind.turns());
    let mut sweep: Ranges = turning.take(SWEPT).copied().collect();
    sweep.reverse();
    Skeleton { sweep, random }
}

/// The middle of a joint's limits and of those of the joints that follow it, at most [`WIDEST`] to either side.
fn range(model: &RobotModel, joint: JointId) -> (f64, f64) {
    let in_degrees = doubt::limits_in_degrees(model).contains(&joint);
    let allowed = calib_urdf::range::range(model, joint);
    let joint = model.joint(joint);
    let (low, high) = match (allowed, joint.kind.turns()) {
        (Some((low, high)), true) if in_degrees => (low.to_radians(), high.to_radians()),
        (Some(range), _) => range,
        (None, true) => (-WIDEST, WIDEST),
        (None, false) => (-SLIDE, SLIDE),
    };
    let (middle, mut half) = (0.5 * (low + high), 0.5 * SHARE * (high - low));
    if joint.kind.turns() {
        half = half.min(WIDEST);
    }
    (middle - half, middle + half)
}
