//! The twelve questions that the first screen answers: words around numbers that the report holds.

use super::clock::clocks;
use super::files::{changed, reproduce};
use super::held_out::{expected_error, worst_pose};
use super::noise::noise;
use super::observability::not_known;
use super::prose::{commands, or, sentence, short};
use super::rejection::thrown_out;
use super::verdict::trust;
use crate::Report;

/// A question of the reader and its answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// Stable id of the heading, `trust`.
    pub id: &'static str,
    /// The heading.
    pub question: &'static str,
    /// The same in a word or two, for a list of links.
    pub short: &'static str,
    /// One statement a line, the decisive first; plain text, commands between backticks.
    pub lines: Vec<String>,
}

/// The twelve answers, in the order of the first screen.
#[must_use]
pub fn answers(report: &Report) -> Vec<Answer> {
    answers_in(report, "below")
}

/// The same for a place where what is left out stands elsewhere: "… and 3 more {rest}."
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
        answer("trust", "May I trust it?", trust(report, rest)),
        answer(
            "scope",
            "For what?",
            or(
                sentences(&report.scope),
                "The profile states no scope: only for poses like those that were recorded.",
            ),
        ),
        answer(
            "expected-error",
            "What error on a new pose?",
            expected_error(report),
        ),
        answer(
            "worst-pose",
            "Which pose is worst?",
            worst_pose(report, rest),
        ),
        answer("not-known", "What is not known?", not_known(report, rest)),
        answer(
            "next",
            "What do I do next?",
            or(sentences(&report.next_steps), "Nothing is open."),
        ),
        answer("changed", "Which file changed?", changed(report)),
        answer(
            "thrown-out",
            "What was thrown out, and why?",
            thrown_out(report, rest),
        ),
        answer("noise", "How noisy was the tracker?", noise(report, rest)),
        answer("clocks", "Did the clocks agree?", clocks(report, rest)),
        answer(
            "undo",
            "How do I undo it?",
            or(
                commands(&report.undo),
                "Nothing to undo: no file of yours was changed.",
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
        "worst-pose" => "Worst pose",
        "not-known" => "Not known",
        "next" => "Next",
        "changed" => "Files",
        "thrown-out" => "Thrown out",
        "noise" => "Noise",
        "clocks" => "Clocks",
        "undo" => "Undo",
        _ => "Reproduce",
    }
}
