//! A fleet in numbers.

use std::collections::BTreeMap;

use calib_report::Verdict;
use serde::{Deserialize, Serialize};

use super::statistics::Statistics;

/// A fleet in numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Version of these keys: 1.
    pub calib_fleet: u32,
    /// Version of the program.
    pub version: String,
    /// Robots.
    pub robots: u64,
    /// Robots by verdict; `failed`: those without a result.
    pub verdicts: BTreeMap<String, u64>,
    /// Robots without a result, by the id of the error.
    pub failures: BTreeMap<String, u64>,
    /// What their changes say.
    pub drift: Statistics,
}

/// As in `report.json`.
pub(super) fn word(verdict: Option<Verdict>) -> &'static str {
    match verdict {
        None => "failed",
        Some(Verdict::Accepted) => "accepted",
        Some(Verdict::AcceptedWithWarnings) => "accepted_with_warnings",
        Some(Verdict::Rejected) => "rejected",
        Some(Verdict::NotEvaluated) => "not_evaluated",
    }
}
