//! `calib run`: everything, in order.

use std::collections::BTreeMap;
use std::path::Path;

pub use crate::options::{Plugins, RunOptions};
use calib_files::OutputFile;
use calib_report::Report;

use crate::error::{ExitCode, PipelineError};
use crate::estimated::{Estimated, estimated};
use crate::formulate::solved::Solved;
use crate::formulate::without_effects::refitted;
use crate::output::assemble::assemble;
use crate::output::evidence::Evidence;
use crate::output::exit::exit_code;
use crate::output::export::patch_urdf;
use crate::output::files::{Robots, files, listed, written};
use crate::output::model_file::model_file;
use crate::output::scene::scene;
use crate::output::shapes;
use crate::output::view::{Shown, view};
use crate::prepare::inputs::Inputs;
use crate::prepare::load::load_recordings_with;
use crate::prepare::robot::load_robot_with;
use crate::select::selected;
use crate::verify::verified;

/// What a run gives.
#[derive(Debug, Clone)]
pub struct RunOutput {
    /// The report.
    pub report: Report,
    /// Every file to be written.
    pub files: Vec<OutputFile>,
    /// How the program should end.
    pub exit: ExitCode,
    /// The calibrated robot, with the fit that it comes from.
    pub solved: Solved,
}

/// Runs a profile; `progress` is told the name of each stage as it begins. Writes nothing.
///
/// # Errors
/// [`PipelineError`] for everything that stops a run before a report exists.
pub fn run(
    profile: &Path,
    options: &RunOptions,
    progress: &mut dyn FnMut(&str),
) -> Result<RunOutput, PipelineError> {
    progress("read profile and robot");
    let robot = load_robot_with(profile, &options.own)?;
    progress("read recordings");
    let inputs = load_recordings_with(robot, options.plugins, &options.own)?;
    run_on(inputs, options, progress)
}

/// [`run`] on recordings that are in memory.
///
/// # Errors
/// As [`run`].
pub fn run_on(
    mut inputs: Inputs,
    options: &RunOptions,
    progress: &mut dyn FnMut(&str),
) -> Result<RunOutput, PipelineError> {
    let chosen = selected(&mut inputs, options, progress)?;
    progress("check data");
    let mut of_shapes = Vec::new();
    let (solids, meshes) = shapes::solids(&inputs.robot, &mut of_shapes);
    inputs.digests.extend(meshes);
    let estimated = estimated(inputs, of_shapes, options, chosen.as_ref(), progress)?;
    let Estimated {
        inputs,
        mut checked,
        nominal,
        origins,
        method,
        solved,
    } = estimated;
    progress("verify");
    let refitted = refitted(&inputs, &checked, &solved)?;
    let verified = verified(&inputs, &checked, &nominal, &solved, refitted.as_ref());
    verified.causes.leave_unexplained(&mut checked.findings);
    checked.findings.extend(verified.findings);
    let (tracks, robot, fit) = (&checked.tracks, &solved.robot, solved.fit.as_ref());
    progress("patch the URDF");
    let urdf = patch_urdf(&inputs, robot, &verified.known)?;
    progress("write the report");
    let shown = Shown {
        nominal: &nominal,
        robot,
        origins: &origins,
        held_out: verified.held_out.as_ref(),
        fit,
    };
    let evidence = Evidence {
        inputs: &inputs,
        tracks,
        method,
        findings: &checked.findings,
        origins: &origins,
        found: &solved.found,
        fit,
        causes: &verified.causes,
        robot,
        loops: verified.loops,
        held_out: verified.held_out.as_ref(),
        urdf: &urdf,
        residuals: &verified.residuals,
        sigmas: &verified.sigmas,
        selection: chosen.map(|chosen| chosen.fitted(fit)),
        arguments: options.arguments(),
    };
    let ((view, alone), mut report) = rayon::join(
        || {
            let view = view(&inputs, tracks, &shown, solids);
            let alone = refitted.map(|robot| patch_urdf(&inputs, &robot, &BTreeMap::new()));
            (view, alone)
        },
        || assemble(&evidence),
    );
    let scene = scene(&inputs, tracks, &solved, &report);
    let robots = Robots {
        urdf: &urdf,
        alone: alone.transpose()?,
        model: &model_file(&inputs, &solved, &scene),
        robot,
    };
    let written = written(&inputs, &verified.residuals, (&scene, &view), &robots)?;
    report.outputs = listed(&inputs, &written);
    let files = files(&inputs, &report, &scene, written, &view)?;
    let exit = exit_code(&report, options.strict, fit, &origins);
    Ok(RunOutput {
        report,
        files,
        exit,
        solved,
    })
}
