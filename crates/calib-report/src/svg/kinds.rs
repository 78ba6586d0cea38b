//! Rows and strips; each returns the height that it used.

use super::scale::Scale;
use super::{Body, STEPS, WIDTH};
use crate::plots::{PlotRow, Strip};
use crate::table::clip;

/// Characters of a label that are shown.
pub(super) const LABEL_CHARS: usize = 34;

/// Width of one of them: text of 11 units, as wide as common fonts make it.
const LABEL_CHAR: f64 = 6.4;

/// Width of the column of labels: as wide as they need.
pub(super) fn label_column<'a>(labels: impl Iterator<Item = &'a str>) -> f64 {
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

pub(super) fn draw_strips(body: &mut Body, axis: &str, rows: &[Strip]) -> f64 {
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
    let bottom = 4.0 + ROW * rows.len() as f64;
    body.text("label middle", labels + 0.5 * width, bottom + 10.0, axis);
    bottom + 16.0
}
