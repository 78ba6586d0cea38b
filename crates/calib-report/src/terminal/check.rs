//! What `calib check` prints.

use super::look::{Look, painted};
use crate::table::{Table, wrap};
use crate::words::check::{bar, noise, recording, without_noise};
use crate::{CheckOutcome, DataChecks, Severity, number, printable_line};
use anstyle::{AnsiColor, Style};

/// What was recorded, what passed, what was not checked, and what was found.
#[must_use]
pub fn data_checks(of: &DataChecks, look: Look) -> String {
    let columns = look.columns;
    let mut text = painted(look, Style::new().bold(), &printable_line(&of.robot)) + "\n";
    for r in &of.recordings {
        text += &wrap(&recording(r), columns, "  ", "    ");
        if !r.alignment.is_empty() {
            text += &wrap(&r.alignment, columns, "    ", "    ");
        }
    }
    if !of.coverage.is_empty() {
        let mut table = Table::new(&[
            "<joint",
            "<samples over its range",
            ">from",
            ">to",
            ">covered",
        ]);
        for joint in &of.coverage {
            let plain = |x: f64| number::plain(x, joint.unit);
            table.row([
                joint.joint.clone(),
                bar(joint),
                plain(joint.min),
                plain(joint.max),
                joint.share.map_or_else(String::new, number::percent),
            ]);
        }
        text += &table.plain(columns);
    }
    if let Some(line) = noise(of) {
        text += &wrap(&line, columns, "", "  ");
    }
    text += &checks(of, columns);
    text += &findings(of, look);
    text
}

fn checks(of: &DataChecks, columns: usize) -> String {
    let passed = of
        .checks
        .iter()
        .filter(|c| c.outcome == CheckOutcome::Passed);
    let passed: Vec<&str> = passed.map(|c| c.check.words()).collect();
    let open = of.checks.iter().filter_map(|c| {
        let because = c.outcome.because()?;
        Some(format!("{} ({because})", c.check.words()))
    });
    let open: Vec<String> = open.chain(without_noise(of)).collect();
    let mut text = String::new();
    if !passed.is_empty() {
        text += &wrap(
            &format!("Passed: {}.", passed.join("; ")),
            columns,
            "",
            "  ",
        );
    }
    if !open.is_empty() {
        text += &wrap(
            &format!("Not checked: {}.", open.join("; ")),
            columns,
            "",
            "  ",
        );
    }
    text
}

/// Rows that are named; the rest is counted.
const ROWS: usize = 8;

fn findings(of: &DataChecks, look: Look) -> String {
    if of.findings.is_empty() {
        return "no findings\n".to_owned();
    }
    let mut text = String::new();
    for f in &of.findings {
        let color = match f.severity {
            Severity::Error => AnsiColor::Red,
            Severity::Warning => AnsiColor::Yellow,
            Severity::Info => AnsiColor::Cyan,
        };
        let word = f.severity.to_string();
        text += &painted(look, color.on_default(), &word);
        text += &format!("[{}] {}", f.id, f.subject);
        if !f.rows.is_empty() {
            let shown: Vec<String> = f.rows.iter().take(ROWS).map(u64::to_string).collect();
            let more = match f.rows.len().saturating_sub(ROWS) {
                0 => String::new(),
                n => format!(" and {n} more"),
            };
            let word = if f.rows.len() == 1 { "row" } else { "rows" };
            text += &format!(" ({word} {}{more})", shown.join(", "));
        }
        text.push('\n');
        text += &wrap(&f.text(), look.columns, "  ", "  ");
        text += &wrap(&format!("help: {}", f.remedy()), look.columns, "  ", "  ");
    }
    text
}
