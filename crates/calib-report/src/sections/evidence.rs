//! What it rests on: data, residuals, what limits the accuracy, files.

use super::{Page, code, mm};
use crate::table::Table;
use crate::{Report, Unit, answers, number};

/// Row numbers in a table cell before the rest is counted.
const ROWS: usize = 8;

pub(super) fn data(page: &mut Page, report: &Report) {
    page.section("data", "The data");
    let mut table = Table::new(&[
        "<recording",
        "<for",
        ">rows",
        ">used",
        ">whole rows left out",
        "<lost by the tracker",
    ]);
    for recording in &report.recordings {
        let lost: Vec<String> = recording
            .lost
            .iter()
            .map(|lost| format!("{} {} of {}", lost.subject, lost.lost, lost.of))
            .collect();
        let [rows, used, rejected] =
            [recording.rows, recording.used, recording.rejected].map(|n| n.to_string());
        table.row([
            code(&recording.name),
            recording.used_for.word().to_owned(),
            rows,
            used,
            rejected,
            if lost.is_empty() {
                "nothing".to_owned()
            } else {
                lost.join(", ")
            },
        ]);
    }
    page.table("", table);

    let mut table = Table::new(&["<recording", "<on reading"]);
    for recording in &report.recordings {
        let up = recording.up_axis.as_ref();
        let up = up.map(|axis| format!("the file says that {axis} is up"));
        for text in recording.conversions.iter().chain(up.as_ref()) {
            table.row([code(&recording.name), text.clone()]);
        }
    }
    page.table("What was converted on reading:", table);

    let mut table = Table::new(&["<joint", ">from", ">to", ">limits", ">covered", ">samples"]);
    for joint in &report.coverage {
        let limits = match (joint.lower_limit, joint.upper_limit) {
            (Some(lower), Some(upper)) => format!(
                "{} to {}",
                number::plain(lower, joint.unit),
                number::plain(upper, joint.unit)
            ),
            _ => "none".to_owned(),
        };
        let share = joint
            .share
            .map_or_else(|| number::UNKNOWN.to_owned(), number::percent);
        table.row([
            code(&joint.joint),
            number::plain(joint.min, joint.unit),
            number::plain(joint.max, joint.unit),
            limits,
            share,
            joint.samples.to_string(),
        ]);
    }
    page.table("Where the joints were:", table);

    let mut table = Table::new(&[
        "<noise",
        ">found σ",
        ">stated σ",
        ">from observations",
        "<how",
    ]);
    for noise in &report.noise {
        let [found, stated] =
            [noise.sigma, noise.stated].map(|sigma| number::sigma(sigma, noise.unit));
        table.row([
            noise.group.clone(),
            found,
            stated,
            noise.samples.to_string(),
            noise.text.clone(),
        ]);
    }
    page.table("Noise, per component:", table);

    let clocks = answers(report)
        .into_iter()
        .find(|answer| answer.id == "clocks");
    page.text(format!(
        "Did the clocks agree? {}",
        clocks.map_or_else(String::new, |answer| answer.lines.join(" "))
    ));

    let mut table = Table::new(&["<recording", "<what", "<rows", "<why"]);
    for rejected in &report.rejected {
        let what = if rejected.subject.is_empty() {
            "whole row".to_owned()
        } else {
            code(&rejected.subject)
        };
        table.row([
            code(&rejected.recording),
            what,
            rows(&rejected.rows),
            rejected.reason.clone(),
        ]);
    }
    page.table("Thrown out of the fit:", table);

    let mut table = Table::new(&[
        "<severity",
        "<finding",
        "<about",
        "<rows",
        "<what was found",
        "<what to do",
    ]);
    for finding in &report.findings {
        table.row([
            finding.severity.word().to_owned(),
            code(finding.id.as_str()),
            finding.subject.to_string(),
            rows(&finding.rows),
            finding.text(),
            finding.remedy(),
        ]);
    }
    page.table("Findings:", table);
}

fn rows(rows: &[u64]) -> String {
    let shown: Vec<String> = rows.iter().take(ROWS).map(ToString::to_string).collect();
    let more = if rows.len() > ROWS {
        format!(" and {} more", rows.len() - ROWS)
    } else {
        String::new()
    };
    shown.join(", ") + &more
}

pub(super) fn residuals(page: &mut Page, report: &Report) {
    if report.residuals.is_empty() {
        return;
    }
    page.section("residuals", "Residuals of the fit");
    page.text("Predicted − observed, mm; over joints and time as pictures in `report.html`, row by row in `residuals.csv`.");
    let mut table = Table::new(&["<of", ">samples", ">mean", ">rms", ">95 %", ">max"]);
    let directions = report
        .residuals
        .by_direction
        .iter()
        .map(|group| (format!("along {} (signed mean)", group.name), group));
    let groups = report
        .residuals
        .all
        .iter()
        .chain(&report.residuals.by_marker)
        .map(|group| (code(&group.name), group));
    for (name, group) in groups.chain(directions) {
        let cells = [group.mean_m, group.rms_m, group.p95_m, group.max_m].map(mm);
        table.row([name, group.samples.to_string()].into_iter().chain(cells));
    }
    page.table("", table);
}

pub(super) fn accuracy(page: &mut Page, report: &Report) {
    if let Some(workspace) = &report.workspace {
        page.section("workspace", "Uncertainty over the workspace");
        let seen = if workspace.relative_to.is_empty() {
            &workspace.frame
        } else {
            &workspace.relative_to
        };
        page.text(format!(
            "Predicted position of {} in {} at {} recorded postures: σ {} rms, {} at the worst. Of the parameters only: what a single measurement adds stands below.",
            code(&workspace.link),
            code(seen),
            workspace.points.len(),
            number::plain(workspace.rms_sigma_m, Unit::Metre),
            number::plain(workspace.max_sigma_m, Unit::Metre)
        ));
    }
    if report.accuracy_limits.is_empty() {
        return;
    }
    page.section("accuracy", "What limits the accuracy now");
    page.text("What an error of the tool on a new pose is made of; shares of the variance.");
    let mut table = Table::new(&[
        "<source",
        ">σ at the tool",
        ">share",
        "<how it was found",
        "<what would help",
    ]);
    for limit in &report.accuracy_limits {
        let share = limit
            .share
            .map_or_else(|| number::UNKNOWN.to_owned(), number::percent);
        table.row([
            limit.source.clone(),
            number::plain_or_unknown(limit.sigma_m, Unit::Metre),
            share,
            limit.text.clone(),
            limit.remedy.clone(),
        ]);
    }
    page.table("", table);
}

pub(super) fn files(page: &mut Page, report: &Report) {
    for (id, title, commands) in [
        ("how-to-reproduce", "How to reproduce it", &report.reproduce),
        ("how-to-undo", "How to undo it", &report.undo),
    ] {
        if !commands.is_empty() {
            page.section(id, title);
            page.code("sh", &commands.join("\n"));
        }
    }
    page.section("files", "Files");
    let mut table = Table::new(&["<read", "<SHA-256"]);
    for input in &report.inputs {
        table.row([code(&input.path), input.sha256.clone()]);
    }
    page.table("", table);
    let mut table = Table::new(&["<written", "<what", "<SHA-256"]);
    for output in &report.outputs {
        table.row([
            code(&output.path),
            output.what.clone(),
            output.sha256.clone().unwrap_or_default(),
        ]);
    }
    page.table("", table);
    page.text(format!(
        "calib {}, seed {}. A report cannot hold its own digest.",
        report.version, report.seed
    ));
}
