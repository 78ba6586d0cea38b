//! Values at places, seen along an axis.

use super::scale::Scale;
use super::{Body, STEPS};
use crate::number;
use crate::plots::Panel;

pub(super) fn draw_map(body: &mut Body, value: &str, panels: &[Panel]) -> f64 {
    const SIDE: f64 = 166.0;
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
        let left = 48.0 + i as f64 * (SIDE + 46.0);
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
        body.text("label middle", left + 0.5 * SIDE, SIDE + 39.0, &panel.x);
        body.upright(left - 32.0, 8.0 + 0.5 * SIDE, &panel.y);
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
