//! How the model was chosen.

use super::{Page, mm};
use crate::table::Table;
use crate::words::selection::{PASTE, STEPS, p_value, saved, summary};
use crate::{Report, Selection};

pub(super) fn choice(page: &mut Page, report: &Report) {
    let Some(selection) = &report.selection else {
        return;
    };
    page.section("selection", "Choice of the model");
    for line in summary(selection) {
        page.text(line);
    }
    page.table(STEPS, steps(selection));
    page.text(PASTE);
    page.code("yaml", &selection.solve);
}

/// One row for each part that was looked at.
fn steps(selection: &Selection) -> Table {
    let mut table = Table::new(&[
        "<part",
        ">before",
        ">after",
        ">squared error saved",
        ">z²",
        ">parameters",
        ">p",
        ">folds",
        "<outcome",
    ]);
    for step in &selection.steps {
        let folds = selection.nested.as_ref().zip(step.in_folds);
        table.row([
            step.part.words(),
            mm(step.before_rms_m),
            mm(step.after_rms_m),
            saved(step),
            format!("{:.1}", step.z2),
            step.parameters.to_string(),
            p_value(step.p_value),
            folds.map_or_else(String::new, |(n, added)| format!("{added} of {}", n.folds)),
            step.ending(),
        ]);
    }
    table
}
