//! Histogram and normal quantiles of the standardized residuals.

use super::{Band, Plot, PlotKind, Series};
use crate::standardized::{BIN, REACH};
use crate::{Report, Standardized};

/// Label of the axis of residuals.
const AXIS: &str = "standardized residual [σ]";

pub(super) fn distribution(plots: &mut Vec<Plot>, report: &Report) {
    let Some(of) = &report.residuals.standardized else {
        return;
    };
    plots.push(Plot {
        id: "plot-residuals-histogram".into(),
        section: "residuals",
        title: "Histogram of standardized residuals".into(),
        description: format!(
            "Bars: {} residuals, decorrelated and each divided by its standard deviation; those beyond ± {REACH} are in the outermost bars. Line: the standard normal distribution, which they follow where model and noise are right.",
            of.n
        ),
        kind: PlotKind::Bars {
            x: AXIS.into(),
            y: "residuals per bin [1]".into(),
            bars: bars(of),
            curve: Series {
                name: "standard normal".into(),
                style: 1,
                line: true,
                points: curve(of),
            },
        },
    });
    plots.push(Plot {
        id: "plot-residuals-quantiles".into(),
        section: "residuals",
        title: "Normal quantile plot of standardized residuals".into(),
        description: "Dots: quantiles of the standardized residuals over those of the standard normal distribution. They follow the line where model and noise are right; ends that bend away from it are outliers or heavy tails, another slope is a wrong noise level. Band: ± 2 σ of each quantile.".into(),
        kind: PlotKind::Xy {
            x: "normal quantile [σ]".into(),
            y: AXIS.into(),
            log_y: false,
            band: Some(band(of)),
            series: vec![
                Series {
                    name: "residuals".into(),
                    style: 0,
                    line: false,
                    points: of.quantiles.clone(),
                },
                Series {
                    name: "standard normal".into(),
                    style: 1,
                    line: true,
                    points: ends(of).map(|z| [z, z]).to_vec(),
                },
            ],
        },
    });
}

/// From, to, count of every bin.
fn bars(of: &Standardized) -> Vec<[f64; 3]> {
    let bar = |(i, count): (usize, &u64)| {
        let from = -REACH + BIN * (i as f64 - 1.0);
        [from, from + BIN, *count as f64]
    };
    of.counts.iter().enumerate().map(bar).collect()
}

fn curve(of: &Standardized) -> Vec<[f64; 2]> {
    /// Points: a smooth line at the size of a plot.
    const POINTS: i32 = 64;
    let at = |i: i32| REACH * (2.0 * f64::from(i) / f64::from(POINTS) - 1.0);
    (0..=POINTS)
        .map(|i| [at(i), of.expected_count(at(i))])
        .collect()
}

/// The least and the largest normal quantile.
fn ends(of: &Standardized) -> [f64; 2] {
    let end = |q: Option<&[f64; 2]>| q.map_or(0.0, |q| q[0]);
    [end(of.quantiles.first()), end(of.quantiles.last())]
}

fn band(of: &Standardized) -> Band {
    let around = |q: &[f64; 2]| {
        let half = 2.0 * of.quantile_sigma(q[0]);
        [q[0], q[0] - half, q[0] + half]
    };
    Band {
        name: "± 2 σ".into(),
        points: of.quantiles.iter().map(around).collect(),
    }
}
