//! Numbers from −1 to 1 for pairs, as a triangle of colored cells.

use super::kinds::{LABEL_CHARS, label_column};
use super::{Body, STEPS, WIDTH};
use crate::number;
use crate::table::clip;

/// Cells of few names would be as large as a stamp.
const LARGEST: f64 = 24.0;

pub(super) fn draw_matrix(
    body: &mut Body,
    value: &str,
    names: &[String],
    rows: &[Vec<f64>],
) -> f64 {
    // A number before each name: the columns carry the number alone.
    let numbered = names.iter().enumerate();
    let numbered: Vec<String> = numbered
        .map(|(i, name)| format!("{name} {}", i + 1))
        .collect();
    let left = label_column(numbered.iter().map(String::as_str));
    let side = ((WIDTH - left - 8.0) / names.len().max(1) as f64).min(LARGEST);
    // Text of 11 units needs a row of its own height.
    let height = side.max(12.5);
    for (i, name) in numbered.iter().enumerate() {
        let y = 4.0 + height * i as f64;
        let text = clip(name, LABEL_CHARS);
        body.text("name end", left - 6.0, y + 0.5 * height + 4.0, &text);
        for (j, rho) in rows.get(i).into_iter().flatten().enumerate() {
            if rho.is_finite() {
                body.rect(&class(*rho), left + side * j as f64, y, side, height);
            }
        }
        body.rect("cell", left + side * i as f64, y, side, height);
    }
    let bottom = 4.0 + height * names.len() as f64;
    // Every column where the numbers fit, else every second.
    let step = if side < 14.0 { 2 } else { 1 };
    for i in (0..names.len()).step_by(step) {
        let x = left + side * (i as f64 + 0.5);
        body.text("tick middle", x, bottom + 13.0, &(i + 1).to_string());
    }
    scale(body, value, bottom + 24.0);
    bottom + 54.0
}

/// Blue above zero, orange below it, denser with the size.
fn class(rho: f64) -> String {
    let step = (rho.abs() * STEPS as f64).ceil().clamp(1.0, STEPS as f64);
    let sign = if rho < 0.0 { "s1" } else { "s0" };
    format!("{sign} o{step}")
}

fn scale(body: &mut Body, value: &str, y: f64) {
    const CELL: f64 = 24.0;
    let steps = STEPS as i32;
    let left = 0.5 * (WIDTH - CELL * f64::from(2 * steps));
    for k in -steps..steps {
        let rho = (f64::from(k) + 0.5) / f64::from(steps);
        let x = left + CELL * f64::from(k + steps);
        body.rect(&class(rho), x, y, CELL, 10.0);
    }
    let end = left + CELL * f64::from(2 * steps);
    for (x, rho) in [(left, -1.0), (0.5 * (left + end), 0.0), (end, 1.0)] {
        body.text("tick middle", x, y + 22.0, &number::fixed(rho, 0));
    }
    body.text("tick", end + 10.0, y + 9.0, value);
}
