//! The error of data that checks refuse.

use calib_finding::Finding;

use crate::error::{DataProblem, PipelineError};
use crate::prepare::inputs::Inputs;

pub(crate) fn stopped(inputs: &Inputs, findings: &[Finding]) -> PipelineError {
    PipelineError::data(&inputs.robot.file, DataProblem::Checks(findings.to_vec()))
}
