//! Which parameters share the width of a key of `solve.prior`.

use calib_core::{EdgeKind, ParameterId};
use calib_profile::SharedWidth;
use calib_urdf::JointId;

use super::joints::{moves, used_joints};
use crate::formulate::formulation::{Formulation, PriorKind};
use crate::prepare::inputs::Inputs;

/// The widths in use, in the order of the joints. Those that a joint states of its own are not among them, and neither is the origin
/// of a fixed joint: it is a mount, and how far it is off says nothing of machined axes.
pub(super) fn shared(formulation: &Formulation, inputs: &Inputs) -> Vec<PriorKind> {
    let mut kinds: Vec<PriorKind> = Vec::new();
    let joints = used_joints(inputs, &inputs.robot.model).into_iter();
    for (width, parameter) in joints.flat_map(|joint| of_joint(formulation, inputs, joint)) {
        let place = kinds.iter().position(|kind| kind.width == width);
        let place = place.unwrap_or_else(|| {
            kinds.push(PriorKind {
                width,
                parameters: Vec::new(),
            });
            kinds.len() - 1
        });
        kinds[place].parameters.push(parameter);
    }
    kinds
}

fn of_joint(
    formulation: &Formulation,
    inputs: &Inputs,
    joint: JointId,
) -> Vec<(SharedWidth, ParameterId)> {
    let problem = &formulation.problem;
    let edge = formulation.joints[joint.index()].map(|e| &problem.edges()[e.index()].kind);
    let Some(EdgeKind::Joint(edge)) = edge else {
        return Vec::new();
    };
    let slides = !inputs.robot.model.joint(joint).kind.turns();
    let moved = moves(problem, &edge.q);
    let free = inputs.robot.profile.solve.free_set(joint, moved, slides);
    let origin = formulation.origins[joint.index()];
    let of_origin = origin.map(|origin| problem.edge_parameters(origin));
    let of_origin = of_origin
        .into_iter()
        .flatten()
        .filter_map(|(i, parameter)| {
            let width = if i < 3 {
                free.angle_width
            } else {
                free.position_width
            };
            Some((width?, parameter))
        });
    let effects = edge.effects.iter().filter_map(|effect| {
        let mut stated = free.effects.iter();
        let stated = stated.find(|f| *f.effect == *effect.kind.effect())?;
        Some((stated.width?, effect.parameter))
    });
    let held = |p: &ParameterId| problem.parameters()[p.index()].fixed;
    let all = of_origin.chain(effects);
    all.filter(|(_, parameter)| !held(parameter)).collect()
}
