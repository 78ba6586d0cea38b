//! Numbers that trackers write in place of a sample that they lost.

use std::collections::BTreeMap;

use calib_finding::{Fact, Finding, Subject, Unit, catalog};
use nalgebra::{Isometry3, Point3};

use crate::model::{Filled, MarkerSample};

/// Nothing is measured as far away, m.
const FAR: f64 = 1e5;
/// Nines before the point, at least: 999.
const LEAST: f64 = 1e3;

/// Whether all three coordinates (m) are one number that stands for nothing: −9999, 999.9, −3.7·10²⁸, in meters or millimeters. Three equal
/// coordinates of this form are not measured.
pub(crate) fn is_placeholder([x, y, z]: [f64; 3]) -> bool {
    x == y && y == z && (x.abs() >= FAR || nines(x.abs()) || nines(x.abs() * 1e3))
}

/// 999, 9999.9, 99999.99, …: a power of ten less one of the last digit.
fn nines(value: f64) -> bool {
    [1.0, 0.1, 0.01, 0.001].iter().any(|last| {
        let next = value + last;
        let power = 10.0_f64.powf(next.log10().round());
        power >= LEAST && (next - power).abs() < 1e-9 * power
    })
}

/// A sample this near to a number that stands for nothing may be a measurement, m: the number is then none.
const NEAR: f64 = 0.02;
/// Samples that show a number which stands for nothing.
const REPEATED: usize = 2;

/// Numbers (m) that stand for nothing, found by their use: all three coordinates have it exactly, in [`REPEATED`] samples at least, and the other
/// samples of these markers are elsewhere. Three equal coordinates are a coincidence once, and twice they are none.
pub(crate) fn repeated(markers: &[Vec<MarkerSample>]) -> Vec<f64> {
    let mut counts: BTreeMap<u64, usize> = BTreeMap::new();
    for value in markers.iter().flatten().filter_map(equal) {
        *counts.entry(value.to_bits()).or_default() += 1;
    }
    counts.retain(|_, count| *count >= REPEATED);
    let values = counts.into_keys().map(f64::from_bits);
    values
        .filter(|value| stands_for_nothing(*value, markers))
        .collect()
}

/// The markers that have the number are elsewhere otherwise, and one of them is anywhere else.
fn stands_for_nothing(value: f64, markers: &[Vec<MarkerSample>]) -> bool {
    let code = Point3::new(value, value, value);
    let has = |track: &&Vec<MarkerSample>| track.iter().any(|s| equal(s) == Some(value));
    let others = markers.iter().filter(has).flatten();
    let mut others = others.filter(|s| equal(s) != Some(value));
    let (mut any, mut near) = (false, false);
    for point in others.by_ref().filter_map(|s| s.point(Filled::Include)) {
        any = true;
        near |= (point - code).norm() < NEAR;
    }
    any && !near
}

/// Takes poses at the origin without a rotation for lost, where the other poses of the body are elsewhere: what loggers write before the first message
/// and after the last. The rows of what was taken.
pub(crate) fn without_identities(track: &mut [Option<Isometry3<f64>>], rows: &[u64]) -> Vec<u64> {
    let nothing = Isometry3::identity();
    let mut others = track
        .iter()
        .flatten()
        .filter(|pose| **pose != nothing)
        .peekable();
    let any = others.peek().is_some();
    if !any || others.any(|pose| pose.translation.vector.norm() < NEAR) {
        return Vec::new();
    }
    let mut taken = Vec::new();
    for (pose, row) in track.iter_mut().zip(rows) {
        if *pose == Some(nothing) {
            *pose = None;
            taken.push(*row);
        }
    }
    taken
}

/// The number that all three coordinates of a sample are; 0 is another rule's.
pub(crate) fn equal(sample: &MarkerSample) -> Option<f64> {
    let at = sample.point(Filled::Include)?;
    (at.x == at.y && at.y == at.z && at.x != 0.0).then_some(at.x)
}

/// What was read as lost because a number repeats, of one marker.
pub(crate) fn repeated_finding(name: &str, value: f64, rows: Vec<u64>) -> Finding {
    Finding::of_kind(
        catalog::PLACEHOLDER_TRIPLET,
        "repeated",
        Subject::marker(name),
    )
    .with("samples", Fact::count(rows.len()))
    .with("value", Fact::number(value, Unit::Meter))
    .at_rows(rows)
}

/// Rows of lost samples by marker or body.
#[derive(Default)]
pub(crate) struct Placeholders(BTreeMap<String, Vec<u64>>);

impl Placeholders {
    /// Notes the sample where it is one.
    pub(crate) fn take(&mut self, name: &str, at: [f64; 3], row: u64) -> bool {
        let is = is_placeholder(at);
        if is {
            self.0.entry(name.to_owned()).or_default().push(row);
        }
        is
    }

    /// What was read as lost without saying so.
    pub(crate) fn findings(&mut self) -> Vec<Finding> {
        let all = std::mem::take(&mut self.0).into_iter();
        all.map(|(name, rows)| {
            Finding::of_kind(catalog::PLACEHOLDER_TRIPLET, "known", Subject::marker(name))
                .with("samples", Fact::count(rows.len()))
                .at_rows(rows)
        })
        .collect()
    }
}

/// As [`is_placeholder`], of a point.
pub(crate) fn is_placeholder_point(point: &Point3<f64>) -> bool {
    is_placeholder(point.coords.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_trackers_are_placeholders_and_measurements_are_not() {
        // −9999 m and mm, NDI's −3.697314E28, 999.9 mm and so on.
        for v in [
            -9999.0,
            -9.999,
            -3.697314e28,
            0.9999,
            999.0,
            99999.99,
            9.99999,
            1e37,
        ] {
            assert!(is_placeholder([v, v, v]), "{v}");
        }
        for v in [
            [0.5, 0.5, 0.5],
            [1.0, 1.0, 1.0],
            [-9.999, -9.999, -9.998],
            [0.09, 0.09, 0.09],
            [0.0; 3],
        ] {
            assert!(!is_placeholder(v), "{v:?}");
        }
    }
}
