//! `twin.html`: what this session can and cannot tell, as one page that needs no other file.

use calib_finding::Unit;
use calib_report::gallery::{self, Grid};
use calib_report::number;
use calib_report::plots::{Plot, PlotKind, PlotRow, Series};

use crate::power::POWERS;
use crate::quantity::Quantity;
use crate::summary::Promise;
use crate::terminal::{checked, intervals, kept, postures, resembles, without_result};
use crate::twin::Twin;
use crate::words;

/// Rows of a plot at the most.
const ROWS: usize = 40;

/// The page.
#[must_use]
pub fn page(twin: &Twin) -> String {
    let mut lines = vec![format!(
        "Profile: `{}`. {} trials from {}, true robots drawn {} (seed {}). Each was recorded in the same postures with the same gaps. {}",
        twin.profile,
        twin.trials,
        words::source(twin.source),
        words::about(twin.about),
        twin.seed,
        words::calibrated(twin.whole, twin.trials)
    )];
    lines.extend(resembles(twin).map(|said| format!("Resemblance: {said}.")));
    if twin.refused + twin.not_converged > 0 {
        lines.push(format!("Without a result: {}.", without_result(twin)));
        let refusal = twin.first_refusal.iter();
        lines.extend(refusal.map(|why| format!("The first refusal: {}", first_line(why))));
    }
    lines.push(format!("Promised σ {}.", kept(twin)));
    lines.push(format!("The 95 % intervals {}.", intervals(twin)));
    lines.push(format!(
        "False alarms: {} trials without a fault.",
        words::share(twin.false_alarms, twin.trials - twin.refused)
    ));
    lines.extend(checked(twin).map(|said| format!("Sizes of effects: {said}.")));
    lines.extend(postures(twin).map(|said| format!("Postures: {said}.")));
    lines.push("The trials have the effects of the model and normal noise. An effect that the model lacks shows only in the resemblance.".to_owned());
    lines.extend(twin.notes.iter().map(words::note));
    let title = format!("What the session of {} can and cannot tell", twin.robot);
    let tables = [promises(twin), effects(twin), slips(twin), likeness(twin)];
    let tables: Vec<Grid> = tables.into_iter().filter(|t| !t.rows.is_empty()).collect();
    gallery::page(&title, &lines, &plots(twin), &tables)
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

fn promises(twin: &Twin) -> Grid {
    let row = |p: &Promise| {
        vec![
            format!("`{}`", words::quantity(&p.of)),
            number::sigma(p.stated, p.unit),
            number::sigma(Some(p.promised), p.unit),
            number::sigma(Some(p.reached), p.unit),
            format!("{:.2} ± {:.2}", p.ratio, p.ratio_sigma),
            format!("{:.1} %", 100.0 * p.coverage),
            p.bias.map_or_else(
                || number::UNKNOWN.to_owned(),
                |bias| number::with_sigma(bias, p.bias_sigma, p.unit),
            ),
            if p.is_observed() { "data" } else { "prior" }.to_owned(),
        ]
    };
    Grid {
        title: "σ promised and reached".to_owned(),
        header: [
            "quantity",
            "σ of this session",
            "promised",
            "reached",
            "promised over reached",
            "95 % intervals with the truth",
            "bias",
            "determined by",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: twin.promises.iter().map(row).collect(),
    }
}

fn effects(twin: &Twin) -> Grid {
    let mut header = vec!["effect".to_owned(), "joint".to_owned()];
    header.extend(POWERS.map(|p| format!("noticed in {:.0} %", 100.0 * p)));
    header.push("noticed and named, of trials with the 80 % size".to_owned());
    let rows = twin.powers.iter().map(|p| {
        let mut row = vec![
            p.effect.replace('_', " "),
            format!("`{}`", words::of_power(p)),
        ];
        row.extend(p.sizes.map(|size| words::size(size, p.unit)));
        row.push(match p.tried {
            0 => number::UNKNOWN.to_owned(),
            tried => format!("{} and {} of {tried}", p.noticed, p.named),
        });
        row
    });
    Grid {
        title: "Effects of joints that are not free: how large they must be to be noticed"
            .to_owned(),
        header,
        rows: rows.collect(),
    }
}

fn slips(twin: &Twin) -> Grid {
    let length = |m: f64| number::sigma(Some(m), Unit::Meter);
    let rows = twin.slips.iter().map(|s| {
        let interval = s
            .interval_m
            .map(|[l, h]| format!("{} to {}", length(l), length(h)));
        vec![
            format!("`{}`", s.body),
            s.size_m.map_or_else(|| number::UNKNOWN.to_owned(), length),
            interval.unwrap_or_else(|| number::UNKNOWN.to_owned()),
            format!("{} and {} of {}", s.noticed, s.named, s.tried),
            format!("{} to {}", length(s.tried_m[0]), length(s.tried_m[1])),
        ]
    });
    Grid {
        title: "Bodies that slip while recording".to_owned(),
        header: [
            "body",
            "noticed in 80 %",
            "95 % interval",
            "noticed and named",
            "slips that were tried",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: rows.collect(),
    }
}

fn likeness(twin: &Twin) -> Grid {
    let marks = twin.resemblance.iter().flat_map(|r| &r.marks);
    let rows = marks.map(|m| {
        vec![
            words::mark(m.mark).to_owned(),
            number::fixed(m.recording, 3),
            number::fixed(m.twin, 3),
            number::fixed(m.spread, 3),
            number::fixed(m.distance(), 1),
        ]
    });
    Grid {
        title: "Residuals of the recording beside those of the trials".to_owned(),
        header: [
            "number (levels and ratios as natural logarithms)",
            "recording",
            "trials, median",
            "σ",
            "difference in σ",
        ]
        .map(str::to_owned)
        .to_vec(),
        rows: rows.collect(),
    }
}

fn plots(twin: &Twin) -> Vec<Plot> {
    let mut plots = Vec::new();
    let observed = twin.promises.iter().filter(|p| p.is_observed());
    let rows = observed.take(ROWS).map(|p| PlotRow {
        label: words::quantity(&p.of),
        style: usize::from(!p.is_kept()),
        mark: Some(p.ratio),
        whisker: Some([p.ratio - 2.0 * p.ratio_sigma, p.ratio + 2.0 * p.ratio_sigma]),
        text: format!("{:.2}", p.ratio),
        ..PlotRow::default()
    });
    let rows: Vec<PlotRow> = rows.collect();
    if !rows.is_empty() {
        plots.push(Plot {
            id: "ratios".to_owned(),
            section: "twin",
            title: "Promised σ over reached σ".to_owned(),
            description: "1: errors are as large as stated; below 1 they are larger. Lines: 95 % interval from the number of trials.".to_owned(),
            kind: PlotKind::Rows {
                axis: "promised over reached [1]".to_owned(),
                rows,
            },
        });
    }
    if let Some(curve) = &twin.curve {
        let points = curve.points.iter().filter_map(|p| {
            let sigma = p.sigma_m.filter(|s| *s > 0.0)?;
            Some([p.postures as f64, sigma * 1e3])
        });
        let mut series = vec![Series {
            name: format!("σ of {}", curve.body),
            style: 0,
            line: true,
            points: points.collect(),
        }];
        let reached = twin
            .promises
            .iter()
            .find(|p| matches!(&p.of, Quantity::Position { body } if *body == curve.body));
        series.extend(reached.map(|p| Series {
            name: "reached in the trials".to_owned(),
            style: 1,
            line: false,
            points: vec![[curve.postures as f64, p.reached * 1e3]],
        }));
        plots.push(Plot {
            id: "postures".to_owned(),
            section: "twin",
            title: "σ of the tool's position against the number of postures".to_owned(),
            description: format!(
                "Postures of the session in random order up to {}, then the session again and again. More postures do not reduce what the model does not describe.",
                curve.postures
            ),
            kind: PlotKind::Xy {
                x: "postures".to_owned(),
                y: "σ [mm]".to_owned(),
                log_y: true,
                band: None,
                series,
            },
        });
    }
    plots
}
