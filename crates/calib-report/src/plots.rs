//! The plots of `report.html` as data: every plotted number, in the unit of its axis.

mod correlation;
mod distribution;
mod residuals;

use crate::{Report, RobotChange, Unit, number};
use serde::Serialize;

/// A plot.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plot {
    /// Unique in the page.
    pub id: String,
    /// The section it belongs to.
    pub section: &'static str,
    /// The heading.
    pub title: String,
    /// What it shows and how to read it, also for screen readers.
    pub description: String,
    /// The kind of plot and its data.
    pub kind: PlotKind,
}

/// Kinds of plots.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PlotKind {
    /// One row per item: a bar, a mark with whiskers, a tick.
    Rows {
        /// Label of the axis.
        axis: String,
        /// Top to bottom.
        rows: Vec<PlotRow>,
    },
    /// Points and lines over two axes.
    Xy {
        /// Label of the horizontal axis.
        x: String,
        /// Label of the vertical axis.
        y: String,
        /// Whether the vertical axis is logarithmic.
        log_y: bool,
        /// Drawn behind the series.
        band: Option<Band>,
        /// In the order of the legend; at most four.
        series: Vec<Series>,
    },
    /// Counts per bin, one strip per joint, each over its own range.
    Strips {
        /// Label of the axis that all strips share in kind.
        axis: String,
        /// Top to bottom.
        rows: Vec<Strip>,
    },
    /// Bars side by side over a variable, and a curve to compare them with.
    Bars {
        /// Label of the horizontal axis.
        x: String,
        /// Label of the vertical axis.
        y: String,
        /// From, to, height.
        bars: Vec<[f64; 3]>,
        /// The curve.
        curve: Series,
    },
    /// Numbers from −1 to 1 for pairs.
    Matrix {
        /// Label of the values.
        value: String,
        /// Of the rows and columns.
        names: Vec<String>,
        /// The lower triangle without its diagonal: row i has i values.
        rows: Vec<Vec<f64>>,
    },
    /// Values at places, seen along an axis.
    Map {
        /// Label of the values.
        value: String,
        /// Views.
        panels: Vec<Panel>,
    },
}

/// A row of [`PlotKind::Rows`].
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct PlotRow {
    /// Left of the row.
    pub label: String,
    /// Color and shape, 0 to 3: 0 is what was calibrated.
    pub style: usize,
    /// Length of the bar from zero.
    pub bar: Option<f64>,
    /// A dot.
    pub mark: Option<f64>,
    /// A thin line from, to.
    pub whisker: Option<[f64; 2]>,
    /// A short upright line: the largest value.
    pub tick: Option<f64>,
    /// The number as text, right of the row.
    pub text: String,
}

/// A series of [`PlotKind::Xy`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Series {
    /// In the legend.
    pub name: String,
    /// Color and shape, 0 to 3: 0 is what was calibrated.
    pub style: usize,
    /// Whether the points are joined.
    pub line: bool,
    /// x, y.
    pub points: Vec<[f64; 2]>,
}

/// A band of [`PlotKind::Xy`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Band {
    /// In the legend.
    pub name: String,
    /// x, lower end, upper end.
    pub points: Vec<[f64; 3]>,
}

/// A row of [`PlotKind::Strips`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Strip {
    /// The joint.
    pub label: String,
    /// Left end, as text.
    pub from: String,
    /// Right end, as text.
    pub to: String,
    /// Samples per bin.
    pub counts: Vec<u64>,
}

/// A view of [`PlotKind::Map`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Panel {
    /// Label of the horizontal axis.
    pub x: String,
    /// Label of the vertical axis.
    pub y: String,
    /// x, y, value.
    pub points: Vec<[f64; 3]>,
}

/// Rows in one plot: more are not readable.
const ROWS: usize = 40;

/// All plots of a report, in the order of the page.
#[must_use]
pub fn plots(report: &Report) -> Vec<Plot> {
    let mut plots = Vec::new();
    held_out(&mut plots, report);
    changes(&mut plots, report);
    loops(&mut plots, report);
    coverage(&mut plots, report);
    residuals::residuals(&mut plots, report);
    distribution::distribution(&mut plots, report);
    workspace(&mut plots, report);
    accuracy(&mut plots, report);
    correlation::correlation(&mut plots, report);
    plots
}

fn mm(meters: f64) -> f64 {
    meters * 1e3
}

fn held_out(plots: &mut Vec<Plot>, report: &Report) {
    let Some(held_out) = &report.verification.held_out else {
        return;
    };
    let models = [
        ("nominal", 1, held_out.nominal),
        ("registration only", 2, held_out.registration_only),
        ("calibrated", 0, held_out.calibrated),
    ];
    let rows: Vec<PlotRow> = models
        .iter()
        .filter_map(|(name, style, stats)| stats.map(|stats| (name, *style, stats)))
        .map(|(name, style, stats)| PlotRow {
            label: (*name).to_owned(),
            style,
            bar: Some(mm(stats.rms_m)),
            whisker: Some([mm(stats.rms_m), mm(stats.p95_m)]),
            tick: Some(mm(stats.max_m)),
            text: number::plain(stats.rms_m, Unit::Meter),
            ..PlotRow::default()
        })
        .collect();
    if !rows.is_empty() {
        plots.push(Plot {
            id: "plot-held-out-models".into(),
            section: "held-out",
            title: "Nominal, registration only, calibrated".into(),
            description: "Bar: rms error over the held-out poses; line: to the 95 % quantile; tick: the largest.".into(),
            kind: PlotKind::Rows { axis: "error [mm]".into(), rows },
        });
    }
    let over = |error: fn(&crate::PoseError) -> Option<f64>| -> Vec<[f64; 2]> {
        let at = held_out.poses.iter().enumerate();
        at.filter_map(|(i, pose)| error(pose).map(|error| [(i + 1) as f64, mm(error)]))
            .collect()
    };
    let series: Vec<Series> = [
        ("nominal", 1, over(|pose| pose.nominal_m)),
        (
            "registration only",
            2,
            over(|pose| pose.registration_only_m),
        ),
        ("calibrated", 0, over(|pose| pose.calibrated_m)),
    ]
    .into_iter()
    .filter(|(_, _, points)| !points.is_empty())
    .map(|(name, style, points)| Series {
        name: name.into(),
        style,
        line: false,
        points,
    })
    .collect();
    if !series.is_empty() {
        plots.push(Plot {
            id: "plot-held-out-poses".into(),
            section: "held-out",
            title: "Pose by pose".into(),
            description: "Every held-out error in the order of the recording; logarithmic.".into(),
            kind: PlotKind::Xy {
                x: "held-out error, in the order of the recording [1]".into(),
                y: "error [mm]".into(),
                log_y: true,
                band: None,
                series,
            },
        });
    }
}

/// Changes in units of their σ: hundredths of a millimeter and degrees on one axis.
fn changes(plots: &mut Vec<Plot>, report: &Report) {
    let all = [
        report.robot_changes.clone(),
        crate::words::robot::effects(report),
    ]
    .concat();
    let all = RobotChange::sorted(all);
    let row = |change: &RobotChange| {
        let z = change.significance()?;
        let signed = z.copysign(change.change.unwrap_or(0.0));
        Some(PlotRow {
            label: change.name.clone(),
            bar: Some(signed),
            text: number::change(change.change?, change.sigma, change.unit),
            ..PlotRow::default()
        })
    };
    let measured = all.iter().filter(|change| change.measured);
    let rows: Vec<PlotRow> = measured.filter_map(row).take(ROWS).collect();
    if !rows.is_empty() {
        plots.push(Plot {
            id: "plot-changes".into(),
            section: "changes",
            title: "Changes in standard deviations".into(),
            description: "Bar: change divided by its σ; beyond ± 2.6 it is significant (99 %)."
                .into(),
            kind: PlotKind::Rows {
                axis: "change [σ]".into(),
                rows,
            },
        });
    }
}

fn loops(plots: &mut Vec<Plot>, report: &Report) {
    for (i, closure) in report
        .loops
        .iter()
        .enumerate()
        .filter(|(_, closure)| closure.groups.len() > 1)
    {
        let row = |group: &crate::LoopGroup| PlotRow {
            label: group.name.clone(),
            bar: Some(mm(group.translation_m.mean)),
            whisker: Some([
                mm(group.translation_m.mean - group.translation_m.std),
                mm(group.translation_m.mean + group.translation_m.std),
            ]),
            tick: Some(mm(group.translation_m.max)),
            text: number::plain(group.translation_m.mean, Unit::Meter),
            ..PlotRow::default()
        };
        plots.push(Plot {
            id: format!("plot-loop-{}", i + 1),
            section: "loops",
            title: format!("{} by {}", closure.name, if closure.grouped_by.is_empty() { "group" } else { &closure.grouped_by }),
            description: "Bar: mean length of e_t; line: ± one standard deviation of the samples; tick: maximum.".into(),
            kind: PlotKind::Rows { axis: "‖e_t‖ [mm]".into(), rows: closure.groups.iter().map(row).take(ROWS).collect() },
        });
    }
}

fn coverage(plots: &mut Vec<Plot>, report: &Report) {
    let rows: Vec<Strip> = report
        .coverage
        .iter()
        .map(|joint| Strip {
            label: joint.joint.clone(),
            from: number::plain(joint.bins_from, joint.unit),
            to: number::plain(joint.bins_to, joint.unit),
            counts: joint.bins.clone(),
        })
        .collect();
    if !rows.is_empty() {
        plots.push(Plot {
            id: "plot-coverage".into(),
            section: "data",
            title: "Joint ranges in the data".into(),
            description:
                "Samples of each joint over its range. Darker: more samples; empty: no samples."
                    .into(),
            kind: PlotKind::Strips {
                axis: "joint position, each over its own range [deg or mm]".into(),
                rows,
            },
        });
    }
}

fn workspace(plots: &mut Vec<Plot>, report: &Report) {
    let Some(workspace) = &report.workspace else {
        return;
    };
    let panel = |i: usize, j: usize| {
        let axis = |i: usize| format!("{} [m]", ["x", "y", "z"][i]);
        let points = workspace
            .points
            .iter()
            .map(|point| [point.position_m[i], point.position_m[j], mm(point.sigma_m)]);
        Panel {
            x: axis(i),
            y: axis(j),
            points: points.collect(),
        }
    };
    plots.push(Plot {
        id: "plot-workspace".into(),
        section: "workspace",
        title: format!("Predicted σ of {}", workspace.link),
        description: format!(
            "Positions in {}, top view and side view. Darker: larger uncertainty of the tool.",
            workspace.frame
        ),
        kind: PlotKind::Map {
            value: "σ [mm]".into(),
            panels: vec![panel(0, 1), panel(0, 2)],
        },
    });
}

fn accuracy(plots: &mut Vec<Plot>, report: &Report) {
    let row = |limit: &crate::AccuracyLimit| {
        let share = limit.share.filter(|share| share.is_finite())?;
        Some(PlotRow {
            label: limit.source.clone(),
            bar: Some(share * 100.0),
            text: number::percent(share),
            ..PlotRow::default()
        })
    };
    let rows: Vec<PlotRow> = report
        .accuracy_limits
        .iter()
        .filter_map(row)
        .take(ROWS)
        .collect();
    if !rows.is_empty() {
        plots.push(Plot {
            id: "plot-accuracy".into(),
            section: "accuracy",
            title: "Shares of the remaining error".into(),
            description: "Share of the variance of the tool's position.".into(),
            kind: PlotKind::Rows {
                axis: "share [%]".into(),
                rows,
            },
        });
    }
}
