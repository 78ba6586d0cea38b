//! The uncertainty budget.

use super::Page;
use crate::budget::{Budget, BudgetRow};
use crate::table::Table;
use crate::words::budget::{caption, certificate, coverage, freedom, measurand};
use crate::{Report, Unit, Verdict, number};

pub(super) fn budget(page: &mut Page, report: &Report) {
    let Some(budget) = Budget::of(report) else {
        return;
    };
    page.section("uncertainty-budget", "Uncertainty budget");
    page.text(measurand(report));
    let mut table = Table::new(&[
        "<source",
        "<type",
        ">u(x)",
        ">ν",
        ">sensitivity c",
        ">|c|·u(x)",
        ">share",
    ]);
    for row in &budget.rows {
        table.row(cells(&budget, row));
    }
    let length = |m: f64| number::plain(m, Unit::Meter);
    let sum = |name: &str, freedom: String, m: f64, share: &str| {
        let [name, m] = [name.to_owned(), length(m)];
        let none = String::new();
        [
            name,
            none.clone(),
            none.clone(),
            freedom,
            none,
            m,
            share.to_owned(),
        ]
    };
    let combined = "combined standard uncertainty u";
    let expanded = "expanded uncertainty U (k = 2)";
    table.row(sum(
        combined,
        freedom(budget.freedom),
        budget.combined_m,
        "100 %",
    ));
    table.row(sum(expanded, String::new(), budget.expanded_m(), ""));
    page.table(&caption(report), table);
    page.text(match report.verdict {
        Verdict::Accepted | Verdict::AcceptedWithWarnings => "For a certificate:",
        _ => "The result is not accepted; these numbers are not for a certificate:",
    });
    page.code("text", &certificate(report, &budget));
    page.text(coverage(&budget));
}

fn cells(budget: &Budget, row: &BudgetRow) -> [String; 7] {
    let sensitivity = match row.unit {
        // m/rad is mm/mrad; a person reads degrees.
        Unit::Radian => format!(
            "{} mm/deg",
            number::bare(row.sensitivity.to_radians(), Unit::Meter)
        ),
        _ => number::fixed(row.sensitivity, 2),
    };
    [
        row.kind.input().to_owned(),
        row.evaluation.word().to_owned(),
        number::plain(row.u, row.unit),
        freedom(row.freedom),
        sensitivity,
        number::plain(row.contribution_m, Unit::Meter),
        number::percent(budget.share(row)),
    ]
}
