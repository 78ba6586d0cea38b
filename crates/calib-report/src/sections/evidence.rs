//! The evidence: data, residuals, what limits the accuracy, files.

use super::{Page, code, mm};
use crate::table::Table;
use crate::words;
use crate::{NoiseChoice, PriorWidth, RecordingSummary, Report, TestedEffect, Unit, number};

/// Row numbers shown in a table cell; the rest is counted.
const ROWS: usize = 8;

pub(super) fn data(page: &mut Page, report: &Report) {
    page.section("data", "Data");
    recordings(page, report);
    conversions(page, report);
    joint_ranges(page, report);
    noise(page, report);
    prior_widths(page, &report.prior_widths);
    tested_effects(page, &report.tested_effects);
    page.text(format!(
        "Were the clocks synchronized? {}",
        words::clock::clocks(report, "below").join(" ")
    ));
    rejected(page, report);
    findings(page, report);
}

fn recordings(page: &mut Page, report: &Report) {
    let mut table = Table::new(&[
        "<recording",
        "<for",
        ">rows",
        ">rows used",
        ">rows rejected",
        ">rows excluded",
        ">rows lost",
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
        // Empty where there is none in any recording: the column goes.
        let [excluded, rows_lost] = [
            |r: &RecordingSummary| r.excluded,
            |r: &RecordingSummary| r.rows_lost,
        ]
        .map(|of| match report.recordings.iter().all(|r| of(r) == 0) {
            true => String::new(),
            false => of(recording).to_string(),
        });
        table.row([
            code(&recording.name),
            recording.used_for.word().to_owned(),
            rows,
            used,
            rejected,
            excluded,
            rows_lost,
            if lost.is_empty() {
                "none".to_owned()
            } else {
                lost.join(", ")
            },
        ]);
    }
    page.table("", table);
}

fn conversions(page: &mut Page, report: &Report) {
    let mut table = Table::new(&["<recording", "<conversion"]);
    for recording in &report.recordings {
        let up = recording.up_axis.as_ref();
        let up = up.map(|axis| format!("the file states that {axis} points up"));
        for text in recording.conversions.iter().chain(up.as_ref()) {
            table.row([code(&recording.name), text.clone()]);
        }
    }
    page.table("Conversions on reading:", table);
}

fn joint_ranges(page: &mut Page, report: &Report) {
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
    page.table("Joint ranges in the data:", table);
}

fn noise(page: &mut Page, report: &Report) {
    let mut table = Table::new(&[
        "<noise",
        ">estimated σ",
        ">stated σ",
        ">observations",
        "<method",
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
    page.table("Noise per component:", table);
    if let Some(choice) = &report.noise_choice {
        noise_choice(page, choice);
    }
    let standardized = report.residuals.standardized.as_ref();
    if let Some(tails) = standardized.and_then(|s| s.tails.as_ref()) {
        page.text(words::noise::tails(tails));
    }
}

/// How wide the priors are, and where that is from.
fn prior_widths(page: &mut Page, widths: &[PriorWidth]) {
    let mut table = Table::new(&[
        "<prior standard deviation",
        ">σ in use",
        ">stated or default σ",
        ">likeliest σ",
        ">numbers",
        "<source",
    ]);
    for width in widths {
        let sigma = |sigma: f64| number::sigma(Some(sigma), width.unit);
        table.row([
            code(&width.key),
            sigma(width.sigma),
            sigma(width.declared),
            width.likeliest.map_or_else(String::new, sigma),
            width.numbers.to_string(),
            width.source.words().to_owned(),
        ]);
    }
    page.table("", table);
}

/// Which effects the data ask for, and which not.
fn tested_effects(page: &mut Page, tested: &[TestedEffect]) {
    let mut table = Table::new(&[
        "<effect",
        ">tests",
        "<most significant",
        ">explains of χ²",
        ">p, of all tests",
        "<the data",
    ]);
    for test in tested {
        table.row([
            test.words(),
            test.tested.to_string(),
            code(&test.parameter),
            number::percent(test.explains),
            words::selection::p_value(test.p_value),
            test.answer.words().to_owned(),
        ]);
    }
    page.table(words::physics::TESTED, table);
}

fn noise_choice(page: &mut Page, choice: &NoiseChoice) {
    page.text(words::noise::choice(choice));
    let mut table = Table::new(&[
        "<random from pose to pose",
        ">largest joint noise",
        ">left-out rms [mm]",
        ">log-likelihood deficit per pose [nats]",
        "<weights",
    ]);
    for candidate in &choice.candidates {
        let chosen = candidate.model == choice.chosen;
        let joint = number::sigma(candidate.joint_sigma_rad, Unit::Radian);
        let less_likely = format!(
            "{} ± {}",
            number::fixed(candidate.surprise, 2),
            number::fixed(candidate.surprise_error, 2)
        );
        let weights = match (chosen, candidate.admitted) {
            (true, _) => "selected",
            (false, true) => "not needed",
            (false, false) => "predicts worse",
        };
        table.row([
            candidate.model.words().to_owned(),
            joint,
            mm(candidate.left_out_rms_m),
            less_likely,
            weights.to_owned(),
        ]);
    }
    page.table("", table);
}

fn rejected(page: &mut Page, report: &Report) {
    let mut table = Table::new(&["<recording", "<subject", "<rows", "<what", "<reason"]);
    for together in words::rejection::together(report) {
        let rejected = together.rejected;
        let names = together.subjects.iter().map(|name| code(name));
        let what = match together.subjects.as_slice() {
            [] => "whole row".to_owned(),
            _ => names.collect::<Vec<_>>().join(", "),
        };
        table.row([
            code(&rejected.recording),
            what,
            rows(&rejected.rows),
            rejected.cause.stage().to_owned(),
            rejected.reason.clone(),
        ]);
    }
    page.table("Rejected and excluded:", table);
}

fn findings(page: &mut Page, report: &Report) {
    let mut table = Table::new(&[
        "<severity",
        "<finding",
        "<subject",
        "<rows",
        "<description",
        "<remedy",
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
    page.text(format!(
        "Predicted minus observed, mm. `report.html` plots them over joints and time; `residuals.csv` lists every row. {}",
        words::rejection::not_counted(report.residuals.rejected)
    ));
    let mut table = Table::new(&[
        "<group",
        ">samples",
        ">rejected",
        ">mean",
        ">rms",
        ">95 %",
        ">max",
    ]);
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
        // Empty where nothing was rejected: the column goes.
        let rejected = match report.residuals.rejected {
            0 => String::new(),
            _ => group.rejected.to_string(),
        };
        let counts = [name, group.samples.to_string(), rejected];
        table.row(counts.into_iter().chain(cells));
    }
    page.table("", table);
}

pub(super) fn accuracy(page: &mut Page, report: &Report) {
    if let Some(workspace) = &report.workspace {
        page.section("workspace", "Uncertainty over the workspace");
        page.text(words::accuracy::workspace(workspace));
    }
    if report.accuracy_limits.is_empty() {
        return;
    }
    page.section("accuracy", "What limits the accuracy");
    page.text(
        "Contributions to the position error of the tool on a new pose, as shares of the variance.",
    );
    let mut table = Table::new(&["<source", ">σ at the tool", ">share", "<basis", "<remedy"]);
    for limit in &report.accuracy_limits {
        let share = limit
            .share
            .map_or_else(|| number::UNKNOWN.to_owned(), number::percent);
        table.row([
            limit.source.clone(),
            number::plain_or_unknown(limit.sigma_m, Unit::Meter),
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
            let place = match id {
                "how-to-reproduce" => words::files::writes_to(report)
                    .map(|line| format!("In the folder of the profile. {line}")),
                _ => Some("In the folder of the results.".to_owned()),
            };
            if let Some(place) = place {
                page.text(place);
            }
            page.code("sh", &commands.join("\n"));
        }
    }
    page.section("files", "Files");
    let mut table = Table::new(&["<read", "<SHA-256"]);
    for input in &report.inputs {
        table.row([code(&input.path), input.sha256.clone()]);
    }
    page.table("", table);
    if !report.components.is_empty() {
        let mut table = Table::new(&["<used", "<for", "<from", "<SHA-256"]);
        for component in &report.components {
            table.row(words::files::component(component, report));
        }
        page.table("", table);
    }
    let mut table = Table::new(&["<written", "<content", "<SHA-256"]);
    for output in &report.outputs {
        table.row([
            code(&output.path),
            output.what.clone(),
            output.sha256.clone().unwrap_or_default(),
        ]);
    }
    page.table("", table);
    page.text(words::files::program(report));
}
