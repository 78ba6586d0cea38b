//! The questions that the first screen answers, in the words of each notion.

use super::clock::clocks;
use super::files::{changed, in_results, reproduce};
use super::held_out::{expected_error, worst_pose};
use super::noise::noise;
use super::observability::unobservable;
use super::prose::{or, sentence, short};
use super::rejection::rejected;
use super::remarks::warnings;
use super::robot;
use super::scope;
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

/// The answers, the most important first.
#[must_use]
pub fn answers(report: &Report) -> Vec<Answer> {
    answers_in(report, "below")
}

/// The same where omitted items are listed elsewhere: "… and 3 more {rest}."
pub(crate) fn answers_in(report: &Report, rest: &str) -> Vec<Answer> {
    let short = |items: &[String]| short(items, rest);
    let sentences =
        |items: &[String]| short(&items.iter().map(|i| sentence(i)).collect::<Vec<_>>());
    let next = sentences(&report.next_steps);
    vec![
        answer("trust", trust(report, rest)),
        answer("scope", scope(report)),
        answer("expected-error", expected_error(report)),
        answer("worst-pose", worst_pose(report, rest)),
        answer("warnings", or(short(&warnings(report)), "None.")),
        answer("unobservable", unobservable(report, rest)),
        answer("next", or(next, "Nothing.")),
        answer(
            "changed",
            [robot::changed(report), changed(report)].concat(),
        ),
        answer("rejected", rejected(report, rest)),
        answer("noise", noise(report, rest)),
        answer("clocks", clocks(report, rest)),
        answer(
            "undo",
            or(
                in_results(&report.undo),
                "Nothing to undo: none of your files was changed.",
            ),
        ),
        answer("reproduce", reproduce(report)),
    ]
}

/// What it holds for, and what it excludes.
fn scope(report: &Report) -> Vec<String> {
    let holds = scope::valid_for(report).into_iter();
    holds.chain(scope::not_for_line(report)).collect()
}

/// Id, question, and the same in a word or two.
const QUESTIONS: [(&str, &str, &str); 13] = [
    ("trust", "Can I trust it?", "Trust"),
    ("scope", "What is it valid for?", "Scope"),
    (
        "expected-error",
        "What error is expected on a new pose?",
        "Error",
    ),
    (
        "worst-pose",
        "Which pose has the largest error?",
        "Largest error",
    ),
    ("warnings", "What are the warnings?", "Warnings"),
    ("unobservable", "What is not observable?", "Not observable"),
    ("next", "What should I do next?", "Next"),
    ("changed", "What changed?", "Changes"),
    ("rejected", "What was rejected, and why?", "Rejected"),
    ("noise", "How noisy was the tracker?", "Noise"),
    ("clocks", "Were the clocks synchronized?", "Clocks"),
    ("undo", "How do I undo it?", "Undo"),
    ("reproduce", "How do I reproduce it?", "Reproduce"),
];

fn answer(id: &'static str, lines: Vec<String>) -> Answer {
    let mut questions = QUESTIONS.into_iter();
    let known = questions.find(|known| known.0 == id);
    let (_, question, short) = known.unwrap_or((id, id, id));
    Answer {
        id,
        question,
        short,
        lines,
    }
}
