//! A robot that was estimated, before anything is verified or written.

use std::collections::BTreeMap;

use calib_finding::{Finding, catalog};
use calib_profile::Method;

use crate::error::PipelineError;
use crate::estimate::paper::OriginEstimate;
use crate::formulate::by_closed_forms::{paper_assumptions, paper_result};
use crate::formulate::by_likelihood::likelihood;
use crate::formulate::checked::{Checked, check_data};
use crate::formulate::chosen::Chosen;
use crate::formulate::from_origins::origins;
use crate::formulate::kinematics::Calibration;
use crate::formulate::repeated::{is_repeatable, repeated};
use crate::formulate::solved::{Solved, nominal};
use crate::options::RunOptions;
use crate::prepare::effects;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::body_tracks;

/// What the stages from the data checks to the solution give.
#[derive(Debug)]
pub struct Estimated {
    /// The recordings as the solution saw them: frames of a pose merged, bad rows out, clocks corrected.
    pub inputs: Inputs,
    /// Findings, tracks and start values.
    pub checked: Checked,
    /// The robot as in the nominal URDF.
    pub nominal: Calibration,
    /// Closed forms of the origins, by name.
    pub origins: BTreeMap<String, OriginEstimate>,
    /// How the transforms were found.
    pub method: Method,
    /// The solution.
    pub solved: Solved,
}

/// Checks the data, with `of_shapes` among the findings, and estimates; `progress` is told the name of each stage as it begins.
///
/// # Errors
/// [`PipelineError`] for everything that stops a run before there is a solution.
pub fn estimated(
    mut inputs: Inputs,
    of_shapes: Vec<Finding>,
    options: &RunOptions,
    chosen: Option<&Chosen>,
    progress: &mut dyn FnMut(&str),
) -> Result<Estimated, PipelineError> {
    let method = options.method(&inputs.robot.profile);
    effects::taken(&inputs, method)?;
    if method == Method::Paper && inputs.robot.profile.origins.is_empty() {
        let file = inputs.robot.file.clone();
        return Err(PipelineError::NoOrigins { file });
    }
    let mut checked = check_data(&mut inputs, of_shapes, options.force)?;
    progress("estimate origins");
    let nominal = nominal(&inputs, &checked.start);
    let origins = origins(&inputs, &mut checked, &nominal)?;
    let solved = match method {
        Method::Paper => {
            checked.findings.push(paper_assumptions());
            paper_result(&inputs, &checked.tracks, &checked.start, &origins, &nominal)
        }
        Method::Ml => likelihood(&mut inputs, &mut checked, chosen, progress)?,
    };
    Ok(Estimated {
        inputs,
        checked,
        nominal,
        origins,
        method,
        solved,
    })
}

/// Estimates recordings that a robot of the same kind gave in the postures of `like`, and in which nothing is wrong: the checks, the closed forms, the
/// choice of the noise and whether it has a memory are those of `like`, and the fit begins where that of `like` ended. `None` where that is not the same
/// estimate, so that [`estimated`] must be asked: the noise of `like` is no single statement, or the recordings show other parameters.
#[must_use]
pub fn estimated_again(mut inputs: Inputs, like: &Estimated) -> Option<Estimated> {
    let fit = like.solved.fit.as_ref().filter(|fit| is_repeatable(fit))?;
    let mut checked = Checked {
        findings: Vec::new(),
        tracks: body_tracks(&inputs, &mut Vec::new()).ok()?,
        start: like.checked.start.clone(),
    };
    let is_memory = |f: &Finding| f.id == catalog::NOISE_HAS_MEMORY;
    let has_memory = like.checked.findings.iter().any(is_memory);
    let solved = repeated(&mut inputs, &mut checked, fit, has_memory)?;
    Some(Estimated {
        inputs,
        checked,
        nominal: like.nominal.clone(),
        origins: BTreeMap::new(),
        method: like.method,
        solved,
    })
}
