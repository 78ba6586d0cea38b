//! The study for people: standing, claims, and tables of one line for each scene.

mod aor;
mod cor;
mod page;
mod table;

use std::fmt::Write;

use page::Page;
use table::{Table, efficiency, shown, table};

use super::text::three;
use crate::{cell::Cell, held::Standing, run::StudyResult, settings::Study};

/// The study as Markdown; of long tables it names the file that [`long_tables`] is.
#[must_use]
pub fn markdown(result: &StudyResult) -> String {
    page(result).text()
}

/// The long tables of the study as CSV: one line for each scene and method.
#[must_use]
pub fn long_tables(result: &StudyResult) -> String {
    page(result).csv()
}

/// Name of the file with the long tables.
pub(super) fn long_tables_name(study: Study) -> String {
    format!("{}-tables.csv", study.word())
}

fn page(result: &StudyResult) -> Page {
    let mut out = Page::new(long_tables_name(result.study));
    let (title, section) = match result.study {
        Study::Cor => ("Centers of rotation", "§3.3"),
        Study::Aor => ("Axes of rotation and frames", "§4 and §5.2"),
    };
    let _ = writeln!(
        out,
        "# {title}: the study of the paper's {section}\n\n\
         `calib study {} --trials {} --seed {}`: {} estimates in {} cells. An ordinary cell has {} trials; slow methods take a part of them.\n\
         Efficiency is the Cramér–Rao bound over the mean square of the error, ± its Monte-Carlo standard error; at 1 nothing is left to gain.\n",
        result.study.word(),
        result.trials,
        result.seed,
        result.fits,
        result.cells.len(),
        result.trials,
    );
    standards(&mut out, result);
    claims(&mut out, result);
    let (others, own): (Vec<Cell>, Vec<Cell>) =
        result.cells.iter().cloned().partition(|c| c.from_plugin);
    if !others.is_empty() {
        let _ = writeln!(out, "Tried beside them: {}.\n", result.plugins.join("; "));
        of_plugins(&mut out, &others);
    }
    match result.study {
        Study::Cor => cor::tables(&mut out, &own),
        Study::Aor => aor::tables(&mut out, &own),
    }
    out
}

/// Estimators of plugins in all scenes that they were tried in.
fn of_plugins(out: &mut Page, cells: &[Cell]) {
    table(
        out,
        cells,
        &Table {
            title: "Estimators of plugins: efficiency",
            note: "Against the bound of what each was given; then its rms error, and the share of the trials that it answered.",
            picked: &|_| true,
            shown: &|c| {
                let answered = c.answered as f64 / c.trials.max(1) as f64;
                let unit = if c.quantity.is_angle() { "°" } else { "mm" };
                format!(
                    "{}; rms {} {unit}; {:.0} %",
                    efficiency(c),
                    shown(c, c.rms),
                    100.0 * answered
                )
            },
        },
    );
}

fn standards(out: &mut Page, result: &StudyResult) {
    let _ = writeln!(
        out,
        "## What is required\n\n\
         A cell that misses its limit by at most three Monte-Carlo errors is undecided. Rates are pooled over scenes for each method and judged by the upper end of their one-sided 95 % interval, which is what so many trials prove; undecided while its lower end is within the limit.\n\n\
         | required | limit | cells | reach it | undecided | worst | value | stands |\n|---|---|---|---|---|---|---|---|"
    );
    for s in &result.standards {
        let (worst, value) = s.worst.as_ref().map_or_else(
            || ("—".to_owned(), "—".to_owned()),
            |w| {
                (
                    w.cell.clone(),
                    if s.is_rate {
                        three(w.value)
                    } else {
                        format!("{} ± {}", three(w.value), three(w.mc))
                    },
                )
            },
        );
        let _ = writeln!(
            out,
            "| {} | {} {} | {} | {} | {} | {worst} | {value} | {} |",
            s.text,
            if s.at_least { "≥" } else { "≤" },
            s.limit,
            s.cells,
            s.held,
            s.within_error,
            match s.standing {
                Standing::Held => "held",
                Standing::WithinError => "within the Monte-Carlo error",
                Standing::NotHeld => "**not held**",
                Standing::NotMeasured => "not measured",
            }
        );
    }
    out.push('\n');
}

fn claims(out: &mut Page, result: &StudyResult) {
    let _ = writeln!(
        out,
        "## What the paper says\n\n\
         `mean |e|` is the error that one calibration has on average; `|mean e|` is the bias that is left when many are averaged.\n\n\
         | place | it says | measured |\n|---|---|---|"
    );
    for claim in &result.claims {
        let numbers: Vec<String> = claim
            .measured
            .iter()
            .map(|m| {
                let unit = match claim.unit.as_str() {
                    "deg" => "°",
                    "mm" => " mm",
                    _ => "",
                };
                match m.mc {
                    Some(mc) => format!("{}: {} ± {}{unit}", m.what, three(m.value), three(mc)),
                    None => format!("{}: {}{unit}", m.what, three(m.value)),
                }
            })
            .collect();
        let measured = if numbers.is_empty() {
            "not measured".to_owned()
        } else {
            numbers.join("<br>")
        };
        // A bar inside a table's cell would end it.
        let _ = writeln!(
            out,
            "| {} | {} | {} |",
            claim.place,
            claim.says,
            measured.replace('|', "\\|")
        );
    }
    out.push('\n');
}
