//! The data checks, and the start values of what passes them.

use std::collections::BTreeMap;

use calib_finding::Finding;

use crate::error::PipelineError;
use crate::estimate::start::{Start, start};
use crate::formulate::{held, model_checks};
use crate::prepare::checks;
use crate::prepare::condensed::condense;
use crate::prepare::ghosts;
use crate::prepare::inputs::Inputs;
use crate::prepare::relabel::relabel;
use crate::prepare::split::split;
use crate::prepare::stopped::stopped;
use crate::prepare::tracks::{BodyTrack, body_tracks};

/// Data that the checks let pass, and start values.
#[derive(Debug)]
pub struct Checked {
    /// What was noticed.
    pub findings: Vec<Finding>,
    /// Tracks of the bodies.
    pub tracks: BTreeMap<String, BodyTrack>,
    /// Start values.
    pub start: Start,
}

/// Checks the data, with `of_shapes` among the findings, and finds start values; errors stop unless `force`.
///
/// # Errors
/// [`PipelineError`] with the findings that stop.
pub fn check_data(
    inputs: &mut Inputs,
    of_shapes: Vec<Finding>,
    force: bool,
) -> Result<Checked, PipelineError> {
    let mut findings = inputs.findings.clone();
    if inputs.robot.profile.solve.robust {
        findings.extend(relabel(inputs));
        findings.extend(held::take_out(inputs));
    }
    findings.extend(checks::check(inputs));
    if inputs.robot.profile.solve.robust {
        ghosts::take_out(inputs, &findings);
    }
    split(inputs);
    findings.extend(condense(inputs));
    findings.extend(of_shapes);
    let stops = |findings: &[Finding]| checks::stops(findings) && !force;
    let tracks = match body_tracks(inputs, &mut findings) {
        Err(_) if stops(&findings) => return Err(stopped(inputs, &findings)),
        tracks => tracks?,
    };
    let start = start(inputs, &tracks);
    model_checks::before_the_fit(inputs, &tracks, &start, &mut findings);
    if stops(&findings) {
        return Err(stopped(inputs, &findings));
    }
    Ok(Checked {
        findings,
        tracks,
        start,
    })
}
