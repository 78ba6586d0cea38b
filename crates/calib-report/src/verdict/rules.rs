//! The rules of the verdict, in the order in which reasons of one effect are listed.

mod of_data;
mod of_errors;
mod of_fit;
mod of_prediction;

use crate::Verdict;
use crate::verdict::facts::Facts;
use crate::verdict::{Effect, Reason};

/// A rule: what it asks of the facts.
pub type Rule = fn(&Facts) -> Vec<Reason>;

/// Every rule. What each asks for stands in the book, by the ids of its reasons.
pub const RULES: [Rule; 23] = [
    of_fit::converged,
    of_fit::origins,
    of_errors::limits,
    of_errors::bodies,
    of_errors::registration,
    of_data::rejected_parts,
    of_errors::orientation,
    of_fit::errors,
    of_prediction::predicted,
    of_prediction::agreement,
    of_prediction::uncertainty,
    of_prediction::expected,
    of_data::validation,
    of_fit::plausible,
    of_data::rejected_share,
    of_data::screened,
    of_fit::goodness,
    of_fit::stated_noise,
    of_data::single_joint,
    of_data::verified_bodies,
    of_data::verified_joints,
    of_errors::urdf_alone,
    of_fit::warnings,
];

/// The verdict and why.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Judgment {
    /// The verdict.
    pub verdict: Verdict,
    /// The reasons, the gravest first, otherwise in the order of the rules.
    pub reasons: Vec<Reason>,
}

/// Applies every rule. The gravest effect decides; facts without any limit are never accepted.
#[must_use]
pub fn judge(facts: &Facts) -> Judgment {
    let mut reasons: Vec<Reason> = RULES.iter().flat_map(|rule| rule(facts)).collect();
    reasons.sort_by_key(|reason| std::cmp::Reverse(reason.effect));
    let verdict = match reasons.first().map(|reason| reason.effect) {
        Some(Effect::Supports) => Verdict::Accepted,
        Some(Effect::Warns) => Verdict::AcceptedWithWarnings,
        Some(Effect::LeavesOpen) | None => Verdict::NotEvaluated,
        Some(Effect::Rejects) => Verdict::Rejected,
    };
    Judgment { verdict, reasons }
}
