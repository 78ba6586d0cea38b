//! The numbers of an origin as they are written.

use calib_urdf::rpy::{rotation_from_rpy, rpy_from_rotation};
use nalgebra::{Isometry3, Translation3, Vector3};

/// Numbers of a written origin end at nine decimals, m and rad: a thousandth of a micrometer is below any tracker.
const PER_UNIT: f64 = 1e9;

/// An origin as it is written: numbers that did not change by half of the last keep their value, the others have nine decimals.
pub(super) fn written(old: Option<&Isometry3<f64>>, new: &Isometry3<f64>) -> Isometry3<f64> {
    let old = old.map(numbers);
    let new = numbers(new);
    let number = |k: usize| match &old {
        Some(old) if (new[k] - old[k]).abs() <= 0.5 / PER_UNIT => old[k],
        _ => (new[k] * PER_UNIT).round() / PER_UNIT,
    };
    Isometry3::from_parts(
        Translation3::new(number(0), number(1), number(2)),
        rotation_from_rpy(&Vector3::new(number(3), number(4), number(5))),
    )
}

/// x, y, z, roll, pitch, yaw; m and rad.
pub(super) fn numbers(pose: &Isometry3<f64>) -> [f64; 6] {
    let t = pose.translation.vector;
    let rpy = rpy_from_rotation(&pose.rotation);
    [t.x, t.y, t.z, rpy[0], rpy[1], rpy[2]]
}
