//! Thresholds of joints that slide: their strokes scale with the robot, angles do not.

use calib_urdf::JointId;

use crate::prepare::inputs::Inputs;

/// A robot of this size, m, has strokes for which a radian's thresholds hold in meters.
const USUAL: f64 = 1.0;

/// Of every joint, by index, what a threshold in rad is multiplied by: 1 where it turns or is as large as usual, m/rad; less where everything that
/// was seen lies closer together than a meter.
pub(crate) fn scales(inputs: &Inputs) -> Vec<f64> {
    let slide = (extent(inputs) / USUAL).clamp(0.0, 1.0);
    let model = &inputs.robot.model;
    let of = |joint: JointId| match model.joint(joint).kind.turns() {
        true => 1.0,
        false => slide,
    };
    model.joint_ids().map(of).collect()
}

/// The longest side of the box of all that was seen, m; infinite where nothing was.
fn extent(inputs: &Inputs) -> f64 {
    let seen = inputs.recordings.values().flat_map(|loaded| {
        let markers = loaded.poses.markers.values().flatten().flatten();
        let bodies = loaded.poses.bodies.values().flatten().flatten();
        markers
            .map(|point| point.coords)
            .chain(bodies.map(|pose| pose.translation.vector))
    });
    let mut ends = [(f64::INFINITY, f64::NEG_INFINITY); 3];
    for place in seen {
        for (end, x) in ends.iter_mut().zip(place.iter()) {
            *end = (end.0.min(*x), end.1.max(*x));
        }
    }
    let longest = ends
        .iter()
        .map(|(low, high)| high - low)
        .fold(0.0, f64::max);
    if longest > 0.0 {
        longest
    } else {
        f64::INFINITY
    }
}
