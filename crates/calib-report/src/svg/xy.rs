//! Points, lines, a band and bars over two axes.

use super::scale::Scale;
use super::{Body, WIDTH};
use crate::plots::{Band, Series};

const TOP: f64 = 28.0;
const LEFT: f64 = 62.0;
const HEIGHT: f64 = 168.0;

/// Width of a letter of the legend: text of 11 units.
const LETTER: f64 = 6.4;

/// Labels of both axes.
pub(super) struct Labels<'a> {
    pub(super) x: &'a str,
    pub(super) y: &'a str,
}

/// Both axes with their grid, ticks and labels.
fn axes(body: &mut Body, labels: &Labels<'_>, x: &Scale, y: &Scale) {
    for (at, label) in y.ticks(4.0) {
        body.line("grid", [LEFT, y.place(at)], [WIDTH - 8.0, y.place(at)]);
        body.text("tick end", LEFT - 6.0, y.place(at) + 4.0, &label);
    }
    for (at, label) in x.ticks(5.0) {
        body.line("grid", [x.place(at), TOP], [x.place(at), TOP + HEIGHT]);
        body.text("tick middle", x.place(at), TOP + HEIGHT + 15.0, &label);
    }
    if !y.log && y.from < 0.0 && y.to > 0.0 {
        body.line("axis", [LEFT, y.place(0.0)], [WIDTH - 8.0, y.place(0.0)]);
    }
    let middle = LEFT + 0.5 * (WIDTH - LEFT);
    body.text("label middle", middle, TOP + HEIGHT + 32.0, labels.x);
    body.upright(13.0, TOP + 0.5 * HEIGHT, labels.y);
}

/// What the lines, marks and the band are.
fn legend(body: &mut Body, series: &[&Series], band: Option<&Band>) {
    let mut at = LEFT;
    for series in series {
        if series.line {
            let class = format!("line s{}", series.style);
            body.line(&class, [at, 10.0], [at + 14.0, 10.0]);
        } else {
            body.mark(series.style, [at + 7.0, 10.0]);
        }
        body.text("tick", at + 18.0, 14.0, &series.name);
        at += 34.0 + LETTER * series.name.chars().count() as f64;
    }
    if let Some(band) = band {
        body.rect("band", at, 5.0, 14.0, 10.0);
        body.text("tick", at + 18.0, 14.0, &band.name);
    }
}

fn draw_series(body: &mut Body, series: &Series, x: &Scale, y: &Scale) {
    let points = series.points.iter();
    let places: Vec<[f64; 2]> = points
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

pub(super) fn draw_xy(
    body: &mut Body,
    labels: &Labels<'_>,
    log_y: bool,
    band: Option<&Band>,
    series: &[Series],
) -> f64 {
    let finite = |p: &&[f64; 3]| p.iter().all(|x| x.is_finite());
    let around: Vec<[f64; 3]> = band
        .into_iter()
        .flat_map(|band| band.points.iter().filter(finite).copied())
        .collect();
    let points = || series.iter().flat_map(|series| &series.points);
    let xs = points().map(|p| p[0]).chain(around.iter().map(|p| p[0]));
    let ys = around.iter().flat_map(|p| [p[1], p[2]]);
    let ys = points().map(|p| p[1]).chain(ys);
    let x = Scale::new(xs, LEFT, WIDTH - LEFT - 8.0, false);
    let y = Scale::new(ys, TOP + HEIGHT, -HEIGHT, log_y);
    // Along the upper edge and back along the lower one.
    let upper = around.iter().map(|p| [x.place(p[0]), y.place(p[2])]);
    let lower = around.iter().rev().map(|p| [x.place(p[0]), y.place(p[1])]);
    let outline: Vec<[f64; 2]> = upper.chain(lower).collect();
    if outline.len() > 2 {
        body.path("band", &outline);
    }
    axes(body, labels, &x, &y);
    legend(body, &series.iter().collect::<Vec<_>>(), band);
    for series in series {
        draw_series(body, series, &x, &y);
    }
    TOP + HEIGHT + 40.0
}

pub(super) fn draw_bars(
    body: &mut Body,
    labels: &Labels<'_>,
    bars: &[[f64; 3]],
    curve: &Series,
) -> f64 {
    let bars = bars.iter().filter(|bar| bar.iter().all(|x| x.is_finite()));
    let xs = bars.clone().flat_map(|bar| [bar[0], bar[1]]);
    let heights = bars.clone().map(|bar| bar[2]);
    let ys = heights.chain(curve.points.iter().map(|p| p[1]));
    let x = Scale::new(xs, LEFT, WIDTH - LEFT - 8.0, false);
    let y = Scale::new(ys.chain([0.0]), TOP + HEIGHT, -HEIGHT, false);
    axes(body, labels, &x, &y);
    for [from, to, height] in bars {
        let (left, top) = (x.place(*from), y.place(*height));
        let width = x.place(*to) - left - 1.0;
        body.rect("bar s0", left + 0.5, top, width, y.place(0.0) - top);
    }
    legend(body, &[curve], None);
    draw_series(body, curve, &x, &y);
    TOP + HEIGHT + 40.0
}
