//! The recordings of a proposal as tables of poses, by the same code that a run reads them with: clocks brought together, holds found.

use std::path::PathBuf;

use calib_pipeline::error::{DataProblem, PipelineError};
use calib_pipeline::prepare::align::align;
use calib_pipeline::prepare::aligned::ClockState;
use calib_pipeline::prepare::inputs::{RobotProfile, Written};
use calib_pipeline::prepare::loads::Masses;
use calib_pipeline::prepare::streams::Scalars;
use calib_pipeline::prepare::timelines::{
    overlapping_offsets, tracker_timeline, with_robot_log, with_robot_rows,
};
use calib_profile::Timing;
use calib_recording::{Filled, Poses, Recording};
use calib_urdf::RobotModel;

use crate::bodies::Found;
use crate::error::InitError;
use crate::fact::{About, Fact, Place};
use crate::labels;
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
    let file = "proposed profile";
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

/// A recording as its files say it, those of the robot's own log among them.
fn recording_of(draft: &Draft, sources: &[Source]) -> Result<Recording, InitError> {
    let source = &sources[draft.source];
    let recording = source.recording.clone();
    let Some(log) = draft.log else {
        return Ok(recording);
    };
    let files = [source, &sources[log]];
    let log = sources[log].recording.clone();
    match draft.stream {
        Some(_) => Ok(with_robot_log(recording, log)),
        None => with_robot_rows(recording, log).map_err(|e| {
            if let Some(unread) = files.into_iter().find_map(Source::times_not_read) {
                return unread;
            }
            let problem = Box::new(DataProblem::RowsDiffer(e));
            let file = source.file.shown.clone();
            PipelineError::Data { file, problem }.into()
        }),
    }
}

/// One table for each recording, with the labels of these bodies put right.
///
/// # Errors
/// [`InitError::Pipeline`] where clocks cannot be brought together, or a file has streams of several clocks.
pub fn tables(
    model: &RobotModel,
    proposal: &Proposal,
    drafts: &[Draft],
    sources: &[Source],
    found: &[Found],
) -> Result<Vec<Poses>, InitError> {
    let robot = robot_profile(model, proposal)?;
    let of = |draft: &Draft| -> Result<Poses, InitError> {
        let source = &sources[draft.source];
        let recording = recording_of(draft, sources)?;
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
    let mut tables: Vec<Poses> = drafts.iter().map(of).collect::<Result<_, _>>()?;
    labels::in_tables(
        &mut tables,
        found.iter().map(|body| body.markers.as_slice()),
    );
    Ok(tables)
}

/// Looks for the offset of clocks that are further apart than a profile looks for by itself, and notes for each such draft how far to look.
///
/// # Errors
/// As [`tables`].
pub fn far_clocks(
    model: &RobotModel,
    proposal: &Proposal,
    drafts: &mut [Draft],
    sources: &[Source],
) -> Result<Vec<Fact>, InitError> {
    /// Looked for beyond the offset that was found, s.
    const ROOM: f64 = 10.0;
    let robot = robot_profile(model, proposal)?;
    let mut facts = Vec::new();
    for draft in drafts {
        let recording = recording_of(draft, sources)?;
        let spec = &robot.profile.recordings[&draft.name];
        let Some(timing) = &spec.timing else { continue };
        let try_it = |timing: &Timing| align(&robot, &draft.name, spec, timing, &recording);
        let Err(PipelineError::Data { problem, .. }) = try_it(timing) else {
            continue;
        };
        let lines = &recording.timelines;
        let tracker = tracker_timeline(&recording).and_then(|line| lines[line].t.clone());
        let joints = Scalars::of_joints(&recording);
        let range = tracker.and_then(|t| overlapping_offsets(&t, &joints));
        let (DataProblem::Clocks { .. }, Some((least, most))) = (*problem, range) else {
            continue;
        };
        let wide = Timing {
            max_offset: least.abs().max(most.abs()) + ROOM,
            ..timing.clone()
        };
        // What says no of all offsets is said by the usual ones.
        let Ok(aligned) = try_it(&wide) else { continue };
        if let ClockState::Found { map, .. } = aligned.alignment.clocks {
            let most = (map.offset.abs() + ROOM).ceil();
            draft.max_offset = Some(most);
            let place = Place::Recording(draft.name.clone());
            let about = About::FarClocks {
                offset: map.offset,
                searched: most,
            };
            facts.push(Fact::new(place, about));
        }
    }
    Ok(facts)
}
