//! The twelve questions that the first screen answers, in the words of each notion.

use super::clock::clocks;
use super::files::{changed, reproduce};
use super::held_out::{expected_error, worst_pose};
use super::noise::noise;
use super::observability::unobservable;
use super::prose::{commands, or, sentence, short};
use super::rejection::rejected;
use super::verdict::trust;
use crate::Report;

/// A question and its answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// Stable id of the heading: `trust`.
    pub id: &'static str,
    /// The heading.
    pub question: &'static str,
    /// The same in a word or two, for a list of links.
    pub short: &'static str,
    /// One sentence per line, the most important first; plain text, commands between backticks.
    pub lines: Vec<String>,
}

/// The twelve answers, in the order of the first screen.
#[must_use]
pub fn answers(report: &Report) -> Vec<Answer> {
    answers_in(report, "below")
}

/// The same where omitted items are listed elsewhere: "… and 3 more {rest}."
pub(crate) fn answers_in(report: &Report, rest: &str) -> Vec<Answer> {
    let short = |items: &[String]| short(items, rest);
    let sentences =
        |items: &[String]| short(&items.iter().map(|i| sentence(i)).collect::<Vec<_>>());
    let answer = |id, question, lines| Answer {
        id,
        question,
        short: short_name(id),
        lines,
    };
    vec![
        answer("trust", "Can I trust it?", trust(report, rest)),
        answer(
            "scope",
            "What is it valid for?",
            or(
                sentences(&report.scope),
                "Only for poses similar to those that were recorded: the profile states no scope.",
            ),
        ),
        answer(
            "expected-error",
            "What error is expected on a new pose?",
            expected_error(report),
        ),
        answer(
            "worst-pose",
            "Which pose has the largest error?",
            worst_pose(report, rest),
        ),
        answer(
            "unobservable",
            "What is not observable?",
            unobservable(report, rest),
        ),
        answer(
            "next",
            "What should I do next?",
            or(sentences(&report.next_steps), "Nothing."),
        ),
        answer("changed", "Which files changed?", changed(report)),
        answer(
            "rejected",
            "What was rejected, and why?",
            rejected(report, rest),
        ),
        answer("noise", "How noisy was the tracker?", noise(report, rest)),
        answer(
            "clocks",
            "Were the clocks synchronized?",
            clocks(report, rest),
        ),
        answer(
            "undo",
            "How do I undo it?",
            or(
                commands(&report.undo),
                "Nothing to undo: none of your files was changed.",
            ),
        ),
        answer("reproduce", "How do I reproduce it?", reproduce(report)),
    ]
}

fn short_name(id: &str) -> &'static str {
    match id {
        "trust" => "Trust",
        "scope" => "Scope",
        "expected-error" => "Error",
        "worst-pose" => "Largest error",
        "unobservable" => "Not observable",
        "next" => "Next",
        "changed" => "Files",
        "rejected" => "Rejected",
        "noise" => "Noise",
        "clocks" => "Clocks",
        "undo" => "Undo",
        _ => "Reproduce",
    }
}
