//! The closed forms of the origins, and the start of the fit that follows from them where the profile asks for it.

use std::collections::BTreeMap;

use calib_profile::StartFrom;

use crate::error::PipelineError;
use crate::estimate::paper::{self, OriginEstimate};
use crate::formulate::by_closed_forms::paper_result;
use crate::formulate::checked::Checked;
use crate::formulate::kinematics::Calibration;
use crate::prepare::inputs::Inputs;

/// All origins by closed forms. With `start_from: origins` the fit starts at their mounts: bodies whose mount the profile states, and the
/// robot's place where it was measured, stay.
///
/// # Errors
/// As [`paper::origins`].
pub(crate) fn origins(
    inputs: &Inputs,
    checked: &mut Checked,
    nominal: &Calibration,
) -> Result<BTreeMap<String, OriginEstimate>, PipelineError> {
    let Checked {
        findings,
        tracks,
        start,
    } = checked;
    let found = paper::origins(inputs, tracks, start, &inputs.estimators, findings)?;
    let profile = &inputs.robot.profile;
    if profile.solve.start_from == StartFrom::Origins {
        let closed = paper_result(inputs, tracks, start, &found, nominal).robot;
        for (body, mount) in closed.mounts {
            if profile.bodies.get(&body).is_some_and(|b| b.mount.is_none()) {
                start.mounts.insert(body, mount);
            }
        }
        if profile.tracker.from_root.is_none() {
            start.tracker_from_root = closed.tracker_from_root;
        }
    }
    Ok(found)
}
