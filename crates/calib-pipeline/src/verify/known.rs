//! How well each changed number of the URDF is known.

use std::collections::BTreeMap;

use calib_core::Configuration;
use calib_urdf::Joint;
use nalgebra::{Isometry3, Matrix3, Matrix6, Vector3};

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::Inputs;

/// σ of a number, and how much of it the data said.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// Standard deviation, m or rad.
    pub sigma: f64,
    /// 1 − posterior variance / prior variance, in [0, 1]; `None` where there is no prior.
    pub data_share: Option<f64>,
}

/// What is known of every number of every calibrated origin and every added body, by `<joint>.<x|y|z|turn about x|y|z>`
/// or `<body>.<x|y|z|roll|pitch|yaw>` (m, rad).
#[must_use]
pub fn known_numbers(inputs: &Inputs, fit: &MlFit) -> BTreeMap<String, Known> {
    let model = &inputs.robot.model;
    let zero = Configuration::zero();
    let mut known = BTreeMap::new();
    for joint in model.joints() {
        let (Some(parent), Some(child)) = (
            fit.formulation.links[joint.parent.index()],
            fit.formulation.links[joint.child.index()],
        ) else {
            continue;
        };
        let Ok(derived) = fit.solution.relative_pose(parent, child, &zero) else {
            continue;
        };
        let Some(covariance) = derived.covariance else {
            continue;
        };
        let prior = number_variances(&derived.pose, &prior(fit, joint));
        let posterior = number_variances(&derived.pose, &covariance);
        for (k, what) in NUMBERS.into_iter().enumerate() {
            let share = 1.0 - posterior[k] / prior[k];
            known.insert(
                format!("{}.{what}", joint.name),
                Known {
                    sigma: posterior[k].sqrt(),
                    data_share: (prior[k] > 0.0).then(|| share.clamp(0.0, 1.0)),
                },
            );
        }
    }
    for (name, body) in &fit.formulation.bodies {
        let link = inputs.robot.profile.bodies[name].link;
        let Some(link) = fit.formulation.links[link.index()] else {
            continue;
        };
        let derived = fit.solution.relative_pose(link, *body, &zero);
        let Some((pose, covariance)) = derived.ok().and_then(|d| Some((d.pose, d.covariance?)))
        else {
            continue;
        };
        let position = number_variances(&pose, &covariance);
        let mut put = |what: &str, sigma: f64| {
            let known_number = Known {
                sigma,
                data_share: None,
            };
            known.insert(format!("{name}.{what}"), known_number);
        };
        for (k, what) in ["x", "y", "z"].into_iter().enumerate() {
            put(what, position[k].sqrt());
        }
        if let Some(sigmas) = rpy_sigmas(&pose, &covariance.fixed_view::<3, 3>(0, 0).into()) {
            for (what, sigma) in ["roll", "pitch", "yaw"].into_iter().zip(sigmas) {
                put(what, sigma);
            }
        }
    }
    known
}

/// The six numbers of an origin, as the report calls them.
const NUMBERS: [&str; 6] = [
    "x",
    "y",
    "z",
    "turn about x",
    "turn about y",
    "turn about z",
];

/// Variances of a child's place along the parent's axes (m²) and of its turns about its own (rad²).
fn number_variances(pose: &Isometry3<f64>, covariance: &Matrix6<f64>) -> [f64; 6] {
    let r = pose.rotation.to_rotation_matrix();
    let place = r.matrix() * covariance.fixed_view::<3, 3>(3, 3) * r.matrix().transpose();
    let turn = covariance.fixed_view::<3, 3>(0, 0);
    [
        place[(0, 0)],
        place[(1, 1)],
        place[(2, 2)],
        turn[(0, 0)],
        turn[(1, 1)],
        turn[(2, 2)],
    ]
    .map(|v| v.max(0.0))
}

/// What was known of `parent_from_child` at zero before the data, `[ω; v]` of the child: its origin's six numbers, and the
/// zero offset as a turn about the axis.
fn prior(fit: &MlFit, joint: &Joint) -> Matrix6<f64> {
    let variance = |name: &str| {
        fit.formulation
            .problem
            .parameters()
            .iter()
            .find(|p| !p.fixed && p.name == format!("{}.{name}", joint.name))
            .map_or(0.0, |p| p.scale().powi(2))
    };
    let mut prior = Matrix6::zeros();
    for (k, what) in ["rx", "ry", "rz", "x", "y", "z"].into_iter().enumerate() {
        prior[(k, k)] = variance(&format!("origin.{what}"));
    }
    if let Some(axis) = joint.kind.axis() {
        let along = axis.into_inner() * axis.transpose() * variance("offset");
        let turns = joint.kind.turns();
        let at = if turns { 0 } else { 3 };
        let mut block = prior.fixed_view_mut::<3, 3>(at, at);
        block += along;
    }
    prior
}

/// σ of roll, pitch and yaw from the covariance of the turn about the child's axes; `None` near pitch ±90°, where the
/// angles say nothing.
fn rpy_sigmas(pose: &Isometry3<f64>, covariance: &Matrix3<f64>) -> Option<[f64; 3]> {
    /// Within 1° of ±90° roll and yaw are the same turn.
    const LOCKED: f64 = 0.017;
    let (roll, pitch, _) = pose.rotation.euler_angles();
    if pitch.cos() < LOCKED {
        return None;
    }
    // ω_child = E · d(roll, pitch, yaw)    with R = Rz(yaw)·Ry(pitch)·Rx(roll)
    let e = Matrix3::from_columns(&[
        Vector3::x(),
        Vector3::new(0.0, roll.cos(), -roll.sin()),
        Vector3::new(
            -pitch.sin(),
            roll.sin() * pitch.cos(),
            roll.cos() * pitch.cos(),
        ),
    ]);
    let inverse = e.try_inverse()?;
    let of_angles = inverse * covariance * inverse.transpose();
    Some([0, 1, 2].map(|k| of_angles[(k, k)].max(0.0).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    #[test]
    fn sigmas_of_angles_are_those_of_small_turns() {
        // Against differences: turn a pose a little about each axis and read the angles.
        let pose = Isometry3::from_parts(
            nalgebra::Translation3::identity(),
            UnitQuaternion::from_euler_angles(0.4, -0.9, 2.1),
        );
        /// Turn of the differences: small against 1, large against rounding (rad).
        const STEP: f64 = 1e-6;
        let columns: Vec<Vector3<f64>> = [Vector3::x(), Vector3::y(), Vector3::z()]
            .into_iter()
            .map(|axis| {
                let turned = |by: f64| {
                    let q = pose.rotation * UnitQuaternion::new(axis * by);
                    let (r, p, y) = q.euler_angles();
                    Vector3::new(r, p, y)
                };
                (turned(STEP) - turned(-STEP)) / (2.0 * STEP)
            })
            .collect();
        let d = Matrix3::from_columns(&columns);
        let covariance = Matrix3::from_diagonal(&Vector3::new(1e-6, 4e-6, 9e-6));
        let expected = d * covariance * d.transpose();
        let found = rpy_sigmas(&pose, &covariance).expect("not near 90°");
        for k in 0..3 {
            assert!(
                (found[k] / expected[(k, k)].sqrt() - 1.0).abs() < 1e-6,
                "{k}"
            );
        }
        let locked = Isometry3::from_parts(
            nalgebra::Translation3::identity(),
            UnitQuaternion::from_euler_angles(0.0, std::f64::consts::FRAC_PI_2, 0.0),
        );
        assert_eq!(rpy_sigmas(&locked, &covariance), None);
    }
}
