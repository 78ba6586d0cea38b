//! A case study as tables and a picture.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use calib_finding::cell as safe;
use calib_report::{LoopClosure, Stats};

use super::{CaseResult, METHODS, Off, Over, RobotResult};

/// What the paper printed: rows of Table 1 (torso 0, 90, 90, −90, 90°).
const TABLE_1: [(&str, [f64; 5]); 6] = [
    ("Max ‖e_t‖, cm", [0.86, 0.79, 0.79, 1.04, 0.82]),
    ("Mean ‖e_t‖, cm", [0.62, 0.56, 0.56, 0.76, 0.48]),
    ("Std ‖e_t‖, cm", [0.1, 0.11, 0.11, 0.12, 0.15]),
    ("Max \\|e_θ\\|, °", [1.34, 1.86, 1.86, 1.59, 1.23]),
    ("Mean \\|e_θ\\|, °", [0.93, 1.20, 1.66, 1.14, 0.89]),
    ("Std \\|e_θ\\|, °", [0.27, 0.31, 0.32, 0.27, 0.21]),
];
/// Table 2: max, mean, std of the difference of norms, mm.
const TABLE_2: [f64; 3] = [4.61, 4.56, 0.04];

/// The result as JSON.
///
/// # Errors
/// What `serde_json` finds, which a finished study does not have.
pub fn json(result: &CaseResult) -> Result<String, serde_json::Error> {
    Ok(serde_json::to_string_pretty(result)? + "\n")
}

/// One line for each robot, method, loop and group; lengths in mm, angles in degrees.
#[must_use]
pub fn csv(result: &CaseResult) -> String {
    let mut out = String::from(
        "seed,method,loop,group,samples,et_max_mm,et_mean_mm,et_std_mm,etheta_max_deg,etheta_mean_deg,etheta_std_deg,\
         norm_max_mm,norm_mean_mm,norm_std_mm\n",
    );
    let three = |s: Option<&Stats>, unit: f64| match s {
        Some(s) => format!("{},{},{}", s.max * unit, s.mean * unit, s.std * unit),
        None => ",,".to_owned(),
    };
    for r in &result.results {
        for l in &r.loops {
            let mut row = |group: &str, samples, t: &Stats, turn: Option<&Stats>, norm| {
                let _ = writeln!(
                    out,
                    "{},{},{},{},{samples},{},{},{}",
                    r.seed,
                    r.method,
                    safe(&l.name),
                    safe(group),
                    three(Some(t), 1e3),
                    three(turn, 1f64.to_degrees()),
                    three(norm, 1e3),
                );
            };
            row(
                "",
                l.samples,
                &l.translation_m,
                l.rotation_rad.as_ref(),
                l.norm_error_m.as_ref(),
            );
            for g in &l.groups {
                row(
                    &g.name,
                    g.samples,
                    &g.translation_m,
                    g.rotation_rad.as_ref(),
                    None,
                );
            }
        }
    }
    out
}

fn of_method<'a>(result: &'a CaseResult, method: &str) -> Vec<&'a RobotResult> {
    result
        .results
        .iter()
        .filter(|r| r.method == method)
        .collect()
}

/// `mean ± spread (largest)` over robots.
fn cell(values: &[f64], unit: f64) -> String {
    Over::of(values).map_or_else(
        || "—".to_owned(),
        |o| {
            format!(
                "{:.2} ± {:.2} (≤ {:.2})",
                o.mean * unit,
                o.spread * unit,
                o.largest * unit
            )
        },
    )
}

/// max, mean, std of one kind of error, by robot.
fn columns(stats: &[Stats]) -> [Vec<f64>; 3] {
    [
        stats.iter().map(|s| s.max).collect(),
        stats.iter().map(|s| s.mean).collect(),
        stats.iter().map(|s| s.std).collect(),
    ]
}

/// The tables of the paper, each cell the mean ± the spread over robots, and the largest of all robots.
#[must_use]
pub fn markdown(result: &CaseResult) -> String {
    let mut out = format!(
        "# Case study {}: {} simulated robots, seeds {} to {}\n\n\
         Every robot is another draw of geometry, offsets, mounts and noise as the profile's `simulate` section says. A cell is the mean over \
         robots ± their standard deviation (≤ the largest). `paper`: the two steps of the paper; `ml`: all at once by maximum likelihood.\n",
        result.study,
        result.robots,
        result.seed,
        result.seed.wrapping_add(result.robots - 1)
    );
    for (_, method) in METHODS {
        let robots = of_method(result, method);
        let failed = robots.iter().filter(|r| r.failure.is_some()).count();
        if failed > 0 {
            let _ = write!(
                out,
                "\n`{method}`: {failed} of {} without a result.\n",
                robots.len()
            );
        }
    }
    let loops: BTreeMap<&str, &LoopClosure> = result
        .results
        .iter()
        .flat_map(|r| r.loops.iter().map(|l| (l.name.as_str(), l)))
        .collect();
    for (name, example) in loops {
        if example.groups.is_empty() {
            table_2(&mut out, result, name);
        } else {
            table_1(&mut out, result, name, example);
        }
    }
    truth(&mut out, result);
    repeated(&mut out, result);
    out
}

fn table_1(out: &mut String, result: &CaseResult, name: &str, example: &LoopClosure) {
    let _ = write!(
        out,
        "\n## Loop `{name}` (the paper's Table 1)\n\n| error | method |"
    );
    for g in &example.groups {
        let _ = write!(out, " {} |", g.name);
    }
    let _ = writeln!(out, "\n|---|---|{}", "---|".repeat(example.groups.len()));
    let turning = example.groups.iter().any(|g| g.rotation_rad.is_some());
    for (row, (title, printed)) in TABLE_1.iter().enumerate() {
        if row >= 3 && !turning {
            break;
        }
        for (_, method) in METHODS {
            let _ = write!(out, "| {title} | {method} |");
            for group in 0..example.groups.len() {
                let stats: Vec<Stats> = of_method(result, method)
                    .iter()
                    .filter_map(|r| r.loops.iter().find(|l| l.name == name))
                    .filter_map(|l| l.groups.get(group))
                    .filter_map(|g| {
                        if row < 3 {
                            Some(g.translation_m)
                        } else {
                            g.rotation_rad
                        }
                    })
                    .collect();
                let unit = if row < 3 { 100.0 } else { 1f64.to_degrees() };
                let _ = write!(out, " {} |", cell(&columns(&stats)[row % 3], unit));
            }
            out.push('\n');
        }
        if result.study == "justin" && printed.len() == example.groups.len() {
            let _ = write!(out, "| {title} | *printed, the real robot* |");
            for value in printed {
                let _ = write!(out, " {value} |");
            }
            out.push('\n');
        }
    }
}

fn table_2(out: &mut String, result: &CaseResult, name: &str) {
    let _ = write!(
        out,
        "\n## Loop `{name}` (the paper's Table 2)\n\n\
         The paper compares lengths of vectors, which hides every error across them: the vector error stands beside it.\n\n\
         | error, mm | method | Max | Mean | Std |\n|---|---|---|---|---|\n"
    );
    for (title, norm) in [("difference of norms", true), ("vector ‖e_t‖", false)] {
        for (_, method) in METHODS {
            let stats: Vec<Stats> = of_method(result, method)
                .iter()
                .filter_map(|r| r.loops.iter().find(|l| l.name == name))
                .filter_map(|l| {
                    if norm {
                        l.norm_error_m
                    } else {
                        Some(l.translation_m)
                    }
                })
                .collect();
            let [max, mean, std] = columns(&stats).map(|c| cell(&c, 1e3));
            let _ = writeln!(out, "| {title} | {method} | {max} | {mean} | {std} |");
        }
    }
    if result.study == "ripley" {
        let [max, mean, std] = TABLE_2;
        let _ = writeln!(
            out,
            "| difference of norms | *printed, the real robot* | {max} | {mean} | {std} |"
        );
    }
}

fn truth(out: &mut String, result: &CaseResult) {
    out.push_str("\n## Found transforms against the truth\n\n");
    of_transforms(out, result, |r| &r.off);
}

/// What several recordings of one robot differ by: of one recording, the table is empty.
fn repeated(out: &mut String, result: &CaseResult) {
    let _ = write!(
        out,
        "\n## Repeatability (paper, §7)\n\nEvery robot recorded and calibrated {}: standard deviation of one calibration over its recordings. What is \
         wrong in every recording does not show in it.\n\n",
        match result.recorded {
            1 => "once (`--recorded 2` and more fill the table)".to_owned(),
            n => format!("{n} times"),
        }
    );
    for (_, method) in METHODS {
        let left_out = of_method(result, method)
            .iter()
            .filter(|r| r.failure.is_some() || r.failed_again > 0)
            .count();
        if result.recorded > 1 && left_out > 0 {
            let _ = write!(
                out,
                "`{method}`: {left_out} of {} robots are left out, for not every recording of theirs has a result.\n\n",
                result.robots
            );
        }
    }
    of_transforms(out, result, |r| &r.scatter);
}

fn of_transforms(
    out: &mut String,
    result: &CaseResult,
    of: fn(&RobotResult) -> &BTreeMap<String, Off>,
) {
    out.push_str("| transform | method | position, mm | orientation, ° |\n|---|---|---|---|\n");
    let names: std::collections::BTreeSet<&String> =
        result.results.iter().flat_map(|r| r.off.keys()).collect();
    for name in names {
        for (_, method) in METHODS {
            let off: Vec<_> = of_method(result, method)
                .iter()
                .filter_map(|r| of(r).get(name).copied())
                .collect();
            let position: Vec<f64> = off.iter().map(|o| o.translation_m).collect();
            let turn: Vec<f64> = off.iter().map(|o| o.rotation_rad).collect();
            let _ = writeln!(
                out,
                "| `{name}` | {method} | {} | {} |",
                cell(&position, 1e3),
                cell(&turn, 1f64.to_degrees())
            );
        }
    }
}

/// Mean ‖e_t‖ of every robot: one dot each, one row for each method and loop.
#[must_use]
pub fn svg(result: &CaseResult) -> String {
    let mut rows: Vec<(String, Vec<f64>)> = Vec::new();
    for r in &result.results {
        for l in &r.loops {
            let label = format!("{}, {}", l.name, r.method);
            match rows.iter_mut().find(|(name, _)| *name == label) {
                Some((_, values)) => values.push(l.translation_m.mean * 1e3),
                None => rows.push((label, vec![l.translation_m.mean * 1e3])),
            }
        }
    }
    rows.sort_by(|a, b| a.0.cmp(&b.0));
    let largest = rows
        .iter()
        .flat_map(|(_, v)| v.iter().copied())
        .fold(0.0, f64::max)
        .max(1e-6);
    let (left, width, step) = (200.0, 420.0, 36.0);
    let height = 60.0 + step * rows.len() as f64;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"660\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <text x=\"{left}\" y=\"20\">mean ‖e_t‖ of each robot, mm</text>\n"
    );
    for (k, (label, values)) in rows.iter().enumerate() {
        let y = 50.0 + step * k as f64;
        let _ = writeln!(out, "<text x=\"8\" y=\"{:.1}\">{label}</text>", y + 4.0);
        for value in values {
            let x = left + width * value / largest;
            let _ = writeln!(
                out,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"#2a6fb0\" fill-opacity=\"0.4\"/>"
            );
        }
    }
    let base = height - 12.0;
    for tick in 0..=4 {
        let value = largest * f64::from(tick) / 4.0;
        let x = left + width * f64::from(tick) / 4.0;
        let _ = writeln!(
            out,
            "<text x=\"{x:.1}\" y=\"{base:.1}\" text-anchor=\"middle\">{value:.2}</text>"
        );
    }
    out.push_str("</svg>\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(seed: u64, method: &str, scatter: Option<f64>) -> RobotResult {
        let off = |translation_m| Off {
            translation_m,
            rotation_rad: 0.0,
        };
        let named = |size: f64| BTreeMap::from([("t".to_owned(), off(size))]);
        RobotResult {
            seed,
            method: method.to_owned(),
            failure: None,
            loops: Vec::new(),
            off: named(1e-3),
            scatter: scatter.map(named).unwrap_or_default(),
            failed_again: u64::from(scatter.is_none()),
        }
    }

    #[test]
    fn robots_without_all_their_calibrations_are_counted() {
        let mut results = Vec::new();
        for (seed, of_paper) in [(0, Some(2e-3)), (1, None), (2, Some(4e-3))] {
            results.push(robot(seed, "paper", of_paper));
            results.push(robot(seed, "ml", Some(1e-3)));
        }
        let page = markdown(&CaseResult {
            study: "ripley".to_owned(),
            robots: 3,
            recorded: 4,
            seed: 0,
            results,
        });
        let (_, repeated) = page.split_once("## Repeatability").expect("a part");
        assert!(repeated.contains("`paper`: 1 of 3 robots are left out"));
        assert!(!repeated.contains("`ml`: "), "{repeated}");
        let mean_of_two = "| `t` | paper | 3.00 ± 1.41";
        assert!(repeated.contains(mean_of_two), "{repeated}");
    }
}
