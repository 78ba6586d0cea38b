//! The numbers that a text gets for a rotation: as near to the old ones as can be.

use super::decimal::{SAME_NUMBER, same_number, tidy_angle};
use crate::kinematics::rpy::{angle_between, rotation_from_rpy, rpy_near};
use nalgebra::{Quaternion, UnitQuaternion, Vector3, Vector4};

/// The `rpy` of a rotation, as near to the old one as can be.
pub(crate) fn rpy_for(wanted: &UnitQuaternion<f64>, old: [f64; 3]) -> [f64; 3] {
    let old = Vector3::from(old);
    // The rotation decides, not its angles: at pitch ±π/2 they may differ and mean the same.
    if angle_between(&rotation_from_rpy(&old), wanted) <= SAME_NUMBER {
        old.into()
    } else {
        rpy_near(wanted, &old).map(tidy_angle).into()
    }
}

pub(super) fn is_zero(vector: &Vector3<f64>) -> bool {
    vector.iter().all(|x| same_number(*x, 0.0))
}

/// Of ±q, the one nearer to the text; the text itself where it is the same rotation.
pub(super) fn quaternion_near(wanted: &UnitQuaternion<f64>, old: [f64; 4]) -> [f64; 4] {
    let written = Vector4::from(old);
    let current = UnitQuaternion::new_normalize(Quaternion::from(written));
    if angle_between(&current, wanted) <= SAME_NUMBER {
        return old;
    }
    if wanted.coords.dot(&written) < 0.0 {
        (-wanted.coords).into()
    } else {
        wanted.coords.into()
    }
}
