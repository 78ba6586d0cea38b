//! Tables of the study of axes and frames.

use super::{
    page::Page,
    table::{Table, against_bound, efficiency, table},
};
use crate::cell::{Cell, Part, Quantity};

/// All tables, in the order of the page.
pub(super) fn tables(out: &mut Page, cells: &[Cell]) {
    one_body(out, cells);
    four_markers(out, cells);
    frames(out, cells);
}

fn direction(c: &Cell) -> bool {
    c.quantity == Quantity::Direction
}

fn circle(c: &Cell) -> bool {
    c.scene.part == Part::Grid && c.scene.sigma_r_rad == 0.0
}

/// One circle, and the poses of one body.
fn one_body(out: &mut Page, cells: &[Cell]) {
    table(
        out,
        cells,
        &Table {
            title: "One circle: efficiency of the direction",
            note: "Positions of one body. `center held` knows a point of the axis off the circle's plane, and so does its bound.",
            picked: &|c| circle(c) && direction(c),
            shown: &efficiency,
        },
    );
    table(
        out,
        cells,
        &Table {
            title: "One circle: rms error of the direction / bound, degrees",
            note: "",
            picked: &|c| circle(c) && direction(c),
            shown: &against_bound,
        },
    );
    table(
        out,
        cells,
        &Table {
            title: "Poses of one body: rms error of the direction / bound, degrees",
            note: "Neither estimator weighs orientations against positions; the bound does.",
            picked: &|c| c.scene.part == Part::Grid && c.scene.sigma_r_rad > 0.0 && direction(c),
            shown: &against_bound,
        },
    );
}

/// Four markers of a body.
fn four_markers(out: &mut Page, cells: &[Cell]) {
    table(
        out,
        cells,
        &Table {
            title: "Four markers: efficiency of the direction",
            note: "The bundle against the bound of a rigid body, the others against that of markers that share an axis only.",
            picked: &|c| c.scene.part == Part::Markers && direction(c),
            shown: &efficiency,
        },
    );
    table(
        out,
        cells,
        &Table {
            title: "Four markers: rms error of the direction / bound, degrees",
            note: "",
            picked: &|c| c.scene.part == Part::Markers && direction(c),
            shown: &against_bound,
        },
    );
    table(
        out,
        cells,
        &Table {
            title: "Four markers: rms offset of the axis / bound, mm",
            note: "",
            picked: &|c| c.scene.part == Part::Markers && c.quantity == Quantity::Offset,
            shown: &against_bound,
        },
    );
}

/// The frame from two axes.
fn frames(out: &mut Page, cells: &[Cell]) {
    table(
        out,
        cells,
        &Table {
            title: "The frame: rms rotation / bound, degrees",
            note: "",
            picked: &|c| c.quantity == Quantity::Turn,
            shown: &against_bound,
        },
    );
    table(
        out,
        cells,
        &Table {
            title: "The frame: rms translation / bound, mm",
            note: "",
            picked: &|c| c.quantity == Quantity::Shift,
            shown: &against_bound,
        },
    );
}
