//! How well each changed number of the URDF is known.

use std::collections::BTreeMap;

use calib_core::{Configuration, EdgeKind, EffectKind, ParameterId};
use calib_urdf::{Joint, JointId};
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

/// A number of the patched URDF.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Number {
    /// Of a joint's origin: x, y, z (m), rotation about x, y, z (rad).
    Origin(JointId, usize),
    /// Of a body's mount: x, y, z (m), roll, pitch, yaw (rad).
    Mount(String, usize),
}

/// What is known of every number of every calibrated origin and every added body.
#[must_use]
pub fn known_numbers(inputs: &Inputs, fit: &MlFit) -> BTreeMap<Number, Known> {
    let model = &inputs.robot.model;
    let zero = Configuration::zero();
    let mut known = BTreeMap::new();
    for id in model.joint_ids() {
        let joint = model.joint(id);
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
        let prior = number_variances(&derived.pose, &prior(fit, id, joint));
        let posterior = number_variances(&derived.pose, &covariance);
        for k in 0..6 {
            let share = 1.0 - posterior[k] / prior[k];
            known.insert(
                Number::Origin(id, k),
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
        let mut put = |k: usize, sigma: f64| {
            let known_number = Known {
                sigma,
                data_share: None,
            };
            known.insert(Number::Mount(name.clone(), k), known_number);
        };
        for (k, variance) in position.iter().enumerate().take(3) {
            put(k, variance.sqrt());
        }
        if let Some(sigmas) = rpy_sigmas(&pose, &covariance.fixed_view::<3, 3>(0, 0).into()) {
            for (k, sigma) in (3..).zip(sigmas) {
                put(k, sigma);
            }
        }
    }
    known.extend(points(inputs, fit));
    known
}

/// σ of the coordinates of points without orientation, which are parameters of their own.
fn points(inputs: &Inputs, fit: &MlFit) -> BTreeMap<Number, Known> {
    let formulation = &fit.formulation;
    let of_bodies = formulation.points.iter();
    let of_bodies = of_bodies.filter(|(body, _)| !formulation.bodies.contains_key(*body));
    let of_bodies = of_bodies.flat_map(|(body, markers)| {
        let one = markers.len() == 1;
        let named = move |marker: &String| if one { body } else { marker }.clone();
        let ids = markers.iter();
        ids.map(move |(marker, id)| (named(marker), *id))
    });
    let touching = inputs.robot.profile.points.keys();
    let touching = touching.filter_map(|name| {
        let id = formulation.contact_points.get(name)?;
        Some((name.clone(), *id))
    });
    let mut known = BTreeMap::new();
    for (name, id) in of_bodies.chain(touching) {
        let coordinates = formulation.problem.points()[id.index()].parameters;
        for (k, parameter) in coordinates.into_iter().flatten().enumerate() {
            let found = &fit.solution.parameters[parameter.index()];
            if let Some(sigma) = found.sigma {
                let number = Known {
                    sigma,
                    data_share: None,
                };
                known.insert(Number::Mount(name.clone(), k), number);
            }
        }
    }
    known
}

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
/// zero offset as a rotation about the axis.
fn prior(fit: &MlFit, id: JointId, joint: &Joint) -> Matrix6<f64> {
    let problem = &fit.formulation.problem;
    let variance = |parameter: ParameterId| {
        let p = &problem.parameters()[parameter.index()];
        if p.fixed { 0.0 } else { p.scale().powi(2) }
    };
    let mut prior = Matrix6::zeros();
    if let Some(edge) = fit.formulation.origins[id.index()] {
        for (k, parameter) in problem.edge_parameters(edge) {
            prior[(k, k)] = variance(parameter);
        }
        if let EdgeKind::Unknown(origin) = &problem.edges()[edge.index()].kind {
            // From the axes of the chart to those of the child.
            let q = origin.chart.child_from_chart().to_rotation_matrix();
            let mut turned = Matrix6::zeros();
            for at in [0, 3] {
                let block = q.matrix() * prior.fixed_view::<3, 3>(at, at) * q.matrix().transpose();
                turned.fixed_view_mut::<3, 3>(at, at).copy_from(&block);
            }
            prior = turned;
        }
    }
    let offset = fit.formulation.joints[id.index()].and_then(|edge| {
        let EdgeKind::Joint(moving) = &problem.edges()[edge.index()].kind else {
            return None;
        };
        let effects = moving.effects.iter();
        let mut offsets = effects.filter(|e| e.kind == EffectKind::ZeroOffset);
        Some(variance(offsets.next()?.parameter))
    });
    if let Some(axis) = joint.kind.axis() {
        let along = axis.into_inner() * axis.transpose() * offset.unwrap_or(0.0);
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
