//! What the estimators are required to reach, judged cell by cell.

mod aor;
mod cor;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{
    cell::Cell,
    render::text::{label, probability},
    settings::Study,
};

/// Monte-Carlo standard errors that a cell may miss its limit by and still count as undecided: among a hundred cells exactly at
/// the limit, three is where the worst one lies.
const ERRORS: f64 = 3.0;

/// How a standard stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// Every cell reaches the limit.
    Held,
    /// Some cells miss it, none by more than three Monte-Carlo errors.
    WithinError,
    /// Some cell misses it by more.
    NotHeld,
    /// No cell could be judged.
    NotMeasured,
}

/// The cell that is furthest on the wrong side, or nearest to it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Worst {
    /// Scene and method.
    pub cell: String,
    /// Its value.
    pub value: f64,
    /// Monte-Carlo standard error; for rates, whose value is the upper end of the one-sided 95 % interval, a third of the way to the lower end.
    pub mc: f64,
}

/// A requirement on many cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Standard {
    /// What is required.
    pub text: String,
    /// The limit.
    pub limit: f64,
    /// Whether values must stay above it (efficiencies) or below.
    pub at_least: bool,
    /// Whether the value is the upper end of a rate's interval, and its error a third of the interval.
    pub is_rate: bool,
    /// Cells judged.
    pub cells: usize,
    /// Cells that reach the limit.
    pub held: usize,
    /// Cells that miss it by no more than three Monte-Carlo errors.
    pub within_error: usize,
    /// All together.
    pub standing: Standing,
    /// The worst cell.
    pub worst: Option<Worst>,
}

/// Value and Monte-Carlo error of one cell.
type Value = (String, f64, f64);

fn judge(text: &str, limit: f64, at_least: bool, values: Vec<Value>) -> Standard {
    let side = if at_least { 1.0 } else { -1.0 };
    let margin = |value: f64| side * (value - limit);
    let held = values.iter().filter(|v| margin(v.1) >= 0.0).count();
    let within_error = values
        .iter()
        .filter(|v| margin(v.1) < 0.0 && margin(v.1) + ERRORS * v.2 >= 0.0)
        .count();
    let standing = if values.is_empty() {
        Standing::NotMeasured
    } else if held == values.len() {
        Standing::Held
    } else if held + within_error == values.len() {
        Standing::WithinError
    } else {
        Standing::NotHeld
    };
    let cells = values.len();
    let worst = values
        .into_iter()
        .min_by(|a, b| (margin(a.1) + ERRORS * a.2).total_cmp(&(margin(b.1) + ERRORS * b.2)))
        .map(|(cell, value, mc)| Worst { cell, value, mc });
    Standard {
        text: text.to_owned(),
        limit,
        at_least,
        is_rate: false,
        cells,
        held,
        within_error,
        standing,
        worst,
    }
}

/// Efficiencies of the cells that `picked` keeps. A cell where some trials have no answer or a weak one is judged by the trials with an answer.
fn efficiencies<'a>(cells: &'a [Cell], picked: impl Fn(&Cell) -> bool + 'a) -> Vec<Value> {
    cells
        .iter()
        .filter(|c| picked(c))
        .filter_map(|c| Some((label(c), c.efficiency?, c.efficiency_mc?)))
        .collect()
}

/// Rates of every method over all scenes that `picked` keeps, judged by the upper end of their one-sided 95 % intervals: what the trials prove.
/// Undecided while the lower end is within the limit.
fn rates(
    text: &str,
    limit: f64,
    cells: &[Cell],
    picked: impl Fn(&Cell) -> bool,
    count: impl Fn(&Cell) -> u64,
) -> Standard {
    let mut methods: BTreeMap<&str, (u64, u64)> = BTreeMap::new();
    for cell in cells.iter().filter(|c| picked(c)) {
        let (wrong, all) = methods.entry(&cell.method).or_default();
        *wrong += count(cell);
        *all += cell.trials;
    }
    let values = methods
        .into_iter()
        .filter(|(_, (_, all))| *all > 0)
        .map(|(method, (wrong, all))| {
            let (low, high) = probability(wrong, all);
            // The other end of the interval decides, as three errors do elsewhere.
            let error = (high - low) / ERRORS;
            (format!("{method}: {wrong} of {all}"), high, error)
        })
        .collect();
    Standard {
        is_rate: true,
        ..judge(text, limit, false, values)
    }
}

/// The standards of a study.
pub(crate) fn standards(study: Study, cells: &[Cell]) -> Vec<Standard> {
    match study {
        Study::Cor => cor::standards(cells),
        Study::Aor => aor::standards(cells),
    }
}
