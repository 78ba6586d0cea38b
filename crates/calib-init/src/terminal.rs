//! What a person sees: what was found, what to check, what comes next.

use std::fmt::Write as _;

use calib_report::terminal::wrapped;

use crate::checked::Checked;
use crate::edit::Edited;
use crate::fact::{About, Fact};
use crate::proposal::Proposal;
use crate::words;

/// The summary of so many columns; `file`: the profile that was written or edited, `checked`: what its check found.
#[must_use]
pub fn summary(
    proposal: &Proposal,
    edited: Option<&Edited>,
    file: &str,
    checked: &Checked<'_>,
    columns: usize,
) -> String {
    let mut text = String::new();
    let mut block = |title: &str, facts: &[&Fact]| {
        if !facts.is_empty() {
            let _ = writeln!(text, "\n{title}");
        }
        for (i, fact) in facts.iter().enumerate() {
            // What several parts have in common is said once.
            if facts[..i].iter().any(|f| f.about == fact.about) {
                continue;
            }
            let same = facts.iter().filter(|f| f.about == fact.about).count() - 1;
            let key = match same {
                0 => words::place(&fact.place),
                n => format!("{} and {n} more", words::place(&fact.place)),
            };
            let line = format!("{key}: {}", words::sentence(&fact.about));
            text += &wrapped(&line, columns, "  ", "    ");
            if !text.ends_with('\n') {
                text.push('\n');
            }
        }
    };
    let (to_check, found): (Vec<&Fact>, Vec<&Fact>) = proposal.facts.iter().partition(|f| f.check);
    block("Found", &found);
    block(words::to_check(edited), &to_check);
    let errors = checked.errors();
    if !errors.is_empty() {
        text += "\nErrors that `calib check` finds\n";
        for (id, error) in &errors {
            let line = match id {
                Some(id) => format!("{id}: {error}"),
                None => error.clone(),
            };
            text += &wrapped(&line, columns, "  ", "    ");
            if !text.ends_with('\n') {
                text.push('\n');
            }
        }
    }
    let is_absent = |fact: &&Fact| matches!(fact.about, About::Absent { .. });
    let next = match proposal.facts.iter().any(|fact| is_absent(&fact)) {
        true => words::next_of_absent(file),
        false => words::next(file, proposal.skeleton.is_some(), errors.len()),
    };
    let wrote = wrapped(&words::wrote(file, edited), columns, "", "  ");
    let wrote = wrote.trim_end();
    format!("{wrote}\n{text}\n{next}\n")
}
