//! The verdict and its reasons.

use super::prose::{sentences, short};
use crate::{Limit, Outcome, Report, Verdict, number};

pub(crate) fn trust(report: &Report, rest: &str) -> Vec<String> {
    let verdict = match report.verdict {
        Verdict::Accepted => "Yes: accepted. Every limit was evaluated and met.",
        Verdict::Rejected => "No: rejected.",
        Verdict::NotEvaluated => "Not decided.",
    };
    std::iter::once(verdict.to_owned())
        .chain(short(&sentences(&report.reasons), rest))
        .collect()
}

impl Limit {
    /// The limit as a reason for the verdict: value, limit and outcome.
    #[must_use]
    pub fn sentence(&self) -> String {
        match (self.outcome, self.value) {
            (Outcome::NotEvaluated, _) | (_, None) => {
                format!("{}: not evaluated ({}).", self.quantity, self.reason)
            }
            (outcome, Some(value)) => format!(
                "{}: {}, limit {} ({}).",
                self.quantity,
                number::plain(value, self.unit),
                number::plain(self.limit, self.unit),
                outcome.word()
            ),
        }
    }
}
