//! The summary for a terminal: the verdict, its numbers, what is not observable. At most 80 columns.

use crate::table::{Table, wrap};
use crate::words::answers::answers_in;
use crate::words::prose::{full_stop, sentence};
use crate::{Class, Outcome, Report, Severity, Unit, Verdict, number};
use anstyle::{AnsiColor, Style};

/// Columns of the narrowest terminal in use.
const COLUMNS: usize = 80;

/// Text wrapped to the width of a terminal; `first` precedes the first line, `rest` the others.
#[must_use]
pub fn wrapped(text: &str, first: &str, rest: &str) -> String {
    wrap(text, COLUMNS, first, rest)
}

/// The summary; `color` adds ANSI styles (the caller checks what the terminal supports).
#[must_use]
pub fn summary(report: &Report, color: bool) -> String {
    let paint = |style: Style, text: &str| {
        if color {
            format!("{style}{text}{style:#}")
        } else {
            text.to_owned()
        }
    };
    let heading = |text: &str| format!("\n{}\n", paint(Style::new().bold(), text));
    let mut text = wrap(
        &format!(
            "calib {} · {} · {} · method {}",
            report.version,
            report.robot,
            report.profile,
            report.method.name()
        ),
        COLUMNS,
        "",
        "  ",
    );

    text += &paint(
        verdict_style(report.verdict),
        &report.verdict.word().to_uppercase(),
    );
    text.push('\n');
    // The table of limits already lists what was met.
    let listed = report.verdict == Verdict::Accepted && !report.limits.is_empty();
    for reason in report.reasons.iter().filter(|_| !listed) {
        text += &wrap(&sentence(reason), COLUMNS, "- ", "  ");
    }
    for scope in &report.scope {
        text += &wrap(&full_stop(scope), COLUMNS, "  valid for: ", "             ");
    }

    if !report.limits.is_empty() {
        text += &heading("Limits");
        let mut table = Table::new(&["<", "<", ">value", ">limit"]);
        for limit in &report.limits {
            let value = number::plain_or_unknown(limit.value, limit.unit);
            table.row([
                limit.outcome.word().to_owned(),
                limit.quantity.clone(),
                value,
                number::plain(limit.limit, limit.unit),
            ]);
        }
        text += &table.plain(COLUMNS);
        for limit in report
            .limits
            .iter()
            .filter(|limit| limit.outcome == Outcome::NotEvaluated)
        {
            text += &wrap(
                &format!("{}: {}", limit.name, limit.reason),
                COLUMNS,
                "  ",
                "    ",
            );
        }
    }

    if let Some(held_out) = &report.verification.held_out {
        text += &heading(&format!("Held-out errors [mm], {} values", held_out.n));
        let mut table = Table::new(&["<", ">mean", ">rms", ">95 %", ">max"]);
        for (name, stats) in [
            ("nominal", held_out.nominal),
            ("registration only", held_out.registration_only),
            ("calibrated", held_out.calibrated),
        ] {
            let Some(stats) = stats else { continue };
            let cells = [stats.mean_m, stats.rms_m, stats.p95_m, stats.max_m]
                .map(|m| number::bare(m, Unit::Meter));
            table.row([name.to_owned()].into_iter().chain(cells));
        }
        text += &table.plain(COLUMNS);
        if let Some(expected) = &held_out.expected {
            let length = |m| number::plain(m, Unit::Meter);
            let line = format!(
                "Expected on a new pose: {} rms ({} interval {} to {}).",
                length(expected.rms_m),
                number::percent(expected.confidence),
                length(expected.low_m),
                length(expected.high_m)
            );
            text += &wrap(&line, COLUMNS, "  ", "  ");
        }
        if let Some(angle) = held_out.orientation.and_then(|o| o.calibrated) {
            let line = format!(
                "Orientation: {} rms, {} maximum.",
                number::plain(angle.rms_rad, Unit::Radian),
                number::plain(angle.max_rad, Unit::Radian)
            );
            text += &wrap(&line, COLUMNS, "  ", "  ");
        }
    }

    if !report.transforms.is_empty() {
        text += &heading("Transforms [mm]");
        let mut table = Table::new(&["<", ">x", ">y", ">z", "<"]);
        for transform in &report.transforms {
            let sigma = |i: usize| transform.sigma_translation_m.map(|sigma| sigma[i]);
            let cell = |i: usize| {
                number::bare_with_sigma(transform.translation_m[i], sigma(i), Unit::Meter)
            };
            let status = if transform.observable {
                transform.status.word()
            } else {
                "partial"
            };
            table.row([
                transform.name.clone(),
                cell(0),
                cell(1),
                cell(2),
                status.to_owned(),
            ]);
        }
        text += &table.plain(COLUMNS);
    }

    if !report.changes.is_empty() {
        let weak = report
            .parameters
            .iter()
            .filter(|parameter| parameter.class != Class::Solid)
            .count();
        text += &heading(&format!("URDF: {} values changed", report.changes.len()));
        let mut table = Table::new(&["<", "<", ">change", ">data share"]);
        for change in report.changes.iter().take(CHANGES) {
            let delta = change.delta.map_or_else(
                || "added".to_owned(),
                |delta| number::change(delta, change.sigma, change.unit),
            );
            let share = change.data_share.map_or_else(String::new, number::percent);
            table.row([change.joint.clone(), change.what.clone(), delta, share]);
        }
        text += &table.plain(COLUMNS);
        if report.changes.len() > CHANGES {
            text += &format!(
                "  … and {} more in the report.\n",
                report.changes.len() - CHANGES
            );
        }
        if weak > 0 {
            text += &format!(
                "  {weak} of {} parameters depend on their priors: see the report.\n",
                report.parameters.len()
            );
        }
    }

    let all = answers_in(report, "in the report");
    for (id, title) in [("unobservable", "Not observable"), ("rejected", "Rejected")] {
        if let Some(answer) = all.iter().find(|answer| answer.id == id) {
            text += &heading(title);
            for line in &answer.lines {
                text += &wrap(line, COLUMNS, "  ", "    ");
            }
        }
    }

    let findings: Vec<_> = report
        .findings
        .iter()
        .filter(|finding| finding.severity > Severity::Info)
        .collect();
    if !findings.is_empty() {
        text += &heading("Findings");
        for finding in findings {
            let style = if finding.severity == Severity::Error {
                AnsiColor::Red
            } else {
                AnsiColor::Yellow
            };
            let line = wrap(
                &format!(
                    "{} {}: {} {}",
                    finding.severity.word(),
                    finding.subject,
                    finding.text(),
                    finding.remedy()
                ),
                COLUMNS,
                "  ",
                "    ",
            );
            // Only the first word is colored: a color over several lines breaks pagers.
            let word = finding.severity.word();
            text += &line.replacen(word, &paint(style.on_default(), word), 1);
        }
    }

    if !report.next_steps.is_empty() {
        text += &heading("Next steps");
        for step in &report.next_steps {
            text += &wrap(&sentence(step), COLUMNS, "  - ", "    ");
        }
    }
    if !report.outputs.is_empty() {
        text += &heading("Written");
        let mut table = Table::new(&["<", "<"]);
        for output in &report.outputs {
            table.row([output.path.clone(), output.what.clone()]);
        }
        text += &table.plain(COLUMNS);
    }
    for command in &report.undo {
        text += &wrap(&format!("undo: {command}"), COLUMNS, "  ", "    ");
    }
    text
}

/// Changes shown: a screen has 24 lines.
const CHANGES: usize = 8;

fn verdict_style(verdict: Verdict) -> Style {
    match verdict {
        Verdict::Accepted => AnsiColor::Green.on_default().bold(),
        Verdict::Rejected => AnsiColor::Red.on_default().bold(),
        Verdict::NotEvaluated => AnsiColor::Yellow.on_default().bold(),
    }
}
