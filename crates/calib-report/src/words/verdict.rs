//! The verdict and its reasons.

use super::prose::{sentence, short};
use crate::{Report, Verdict};

pub(crate) fn trust(report: &Report, rest: &str) -> Vec<String> {
    let verdict = match report.verdict {
        Verdict::Accepted => "Yes: accepted. Every limit was evaluated and met.",
        Verdict::Rejected => "No: rejected.",
        Verdict::NotEvaluated => "Not shown: not evaluated. That is not a pass.",
    };
    std::iter::once(verdict.to_owned())
        .chain(short(
            &report
                .reasons
                .iter()
                .map(|r| sentence(r))
                .collect::<Vec<_>>(),
            rest,
        ))
        .collect()
}
