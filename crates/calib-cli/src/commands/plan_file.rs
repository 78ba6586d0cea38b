//! `plan.yaml` as an argument of commands.

use std::path::Path;

use calib_files::input;
use calib_pipeline::prepare::load::RobotProfile;
use calib_plan::PlanError;
use calib_plan::write::{PlanFile, read};

/// Largest plan, bytes.
const LARGEST: u64 = 64 << 20;

/// Reads a plan of this robot.
pub(super) fn plan_of(path: &Path, robot: &RobotProfile) -> Result<PlanFile, PlanError> {
    let name = path.display().to_string();
    let text = input::read_text(path, LARGEST).map_err(|e| PlanError::NotAPlan {
        file: name.clone(),
        why: e.to_string(),
    })?;
    let plan = read(&text, &name, &robot.model)?;
    if plan.robot != robot.profile.robot {
        return Err(PlanError::OtherRobot {
            file: name,
            planned: plan.robot,
            profile: robot.file.clone(),
            robot: robot.profile.robot.clone(),
        });
    }
    Ok(plan)
}
