//! The summary for a terminal: the verdict, its numbers, what is not observable. At most 80 columns.

use crate::table::{Table, markup_free, wrap};
use crate::words;
use crate::words::answers::answers_in;
use crate::words::prose::{full_stop, sentence};
use crate::{Class, Outcome, Report, Selection, Severity, Unit, Verdict, number};
use anstyle::{AnsiColor, Style};
use calib_finding::catalog;

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
    let mut screen = Screen {
        report,
        color,
        text: String::new(),
    };
    screen.verdict();
    screen.limits();
    screen.held_out();
    if let Some(choice) = &report.selection {
        screen.heading(words::selection::HEADING);
        screen.text += &selection(choice);
    }
    screen.transforms();
    screen.changes();
    screen.answers();
    screen.findings();
    screen.files();
    screen.text
}

/// How a model was chosen, at most 80 columns.
#[must_use]
pub fn selection(selection: &Selection) -> String {
    use words::selection::{PASTE, TRIED, saved, summary};
    let mut text = String::new();
    for line in summary(selection) {
        text += &wrap(&markup_free(&line), COLUMNS, "", "");
    }
    let mut table = Table::new(&["<tried", ">left out", ">saved", "<outcome"]);
    for step in &selection.steps {
        table.row([
            markup_free(&step.part.words()),
            number::bare(step.after_rms_m, Unit::Meter),
            saved(step),
            step.short_ending().to_owned(),
        ]);
    }
    if !table.is_empty() {
        text += &wrap(TRIED, COLUMNS, "\n", "");
        text += &table.plain(COLUMNS);
    }
    for step in selection.steps.iter().filter(|s| s.has_remarks()) {
        let line = format!("{}: {}.", step.part.words(), step.ending());
        text += &wrap(&markup_free(&line), COLUMNS, "- ", "  ");
    }
    text += &wrap(&markup_free(PASTE), COLUMNS, "\n", "");
    text += &selection.solve;
    text
}

/// A summary that is being written.
struct Screen<'a> {
    report: &'a Report,
    color: bool,
    text: String,
}

impl Screen<'_> {
    fn paint(&self, style: Style, text: &str) -> String {
        if self.color {
            format!("{style}{text}{style:#}")
        } else {
            text.to_owned()
        }
    }

    fn heading(&mut self, text: &str) {
        let title = self.paint(Style::new().bold(), text);
        self.text += &format!("\n{title}\n");
    }

    /// What was calibrated, the verdict, its reasons, and what it holds for.
    fn verdict(&mut self) {
        self.text = wrap(
            &format!(
                "calib {} · {} · {} · method {}",
                self.report.version,
                self.report.robot,
                self.report.profile,
                self.report.method.name()
            ),
            COLUMNS,
            "",
            "  ",
        );

        self.text += &self.paint(
            verdict_style(self.report.verdict),
            &self.report.verdict_line().to_uppercase(),
        );
        self.text.push('\n');
        // The table of limits already lists what was met.
        for reason in self.report.objections() {
            self.text += &wrap(&sentence(reason), COLUMNS, "- ", "  ");
        }
        for scope in &self.report.scope {
            self.text += &wrap(&full_stop(scope), COLUMNS, "  valid for: ", "             ");
        }
    }

    /// Limits and whether they are met.
    fn limits(&mut self) {
        if self.report.limits.is_empty() {
            return;
        }
        self.heading("Limits");
        let mut table = Table::new(&["<", "<", ">value", ">limit"]);
        for limit in &self.report.limits {
            let value = number::plain_or_unknown(limit.value, limit.unit);
            table.row([
                limit.outcome.word().to_owned(),
                limit.quantity.clone(),
                value,
                number::plain(limit.limit, limit.unit),
            ]);
        }
        self.text += &table.plain(COLUMNS);
        for limit in self
            .report
            .limits
            .iter()
            .filter(|limit| limit.outcome == Outcome::NotEvaluated)
        {
            self.text += &wrap(
                &format!("{}: {}", limit.name, limit.reason),
                COLUMNS,
                "  ",
                "    ",
            );
        }
    }

    /// Errors on poses that were not fitted.
    fn held_out(&mut self) {
        let Some(held_out) = &self.report.verification.held_out else {
            return;
        };
        let title = words::held_out::heading(held_out);
        self.heading(&title);
        let mut table = Table::new(&["<", ">mean", ">rms", ">95 %", ">max"]);
        for (name, stats) in [
            ("nominal", held_out.nominal),
            ("registration only", held_out.registration_only),
            ("URDF without effects", held_out.urdf_alone),
            ("URDF fitted without effects", held_out.urdf_refitted),
            ("calibrated", held_out.calibrated),
        ] {
            let Some(stats) = stats else { continue };
            let cells = [stats.mean_m, stats.rms_m, stats.p95_m, stats.max_m]
                .map(|m| number::bare(m, Unit::Meter));
            table.row([name.to_owned()].into_iter().chain(cells));
        }
        self.text += &table.plain(COLUMNS);
        for line in words::held_out::expected_lines(held_out) {
            self.text += &wrap(&line, COLUMNS, "  ", "  ");
        }
        if let Some(angle) = held_out.orientation.and_then(|o| o.calibrated) {
            let line = format!(
                "Orientation: {} rms, {} maximum.",
                number::plain(angle.rms_rad, Unit::Radian),
                number::plain(angle.max_rad, Unit::Radian)
            );
            self.text += &wrap(&line, COLUMNS, "  ", "  ");
        }
    }

    /// Transforms that were asked for.
    fn transforms(&mut self) {
        if self.report.transforms.is_empty() {
            return;
        }
        self.heading("Transforms [mm]");
        let mut table = Table::new(&["<", ">x", ">y", ">z", "<"]);
        for transform in &self.report.transforms {
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
        self.text += &table.plain(COLUMNS);
    }

    /// Numbers of the URDF that changed.
    fn changes(&mut self) {
        if self.report.changes.is_empty() {
            return;
        }
        let weak = self
            .report
            .parameters
            .iter()
            .filter(|parameter| parameter.class != Class::Solid)
            .count();
        self.heading(&format!(
            "URDF: {} values changed",
            self.report.changes.len()
        ));
        let mut table = Table::new(&["<", "<", ">change", ">data share"]);
        for change in self.report.changes.iter().take(CHANGES) {
            let delta = change.delta.map_or_else(
                || "added".to_owned(),
                |delta| number::change(delta, change.sigma, change.unit),
            );
            let share = change.data_share.map_or_else(String::new, number::percent);
            table.row([change.joint.clone(), change.what.clone(), delta, share]);
        }
        self.text += &table.plain(COLUMNS);
        if self.report.changes.len() > CHANGES {
            self.text += &format!(
                "  … and {} more in the report.\n",
                self.report.changes.len() - CHANGES
            );
        }
        if weak > 0 {
            self.text += &format!(
                "  {weak} of {} parameters depend on their priors: see the report.\n",
                self.report.parameters.len()
            );
        }
    }

    /// What is not observable, and what was rejected.
    fn answers(&mut self) {
        let all = answers_in(self.report, "in the report");
        for (id, title) in [("unobservable", "Not observable"), ("rejected", "Rejected")] {
            if let Some(answer) = all.iter().find(|answer| answer.id == id) {
                self.heading(title);
                for line in &answer.lines {
                    self.text += &wrap(line, COLUMNS, "  ", "    ");
                }
            }
        }
    }

    /// Warnings and errors, and what changes the count of the data.
    fn findings(&mut self) {
        let shown = |finding: &&calib_finding::Finding| {
            finding.severity > Severity::Info || finding.id == catalog::FRAMES_MERGED
        };
        let findings: Vec<_> = self.report.findings.iter().filter(shown).collect();
        if !findings.is_empty() {
            self.heading("Findings");
            for finding in findings {
                let style = match finding.severity {
                    Severity::Error => AnsiColor::Red,
                    Severity::Warning => AnsiColor::Yellow,
                    Severity::Info => AnsiColor::Cyan,
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
                self.text += &line.replacen(word, &self.paint(style.on_default(), word), 1);
            }
        }
    }

    /// What to do next, what was written, and how to undo it.
    fn files(&mut self) {
        if !self.report.next_steps.is_empty() {
            self.heading("Next steps");
            for step in &self.report.next_steps {
                self.text += &wrap(&sentence(step), COLUMNS, "  - ", "    ");
            }
        }
        if !self.report.outputs.is_empty() {
            self.heading("Written");
            let mut table = Table::new(&["<", "<"]);
            for output in &self.report.outputs {
                table.row([output.path.clone(), output.what.clone()]);
            }
            self.text += &table.plain(COLUMNS);
        }
        for command in &self.report.undo {
            self.text += &wrap(&format!("undo: {command}"), COLUMNS, "  ", "    ");
        }
    }
}

/// Changes shown: a screen has 24 lines.
const CHANGES: usize = 8;

fn verdict_style(verdict: Verdict) -> Style {
    match verdict {
        Verdict::Accepted => AnsiColor::Green.on_default().bold(),
        Verdict::AcceptedWithWarnings => AnsiColor::Yellow.on_default().bold(),
        Verdict::Rejected => AnsiColor::Red.on_default().bold(),
        Verdict::NotEvaluated => AnsiColor::Yellow.on_default().bold(),
    }
}
