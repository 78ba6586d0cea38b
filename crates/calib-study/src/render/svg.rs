//! Pictures of a study: lines over logarithmic axes, plain paths.

use std::fmt::Write;

use crate::{
    cell::{Cell, Part, Quantity},
    run::StudyResult,
    settings::Study,
};

/// A picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Figure {
    /// Stem of its file.
    pub name: String,
    /// The `<svg>` document.
    pub svg: String,
}

/// Width and height in user units, and the frame's margins (left, right, top, bottom).
const SIZE: [f64; 2] = [560.0, 360.0];
const MARGINS: [f64; 4] = [62.0, 170.0, 34.0, 46.0];
/// Seven colors that stay apart in print and for the color-blind (Okabe & Ito 2008).
const COLORS: [&str; 7] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#333333",
];

struct Series {
    name: String,
    dashed: bool,
    points: Vec<[f64; 2]>,
}

struct Plot {
    name: String,
    title: String,
    x: &'static str,
    y: &'static str,
    /// Places on the horizontal axis, in order, evenly spaced: the study's levels.
    levels: Vec<f64>,
    series: Vec<Series>,
}

/// The figures of a study.
#[must_use]
pub fn svg(result: &StudyResult) -> Vec<Figure> {
    let plots = match result.study {
        Study::Cor => cor(&result.cells),
        Study::Aor => aor(&result.cells),
    };
    plots
        .iter()
        .filter(|p| p.series.iter().any(|s| !s.points.is_empty()))
        .map(|p| Figure {
            name: format!("{}-{}", result.study.word(), p.name),
            svg: draw(p),
        })
        .collect()
}

fn series(
    cells: &[Cell],
    name: &str,
    dashed: bool,
    picked: impl Fn(&Cell) -> bool,
    x: impl Fn(&Cell) -> f64,
    y: impl Fn(&Cell) -> Option<f64>,
) -> Series {
    let mut points: Vec<[f64; 2]> = cells
        .iter()
        .filter(|c| picked(c))
        .filter_map(|c| Some([x(c), y(c)?]))
        .filter(|[_, y]| y.is_finite() && *y > 0.0)
        .collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    Series {
        name: name.to_owned(),
        dashed,
        points,
    }
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

fn cor(cells: &[Cell]) -> Vec<Plot> {
    let mut plots = Vec::new();
    for samples in crate::cor::COUNTS {
        let here = |c: &Cell, method: &str| {
            c.scene.part == Part::Grid
                && c.scene.motion == "hand"
                && c.scene.samples == samples
                && near(c.scene.radius_m, 0.1)
                && near(c.scene.sigma_t_m, 1e-3)
                && c.method == method
        };
        let x = |c: &Cell| c.scene.sigma_r_rad.to_degrees();
        let rms = |c: &Cell| c.rms.map(|v| v * 1e3);
        let bound = |c: &Cell| c.bound.map(|v| v * 1e3);
        let mut lines = Vec::new();
        for (name, method) in [
            ("HSE", "hse"),
            ("hot-spot ML, σ known", "hotspot_ml, σ known"),
            ("hot-spot ML", "hotspot_ml"),
            ("SFE", "sfe"),
        ] {
            lines.push(series(cells, name, false, |c| here(c, method), x, rms));
        }
        lines.push(series(
            cells,
            "bound, poses",
            true,
            |c| here(c, "hse"),
            x,
            bound,
        ));
        lines.push(series(
            cells,
            "bound, positions",
            true,
            |c| here(c, "sfe"),
            x,
            bound,
        ));
        plots.push(Plot {
            name: format!("orientation-noise-{samples}"),
            title: format!("Center from {samples} poses, r 100 mm, σ 1 mm"),
            x: "orientation noise, °",
            y: "rms error, mm",
            levels: crate::cor::TURNS_DEG.to_vec(),
            series: lines,
        });
    }
    let here = |c: &Cell, method: &str| {
        c.scene.part == Part::Arc && near(c.scene.sigma_t_m, 1e-4) && c.method == method
    };
    let x = |c: &Cell| degrees(&c.scene.motion);
    let mut levels = crate::cor::ARCS_DEG.to_vec();
    levels.reverse();
    let mut lines = Vec::new();
    for (name, method) in [
        ("Kåsa", "kasa"),
        ("SFE", "sfe"),
        ("Hyper", "hyper"),
        ("ML sphere", "ml_sphere"),
        ("HSE", "hse"),
        ("hot-spot ML, σ known", "hotspot_ml, σ known"),
    ] {
        let bias = |c: &Cell| c.bias.map(|v| v / c.scene.sigma_t_m);
        lines.push(series(cells, name, false, |c| here(c, method), x, bias));
    }
    plots.push(Plot {
        name: "bias".to_owned(),
        title: "Bias on short arcs, r 250 mm, σ 0.1 mm, 0.1°".to_owned(),
        x: "range of both axes, °",
        y: "|mean error| / σ",
        levels,
        series: lines,
    });
    plots
}

/// The number that a motion's name holds: `arc 20°`, `20° × 20°`.
fn degrees(motion: &str) -> f64 {
    motion
        .split(|c: char| !c.is_ascii_digit())
        .find_map(|word| word.parse().ok())
        .unwrap_or(f64::NAN)
}

fn aor(cells: &[Cell]) -> Vec<Plot> {
    let mut plots = Vec::new();
    let rms = |c: &Cell| c.rms.map(f64::to_degrees);
    let bound = |c: &Cell| c.bound.map(f64::to_degrees);
    let sigma = |c: &Cell| c.scene.sigma_t_m * 1e3;
    for (motion, word) in [("hand z", "z"), ("hand x", "x")] {
        let mut lines = Vec::new();
        for samples in crate::aor::COUNTS {
            let here = move |c: &Cell| {
                c.scene.part == Part::Grid
                    && c.scene.motion == motion
                    && c.scene.samples == samples
                    && near(c.scene.radius_m, 0.1)
                    && c.method == "planar_radial_gn"
                    && c.quantity == Quantity::Direction
            };
            lines.push(series(
                cells,
                &format!("n = {samples}"),
                false,
                here,
                sigma,
                rms,
            ));
            lines.push(series(
                cells,
                &format!("bound, n = {samples}"),
                true,
                here,
                sigma,
                bound,
            ));
        }
        plots.push(Plot {
            name: format!("noise-{word}"),
            title: format!("Axis {word} from one circle, r 100 mm"),
            x: "position noise, mm",
            y: "rms error, °",
            levels: crate::aor::SIGMAS_MM.to_vec(),
            series: lines,
        });
    }
    let mut lines = Vec::new();
    for (name, method) in [
        ("planes", "plane"),
        ("common line", "line_ml"),
        ("Halvorsen's line", "halvorsen_line"),
        ("hinge bundle", "hinge_bundle"),
        ("bundle with encoder", "hinge_bundle, encoder"),
    ] {
        let here = move |c: &Cell| arc_cell(c, method);
        let x = |c: &Cell| degrees(&c.scene.motion);
        lines.push(series(cells, name, false, here, x, rms));
    }
    let here = |c: &Cell| arc_cell(c, "hinge_bundle");
    let x = |c: &Cell| degrees(&c.scene.motion);
    lines.push(series(cells, "bound, rigid body", true, here, x, bound));
    let mut levels = crate::aor::ARCS_DEG.to_vec();
    levels.reverse();
    plots.push(Plot {
        name: "arcs".to_owned(),
        title: "Axis from four markers, n = 10, r 100 mm, σ 1 mm".to_owned(),
        x: "arc, °",
        y: "rms error, °",
        levels,
        series: lines,
    });
    plots
}

fn arc_cell(c: &Cell, method: &str) -> bool {
    c.scene.part == Part::Markers
        && c.scene.samples == 10
        && near(c.scene.radius_m, 0.1)
        && near(c.scene.sigma_t_m, 1e-3)
        && c.method == method
        && c.quantity == Quantity::Direction
}

fn draw(plot: &Plot) -> String {
    let [width, height] = SIZE;
    let [left, right, top, bottom] = MARGINS;
    let (x0, x1, y0, y1) = (left, width - right, height - bottom, top);
    let values = || {
        plot.series
            .iter()
            .flat_map(|s| s.points.iter().map(|p| p[1]))
    };
    // Whole decades would waste the frame: a tenth of a decade around the data.
    let low = values().fold(f64::INFINITY, f64::min).log10() - 0.1;
    let high = values().fold(0.0, f64::max).log10() + 0.1;
    let last = (plot.levels.len().max(2) - 1) as f64;
    let place_x = |x: f64| {
        let k = plot.levels.iter().position(|l| (l - x).abs() < 1e-6);
        k.map(|k| x0 + (x1 - x0) * k as f64 / last)
    };
    let place_y = |y: f64| y0 + (y1 - y0) * (y.log10() - low) / (high - low);

    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"12\" role=\"img\">\
         <title>{}</title><rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n",
        escape(&plot.title)
    );
    let _ = writeln!(
        out,
        "<text x=\"{left}\" y=\"20\" font-weight=\"bold\">{}</text>\
         <path d=\"M{x0} {y1}V{y0}H{x1}\" fill=\"none\" stroke=\"#333\"/>\
         <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
         <text x=\"16\" y=\"{:.1}\" text-anchor=\"middle\" transform=\"rotate(-90 16 {:.1})\">{}</text>",
        escape(&plot.title),
        (x0 + x1) / 2.0,
        height - 10.0,
        escape(plot.x),
        (y0 + y1) / 2.0,
        (y0 + y1) / 2.0,
        escape(plot.y),
    );
    for (k, level) in plot.levels.iter().enumerate() {
        let x = x0 + (x1 - x0) * k as f64 / last;
        let _ = writeln!(
            out,
            "<path d=\"M{x:.1} {y0}v4\" stroke=\"#333\"/><text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{level}</text>",
            y0 + 17.0
        );
    }
    for exponent in (low.floor() as i32)..=(high.ceil() as i32) {
        for digit in [1.0, 2.0, 5.0] {
            let value = digit * 10f64.powi(exponent);
            if value.log10() < low || value.log10() > high {
                continue;
            }
            let y = place_y(value);
            let text = format!("{}", (value * 1e6).round() / 1e6);
            let _ = writeln!(
                out,
                "<path d=\"M{x0} {y:.1}H{x1}\" stroke=\"#ddd\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
                x0 - 6.0,
                y + 4.0
            );
        }
    }
    for (k, series) in plot.series.iter().enumerate() {
        let color = COLORS[k % COLORS.len()];
        let dash = if series.dashed {
            " stroke-dasharray=\"5 4\""
        } else {
            ""
        };
        let mut d = String::new();
        for [x, y] in &series.points {
            if let Some(x) = place_x(*x) {
                let y = place_y(*y);
                let _ = write!(d, "{}{x:.1} {y:.1}", if d.is_empty() { "M" } else { "L" });
                if !series.dashed {
                    let _ = writeln!(
                        out,
                        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{color}\"/>"
                    );
                }
            }
        }
        let key = top + 8.0 + 18.0 * k as f64;
        let _ = writeln!(
            out,
            "<path d=\"{d}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.6\"{dash}/>\
             <path d=\"M{:.1} {key:.1}h22\" stroke=\"{color}\" stroke-width=\"1.6\"{dash}/>\
             <text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            x1 + 10.0,
            x1 + 38.0,
            key + 4.0,
            escape(&series.name)
        );
    }
    out.push_str("</svg>\n");
    out
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
