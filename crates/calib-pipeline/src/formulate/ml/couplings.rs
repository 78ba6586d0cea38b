//! Shares of other joints' motion, offered to the test for missing physics.

use calib_core::EffectKind;
use calib_urdf::JointId;

use super::joints::{Row, moves};
use crate::formulate::formulation::Formulation;
use crate::prepare::inputs::Inputs;

/// Declares every joint's share in the motion of every other one on its chain that the recordings move, whether they turn or slide, unless the profile frees it.
pub(super) fn coupling_candidates(
    formulation: &mut Formulation,
    inputs: &Inputs,
    rows: &[Row<'_>],
) {
    let model = &inputs.robot.model;
    let readings = |joint: JointId| -> Vec<f64> {
        rows.iter()
            .map(|row| model.position(row.q, joint))
            .collect()
    };
    let edge = |formulation: &Formulation, joint: JointId| formulation.joints[joint.index()];
    let driven: Vec<(JointId, Vec<f64>)> = model
        .independent_joints()
        .filter(|joint| edge(formulation, *joint).is_some())
        .map(|joint| (joint, readings(joint)))
        .filter(|(_, readings)| moves(&formulation.problem, readings))
        .collect();
    let bodies = inputs.robot.profile.bodies.values();
    let chain = |link| {
        model
            .chain(model.root(), link)
            .iter()
            .map(|s| s.joint)
            .collect()
    };
    let chains: Vec<Vec<JointId>> = bodies.map(|body| chain(body.link)).collect();
    for (joint, _) in &driven {
        let Some(edge) = edge(formulation, *joint) else {
            continue;
        };
        let stated = inputs.robot.profile.solve.joints.get(joint);
        let stated = stated.map_or(&[][..], |exception| &exception.coupled_to);
        for (other, readings) in &driven {
            let apart = !chains
                .iter()
                .any(|c| c.contains(joint) && c.contains(other));
            if joint == other || apart || stated.contains(other) {
                continue;
            }
            let (own, that) = (&model.joint(*joint).name, &model.joint(*other).name);
            let name = format!("{own}.coupling.{that}");
            let problem = &mut formulation.problem;
            problem.shared_candidate(edge, EffectKind::Coupling, name, readings.clone());
        }
    }
}
