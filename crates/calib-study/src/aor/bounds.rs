//! Cramér–Rao bounds that the estimators' crate does not have: an axis from poses, a frame in the tracker.
//!
//! The axis from the poses of one body, joint angles unknown:
//!
//! ```text
//! T_i = W Rz(θ_i) Y,  T̃_i = T_i exp(ξ_i),  ξ ~ N(0, diag(σ_r² I, σ_t² I))
//! dξ_i = Ad((Rz(θ_i) Y)⁻¹) dW + Ad(Y⁻¹) dY + Ad(Y⁻¹) ẑ dθ_i                                      (1)
//! ```
//!
//! Each θ_i is eliminated from its own pose; of dW the turn about z and the shift along z, of dY the turn about z do nothing that the
//! others cannot: nine unknowns are left.

use calib_geometry::se3;
use nalgebra::{Isometry3, Matrix6, SMatrix, Translation3, Unit, UnitQuaternion, Vector3, Vector6};

/// Over `[direction; point]` in the tracker's frame, at `point`. `world_from_body`: true poses on the hinge.
///
/// `None` where the poses do not fix the axis or a noise level is not positive.
pub(crate) fn hinge_poses(
    world_from_body: &[Isometry3<f64>],
    axis: &Unit<Vector3<f64>>,
    point: &Vector3<f64>,
    sigma_t: f64,
    sigma_r: f64,
) -> Option<Matrix6<f64>> {
    if !(sigma_t > 0.0 && sigma_r > 0.0) {
        return None;
    }
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), axis)?;
    let hinge = Isometry3::from_parts(Translation3::from(*point), turn);
    let first = world_from_body.first()?;
    let y = hinge.inverse() * first;
    let of_y = se3::adjoint(&y.inverse());
    let mut weight = Matrix6::identity() / (sigma_t * sigma_t);
    for k in 0..3 {
        weight[(k, k)] = 1.0 / (sigma_r * sigma_r);
    }
    let of_angle: Vector6<f64> = of_y.column(2).into();
    let seen = weight * of_angle;
    let without_angle = weight - seen * seen.transpose() / of_angle.dot(&seen);
    let mut information = SMatrix::<f64, 9, 9>::zeros();
    for pose in world_from_body {
        let of_w = se3::adjoint(&(pose.inverse() * hinge));
        let mut j = SMatrix::<f64, 6, 9>::zeros();
        for (column, of) in [0, 1, 3, 4].into_iter().enumerate() {
            j.set_column(column, &of_w.column(of));
        }
        for (column, of) in [0, 1, 3, 4, 5].into_iter().enumerate() {
            j.set_column(4 + column, &of_y.column(of));
        }
        information += j.transpose() * without_angle * j;
    }
    // Angles and lengths differ by decades: scale before judging and inverting.
    let scale = information
        .diagonal()
        .map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
    let scaled = SMatrix::<f64, 9, 9>::from_fn(|i, k| information[(i, k)] * scale[i] * scale[k]);
    let inverse = scaled.cholesky()?.inverse();
    let of_axis = SMatrix::<f64, 4, 4>::from_fn(|i, k| inverse[(i, k)] * scale[i] * scale[k]);
    // dn = R (ω × ẑ) = R (ω_y, −ω_x, 0);  dp = R (v_x, v_y, 0)
    let r = turn.to_rotation_matrix().into_inner();
    let mut out = SMatrix::<f64, 6, 4>::zeros();
    for row in 0..3 {
        out[(row, 0)] = -r[(row, 1)];
        out[(row, 1)] = r[(row, 0)];
        out[(3 + row, 2)] = r[(row, 0)];
        out[(3 + row, 3)] = r[(row, 1)];
    }
    Some(out * of_axis * out.transpose())
}

/// The frame of a joint from poses `W A_i Y` with known turns A_i, over `[ω; v]` of W = world_from_joint and of
/// Y = joint_from_body, both perturbed on the right.
///
/// ```text
/// dξ_i = Ad((A_i Y)⁻¹) dW + dY
/// ```
pub(crate) fn frame(
    turns: &[UnitQuaternion<f64>],
    joint_from_body: &Isometry3<f64>,
    sigma_t: f64,
    sigma_r: f64,
) -> Option<SMatrix<f64, 12, 12>> {
    if !(sigma_t > 0.0 && sigma_r > 0.0) {
        return None;
    }
    // Scaled unknowns: angles by σ_r, lengths by σ_t.
    let scale = |k: usize| if k % 6 < 3 { sigma_r } else { sigma_t };
    let mut information = SMatrix::<f64, 12, 12>::zeros();
    for turn in turns {
        let of_w = se3::adjoint(&(turn * joint_from_body).inverse());
        let mut j = SMatrix::<f64, 6, 12>::zeros();
        for row in 0..6 {
            for column in 0..6 {
                j[(row, column)] = of_w[(row, column)] * scale(column) / scale(row);
            }
            j[(row, 6 + row)] = 1.0;
        }
        information += j.transpose() * j;
    }
    let c = information.cholesky()?.inverse();
    Some(SMatrix::from_fn(|i, k| c[(i, k)] * scale(i) * scale(k)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aor::method::{POINT, arm, axis, turned};
    use crate::motion::steps;

    fn poses(radius: f64) -> Vec<Isometry3<f64>> {
        steps(0.0, 120.0, 10)
            .map(|a| {
                let turn = turned(a);
                Isometry3::from_parts((POINT + turn * arm(radius)).into(), turn)
            })
            .collect()
    }

    /// Far noisier positions leave the direction to the orientations: two axes across, seen in the body and in the world.
    #[test]
    fn without_positions_only_orientations_count() {
        let poses = poses(0.1);
        let sigma_r = 0.01;
        let bound = hinge_poses(&poses, &axis(), &POINT, 1e3, sigma_r).expect("a bound");
        // Unknown: axis in world and in body, 2 + 2. Each pose tells R a_child = a_parent across the axis.
        let mut information = SMatrix::<f64, 4, 4>::zeros();
        for angle in steps(0.0, 120.0, 10) {
            let (s, c) = angle.sin_cos();
            let j = SMatrix::<f64, 2, 4>::new(c, -s, 1.0, 0.0, s, c, 0.0, 1.0);
            information += j.transpose() * j / (sigma_r * sigma_r);
        }
        let by_hand = information.try_inverse().expect("two axes");
        let expected = by_hand[(0, 0)] + by_hand[(1, 1)];
        let got = bound.fixed_view::<3, 3>(0, 0).trace();
        assert!((got / expected - 1.0).abs() < 1e-6, "{got} {expected}");
    }

    /// Useless orientations leave what one marker on its circle knows.
    #[test]
    fn without_orientations_it_is_the_circle() {
        let poses = poses(0.1);
        let bound = hinge_poses(&poses, &axis(), &POINT, 1e-3, 1e4).expect("a bound");
        let track: Vec<_> = poses.iter().map(|p| p.translation.vector.into()).collect();
        let line = crate::aor::method::truth();
        let circle = calib_aor::bounds::common_line(&[track], &line, 1e-3).expect("a bound");
        for first in [0, 3] {
            let got = bound.fixed_view::<3, 3>(first, first).trace();
            let expected = circle.fixed_view::<3, 3>(first, first).trace();
            assert!((got / expected - 1.0).abs() < 1e-3, "{got} {expected}");
        }
    }

    /// The body's part is the bound of the estimators' crate.
    #[test]
    fn the_frame_in_the_body_is_known() {
        let axes = calib_aor::FrameAxes::default();
        let body_from_joint =
            Isometry3::new(Vector3::new(0.0, -0.1, 0.0), Vector3::new(-0.9, 0.3, 0.5));
        let mut angles = Vec::new();
        for p in steps(-45.0, 135.0, 6) {
            for d in steps(-45.0, 80.0, 6) {
                angles.push((p, d));
            }
        }
        let turns: Vec<_> = angles.iter().map(|(p, d)| axes.turned(*p, *d)).collect();
        let y = body_from_joint.inverse();
        let ours = frame(&turns, &y, 1e-3, 0.01).expect("a bound");
        let ad = se3::adjoint(&y);
        let of_y: Matrix6<f64> = ours.fixed_view::<6, 6>(6, 6).into();
        let in_body = ad * of_y * ad.transpose();
        let theirs = calib_aor::bounds::frame(axes, &angles, &body_from_joint, 1e-3, 0.01);
        let difference = (in_body - theirs.expect("a bound")).norm() / in_body.norm();
        assert!(difference < 1e-9, "{difference}");
    }
}
