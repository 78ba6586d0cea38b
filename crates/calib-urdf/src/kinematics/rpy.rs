//! Fixed-axis X-Y-Z angles (roll, pitch, yaw) of a URDF and rotations, both ways.
//!
//! ```text
//! R = Rz(y) · Ry(p) · Rx(r)                                                                    (1)
//! ```
//!
//! At pitch = ±π/2 only `y ∓ r` is defined, and *near* it r and y each carry the rounding noise
//! divided by cos p, while (1) needs their noises to cancel. Therefore the angles are found one
//! after the other: whatever r comes out first, y and p are then taken from `R · Rx(−r)`, in
//! which r's noise is already contained. The round trip keeps 1e-15 rad at every pitch.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::f64::consts::{PI, TAU};

/// Below this `|cos pitch|`, roll is not in the matrix but only its rounding noise.
const GIMBAL_COS: f64 = 1e-15;

/// What quaternion → matrix → angles → quaternion costs, rad.
const ROUNDING: f64 = 2e-15;

/// The rotation of a URDF's `rpy`, `Rz(yaw) · Ry(pitch) · Rx(roll)`; angles in rad.
#[must_use]
pub fn rotation_from_rpy(rpy: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), rpy.z)
        * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), rpy.y)
        * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), rpy.x)
}

/// Roll, pitch, yaw (rad) of a rotation, pitch in [−π/2, π/2]; roll is 0 where it is undefined.
///
/// [`rotation_from_rpy`] of the result is the given rotation to 1e-15 rad or so, pitch ±π/2 included.
#[must_use]
pub fn rpy_from_rotation(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let matrix = rotation.to_rotation_matrix().into_inner();
    let roll = if matrix[(2, 1)].hypot(matrix[(2, 2)]) < GIMBAL_COS {
        0.0
    } else {
        matrix[(2, 1)].atan2(matrix[(2, 2)])
    };
    with_roll(&matrix, roll)
}

/// The one of the many `rpy` triplets of a rotation that is nearest to `near` (rad).
///
/// (r, p, y) and (r + π, π − p, y + π) are the same rotation, and so is each plus full turns. A
/// reader of a diff expects `1.5708` to become `1.5731`, not `-1.5685` with two other angles jumped by π.
#[must_use]
pub fn rpy_near(rotation: &UnitQuaternion<f64>, near: &Vector3<f64>) -> Vector3<f64> {
    let matrix = rotation.to_rotation_matrix().into_inner();
    // Near pitch ±π/2 many rolls fit within rounding: the text's own is then the one to keep.
    let kept = with_roll(&matrix, near.x).zip_map(near, nearest_turn);
    if angle_between(&rotation_from_rpy(&kept), rotation) <= ROUNDING {
        return kept;
    }
    let roll = matrix[(2, 1)].atan2(matrix[(2, 2)]);
    let mut best = with_roll(&matrix, roll);
    let mut best_distance = f64::INFINITY;
    for branch in [with_roll(&matrix, roll), with_roll(&matrix, roll + PI)] {
        // Full turns are added to the angle, which rounds it: only where the text has them.
        let candidate = branch.zip_map(near, nearest_turn);
        let distance = (candidate - near).norm();
        if distance < best_distance {
            best = candidate;
            best_distance = distance;
        }
    }
    best
}

/// Yaw and pitch from `R · Rx(−roll) = Rz(y) · Ry(p)`.
fn with_roll(matrix: &Matrix3<f64>, roll: f64) -> Vector3<f64> {
    let (s, c) = roll.sin_cos();
    // Second column of R·Rx(−r) = (−sin y, cos y, 0);  third row of it = (−sin p, 0, cos p)
    let minus_sin_yaw = c * matrix[(0, 1)] - s * matrix[(0, 2)];
    let cos_yaw = c * matrix[(1, 1)] - s * matrix[(1, 2)];
    let cos_pitch = s * matrix[(2, 1)] + c * matrix[(2, 2)];
    Vector3::new(
        roll,
        (-matrix[(2, 0)]).atan2(cos_pitch),
        (-minus_sin_yaw).atan2(cos_yaw),
    )
}

fn nearest_turn(angle: f64, near: f64) -> f64 {
    let turns = ((near - angle) / TAU).round();
    if turns == 0.0 {
        angle
    } else {
        angle + turns * TAU
    }
}

/// The angle (rad) between two rotations, precise for small angles: `2·asin(|q_a − q_b| / 2)` each way.
#[must_use]
pub fn angle_between(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    let difference = (a.coords - b.coords)
        .norm()
        .min((a.coords + b.coords).norm());
    4.0 * (0.5 * difference).min(1.0).asin()
}

/// The rotation matrix of `rpy` by hand, eq. (1): a second way for tests and for reading formulas.
#[must_use]
pub fn matrix_from_rpy(rpy: &Vector3<f64>) -> Rotation3<f64> {
    let (sr, cr) = rpy.x.sin_cos();
    let (sp, cp) = rpy.y.sin_cos();
    let (sy, cy) = rpy.z.sin_cos();
    Rotation3::from_matrix_unchecked(Matrix3::new(
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    /// A few roundings of quaternion → matrix → angles → quaternion.
    const ROUND_TRIP: f64 = 4e-15;

    fn assert_round_trip(rpy: Vector3<f64>) {
        let rotation = rotation_from_rpy(&rpy);
        let again = rotation_from_rpy(&rpy_from_rotation(&rotation));
        let error = angle_between(&rotation, &again);
        assert!(error < ROUND_TRIP, "{rpy:?}: {error:e}");
        let near = rpy_near(&rotation, &rpy);
        let error = angle_between(&rotation, &rotation_from_rpy(&near));
        assert!(error < ROUND_TRIP, "near {rpy:?} → {near:?}: {error:e}");
    }

    #[test]
    fn the_product_of_three_turns_is_the_matrix_of_the_standard() {
        for rpy in [[0.1, 0.2, 0.3], [-2.0, 1.4, 3.0], [0.5, FRAC_PI_2, -0.5]] {
            let rpy = Vector3::from(rpy);
            let difference = rotation_from_rpy(&rpy).to_rotation_matrix().into_inner()
                - matrix_from_rpy(&rpy).into_inner();
            assert!(difference.norm() < 1e-15, "{rpy:?}: {difference}");
        }
    }

    #[test]
    fn round_trip_at_and_around_gimbal_lock() {
        for sign in [-1.0, 1.0] {
            for away in [0.0, 1e-16, 1e-14, 1e-12, 1e-9, 1e-8, 3e-8, 1e-6, 1e-3] {
                for (roll, yaw) in [(0.0, 0.0), (0.3, -1.2), (PI, 0.1), (-3.0, 3.1), (1.57, PI)] {
                    assert_round_trip(Vector3::new(roll, sign * (FRAC_PI_2 - away), yaw));
                    assert_round_trip(Vector3::new(roll, sign * (FRAC_PI_2 + away), yaw));
                }
            }
        }
    }

    #[test]
    fn roll_is_zero_where_it_is_undefined_and_kept_where_a_text_has_one() {
        let rotation = rotation_from_rpy(&Vector3::new(0.4, FRAC_PI_2, 0.1));
        assert_eq!(rpy_from_rotation(&rotation).x, 0.0);
        let near = rpy_near(&rotation, &Vector3::new(0.4, FRAC_PI_2, 0.1));
        assert!(
            (near - Vector3::new(0.4, FRAC_PI_2, 0.1)).norm() < 1e-15,
            "{near:?}"
        );
    }

    #[test]
    fn the_near_triplet_stays_on_the_branch_of_the_text() {
        // 1.57081 is just beyond π/2: the plain answer would turn roll and yaw by π.
        let text = Vector3::new(1.57081, 1.57081, 3.13);
        let near = rpy_near(&rotation_from_rpy(&text), &text);
        // cos p = 1.4e-5: roll and yaw alone carry 1e-16 / 1.4e-5.
        assert!((near - text).norm() < 1e-9, "{near:?}");
        assert!((rpy_from_rotation(&rotation_from_rpy(&text)) - text).norm() > 3.0);
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
        #[test]
        fn round_trip_anywhere(r in -7.0..7.0f64, p in -7.0..7.0f64, y in -7.0..7.0f64) {
            assert_round_trip(Vector3::new(r, p, y));
        }
    }
}
