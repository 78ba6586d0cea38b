//! What fits a screen of 24 rows: at most [`ROWS`] lines, the verdict and the report's path last.

use super::look::{Look, Places, painted, verdict_style};
use crate::table::wrap;
use crate::words::headline::{Headline, headline, steps};
use crate::words::prose::sentence;
use crate::words::remarks::{Remark, remarks};
use crate::words::{self, diagnosis};
use crate::{Effect, Report, Unit, number, printable_line};
use anstyle::AnsiColor;

/// Rows of a summary: a terminal has 24, and the command and the next prompt stand in it, too.
pub(super) const ROWS: usize = 20;

/// The summary.
pub(super) fn summary(report: &Report, look: Look, places: Places<'_>) -> String {
    let head = head(report, look);
    let tail = tail(report, look, places);
    let room = ROWS.saturating_sub(head.len() + tail.len());
    let middle = middle(report, look, room);
    [head, middle, tail].concat().join("\n") + "\n"
}

/// One line: verdict, robot, error, report.
pub(super) fn line(report: &Report, look: Look, places: Places<'_>) -> String {
    let number = headline(report);
    let limit = match number.limit.as_str() {
        "" => String::new(),
        limit => format!(", {limit}"),
    };
    let word = painted(look, verdict_style(report.verdict), &report.verdict_line());
    let at = places.page;
    let robot = printable_line(&report.robot);
    format!("{word}: {robot}, {}{limit}: {at}\n", number.value)
}

/// Lines of text within the width.
fn lines(text: &str, look: Look, first: &str, rest: &str) -> Vec<String> {
    let wrapped = wrap(text, look.columns, first, rest);
    wrapped.lines().map(str::to_owned).collect()
}

/// What was calibrated, the one number and its parts.
fn head(report: &Report, look: Look) -> Vec<String> {
    let identification = match words::headline::identification(report) {
        text if text.is_empty() => text,
        text => format!(" · {text}"),
    };
    let title = format!(
        "{}{identification} · {} · method {} · calib {}",
        report.robot,
        report.profile,
        report.method.name(),
        report.version
    );
    let mut out = lines(&printable_line(&title), look, "", "  ");
    let number = headline(report);
    out.extend(lines(&first_line(&number), look, "", "  "));
    let all: Vec<String> = steps(report)
        .iter()
        .map(|(name, rms)| format!("{name} {}", number::plain(*rms, Unit::Meter)))
        .collect();
    if all.len() > 1 {
        out.extend(lines(&all.join(" → "), look, "  ", "    "));
    }
    if !number.parts.is_empty() {
        let parts = format!(
            "{}: {}",
            number.made_of.to_lowercase(),
            number.parts.join(", ")
        );
        let robot = match number.robot.as_str() {
            "" => parts,
            robot => format!("{parts}; {robot}"),
        };
        out.extend(lines(&robot, look, "  ", "    "));
    }
    if !number.more.is_empty() {
        out.extend(lines(&number.more.join(" · "), look, "  ", "    "));
    }
    out.extend(lines(&words::fit::in_short(report), look, "", "  "));
    if let Some(parameters) = words::robot::parameters(report) {
        out.extend(lines(&parameters, look, "", "  "));
    }
    if words::transforms::is_the_result(report) {
        for transform in &report.transforms {
            out.extend(lines(&words::transforms::line(transform), look, "", "  "));
        }
    }
    out
}

/// `Position error on new poses: 0.611 mm rms (95 % interval …), limit 1.50 mm`
fn first_line(of: &Headline) -> String {
    let interval = match of.interval.as_str() {
        "" => String::new(),
        interval => format!(" ({interval})"),
    };
    let limit = match of.limit.as_str() {
        "" => String::new(),
        limit => format!(", {limit}"),
    };
    format!("{}: {}{interval}{limit}", of.quantity, of.value)
}

/// What speaks against the result, in the rows that are left.
fn middle(report: &Report, look: Look, room: usize) -> Vec<String> {
    let all = remarks(report);
    let mut out: Vec<String> = Vec::new();
    for (i, remark) in all.iter().enumerate() {
        let next = of_remark(remark, look);
        let left = all.len() - i;
        // The last row counts what is not shown.
        let needed = next.len() + usize::from(left > 1);
        if out.len() + needed > room {
            if room > 0 {
                // Of a first remark that is too long, what fits.
                let fits = if i == 0 { room - 1 } else { 0 };
                out.extend(next.into_iter().take(fits));
                out.push(match i {
                    0 => "… see the report, or use --full.".to_owned(),
                    _ => format!("… {left} more: see the report, or use --full."),
                });
            }
            break;
        }
        out.extend(next);
    }
    out
}

/// Everything that speaks against the result.
pub(super) fn remark_lines(report: &Report, look: Look) -> Vec<String> {
    let all = remarks(report).into_iter();
    all.flat_map(|remark| of_remark(&remark, look)).collect()
}

/// The finding on its line, the remedy on the next.
fn of_remark(remark: &Remark, look: Look) -> Vec<String> {
    let (word, color) = match remark.effect {
        Effect::Rejects => ("rejected:", AnsiColor::Red),
        Effect::LeavesOpen => ("open:", AnsiColor::Yellow),
        Effect::Warns | Effect::Supports => ("warning:", AnsiColor::Yellow),
    };
    let text = format!("{word} {}", remark.text);
    let mut out = lines(&text, look, "", "  ");
    if let Some(first) = out.first_mut() {
        // Only the first word is colored: a color over several lines breaks pagers.
        *first = first.replacen(word, &painted(look, color.on_default(), word), 1);
    }
    if !remark.remedy.is_empty() {
        out.extend(lines(&remark.remedy, look, "  ", "  "));
    }
    out
}

/// Diagnosis, next step, verdict, and where the report is.
fn tail(report: &Report, look: Look, places: Places<'_>) -> Vec<String> {
    let mut out = Vec::new();
    match diagnosis::diagnosis_from(report, &places.again(report)) {
        Some([why, what]) => {
            out.extend(lines(&format!("Diagnosis: {why}"), look, "", "  "));
            out.extend(lines(&format!("Next: {what}"), look, "", "  "));
        }
        None => {
            if let Some(next) = next(report, places) {
                out.extend(lines(&format!("Next: {next}"), look, "", "  "));
            }
        }
    }
    let verdict = report.verdict_line().to_uppercase();
    out.push(painted(look, verdict_style(report.verdict), &verdict));
    if !places.page.is_empty() {
        out.push(format!("report: {}", places.page));
    }
    out
}

fn next(report: &Report, places: Places<'_>) -> Option<String> {
    let urdf = diagnosis::nominal_urdf(report);
    let command = urdf.and_then(|urdf| diagnosis::apply(report, places.folder, &places.of(urdf)));
    command.or_else(|| report.next_steps.first().map(|step| sentence(step)))
}
