//! What a person and a program read of a history.

use std::fmt::Write as _;

use calib_report::plots::{Plot, PlotKind, PlotRow};
use calib_report::{Unit, number, printable_line, terminal};

use crate::error::DriftError;
use crate::history::{Calibration, History, Track, Value};

/// The calibration in a table: its number, its date, and its report.
fn named(i: usize, of: &Calibration) -> String {
    let date = of.date.as_deref().unwrap_or("no date");
    format!("{}  {date}", i + 1)
}

/// Since the calibration before the one at place `i`, and since the first.
fn since((i, of): (usize, &Calibration)) -> String {
    let changes = changes((i, of));
    match of.rejected {
        true => format!("REJECTED  {changes}"),
        false => changes,
    }
}

fn changes((i, of): (usize, &Calibration)) -> String {
    let step = match of.changed {
        None if i == 0 => String::new(),
        None => "not decided: see calib drift".to_owned(),
        Some(false) => "no significant change".to_owned(),
        Some(true) if of.what.is_empty() => "CHANGED".to_owned(),
        Some(true) => format!("CHANGED: {}", of.what.join("; ")),
    };
    match (of.changed, of.changed_since_first) {
        (Some(true), _) | (_, None | Some(false)) => step,
        (_, Some(true)) => format!("{step}, CHANGED since the first"),
    }
}

fn change(value: &Value, unit: Unit) -> String {
    if value.change_sigma == 0.0 {
        return String::new();
    }
    let sigmas = (value.change / value.change_sigma).abs();
    let change = number::change(value.change, Some(value.change_sigma), unit);
    format!("{change}  ({sigmas:.1} σ)")
}

/// For a terminal of so many columns: the calibrations, then each quantity with its change since the first.
#[must_use]
pub fn history_text(history: &History, columns: usize) -> String {
    let mut out = String::new();
    // Writing to a String does not fail.
    let _ = writeln!(
        out,
        "{} · {}",
        printable_line(&history.robot),
        match history.calibrations.len() {
            1 => "1 calibration".to_owned(),
            n => format!("{n} calibrations"),
        }
    );
    if !history.by_date && history.calibrations.len() > 1 {
        out += "in the order given: not all have a date as 2026-11-03\n";
    }
    for (i, of) in history.calibrations.iter().enumerate() {
        let line = format!("{}  {}", of.report, since((i, of)));
        out += &terminal::wrapped(
            line.trim_end(),
            columns,
            &format!("{}  ", named(i, of)),
            "      ",
        );
    }
    for track in &history.quantities {
        out.push('\n');
        out += &terminal::wrapped(&track.text, columns, "", "  ");
        for (i, of) in history.calibrations.iter().enumerate() {
            let line = match track.values.get(i).copied().flatten() {
                None => "not determined".to_owned(),
                Some(v) => format!(
                    "{}   {}",
                    number::with_sigma(v.value, Some(v.sigma), track.unit),
                    change(&v, track.unit)
                ),
            };
            let _ = writeln!(out, "  {}  {}", named(i, of), line.trim_end());
        }
    }
    out
}

/// The history as a page with a picture of each quantity.
#[must_use]
pub fn history_page(history: &History) -> String {
    let lines: Vec<String> = history
        .calibrations
        .iter()
        .enumerate()
        .map(|(i, of)| {
            let line = format!("{}  {}  {}", named(i, of), of.report, since((i, of)));
            line.trim_end().to_owned()
        })
        .collect();
    let plots: Vec<Plot> = history
        .quantities
        .iter()
        .map(|track| plot(history, track))
        .collect();
    calib_report::gallery::page(
        &format!("History of {}", printable_line(&history.robot)),
        &lines,
        &plots,
        &[],
    )
}

/// A quantity over time: its change since the first calibration, with ± 2 σ.
fn plot(history: &History, track: &Track) -> Plot {
    let scale = match track.unit {
        Unit::Meter => 1e3,
        Unit::Radian => 1_f64.to_degrees(),
        _ => 1.0,
    };
    let unit = number::unit_name(track.unit);
    let row = |(i, of): (usize, &Calibration)| {
        let value = track.values.get(i).copied().flatten();
        PlotRow {
            label: named(i, of),
            mark: value.map(|v| v.change * scale),
            whisker: value.map(|v| {
                let sigma = if v.change_sigma == 0.0 {
                    v.sigma
                } else {
                    v.change_sigma
                };
                [-2.0, 2.0].map(|times| (v.change + times * sigma) * scale)
            }),
            text: value.map_or_else(
                || "not determined".to_owned(),
                |v| number::with_sigma(v.value, Some(v.sigma), track.unit),
            ),
            ..PlotRow::default()
        }
    };
    Plot {
        id: format!("plot-{}", track.name.replace('.', "-")),
        section: "history",
        title: track.text.clone(),
        description: "Dot: change since the first calibration; line: ± 2 σ of the change. Right: the value ± σ.".to_owned(),
        kind: PlotKind::Rows {
            axis: format!("change [{unit}]"),
            rows: history.calibrations.iter().enumerate().map(row).collect(),
        },
    }
}

/// For a program: SI, floats with twelve digits.
///
/// # Errors
/// [`DriftError::Unwritable`] when it has no JSON form.
pub fn history_json(history: &History) -> Result<String, DriftError> {
    crate::render::rounded(history)
}
