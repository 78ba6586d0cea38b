//! How the program ends after a run.

use std::collections::BTreeMap;

use calib_report::{Report, Verdict};

use crate::error::ExitCode;
use crate::estimate::paper::OriginEstimate;
use crate::formulate::formulation::MlFit;

/// The exit code of a report; `strict` does not let warnings pass.
pub(crate) fn exit_code(
    report: &Report,
    strict: bool,
    fit: Option<&MlFit>,
    origins: &BTreeMap<String, OriginEstimate>,
) -> ExitCode {
    if fit.is_some_and(|f| !f.solution.status.is_converged()) {
        return ExitCode::NotConverged;
    }
    if fit.is_none() && origins.values().any(|o| o.pose.is_none()) {
        return ExitCode::NotObservable;
    }
    match report.verdict {
        Verdict::Accepted => ExitCode::Accepted,
        Verdict::AcceptedWithWarnings if !strict => ExitCode::Accepted,
        Verdict::AcceptedWithWarnings => ExitCode::VerdictFail,
        Verdict::Rejected | Verdict::NotEvaluated => ExitCode::VerdictFail,
    }
}
