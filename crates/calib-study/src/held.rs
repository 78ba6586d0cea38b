//! What the estimators are required to reach, judged cell by cell.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{
    cell::{Cell, Part, Quantity},
    render::text::{label, probability},
    run::Study,
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
    judge(text, limit, false, values)
}

/// Methods that choose their samples.
fn is_robust(cell: &Cell) -> bool {
    matches!(cell.estimator.as_str(), "robust" | "consensus")
}

/// The standards of a study.
pub(crate) fn standards(study: Study, cells: &[Cell]) -> Vec<Standard> {
    match study {
        Study::Cor => cor(cells),
        Study::Aor => aor(cells),
    }
}

/// Point estimators that are meant to reach the bound: Kåsa's and its several-marker form are not.
fn is_good_sphere(cell: &Cell) -> bool {
    matches!(
        cell.estimator.as_str(),
        "sfe" | "sfa" | "taubin" | "hyper" | "hyper_n" | "halvorsen" | "ml_sphere" | "sphere_eiv"
    )
}

fn cor(cells: &[Cell]) -> Vec<Standard> {
    let grid = |c: &Cell| c.scene.part == Part::Grid && c.scene.motion == "hand";
    let mut out = vec![
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
    ];
    // The bias in units of the measurement noise, and in units of the estimate's own spread.
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
    // Refused: no center is given. Doubted: it is given, but called weak.
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

fn aor(cells: &[Cell]) -> Vec<Standard> {
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
        judge(
            "frame ML: efficiency of the turn",
            0.97,
            true,
            of(Part::Frame, Quantity::Turn, "frame_ml"),
        ),
        judge(
            "frame ML: efficiency of the shift",
            0.97,
            true,
            of(Part::Frame, Quantity::Shift, "frame_ml"),
        ),
        judge(
            "frame ML on 6 × 6, 1 mm, 0.5°, in the tracker: rms of the turn, degrees",
            0.165,
            false,
            frame(Quantity::Turn, 180.0 / std::f64::consts::PI, 1e-3, 0.5),
        ),
        judge(
            "frame ML on 6 × 6, 1 mm, 0.5°, in the tracker: rms of the shift, mm",
            0.375,
            false,
            frame(Quantity::Shift, 1e3, 1e-3, 0.5),
        ),
    ]
}
