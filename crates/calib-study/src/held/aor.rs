//! What the estimators of axes and frames have to reach.

use super::{Standard, Value, efficiencies, judge};
use crate::{
    cell::{Cell, Part, Quantity},
    render::text::label,
};

/// All standards, in the order of the page.
pub(super) fn standards(cells: &[Cell]) -> Vec<Standard> {
    [axes(cells), frames(cells)].concat()
}

/// Hinges and circles.
fn axes(cells: &[Cell]) -> Vec<Standard> {
    let of = |part: Part, quantity: Quantity, method: &'static str| {
        efficiencies(cells, move |c| {
            c.scene.part == part && c.quantity == quantity && c.method == method
        })
    };
    vec![
        judge(
            "hinge bundle, 4 markers, arcs 180° and 125°: efficiency of the direction",
            0.98,
            true,
            efficiencies(cells, |c| {
                c.method == "hinge_bundle"
                    && c.quantity == Quantity::Direction
                    && matches!(c.scene.motion.as_str(), "arc 180°" | "arc 125°")
            }),
        ),
        judge(
            "hinge bundle, 4 markers, arcs 60° and 20°: efficiency of the direction",
            0.98,
            true,
            efficiencies(cells, |c| {
                c.method == "hinge_bundle"
                    && c.quantity == Quantity::Direction
                    && matches!(c.scene.motion.as_str(), "arc 60°" | "arc 20°")
            }),
        ),
        judge(
            "hinge bundle with encoder: efficiency of the direction",
            0.98,
            true,
            of(Part::Markers, Quantity::Direction, "hinge_bundle, encoder"),
        ),
        judge(
            "one circle, Gauss–Newton: efficiency of the direction",
            0.97,
            true,
            of(Part::Grid, Quantity::Direction, "planar_radial_gn"),
        ),
    ]
}

/// Frames from two axes.
fn frames(cells: &[Cell]) -> Vec<Standard> {
    let of = |part: Part, quantity: Quantity, method: &'static str| {
        efficiencies(cells, move |c| {
            c.scene.part == part && c.quantity == quantity && c.method == method
        })
    };
    let frame = |quantity, unit: f64, sigma: f64, sigma_r: f64| -> Vec<Value> {
        cells
            .iter()
            .filter(|c| {
                c.method == "frame_ml, in the tracker"
                    && c.quantity == quantity
                    && (c.scene.sigma_t_m - sigma).abs() < 1e-9
                    && (c.scene.sigma_r_rad - sigma_r.to_radians()).abs() < 1e-9
            })
            .filter_map(|c| Some((label(c), c.rms? * unit, c.rms_mc? * unit)))
            .collect()
    };
    vec![
        judge(
            "frame ML: efficiency of the rotation",
            0.97,
            true,
            of(Part::Frame, Quantity::Turn, "frame_ml"),
        ),
        judge(
            "frame ML: efficiency of the translation",
            0.97,
            true,
            of(Part::Frame, Quantity::Shift, "frame_ml"),
        ),
        judge(
            "frame ML on 6 × 6, 1 mm, 0.5°, in the tracker: rms of the rotation, degrees",
            0.165,
            false,
            frame(Quantity::Turn, 180.0 / std::f64::consts::PI, 1e-3, 0.5),
        ),
        judge(
            "frame ML on 6 × 6, 1 mm, 0.5°, in the tracker: rms of the translation, mm",
            0.375,
            false,
            frame(Quantity::Shift, 1e3, 1e-3, 0.5),
        ),
    ]
}
