//! Residuals by marker and direction, over joints and over time.

use super::{Band, Plot, PlotKind, PlotRow, ROWS, Series, mm};
use crate::{JointResiduals, Report, ResidualGroup, Unit, number};

pub(super) fn residuals(plots: &mut Vec<Plot>, report: &Report) {
    let row = |group: &ResidualGroup| PlotRow {
        label: group.name.clone(),
        bar: Some(mm(group.rms_m)),
        whisker: Some([mm(group.rms_m), mm(group.p95_m)]),
        tick: Some(mm(group.max_m)),
        text: number::plain(group.rms_m, Unit::Meter),
        ..PlotRow::default()
    };
    for (id, title, groups) in [
        (
            "plot-residuals-marker",
            "Residuals per marker",
            &report.residuals.by_marker,
        ),
        (
            "plot-residuals-direction",
            "Residuals along the axes of the tracker",
            &report.residuals.by_direction,
        ),
    ] {
        if !groups.is_empty() {
            plots.push(Plot {
                id: id.into(),
                section: "residuals",
                title: title.into(),
                description: "Bar: rms; line: up to the 95 % quantile; tick: maximum.".into(),
                kind: PlotKind::Rows {
                    axis: "residual [mm]".into(),
                    rows: groups.iter().map(row).take(ROWS).collect(),
                },
            });
        }
    }
    for (i, joint) in report.residuals.by_joint.iter().enumerate() {
        plots.push(over_bins(
            format!("plot-residuals-joint-{}", i + 1),
            format!("Residuals over {}", joint.name),
            joint,
        ));
    }
    for (i, recording) in report.residuals.over_time.iter().enumerate() {
        plots.push(over_bins(
            format!("plot-residuals-time-{}", i + 1),
            format!("Residuals over {}", recording.name),
            recording,
        ));
    }
}

/// Mean residuals over a variable, and the band that holds 95 % of them where nothing is systematic.
fn over_bins(id: String, title: String, residuals: &JointResiduals) -> Plot {
    let (scale, x) = match residuals.unit {
        Unit::Radian => (
            180.0 / std::f64::consts::PI,
            format!("{} [deg]", residuals.name),
        ),
        Unit::Meter => (1e3, format!("{} [mm]", residuals.name)),
        Unit::Second => (1.0, "time [s]".to_owned()),
        _ => (1.0, "row [1]".to_owned()),
    };
    let component = |name: &str, i: usize| {
        let bins = residuals.bins.iter();
        Series {
            name: format!("mean {name}"),
            style: i,
            line: true,
            points: bins
                .map(|bin| [bin.center * scale, mm(bin.mean_m[i])])
                .collect(),
        }
    };
    let known = residuals.bins.iter();
    let known = known.filter_map(|bin| {
        let two_sigma = 2.0 * mm(bin.mean_sigma_m?);
        Some([bin.center * scale, -two_sigma, two_sigma])
    });
    let points: Vec<[f64; 3]> = known.collect();
    Plot {
        id,
        section: "residuals",
        title,
        description: "Lines: mean residual along the x, y, z axes of the tracker. Band: ± 2 σ of these means if nothing is systematic; a pattern beyond it indicates an effect that is not modeled.".into(),
        kind: PlotKind::Xy {
            x,
            y: "mean residual [mm]".into(),
            log_y: false,
            band: (!points.is_empty()).then(|| Band {
                name: "± 2 σ".into(),
                points,
            }),
            series: vec![component("x", 0), component("y", 1), component("z", 2)],
        },
    }
}
