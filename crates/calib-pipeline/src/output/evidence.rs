//! What the report is made of.

use std::collections::BTreeMap;

use calib_core::SolveStatus;
use calib_finding::Finding;
use calib_profile::Method;
use calib_report::{FitEnd, HeldOut, LoopClosure, ResidualRow, Selection};

use crate::estimate::paper::OriginEstimate;
use crate::formulate::formulation::MlFit;
use crate::formulate::found::Found;
use crate::formulate::kinematics::Calibration;
use crate::output::export::PatchedUrdf;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;
use crate::verify::causes::Causes;

/// What the report is made of.
#[derive(Debug)]
pub struct Evidence<'a> {
    /// Profile, robot, recordings.
    pub inputs: &'a Inputs,
    /// Body tracks.
    pub tracks: &'a BTreeMap<String, BodyTrack>,
    /// How it was solved.
    pub method: Method,
    /// Data checks and what the stages noticed.
    pub findings: &'a [Finding],
    /// Closed forms.
    pub origins: &'a BTreeMap<String, OriginEstimate>,
    /// Transforms found.
    pub found: &'a [Found],
    /// The fit, with `method: ml`.
    pub fit: Option<&'a MlFit>,
    /// What made the residuals, each cause beside the others.
    pub causes: &'a Causes,
    /// The calibrated robot.
    pub robot: &'a Calibration,
    /// Loop closures.
    pub loops: Vec<LoopClosure>,
    /// Held-out errors.
    pub held_out: Option<&'a HeldOut>,
    /// The patched description.
    pub urdf: &'a PatchedUrdf,
    /// Residuals of the fit.
    pub residuals: &'a [ResidualRow],
    /// σ of the robot's numbers, by name, where that of the fit holds only for ratios that nobody measured.
    pub sigmas: &'a BTreeMap<String, f64>,
    /// How the model was chosen, where it was.
    pub selection: Option<Selection>,
    /// Options of the run that are not the profile's, as arguments.
    pub arguments: Vec<&'static str>,
}

/// How the solver ended.
pub(crate) fn fit_end(fit: &MlFit) -> FitEnd {
    match fit.solution.status {
        SolveStatus::Converged => FitEnd::Converged,
        SolveStatus::Stalled => FitEnd::Stalled,
        SolveStatus::MaxIterations => FitEnd::MaxIterations,
        SolveStatus::NotEvaluable => FitEnd::NotEvaluable,
    }
}
