//! What the data leave open at the tool.

use super::Page;
use crate::table::Table;
use crate::words::weak::{summary, terms};
use crate::{Report, Unit, number};

pub(super) fn directions(page: &mut Page, report: &Report) {
    let Some(weak) = &report.weak_directions else {
        return;
    };
    page.section("weak-directions", "What the data leave open");
    for line in summary(weak) {
        page.text(line);
    }
    let mut table = Table::new(&[">rms", ">maximum", ">from priors", "<parameters, for 1 σ"]);
    for direction in &weak.directions {
        table.row([
            number::plain(direction.rms_m, Unit::Meter),
            number::plain(direction.max_m, Unit::Meter),
            number::percent(direction.prior_share),
            terms(direction),
        ]);
    }
    page.table(
        "Independent combinations of parameters that move the tool most:",
        table,
    );
}
