//! The recordings of a proposal as tables of poses, by the same code that a run reads them with: clocks brought together, holds found.

use std::path::PathBuf;

use calib_pipeline::error::{DataProblem, PipelineError};
use calib_pipeline::prepare::align::align;
use calib_pipeline::prepare::inputs::{RobotProfile, Written};
use calib_pipeline::prepare::loads::Masses;
use calib_pipeline::prepare::timelines::{with_robot_log, with_robot_rows};
use calib_recording::{Filled, Poses};
use calib_urdf::RobotModel;

use crate::error::InitError;
use crate::proposal::Proposal;
use crate::session::Draft;
use crate::source::Source;
use crate::write;

/// A proposal as the pipeline takes it: its text is read and checked as a profile.
///
/// # Errors
/// [`InitError::Profile`] where a name in the files is not one that a profile may have.
pub fn robot_profile(model: &RobotModel, proposal: &Proposal) -> Result<RobotProfile, InitError> {
    let text = write::profile(model, proposal);
    let file = "profile.yaml";
    let raw = calib_profile::parse(&text, file)?;
    let profile = calib_profile::check(&raw, &text, file, model)?;
    Ok(RobotProfile {
        file: file.to_owned(),
        written: Written {
            shown: file.to_owned(),
            text,
        },
        folder: PathBuf::new(),
        masses: Masses::of(model, &profile.load),
        profile,
        model: model.clone(),
        urdf_text: String::new(),
        digests: Vec::new(),
    })
}

/// One table for each recording.
///
/// # Errors
/// [`InitError::Pipeline`] where clocks cannot be brought together, or a file has streams of several clocks.
pub fn tables(
    model: &RobotModel,
    proposal: &Proposal,
    drafts: &[Draft],
    sources: &[Source],
) -> Result<Vec<Poses>, InitError> {
    let robot = robot_profile(model, proposal)?;
    let of = |draft: &Draft| -> Result<Poses, InitError> {
        let source = &sources[draft.source];
        let mut recording = source.recording.clone();
        if let Some(log) = draft.log {
            let log = sources[log].recording.clone();
            recording = match draft.stream {
                Some(_) => with_robot_log(recording, log),
                None => with_robot_rows(recording, log).map_err(|e| PipelineError::Data {
                    file: source.file.shown.clone(),
                    problem: Box::new(DataProblem::RowsDiffer(e)),
                })?,
            };
        }
        let spec = &robot.profile.recordings[&draft.name];
        match &spec.timing {
            None => {
                let wrong = |e| PipelineError::Data {
                    file: source.file.shown.clone(),
                    problem: Box::new(DataProblem::NotOneTable(e)),
                };
                Ok(recording.poses(Filled::Exclude).map_err(wrong)?)
            }
            Some(timing) => Ok(align(&robot, &draft.name, spec, timing, &recording)?.poses),
        }
    };
    drafts.iter().map(of).collect()
}
