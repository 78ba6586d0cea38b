//! Tables of the study of centers.

use std::fmt::Write;

use super::{
    page::Page,
    table::{Table, against_bound, efficiency, rates, shown, table, table_beside},
};
use crate::{
    cell::{Cell, Part},
    render::text::three_or_dash,
};

/// All tables, in the order of the page.
pub(super) fn tables(out: &mut Page, cells: &[Cell]) {
    grid(out, cells);
    markers_and_depth(out, cells);
    arcs_and_outliers(out, cells);
}

/// A grid of the paper's hand.
fn hand(c: &Cell) -> bool {
    c.scene.part == Part::Grid && c.scene.motion == "hand"
}

/// A cell whose orientations are exact.
fn still(c: &Cell) -> bool {
    c.scene.sigma_r_rad == 0.0
}

/// The paper's own methods.
fn paper(c: &Cell) -> bool {
    matches!(
        c.method.as_str(),
        "hse" | "hsa" | "sfe" | "hotspot_ml, σ known"
    )
}

/// The grid of the paper.
fn grid(out: &mut Page, cells: &[Cell]) {
    table(
        out,
        cells,
        &Table {
            title: "The paper's methods",
            note: "rms error / bound, mm. The bound is that of the data each method uses: positions for `sfe`, poses for the rest.",
            picked: &|c| hand(c) && paper(c),
            shown: &against_bound,
        },
    );
    table(
        out,
        cells,
        &Table {
            title: "Hot spots: efficiency",
            note: "Poses, known noise and noise estimated from the residuals.",
            picked: &|c| {
                hand(c)
                    && matches!(
                        c.method.as_str(),
                        "hse"
                            | "hotspot_ml"
                            | "hotspot_ml, σ known"
                            | "robust, poses"
                            | "consensus, poses"
                    )
            },
            shown: &efficiency,
        },
    );
    table(
        out,
        cells,
        &Table {
            title: "Spheres: efficiency",
            note: "Positions only: orientation noise plays no part.",
            picked: &|c| {
                hand(c)
                    && still(c)
                    && c.estimator != "hse"
                    && c.estimator != "hsa"
                    && c.estimator != "hotspot_ml"
            },
            shown: &efficiency,
        },
    );
    table(
        out,
        cells,
        &Table {
            title: "Mean size of the error and size of the mean error",
            note: "mean |e| / |mean e| ± Monte-Carlo error, mm.",
            picked: &|c| {
                hand(c)
                    && still(c)
                    && matches!(c.method.as_str(), "sfe" | "hse" | "kasa" | "ml_sphere")
            },
            shown: &|c| {
                format!(
                    "{} / {} ± {}",
                    shown(c, c.mean_abs),
                    shown(c, c.bias),
                    shown(c, c.bias_mc)
                )
            },
        },
    );
}

/// Several markers, noise along the line of sight, two bodies.
fn markers_and_depth(out: &mut Page, cells: &[Cell]) {
    table(
        out,
        cells,
        &Table {
            title: "Raw markers of a body: efficiency",
            note: "The bundle against the bound of a rigid body, the spheres against that of markers that move on their own.",
            picked: &|c| c.scene.part == Part::Markers,
            shown: &|c| format!("{}; rms {} mm", efficiency(c), shown(c, c.rms)),
        },
    );
    table_beside(
        out,
        cells,
        &Table {
            title: "Depth noise: efficiency",
            note: "σ is the noise across the line of sight. `unbiased ≤`: no unbiased estimator is above that, however the feet of the samples are found. \
                   `second order`: what is left to second order where direction and weight of a sample are read off the sample itself; at large noise, terms beyond it count. \
                   Both computed, not simulated (`calib_cor::bounds::sphere_center_weighted`).",
            picked: &|c| c.scene.part == Part::Depth,
            shown: &efficiency,
        },
        &[
            ("unbiased ≤", |c| c.unbiased_limit),
            ("second order", |c| c.second_order_limit),
        ],
    );
    table(
        out,
        cells,
        &Table {
            title: "Two moving bodies: efficiency",
            note: "The center in the second body, against the bound over both bodies' poses.",
            picked: &|c| c.scene.part == Part::Bodies,
            shown: &|c| format!("{}; rms {} mm", efficiency(c), shown(c, c.rms)),
        },
    );
}

/// Short arcs, outliers, and rates of refusal.
fn arcs_and_outliers(out: &mut Page, cells: &[Cell]) {
    table(
        out,
        cells,
        &Table {
            title: "Short arcs: bias",
            note: "|mean e| / σ of the measurements ± Monte-Carlo error; in brackets rms / σ.",
            picked: &|c| c.scene.part == Part::Arc,
            shown: &|c| {
                let sigma = c.scene.sigma_t_m;
                let over = |x: Option<f64>| three_or_dash(x.map(|x| x / sigma));
                format!("{} ± {} ({})", over(c.bias), over(c.bias_mc), over(c.rms))
            },
        },
    );
    table(
        out,
        cells,
        &Table {
            title: "Outliers: rms error, mm",
            note: "`clean`: the same recordings before their poses were moved; `inliers`: only the poses that were not moved; \
                   `known mixture`: one who knows the noise, the share of outliers, their distribution and every direction, but not which samples they are.",
            picked: &|c| c.scene.part == Part::Outliers,
            shown: &|c| {
                let mut text = shown(c, c.rms);
                if c.answered < c.trials {
                    let _ = write!(
                        text,
                        " ({} of {} without answer)",
                        c.trials - c.answered,
                        c.trials
                    );
                }
                text
            },
        },
    );
    rates(
        out,
        cells,
        "One-axis sweeps called a center",
        &|c| c.scene.part == Part::OneAxis,
        &|c| c.observable,
    );
    rates(
        out,
        cells,
        "Grids called not observable",
        &|c| c.scene.part == Part::Grid && c.observable < c.trials,
        &|c| c.trials - c.observable,
    );
}
