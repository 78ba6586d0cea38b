//! What a terminal shows: a summary of at most 20 lines, everything, or one line.

mod check;
mod look;
mod short;

pub use check::data_checks;
pub use look::{COLUMNS, Look, Places};

use crate::table::{Table, markup_free, wrap};
use crate::words;
use crate::words::answers::answers_in;
use crate::words::prose::{full_stop, sentence};
use crate::{Outcome, Report, RobotChange, Selection, Severity, Unit, number};
use anstyle::{AnsiColor, Style};
use calib_finding::catalog;
use look::painted;

/// Text wrapped to this many columns; `first` precedes the first line, `rest` the others.
#[must_use]
pub fn wrapped(text: &str, columns: usize, first: &str, rest: &str) -> String {
    wrap(text, columns, first, rest)
}

/// At most 20 lines, the verdict and the report's path last.
#[must_use]
pub fn summary(report: &Report, look: Look, places: Places<'_>) -> String {
    short::summary(report, look, places)
}

/// One line: verdict, robot, error, report.
#[must_use]
pub fn line(report: &Report, look: Look, places: Places<'_>) -> String {
    short::line(report, look, places)
}

/// Everything that a terminal can show of a report; what [`summary`] shows comes last.
#[must_use]
pub fn full(report: &Report, look: Look, places: Places<'_>) -> String {
    let mut screen = Screen {
        report,
        look,
        text: String::new(),
    };
    screen.scope();
    screen.limits();
    screen.held_out();
    if let Some(choice) = &report.selection {
        screen.heading(words::selection::HEADING);
        screen.text += &selection(choice, look.columns);
    }
    screen.transforms();
    screen.contact_points();
    screen.changes();
    screen.answers();
    screen.findings();
    screen.files();
    screen.remarks();
    screen.heading("Summary");
    screen.text += &short::summary(report, look, places);
    screen.text.trim_start().to_owned()
}

/// How a model was chosen, at most `columns` wide.
#[must_use]
pub fn selection(selection: &Selection, columns: usize) -> String {
    use words::selection::{PASTE, TRIED, saved, summary};
    let mut text = String::new();
    for line in summary(selection) {
        text += &wrap(&markup_free(&line), columns, "", "");
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
        text += &wrap(TRIED, columns, "\n", "");
        text += &table.plain(columns);
    }
    for step in selection.steps.iter().filter(|s| s.has_remarks()) {
        let line = format!("{}: {}.", step.part.words(), step.ending());
        text += &wrap(&markup_free(&line), columns, "- ", "  ");
    }
    text += &wrap(&markup_free(PASTE), columns, "\n", "");
    text += &selection.solve;
    text
}

/// A text that is being written.
struct Screen<'a> {
    report: &'a Report,
    look: Look,
    text: String,
}

impl Screen<'_> {
    fn paint(&self, style: Style, text: &str) -> String {
        painted(self.look, style, text)
    }

    fn heading(&mut self, text: &str) {
        let title = self.paint(Style::new().bold(), text);
        self.text += &format!("\n{title}\n");
    }

    /// What it holds for.
    fn scope(&mut self) {
        self.heading("Valid for");
        let holds = words::scope::valid_for(self.report).into_iter();
        for line in holds.chain(words::scope::not_for_line(self.report)) {
            self.text += &wrap(&full_stop(&line), self.look.columns, "  - ", "    ");
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
        self.text += &table.plain(self.look.columns);
        for limit in self
            .report
            .limits
            .iter()
            .filter(|limit| limit.outcome == Outcome::NotEvaluated)
        {
            self.text += &wrap(
                &format!("{}: {}", limit.name, limit.reason),
                self.look.columns,
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
        self.text += &table.plain(self.look.columns);
        for line in words::held_out::expected_lines(held_out) {
            self.text += &wrap(&line, self.look.columns, "  ", "  ");
        }
        if let Some(angle) = held_out.orientation.and_then(|o| o.calibrated) {
            let line = format!(
                "Orientation: {} rms, {} maximum.",
                number::plain(angle.rms_rad, Unit::Radian),
                number::plain(angle.max_rad, Unit::Radian)
            );
            self.text += &wrap(&line, self.look.columns, "  ", "  ");
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
            table.row([
                transform.name.clone(),
                cell(0),
                cell(1),
                cell(2),
                words::transforms::short_status(transform).to_owned(),
            ]);
        }
        self.text += &table.plain(self.look.columns);
    }

    /// Points of the robot that touch something, in the frames of their links.
    fn contact_points(&mut self) {
        let points = words::transforms::contact_points(self.report);
        if points.is_empty() {
            return;
        }
        self.heading(words::transforms::CONTACT_POINTS);
        let mut table = Table::new(&["<", ">x", ">y", ">z"]);
        for row in points {
            table.row(row);
        }
        self.text += &table.plain(self.look.columns);
    }

    /// What changed of the robot itself.
    fn changes(&mut self) {
        let effects = words::robot::effects(self.report);
        let all = [self.report.robot_changes.clone(), effects].concat();
        let all: Vec<_> = RobotChange::sorted(all)
            .into_iter()
            .filter(|c| c.measured)
            .collect();
        if all.is_empty() {
            return;
        }
        self.heading("What changed");
        let mut table = Table::new(&["<", ">nominal", ">calibrated ± σ", ">change"]);
        for change in all.iter().take(CHANGES) {
            let [before, after] = words::robot::before_and_after(change);
            let z = words::robot::significance(change);
            table.row([change.text.clone(), before, after, z]);
        }
        self.text += &table.plain(self.look.columns);
        if all.len() > CHANGES {
            self.text += &format!("  … and {} more in the report.\n", all.len() - CHANGES);
        }
    }

    /// What is not observable, and what was rejected.
    fn answers(&mut self) {
        let all = answers_in(self.report, "in the report");
        for (id, title) in [("unobservable", "Not observable"), ("rejected", "Rejected")] {
            if let Some(answer) = all.iter().find(|answer| answer.id == id) {
                self.heading(title);
                for line in &answer.lines {
                    self.text += &wrap(line, self.look.columns, "  ", "    ");
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
                let columns = self.look.columns;
                let (word, of) = (finding.severity.word(), &finding.subject);
                let line = wrap(
                    &format!("{word} {of}: {}", finding.text()),
                    columns,
                    "  ",
                    "    ",
                );
                let remedy = wrap(&finding.remedy(), columns, "    ", "    ");
                // Only the first word is colored: a color over several lines breaks pagers.
                self.text += &line.replacen(word, &self.paint(style.on_default(), word), 1);
                self.text += &remedy;
            }
        }
    }

    /// Everything that speaks against the result.
    fn remarks(&mut self) {
        let lines = short::remark_lines(self.report, self.look);
        if !lines.is_empty() {
            self.heading("Against the result");
            self.text += &(lines.join("\n") + "\n");
        }
    }

    /// What to do next, what was written, and how to undo it.
    fn files(&mut self) {
        if !self.report.next_steps.is_empty() {
            self.heading("Next steps");
            for step in &self.report.next_steps {
                self.text += &wrap(&sentence(step), self.look.columns, "  - ", "    ");
            }
        }
        if !self.report.outputs.is_empty() {
            self.heading("Written");
            let mut table = Table::new(&["<", "<"]);
            for output in &self.report.outputs {
                table.row([output.path.clone(), output.what.clone()]);
            }
            self.text += &table.plain(self.look.columns);
        }
        for command in &self.report.undo {
            self.text += &wrap(&format!("undo: {command}"), self.look.columns, "  ", "    ");
        }
    }
}

/// Changes shown: more are in the report.
const CHANGES: usize = 12;
