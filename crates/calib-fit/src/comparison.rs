//! All estimators side by side.

use std::fmt::Write as _;

use nalgebra::Vector3;
use serde_json::{Value, json};

use crate::answer::{Answer, answer, coordinates};

/// What of an estimate is compared.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Quantity {
    /// A place, m, under this key.
    Place(&'static str),
    /// A direction without sign, under this key.
    Direction(&'static str),
}

/// The quantity in one estimate.
pub(crate) struct Found {
    pub value: Vector3<f64>,
    /// m or rad.
    pub sigma: f64,
}

/// What one estimator says.
pub(crate) struct Line {
    pub id: &'static str,
    pub verdict: &'static str,
    pub reason: String,
    pub found: Option<Found>,
}

/// Distances of this many combined σ are agreement.
const AGREES: f64 = 4.0;

impl Quantity {
    fn key(self) -> &'static str {
        match self {
            Self::Place(key) | Self::Direction(key) => key,
        }
    }

    /// m or rad.
    fn distance(self, a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
        match self {
            Self::Place(_) => (a - b).norm(),
            Self::Direction(_) => a.cross(b).norm().atan2(a.dot(b).abs()),
        }
    }

    fn shown(self, length: f64) -> String {
        match self {
            Self::Place(_) => format!("{:.4} mm", length * 1e3),
            Self::Direction(_) => format!("{:.4} deg", length.to_degrees()),
        }
    }
}

/// A table of estimates with the distance of each from the first that is observable.
pub(crate) fn comparison(quantity: Quantity, lines: &[Line]) -> Answer {
    let reference = lines.iter().find(|l| l.verdict == "ok");
    let reference = reference.and_then(|l| l.found.as_ref());
    let mut text = String::new();
    let mut values = Vec::new();
    for Line {
        id,
        verdict,
        reason,
        found,
    } in lines
    {
        let Some(Found { value, sigma }) = found else {
            let _ = writeln!(text, "{id:<16} {verdict}: {reason}");
            values.push(json!({ "estimator": id, "observable": false, "reason": reason }));
            continue;
        };
        let distance = reference.map(|r| quantity.distance(value, &r.value));
        let combined = reference.map_or(f64::INFINITY, |r| r.sigma.hypot(*sigma));
        let agrees = distance.is_some_and(|d| d <= AGREES * combined);
        let compared = match distance.map(|d| quantity.shown(d)) {
            Some(off) => format!("off {off}  {}", if agrees { "agrees" } else { "DIFFERS" }),
            // Nothing to compare with: what stands against it is the news.
            None => format!("\n  {reason}"),
        };
        let _ = writeln!(
            text,
            "{id:<16} {verdict:<6} {}  sigma {}  {compared}",
            coordinates(value.as_slice()),
            quantity.shown(*sigma),
        );
        values.push(json!({
            "estimator": id,
            "observable": *verdict == "ok",
            "reason": reason,
            (quantity.key()): value.as_slice(),
            "sigma": sigma,
            "distance": distance,
            "agrees": agrees,
        }));
    }
    let observable = lines.iter().any(|l| l.verdict == "ok");
    answer(text, &Value::Array(values), observable)
}
