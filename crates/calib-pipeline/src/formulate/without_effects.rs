//! The robot that a URDF alone describes best: the geometry fitted to the same measurements without the joint effects that a
//! URDF cannot hold.
//!
//! The geometry of the full model, used without its effects, is wrong by all of them; fitted without, it takes what it can of
//! their mean. Plain least squares: what is left is missing physics, which a noise level for the joints would swallow.
//!
//! The tracker stays where the full model has it: a frame of its own would be written nowhere, and who uses the URDF has the one that is.

use calib_core::{Settings, solve_kept};
use calib_profile::{Free, JointFree};

use crate::error::PipelineError;
use crate::estimate::start::Start;
use crate::formulate::checked::Checked;
use crate::formulate::formulation::FreeSet;
use crate::formulate::kinematics::Calibration;
use crate::formulate::ml;
use crate::formulate::priors;
use crate::formulate::solved::Solved;
use crate::prepare::inputs::Inputs;

/// The refitted robot; `None` where the URDF holds everything, or with the closed forms.
///
/// # Errors
/// [`PipelineError::Solve`] when the problem cannot be stated so.
pub fn refitted(
    inputs: &Inputs,
    checked: &Checked,
    solved: &Solved,
) -> Result<Option<Calibration>, PipelineError> {
    let Some(fit) = &solved.fit else {
        return Ok(None);
    };
    if solved.robot.urdf_alone().is_none() {
        return Ok(None);
    }
    let inputs = without_effects(inputs);
    let start = Start {
        tracker_from_root: solved.robot.tracker_from_root,
        ..checked.start.clone()
    };
    let mut formulation = ml::state(&inputs, &checked.tracks, &start, FreeSet::Profile);
    priors::take_over(fit, &formulation.widths, &mut formulation.problem);
    let solution = solve_kept(&formulation.problem, &fit.solution, &Settings::plain())?;
    let robot = ml::calibration_at(&formulation, &solution.model, &solution.values, &inputs);
    Ok(Some(Calibration {
        model: robot.urdf_model(),
        effects: vec![Default::default(); robot.effects.len()],
        ..robot
    }))
}

/// The same profile with nothing free that a URDF cannot hold, and the tracker held.
fn without_effects(inputs: &Inputs) -> Inputs {
    let mut inputs = inputs.clone();
    let profile = &mut inputs.robot.profile;
    profile.load.stiffness.clear();
    profile.tracker.from_root = None;
    profile.solve.free.retain(|free| match free {
        Free::Effect(effect) => effect.geometric,
        Free::Masses | Free::Tracker => false,
        _ => true,
    });
    for exception in profile.solve.joints.values_mut() {
        exception.coupled_to.clear();
        exception.outside.clear();
        if let Some(free) = &mut exception.free {
            free.retain(|free| !matches!(free, JointFree::Effect(effect) if !effect.geometric));
        }
    }
    inputs
}
