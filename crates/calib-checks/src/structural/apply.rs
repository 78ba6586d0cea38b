//! Corrections applied to data.

use super::correct::correct;
use super::data::Data;
use super::hypothesis::{Hypothesis, Scoped};
use super::special;

/// The data as they would be had the mistake not been made.
///
/// [`Hypothesis::TrackerMoved`] and [`Hypothesis::MissingColumn`] estimate what they need (the motion, the missing
/// readings) from the data.
#[must_use]
pub fn apply(scoped: &Scoped, data: &Data) -> Data {
    match scoped.hypothesis {
        Hypothesis::TrackerMoved | Hypothesis::MissingColumn { .. } => special::apply(scoped, data),
        _ => correct(scoped, data),
    }
}

/// All corrections, one after the other.
#[must_use]
pub fn apply_all(corrections: &[Scoped], data: &Data) -> Data {
    corrections
        .iter()
        .fold(data.clone(), |data, scoped| apply(scoped, &data))
}
