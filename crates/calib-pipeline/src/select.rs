//! `calib run --select`: the choice of what to free.

use std::path::Path;

use calib_report::Selection;

use crate::error::PipelineError;
use crate::formulate::chosen::Chosen;
use crate::formulate::selection::choose;
use crate::options::{Plugins, RunOptions};
use crate::prepare::inputs::Inputs;
use crate::prepare::load::load_recordings;
use crate::prepare::robot::load_robot;

/// What `select` of [`RunOptions`] would choose, and why. Writes nothing.
///
/// # Errors
/// As [`run`](crate::run::run).
pub fn select(
    profile: &Path,
    force: bool,
    plugins: Plugins,
    progress: &mut dyn FnMut(&str),
) -> Result<Selection, PipelineError> {
    progress("read profile and robot");
    let robot = load_robot(profile)?;
    progress("read recordings");
    let inputs = load_recordings(robot, plugins)?;
    Ok(choose(inputs, force, progress)?.selection)
}

/// Chooses the effects where the options ask for it, and puts what was chosen into the profile's `solve:`.
pub(crate) fn selected(
    inputs: &mut Inputs,
    options: &RunOptions,
    progress: &mut dyn FnMut(&str),
) -> Result<Option<Chosen>, PipelineError> {
    if !options.select {
        return Ok(None);
    }
    let chosen = choose(inputs.clone(), options.force, progress)?;
    inputs.robot.profile.solve = chosen.solve.clone();
    Ok(Some(chosen))
}
