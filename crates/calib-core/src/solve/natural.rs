//! Natural scales of the parameters: how far a linearization holds.
//!
//! The prior σ, or what such a number is usually off by: 1°, 1 cm. A robot of less than a meter is smaller in all its lengths: its centimeter is as
//! much less.

use nalgebra::Vector3;

use crate::graph::measurement::MeasurementKind;
use crate::graph::unit::Unit;
use crate::model::layout::Model;

/// A prior wider than this many typical deviations does not say how far a linearization holds.
const WIDEST_SCALE: f64 = 30.0;
/// One wider than this many (300°, 3 m) says nothing: steps are as without it, and values stay where they start along gauges.
const SAYS_NOTHING: f64 = 300.0;
/// In a volume of this size, m, lengths are off by what is typical.
const USUAL: f64 = 1.0;

/// Diagonal of S⁻², one per column.
pub(crate) fn natural(model: &Model) -> Vec<f64> {
    let parameters = &model.problem.parameters;
    let length = (extent(model) / USUAL).min(1.0);
    let of = |&p: &usize| {
        let parameter = &parameters[p];
        let typical = match parameter.unit {
            Unit::Meter => length * Unit::Meter.typical_deviation(),
            unit => unit.typical_deviation(),
        };
        let scale = parameter.prior_sigma.unwrap_or(typical);
        if scale > SAYS_NOTHING * typical {
            typical.powi(-2)
        } else {
            scale.min(WIDEST_SCALE * typical).powi(-2)
        }
    };
    model.columns.iter().map(of).collect()
}

/// The longest side of the box of all places that were measured, m; infinite where there are not two.
fn extent(model: &Model) -> f64 {
    let mut ends = [(f64::INFINITY, f64::NEG_INFINITY); 3];
    let mut include = |place: &Vector3<f64>| {
        for (end, x) in ends.iter_mut().zip(place.iter()) {
            *end = (end.0.min(*x), end.1.max(*x));
        }
    };
    for measurement in model.problem.measurements.iter() {
        match &measurement.kind {
            MeasurementKind::Markers(seen) => {
                seen.observations
                    .iter()
                    .for_each(|o| include(&o.position.coords));
            }
            MeasurementKind::Poses(seen) => {
                seen.observations
                    .iter()
                    .for_each(|o| include(&o.pose.translation.vector));
            }
            _ => {}
        }
    }
    let longest = ends
        .iter()
        .map(|(low, high)| high - low)
        .fold(0.0, f64::max);
    if longest > 0.0 {
        longest
    } else {
        f64::INFINITY
    }
}
