//! `calib simulate`: recordings with known truth for a profile.

use calib_recording::WriteOptions;

use crate::error::PipelineError;
use crate::output::write::OutputFile;
use crate::prepare::load::RobotProfile;

/// The files of a simulation: every recording under its profile path's file name, and `truth.json`.
///
/// # Errors
/// [`PipelineError`] when the profile has no `simulate` section or the tables cannot be written.
pub fn simulate(robot: &RobotProfile, seed: Option<u64>) -> Result<Vec<OutputFile>, PipelineError> {
    let simulated = calib_sim::simulate(&robot.profile, &robot.model, seed).map_err(|source| {
        PipelineError::Simulation {
            file: robot.file.clone(),
            source: Box::new(source),
        }
    })?;
    let mut files = Vec::new();
    for (name, poses) in &simulated.recordings {
        let options = WriteOptions {
            comments: vec![
                format!(
                    "simulated by `calib simulate {}` with seed {}; the truth is in truth.json",
                    robot.file, simulated.truth.seed
                ),
                format!("recording {name} of {}", robot.profile.robot),
            ],
            degrees: true,
            ..WriteOptions::micro()
        };
        let text =
            calib_recording::write_poses(poses, &options).map_err(|e| PipelineError::Usage {
                finding: format!("recording `{name}` cannot be written: {e}"),
                remedy: "use names without commas, quotes and line breaks".to_owned(),
            })?;
        files.push(OutputFile::text(file_name(robot, name), text));
    }
    let mut truth =
        serde_json::to_string_pretty(&simulated.truth).map_err(|e| PipelineError::Usage {
            finding: format!("the truth cannot be written: {e}"),
            remedy: "check the numbers of the `simulate` section".to_owned(),
        })?;
    truth.push('\n');
    files.push(OutputFile::text("truth.json", truth));
    Ok(files)
}

fn file_name(robot: &RobotProfile, recording: &str) -> String {
    let spec = robot.profile.recordings.get(recording);
    let path = spec.map_or_else(|| format!("{recording}.csv"), |s| s.file.clone());
    path.rsplit(['/', '\\']).next().unwrap_or(&path).to_owned()
}
