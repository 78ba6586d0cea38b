//! A fit that holds every joint of a robot that is not as its URDF says.
//!
//! What the robot's own errors leave then looks like a change while recording, or like a missing effect: whatever a joint does in one part of the
//! recordings more than in another. So the offsets and axes of the joints are freed beside it: where they explain the residuals and nothing changes
//! any longer, that is what is said.

use calib_core::EffectKind;
use calib_finding::{About, Fact, Finding, catalog};
use calib_profile::Free;

use crate::formulate::checked::Checked;
use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::Inputs;
use crate::verify::applied::again;
use crate::verify::causes::Causes;
use crate::verify::changes;
use crate::verify::residuals::residual_rows;

/// With the joints free, this much of the rms residual is left at most.
const LEFT: f64 = 0.7;

/// That no joint is free although freeing them explains what seems to have changed or to be missing.
pub(super) fn unfreed(
    inputs: &Inputs,
    checked: &Checked,
    fit: &MlFit,
    causes: &Causes,
) -> Option<Finding> {
    if frees_a_joint(inputs, fit) || !causes.lacks_effects() {
        return None;
    }
    let mut free = inputs.clone();
    let solve = &mut free.robot.profile.solve;
    let offsets = Free::Effect(EffectKind::ZeroOffset.effect());
    solve.free.extend([Free::JointAxes, offsets]);
    let (free, with_joints) = again(free, checked)?;
    if !with_joints.solution.status.is_converged() {
        return None;
    }
    let rms = |inputs: &Inputs, fit: &MlFit| {
        let rows = residual_rows(inputs, &checked.tracks, &fit.calibration, Some(fit));
        let used = rows.iter().filter(|row| row.used);
        let squares: Vec<f64> = used.map(|row| row.length_m().powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    };
    let (before, after) = (rms(inputs, fit), rms(&free, &with_joints));
    if after > LEFT * before {
        return None;
    }
    let changed = changes::scan(&with_joints, None);
    if changed.is_some_and(|scan| scan.significant().is_some()) {
        return None;
    }
    Some(
        Finding::new(catalog::JOINTS_HELD, About::Fit)
            .with("none", Fact::meters(before))
            .with("best", Fact::meters(after)),
    )
}

/// Whether a number of a joint that moves is free.
fn frees_a_joint(inputs: &Inputs, fit: &MlFit) -> bool {
    let model = &inputs.robot.model;
    let moves = |name: &String| {
        let id = model.joint_id(name);
        id.is_ok_and(|id| model.joint(id).kind.axis().is_some())
    };
    let mut parameters = fit.formulation.problem.parameters().iter();
    parameters.any(|p| !p.fixed && p.joint.as_ref().is_some_and(moves))
}
