//! One function per kind of plot; each returns the height that it used.

use super::scale::Scale;
use super::{Body, STEPS, WIDTH};
use crate::number;
use crate::plots::{Panel, PlotRow, Series, Strip};
use crate::table::clip;

/// Characters of a label that are shown.
const LABEL_CHARS: usize = 34;

/// Width of one of them: text of 11 units, as wide as common fonts make it.
const LABEL_CHAR: f64 = 6.4;

/// Width of the column of labels: as wide as they need.
fn label_column<'a>(labels: impl Iterator<Item = &'a str>) -> f64 {
    let longest = labels.map(|label| label.chars().count()).max().unwrap_or(0);
    16.0 + LABEL_CHAR * longest.clamp(6, LABEL_CHARS) as f64
}

/// Width of the column of numbers right of the rows.
const TEXTS: f64 = 134.0;

pub(super) fn draw_rows(body: &mut Body, axis: &str, rows: &[PlotRow]) -> f64 {
    const ROW: f64 = 24.0;
    let labels = label_column(rows.iter().map(|row| row.label.as_str()));
    let values = rows
        .iter()
        .flat_map(|row| {
            [
                row.bar,
                row.mark,
                row.tick,
                row.whisker.map(|w| w[0]),
                row.whisker.map(|w| w[1]),
            ]
        })
        .flatten();
    let scale = Scale::new(values.chain([0.0]), labels, WIDTH - labels - TEXTS, false);
    let bottom = 6.0 + ROW * rows.len() as f64;
    for (x, label) in scale.ticks(3.0) {
        let at = scale.place(x);
        body.line("grid", [at, 4.0], [at, bottom]);
        body.text("tick middle", at, bottom + 14.0, &label);
    }
    let zero = scale.place(0.0);
    body.line("axis", [zero, 2.0], [zero, bottom + 2.0]);
    body.text(
        "label middle",
        labels + 0.5 * (WIDTH - labels - TEXTS),
        bottom + 30.0,
        axis,
    );
    for (i, row) in rows.iter().enumerate() {
        let y = 6.0 + ROW * (i as f64 + 0.5);
        body.text(
            "name end",
            labels - 8.0,
            y + 4.0,
            &clip(&row.label, LABEL_CHARS),
        );
        if let Some(bar) = row.bar {
            let at = scale.place(bar);
            body.rect(
                &format!("bar s{}", row.style),
                zero.min(at),
                y - 6.0,
                (at - zero).abs(),
                12.0,
            );
        }
        if let Some([from, to]) = row.whisker {
            body.line("whisker", [scale.place(from), y], [scale.place(to), y]);
        }
        if let Some(tick) = row.tick {
            let at = scale.place(tick);
            body.line("whisker", [at, y - 5.0], [at, y + 5.0]);
        }
        if let Some(mark) = row.mark {
            body.mark(row.style, [scale.place(mark), y]);
        }
        body.text("number", WIDTH - TEXTS + 6.0, y + 4.0, &clip(&row.text, 20));
    }
    bottom + 36.0
}

pub(super) fn draw_xy(
    body: &mut Body,
    x_label: &str,
    y_label: &str,
    log_y: bool,
    series: &[Series],
) -> f64 {
    const TOP: f64 = 28.0;
    const LEFT: f64 = 50.0;
    const HEIGHT: f64 = 168.0;
    let points = || series.iter().flat_map(|series| &series.points);
    let x = Scale::new(points().map(|p| p[0]), LEFT, WIDTH - LEFT - 8.0, false);
    let y = Scale::new(points().map(|p| p[1]), TOP + HEIGHT, -HEIGHT, log_y);
    for (at, label) in y.ticks(4.0) {
        body.line("grid", [LEFT, y.place(at)], [WIDTH - 8.0, y.place(at)]);
        body.text("tick end", LEFT - 6.0, y.place(at) + 4.0, &label);
    }
    for (at, label) in x.ticks(5.0) {
        body.line("grid", [x.place(at), TOP], [x.place(at), TOP + HEIGHT]);
        body.text("tick middle", x.place(at), TOP + HEIGHT + 15.0, &label);
    }
    if !log_y && y.from < 0.0 && y.to > 0.0 {
        body.line("axis", [LEFT, y.place(0.0)], [WIDTH - 8.0, y.place(0.0)]);
    }
    body.text(
        "label middle",
        LEFT + 0.5 * (WIDTH - LEFT),
        TOP + HEIGHT + 32.0,
        x_label,
    );
    let mut legend = LEFT;
    for series in series {
        if series.line {
            body.line(
                &format!("line s{}", series.style),
                [legend, 10.0],
                [legend + 14.0, 10.0],
            );
        } else {
            body.mark(series.style, [legend + 7.0, 10.0]);
        }
        body.text("tick", legend + 18.0, 14.0, &series.name);
        legend += 34.0 + 6.4 * series.name.chars().count() as f64;
    }
    body.text("tick end", WIDTH - 8.0, 14.0, y_label);
    for series in series {
        let places: Vec<[f64; 2]> = series
            .points
            .iter()
            .filter(|p| p[0].is_finite() && p[1].is_finite())
            .map(|p| [x.place(p[0]), y.place(p[1])])
            .collect();
        if series.line && places.len() > 1 {
            body.path(&format!("line s{}", series.style), &places);
        } else {
            for place in places {
                body.mark(series.style, place);
            }
        }
    }
    TOP + HEIGHT + 40.0
}

pub(super) fn draw_strips(body: &mut Body, rows: &[Strip]) -> f64 {
    const ROW: f64 = 34.0;
    let labels = label_column(rows.iter().map(|row| row.label.as_str()));
    let width = WIDTH - labels - 10.0;
    for (i, row) in rows.iter().enumerate() {
        let y = 4.0 + ROW * i as f64;
        body.text(
            "name end",
            labels - 8.0,
            y + 12.0,
            &clip(&row.label, LABEL_CHARS),
        );
        let cell = width / row.counts.len().max(1) as f64;
        let most = row.counts.iter().copied().max().unwrap_or(0).max(1);
        for (bin, count) in row.counts.iter().enumerate() {
            // Five shades; one sample is already the first.
            let shade = (count * STEPS as u64).div_ceil(most);
            body.rect(
                &format!("cell v{shade}"),
                labels + bin as f64 * cell,
                y,
                cell,
                16.0,
            );
        }
        body.text("tick", labels, y + 28.0, &row.from);
        body.text("tick end", labels + width, y + 28.0, &row.to);
    }
    8.0 + ROW * rows.len() as f64
}

pub(super) fn draw_map(body: &mut Body, value: &str, panels: &[Panel]) -> f64 {
    const SIDE: f64 = 172.0;
    let values = || {
        panels
            .iter()
            .flat_map(|panel| panel.points.iter().map(|p| p[2]))
    };
    let (low, high) = (
        values().fold(f64::INFINITY, f64::min),
        values().fold(f64::NEG_INFINITY, f64::max),
    );
    let shade = |v: f64| {
        if high > low {
            (1 + ((v - low) / (high - low) * STEPS as f64) as usize).min(STEPS)
        } else {
            1
        }
    };
    for (i, panel) in panels.iter().enumerate() {
        let left = 38.0 + i as f64 * (SIDE + 50.0);
        // One scale for both axes: a workspace that is round looks round.
        let span = |k: usize| {
            let (a, b) = panel
                .points
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| {
                    (a.min(p[k]), b.max(p[k]))
                });
            if a <= b {
                (0.5 * (a + b), b - a)
            } else {
                (0.0, 1.0)
            }
        };
        let (middle_x, width) = span(0);
        let (middle_y, height) = span(1);
        let half = 0.5 * width.max(height).max(1e-3);
        let x = Scale::new(
            [middle_x - half, middle_x + half].into_iter(),
            left,
            SIDE,
            false,
        );
        let y = Scale::new(
            [middle_y - half, middle_y + half].into_iter(),
            8.0 + SIDE,
            -SIDE,
            false,
        );
        for (at, label) in x.ticks(4.0) {
            body.line("grid", [x.place(at), 8.0], [x.place(at), 8.0 + SIDE]);
            body.text("tick middle", x.place(at), SIDE + 23.0, &label);
        }
        for (at, label) in y.ticks(4.0) {
            body.line("grid", [left, y.place(at)], [left + SIDE, y.place(at)]);
            body.text("tick end", left - 5.0, y.place(at) + 4.0, &label);
        }
        body.text(
            "label middle",
            left + 0.5 * SIDE,
            SIDE + 39.0,
            &format!("{} over {}", panel.y, panel.x),
        );
        for point in &panel.points {
            body.circle(
                &format!("place v{}", shade(point[2])),
                [x.place(point[0]), y.place(point[1])],
                3.0,
            );
        }
    }
    let y = SIDE + 52.0;
    body.text(
        "tick end",
        150.0,
        y + 10.0,
        &format!("{value} {}", number::fixed(low, 3)),
    );
    for step in 1..=STEPS {
        body.rect(
            &format!("cell v{step}"),
            156.0 + 24.0 * (step - 1) as f64,
            y,
            24.0,
            12.0,
        );
    }
    body.text(
        "tick",
        162.0 + 24.0 * STEPS as f64,
        y + 10.0,
        &number::fixed(high, 3),
    );
    y + 20.0
}
