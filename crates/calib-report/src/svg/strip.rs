//! Nominal, registration only, calibrated as bars of one scale, with the limit across them.

use super::{Body, escape};
use crate::{Unit, number};

const WIDTH: f64 = 440.0;
const LABELS: f64 = 112.0;
const NUMBERS: f64 = 58.0;
const ROW: f64 = 20.0;

/// rms errors (m) by name, and the limit (m).
pub(crate) fn strip(steps: &[(&str, f64)], limit: Option<f64>) -> String {
    let largest = steps.iter().map(|step| step.1).chain(limit);
    let largest = largest.fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let scale = (WIDTH - LABELS - 2.0 * NUMBERS) / largest;
    let bottom = ROW * steps.len() as f64;
    let mut body = Body(String::new());
    for (i, (name, rms)) in steps.iter().enumerate() {
        let y = ROW * i as f64;
        body.text("name end", LABELS - 8.0, y + 14.0, name);
        let class = if *name == "calibrated" {
            "bar s0"
        } else {
            "bar s1"
        };
        body.rect(class, LABELS, y + 4.0, (rms * scale).max(1.0), 12.0);
        let text = number::plain(*rms, Unit::Meter);
        let end = rms * scale + 6.0;
        // Not on the line of the limit.
        let line = limit.map(|limit| limit * scale);
        let crossed = line.filter(|at| (end - 6.0..end + NUMBERS).contains(at));
        let at = LABELS + crossed.map_or(end, |at| at + 6.0);
        body.text("number", at, y + 14.0, &text);
    }
    if let Some(limit) = limit {
        let at = LABELS + limit * scale;
        body.line("limit", [at, 0.0], [at, bottom + 4.0]);
        let text = format!("limit {}", number::plain(limit, Unit::Meter));
        // The label stays inside of the picture.
        let class = if at > 0.6 * WIDTH { "tick end" } else { "tick" };
        body.text(class, at, bottom + 16.0, &text);
    }
    let label: Vec<String> = steps
        .iter()
        .map(|(name, rms)| format!("{name} {}", number::plain(*rms, Unit::Meter)))
        .collect();
    format!(
        "<svg role=\"img\" viewBox=\"0 0 {WIDTH} {}\" aria-label=\"rms position error: {}\">{}</svg>",
        bottom + 20.0,
        escape(&label.join(", ")),
        body.0
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_strip_is_well_formed_and_finite() {
        for limit in [None, Some(0.0), Some(1e-3), Some(1.0)] {
            let text = strip(&[("nominal", 1e-2), ("calibrated", 0.0)], limit);
            roxmltree::Document::parse(&text).expect("well-formed");
            assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
        }
    }
}
