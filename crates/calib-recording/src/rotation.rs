//! Rotations from written numbers, which must be rotations but for rounding.

use crate::error::{At, Placed, Problem};
use calib_geometry::so3;
use nalgebra::{Matrix3, Quaternion, Unit, UnitQuaternion, Vector3};

/// How far the length of a quaternion or of an axis may be from 1. Four written decimals (NDI) give 1e-4; swapped or scaled columns give tenths.
pub(crate) const UNIT_TOLERANCE: f64 = 5e-3;

/// How far a written rotation matrix may be from orthonormal: three decimals are rounded to 5e-4.
const MATRIX_TOLERANCE: f64 = 5e-3;

/// A unit quaternion from its parts `[x, y, z, w]`.
pub(crate) fn quaternion(
    at: At,
    body: &str,
    [x, y, z, w]: [f64; 4],
) -> Placed<UnitQuaternion<f64>> {
    let q = Quaternion::new(w, x, y, z);
    unit(at, body, "quaternion", q.norm())?;
    Ok(UnitQuaternion::from_quaternion(q))
}

/// The rotation nearest to a written matrix, if it is one but for rounding; a mirrored one is refused.
pub(crate) fn from_matrix(
    at: At,
    body: &str,
    matrix: &Matrix3<f64>,
) -> Placed<UnitQuaternion<f64>> {
    let departure = (matrix.transpose() * matrix - Matrix3::identity())
        .abs()
        .max();
    let determinant = matrix.determinant();
    let nearest = (departure <= MATRIX_TOLERANCE && determinant > 0.0)
        .then(|| so3::nearest_rotation(matrix))
        .flatten();
    nearest.ok_or_else(|| {
        let body = body.to_string();
        (
            at,
            Problem::NotRotation {
                body,
                determinant,
                departure,
                tolerance: MATRIX_TOLERANCE,
            },
        )
    })
}

/// The rotation by an angle, rad, about an axis of length 1, which may be missing (zeros) where nothing is turned.
pub(crate) fn axis_angle(
    at: At,
    body: &str,
    axis: Vector3<f64>,
    angle: f64,
) -> Placed<UnitQuaternion<f64>> {
    if angle == 0.0 && axis == Vector3::zeros() {
        return Ok(UnitQuaternion::identity());
    }
    unit(at, body, "axis of rotation", axis.norm())?;
    Ok(UnitQuaternion::from_axis_angle(
        &Unit::new_normalize(axis),
        angle,
    ))
}

/// Refuses what has another length than 1.
fn unit(at: At, body: &str, what: &'static str, norm: f64) -> Placed<()> {
    if norm.is_nan() || (norm - 1.0).abs() > UNIT_TOLERANCE {
        return Err((
            at,
            Problem::NotUnit {
                body: body.to_string(),
                what,
                norm,
                tolerance: UNIT_TOLERANCE,
            },
        ));
    }
    Ok(())
}
