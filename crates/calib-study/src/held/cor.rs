//! What the estimators of centers have to reach.

use super::{Standard, Value, efficiencies, judge, rates};
use crate::{
    cell::{Cell, Part},
    render::text::label,
};

/// All standards, in the order of the page.
pub(super) fn standards(cells: &[Cell]) -> Vec<Standard> {
    [
        unweighted(cells),
        weighted(cells),
        biases(cells),
        outliers(cells),
        one_axis(cells),
        refusals(cells),
    ]
    .concat()
}

/// Methods that choose their samples.
fn is_robust(cell: &Cell) -> bool {
    matches!(cell.estimator.as_str(), "robust" | "consensus")
}

/// Point estimators that are meant to reach the bound: Kåsa's and its several-marker form are not.
fn is_good_sphere(cell: &Cell) -> bool {
    matches!(
        cell.estimator.as_str(),
        "sfe" | "sfa" | "taubin" | "hyper" | "hyper_n" | "halvorsen" | "ml_sphere" | "sphere_eiv"
    )
}

/// Points, poses and bundles of markers.
fn unweighted(cells: &[Cell]) -> Vec<Standard> {
    let grid = |c: &Cell| c.scene.part == Part::Grid && c.scene.motion == "hand";
    vec![
        judge(
            "points, σ ≤ 2.5 mm, hand: efficiency",
            0.97,
            true,
            efficiencies(cells, |c| {
                grid(c) && is_good_sphere(c) && c.scene.sigma_t_m < 2.6e-3
            }),
        ),
        judge(
            "hot-spot ML with known σ, hand: efficiency",
            0.985,
            true,
            efficiencies(cells, |c| grid(c) && c.method == "hotspot_ml, σ known"),
        ),
        judge(
            "ball bundle: efficiency",
            0.995,
            true,
            efficiencies(cells, |c| {
                c.scene.part == Part::Markers && c.estimator == "ball_bundle"
            }),
        ),
    ]
}

/// Spheres weighted by covariances, under noise along the line of sight.
fn weighted(cells: &[Cell]) -> Vec<Standard> {
    vec![
        judge(
            "sphere weighted by covariances (sphere_eiv), noise along the sight ≤ 3 mm: efficiency",
            0.99,
            true,
            depth(cells, 0.0, 3.1e-3),
        ),
        judge(
            "the same, noise along the sight 5 mm",
            0.99,
            true,
            depth(cells, 3.1e-3, 5.1e-3),
        ),
        judge(
            "the same, noise along the sight 7.5 to 25 mm",
            0.99,
            true,
            depth(cells, 5.1e-3, 1.0),
        ),
        judge(
            "the same where an unbiased estimator can have 0.99 (column `unbiased ≤`)",
            0.99,
            true,
            within(cells, 5.1e-3, |c| {
                c.unbiased_limit
                    .is_some_and(|limit| limit >= 0.99)
                    .then_some(1.0)
            }),
        ),
        judge(
            "the same over what is left to second order, noise along the sight 5 to 25 mm",
            0.99,
            true,
            within(cells, 3.1e-3, |c| c.second_order_limit),
        ),
    ]
}

/// The bias of short arcs, in units of the measurement noise and of the estimate's own spread.
fn biases(cells: &[Cell]) -> Vec<Standard> {
    let mut out = Vec::new();
    let arc = |c: &&Cell| {
        c.scene.part == Part::Arc
            && matches!(c.method.as_str(), "sphere_eiv" | "hotspot_ml, σ known")
    };
    let biases = |unit: &dyn Fn(&Cell) -> Option<f64>| -> Vec<Value> {
        cells
            .iter()
            .filter(arc)
            .filter_map(|c| {
                let unit = unit(c)?;
                Some((label(c), c.bias? / unit, c.bias_mc? / unit))
            })
            .collect()
    };
    out.push(judge(
        "bias / σ of the measurements, arcs 180° to 20° (sphere_eiv, hotspot_ml)",
        0.1,
        false,
        biases(&|c| Some(c.scene.sigma_t_m)),
    ));
    out.push(judge(
        "bias / rms error of the estimate, the same cells",
        0.1,
        false,
        biases(&|c| c.rms),
    ));
    out
}

/// Outliers, against the clean recording of the same trials.
fn outliers(cells: &[Cell]) -> Vec<Standard> {
    let mut out = Vec::new();
    for (reach, text) in [
        (
            "±500 mm",
            "30 % outliers of ±500 mm: rms / rms of the clean recording",
        ),
        (
            "±20 mm",
            "30 % outliers of ±20 mm: rms / rms of the clean recording",
        ),
    ] {
        for samples in [63, 16, 9] {
            out.push(judge(
                &format!("{text}, n = {samples}"),
                1.3,
                false,
                outlier_ratios(cells, reach, samples),
            ));
        }
    }
    out
}

/// Sweeps of one axis that are called a center.
fn one_axis(cells: &[Cell]) -> Vec<Standard> {
    let mut out = Vec::new();
    let kind = |c: &Cell| match c.estimator.as_str() {
        "sfa" => "sfa, which is too slow for a proof",
        _ if is_robust(c) => "robust and consensus methods",
        _ => "plain methods",
    };
    for methods in [
        "plain methods",
        "robust and consensus methods",
        "sfa, which is too slow for a proof",
    ] {
        out.push(rates(
            &format!("one-axis sweeps called a center, σ 0.01–5 mm, {methods}: rate, upper end"),
            1e-3,
            cells,
            |c| c.scene.part == Part::OneAxis && kind(c) == methods,
            |c| c.observable,
        ));
    }
    out
}

/// Good grids that are refused (no center is given) or called weak.
fn refusals(cells: &[Cell]) -> Vec<Standard> {
    let mut out = Vec::new();
    for (robust, doubted, text) in [
        (false, false, "hand and head grids refused, plain methods"),
        (
            true,
            false,
            "hand and head grids refused, robust and consensus methods",
        ),
        (
            false,
            true,
            "hand and head grids refused or called weak, plain methods",
        ),
    ] {
        out.push(rates(
            &format!("{text}: rate, upper end"),
            1e-3,
            cells,
            |c| c.scene.part == Part::Grid && is_robust(c) == robust,
            |c| c.trials - if doubted { c.observable } else { c.answered },
        ));
    }
    out
}

/// Efficiencies under noise along the line of sight of a size between the two, m.
fn depth(cells: &[Cell], above: f64, to: f64) -> Vec<Value> {
    efficiencies(cells, |c| is_deep(c, above, to))
}

/// The same above a size, over what `limit` says can be had; cells without a limit are left out.
fn within(cells: &[Cell], above: f64, limit: impl Fn(&Cell) -> Option<f64>) -> Vec<Value> {
    cells
        .iter()
        .filter(|c| is_deep(c, above, 1.0))
        .filter_map(|c| {
            let limit = limit(c)?;
            Some((label(c), c.efficiency? / limit, c.efficiency_mc? / limit))
        })
        .collect()
}

fn is_deep(cell: &Cell, above: f64, to: f64) -> bool {
    let ratio = if cell.scene.condition == "depth × 5" {
        5.0
    } else {
        3.0
    };
    let along = ratio * cell.scene.sigma_t_m;
    cell.method == "sphere_eiv, covariances" && along > above && along < to
}

/// rms of the robust methods over that of the plain one on the clean recording of the same trials.
fn outlier_ratios(cells: &[Cell], reach: &str, samples: usize) -> Vec<Value> {
    let here = |c: &&Cell| {
        c.scene.part == Part::Outliers
            && c.scene.samples == samples
            && c.scene.condition.contains(reach)
    };
    let mut out = Vec::new();
    for (clean, way) in [
        ("ml_sphere, clean", "robust, points"),
        ("ml_sphere, clean", "robust, points, σ known"),
        ("hotspot_ml, clean", "robust, poses"),
        ("hotspot_ml, clean", "robust, poses, σ known"),
    ] {
        let find = |name: &str| cells.iter().filter(here).find(|c| c.method == name);
        if let (Some(clean), Some(robust)) = (find(clean), find(way))
            && let (Some(r), Some(r_mc), Some(c), Some(c_mc)) =
                (robust.rms, robust.rms_mc, clean.rms, clean.rms_mc)
        {
            // As if independent: the same poses are in both, so this errs to the large side.
            let ratio = r / c;
            out.push((label(robust), ratio, ratio * (r_mc / r).hypot(c_mc / c)));
        }
    }
    out
}
