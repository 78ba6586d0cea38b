//! The study for people: standing, claims, and tables of one line for each scene.

use std::fmt::Write;

use super::text::{probability, three, three_or_dash, with_error};
use crate::{
    cell::{Cell, Part, Quantity, Scene, shortest},
    held::Standing,
    run::{Study, StudyResult},
};

/// The whole study as Markdown.
#[must_use]
pub fn markdown(result: &StudyResult) -> String {
    let mut out = String::new();
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
    match result.study {
        Study::Cor => cor(&mut out, &result.cells),
        Study::Aor => aor(&mut out, &result.cells),
    }
    out
}

fn standards(out: &mut String, result: &StudyResult) {
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
                    if s.text.ends_with("upper end") {
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

fn claims(out: &mut String, result: &StudyResult) {
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

/// mm or degrees.
fn shown(cell: &Cell, value: Option<f64>) -> String {
    three_or_dash(value.map(|v| {
        if cell.quantity.is_angle() {
            v.to_degrees()
        } else {
            v * 1e3
        }
    }))
}

/// Which scenes, which lines, and what stands in the cells of a table.
struct Table<'a> {
    title: &'a str,
    note: &'a str,
    picked: &'a dyn Fn(&Cell) -> bool,
    shown: &'a dyn Fn(&Cell) -> String,
}

/// A column that belongs to the scene, whatever the method.
type Beside = (&'static str, fn(&Cell) -> Option<f64>);

/// Lines are scenes, columns methods; a method that does not occur in a scene leaves a blank.
fn table(out: &mut String, cells: &[Cell], t: &Table<'_>) {
    table_beside(out, cells, t, &[]);
}

/// The same with columns of the scene itself after the methods'.
fn table_beside(out: &mut String, cells: &[Cell], t: &Table<'_>, beside: &[Beside]) {
    let picked: Vec<&Cell> = cells.iter().filter(|c| (t.picked)(c)).collect();
    let (mut scenes, mut methods): (Vec<&Scene>, Vec<&str>) = (Vec::new(), Vec::new());
    for cell in &picked {
        if !scenes.contains(&&cell.scene) {
            scenes.push(&cell.scene);
        }
        if !methods.contains(&cell.method.as_str()) {
            methods.push(&cell.method);
        }
    }
    if scenes.is_empty() {
        return;
    }
    let _ = writeln!(out, "## {}\n", t.title);
    if !t.note.is_empty() {
        let _ = writeln!(out, "{}\n", t.note);
    }
    let _ = writeln!(
        out,
        "| motion | n | r mm | σ mm | σ ° | {} |",
        methods
            .iter()
            .copied()
            .chain(beside.iter().map(|(name, _)| *name))
            .collect::<Vec<_>>()
            .join(" | ")
    );
    let _ = writeln!(
        out,
        "|---|---|---|---|---|{}",
        "---|".repeat(methods.len() + beside.len())
    );
    for scene in scenes {
        let mut motion = scene.motion.clone();
        if !scene.condition.is_empty() {
            motion = format!("{motion}, {}", scene.condition);
        }
        let _ = write!(
            out,
            "| {motion} | {} | {} | {} | {} |",
            scene.samples,
            shortest(scene.radius_m * 1e3),
            shortest(scene.sigma_t_m * 1e3),
            shortest(scene.sigma_r_rad.to_degrees()),
        );
        for method in &methods {
            let found = picked
                .iter()
                .find(|c| c.scene == *scene && c.method == *method);
            let _ = write!(
                out,
                " {} |",
                found.map_or_else(String::new, |c| (t.shown)(c))
            );
        }
        for (_, value) in beside {
            let found = picked.iter().find(|c| c.scene == *scene);
            let value = found.and_then(|c| value(c));
            let _ = write!(
                out,
                " {} |",
                value.map_or_else(|| "—".to_owned(), |v| format!("{v:.3}"))
            );
        }
        out.push('\n');
    }
    out.push('\n');
}

/// Error against its bound.
fn against_bound(cell: &Cell) -> String {
    format!("{} / {}", shown(cell, cell.rms), shown(cell, cell.bound))
}

fn efficiency(cell: &Cell) -> String {
    let mut text = with_error(cell.efficiency, cell.efficiency_mc);
    if cell.answered < cell.trials {
        let none = cell.trials - cell.answered;
        let _ = write!(text, " ({none} of {} without answer)", cell.trials);
    }
    text
}

fn cor(out: &mut String, cells: &[Cell]) {
    let hand = |c: &Cell| c.scene.part == Part::Grid && c.scene.motion == "hand";
    let paper = |c: &Cell| {
        matches!(
            c.method.as_str(),
            "hse" | "hsa" | "sfe" | "hotspot_ml, σ known"
        )
    };
    let still = |c: &Cell| c.scene.sigma_r_rad == 0.0;
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

/// Counts with the upper end of their interval.
fn rates(
    out: &mut String,
    cells: &[Cell],
    title: &str,
    picked: &dyn Fn(&Cell) -> bool,
    count: &dyn Fn(&Cell) -> u64,
) {
    table(
        out,
        cells,
        &Table {
            title,
            note: "Count of trials, and the upper end of the rate's one-sided 95 % interval. Methods and scenes without any are left out where others have some.",
            picked,
            shown: &|c| {
                let (_, high) = probability(count(c), c.trials);
                format!("{} of {} (< {})", count(c), c.trials, three(high))
            },
        },
    );
}

fn aor(out: &mut String, cells: &[Cell]) {
    let direction = |c: &Cell| c.quantity == Quantity::Direction;
    let circle = |c: &Cell| c.scene.part == Part::Grid && c.scene.sigma_r_rad == 0.0;
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
    table(
        out,
        cells,
        &Table {
            title: "The frame: rms turn / bound, degrees",
            note: "",
            picked: &|c| c.quantity == Quantity::Turn,
            shown: &against_bound,
        },
    );
    table(
        out,
        cells,
        &Table {
            title: "The frame: rms shift / bound, mm",
            note: "",
            picked: &|c| c.quantity == Quantity::Shift,
            shown: &against_bound,
        },
    );
}
