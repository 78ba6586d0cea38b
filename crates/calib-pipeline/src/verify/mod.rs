//! What a solution is worth: held-out errors, loops, residuals, accuracy over the workspace.

pub(crate) mod accuracy;
pub mod changes;
pub mod closure;
pub mod deviations;
pub mod held_out;
pub mod information;
pub mod invariants;
pub mod known;
pub mod left_out;
pub(crate) mod motions;
pub mod moved;
pub mod residuals;
pub mod robot_changes;

use std::collections::BTreeMap;

use calib_report::HeldOut;

use crate::formulate::kinematics::Calibration;
use crate::formulate::solved::Solved;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;

/// Errors on held-out recordings; without any, on fitted poses that are left out in turn.
#[must_use]
pub fn held_out(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    nominal: &Calibration,
    solved: &Solved,
    refitted: Option<&Calibration>,
) -> Option<HeldOut> {
    let urdf_alone = solved.robot.urdf_alone();
    let robots = held_out::Robots {
        nominal: Some(nominal),
        registered: solved.registered.as_ref(),
        calibrated: &solved.robot,
        urdf_alone: urdf_alone.as_ref(),
        refitted,
    };
    let fit = solved.fit.as_ref();
    held_out::held_out(inputs, tracks, &robots, fit)
        .or_else(|| left_out::left_out(inputs, tracks, &robots, fit?, solved.registration.as_ref()))
}
