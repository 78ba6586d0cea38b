//! All estimators side by side.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::{Answer, answer, coordinates};

/// Verdict, reason and estimate (value, σ) of each estimator.
pub(crate) type Line<'a> = (
    &'a str,
    &'a str,
    String,
    Option<(nalgebra::Vector3<f64>, f64)>,
);

/// A table of estimates with the distance of each from the first that is observable.
pub(crate) fn comparison(what: &str, lines: &[Line<'_>]) -> Answer {
    let lengths = what == "center_m";
    let reference = lines.iter().find(|l| l.1 == "ok").and_then(|l| l.3);
    let mut text = String::new();
    let mut values = Vec::new();
    for (id, verdict, reason, point) in lines {
        let Some((p, sigma)) = point else {
            let _ = writeln!(text, "{id:<16} {verdict}: {reason}");
            values.push(json!({ "estimator": id, "observable": false, "reason": reason }));
            continue;
        };
        let distance = reference.map(|(r, _)| {
            if lengths {
                (p - r).norm()
            } else {
                p.cross(&r).norm().atan2(p.dot(&r).abs())
            }
        });
        let combined = reference.map_or(f64::INFINITY, |(_, s)| (s * s + sigma * sigma).sqrt());
        let agrees = distance.is_some_and(|d| d <= 4.0 * combined);
        let (shown_sigma, shown_distance) = if lengths {
            (
                format!("{:.4} mm", sigma * 1e3),
                distance.map(|d| format!("{:.4} mm", d * 1e3)),
            )
        } else {
            (
                format!("{:.4} deg", sigma.to_degrees()),
                distance.map(|d| format!("{:.4} deg", d.to_degrees())),
            )
        };
        let _ = writeln!(
            text,
            "{id:<16} {verdict:<6} {}  sigma {shown_sigma}  off {}  {}",
            coordinates(p.as_slice()),
            shown_distance.unwrap_or_default(),
            if agrees { "agrees" } else { "DIFFERS" }
        );
        values.push(json!({ "estimator": id, "observable": *verdict == "ok", "reason": reason, what: p.as_slice(), "sigma": sigma, "distance": distance, "agrees": agrees }));
    }
    let observable = lines.iter().any(|l| l.1 == "ok");
    answer(text, &Value::Array(values), observable)
}
