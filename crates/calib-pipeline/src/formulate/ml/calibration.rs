//! The robot that values of the parameters describe.

use calib_core::effect::Source;
use calib_core::{EdgeId, Solution};
use calib_urdf::JointId;
use nalgebra::Isometry3;

use crate::formulate::formulation::Formulation;
use crate::formulate::kinematics::{Calibration, JointEffects};
use crate::formulate::solved::stated_spots;
use crate::prepare::inputs::Inputs;

/// The robot that a solution describes.
pub(crate) fn calibration(
    formulation: &Formulation,
    solution: &Solution,
    inputs: &Inputs,
) -> Calibration {
    calibration_at(formulation, &solution.model, &solution.values, inputs)
}

/// The robot that any values of the parameters describe.
#[must_use]
pub fn calibration_at(
    formulation: &Formulation,
    solved: &calib_core::Model,
    values: &calib_core::Values,
    inputs: &Inputs,
) -> Calibration {
    let model = &inputs.robot.model;
    let pose = |edge: EdgeId| {
        solved
            .edge_pose(edge, values)
            .unwrap_or_else(Isometry3::identity)
    };
    let load = &inputs.robot.profile.load;
    let mut robot = Calibration::nominal(model, load, pose(formulation.root));
    for (moment, parameter) in &formulation.masses {
        robot.masses.add(*moment, values.0[parameter.index()]);
    }
    for joint in model.joint_ids() {
        if let Some(edge) = formulation.origins[joint.index()] {
            robot.model = robot.model.with_origin(joint, pose(edge));
        }
        if let Some(edge) = formulation.joints[joint.index()] {
            robot.effects[joint.index()] = effects(formulation, values, inputs, joint, edge);
        }
    }
    robot.mounts = formulation
        .mounts
        .iter()
        .map(|(name, edge)| (name.clone(), pose(*edge)))
        .collect();
    for (body, points) in &formulation.points {
        let link_from_body = robot
            .mounts
            .get(body)
            .copied()
            .unwrap_or_else(Isometry3::identity);
        let on_link = points.iter().map(|(marker, point)| {
            let p = solved.point_position(point.index(), values);
            (marker.clone(), link_from_body * p)
        });
        robot.points.insert(body.clone(), on_link.collect());
    }
    for (name, point) in &formulation.contact_points {
        let at = solved.point_position(point.index(), values);
        robot.contact_points.insert(name.clone(), at);
    }
    for (name, place) in &formulation.contacts {
        robot.places.insert(name.clone(), pose(*place));
    }
    robot.spots = stated_spots(inputs);
    for (name, spots) in &formulation.spots {
        let of = robot.spots.entry(name.clone()).or_default();
        for (spot, edge) in spots {
            of.insert(spot.clone(), pose(*edge).translation.vector.into());
        }
    }
    robot
}

fn effects(
    formulation: &Formulation,
    values: &calib_core::Values,
    inputs: &Inputs,
    joint: JointId,
    edge: EdgeId,
) -> JointEffects {
    let mut effects = JointEffects::default();
    let calib_core::EdgeKind::Joint(j) = &formulation.problem.edges()[edge.index()].kind else {
        return effects;
    };
    let mut coupled = inputs
        .robot
        .profile
        .solve
        .joints
        .get(&joint)
        .map_or(&[][..], |e| &e.coupled_to)
        .iter();
    for effect in &j.effects {
        let c = values.0[effect.parameter.index()];
        match effect.kind.term().source {
            Source::OtherJoint => {
                if let Some(other) = coupled.next() {
                    effects.coupling.insert(other.index(), c);
                }
            }
            // The clocks belong to the recordings, not to the robot.
            Source::Velocity | Source::Caller => {}
            _ => {
                effects.coefficients.insert(effect.kind, c);
            }
        }
    }
    effects
}
