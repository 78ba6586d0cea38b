//! The poses that a sweep requests, one after the other.

use crate::{JointColumn, Unit};

/// One requested pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Step {
    /// Value of each guided joint, rad or m.
    pub targets: Vec<f64>,
    /// It is only on the way to the next one: nothing is recorded.
    pub through: bool,
    /// The straight motion to it may touch something.
    pub blocked: bool,
    /// Bodies that need not be seen in it: places in [`crate::Plan::moved`].
    pub unseen: Vec<usize>,
}

impl Step {
    /// A pose that is recorded, and that everything that moves is seen in.
    pub fn at(targets: Vec<f64>) -> Self {
        Self {
            targets,
            ..Self::default()
        }
    }
}

/// A sweep: its joints, their ranges, its poses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Guide {
    /// Index of each guided joint among the columns.
    pub joints: Vec<usize>,
    /// Requested range of each, rad or m.
    pub ranges: Vec<(f64, f64)>,
    /// The poses; none for a recording whose poses the operator chooses.
    pub steps: Vec<Step>,
}

impl Guide {
    /// `waist 40.0°, shoulder -80.25°`.
    pub fn shown(&self, step: &Step, columns: &[JointColumn]) -> String {
        let all: Vec<usize> = (0..self.joints.len()).collect();
        self.shown_of(step, &all, columns)
    }

    /// The same of some of the guided joints.
    pub(crate) fn shown_of(
        &self,
        step: &Step,
        places: &[usize],
        columns: &[JointColumn],
    ) -> String {
        let of = |&place: &usize| {
            let column = columns.get(*self.joints.get(place)?)?;
            let target = step.targets.get(place)?;
            Some(format!("{} {}", column.name, column.unit.asked(*target)))
        };
        let texts: Vec<String> = places.iter().filter_map(of).collect();
        texts.join(", ")
    }

    /// `36 poses of head_pan -90.0..90.0°, head_tilt -20.0..40.0°`; `None` where no poses are requested.
    pub fn poses(&self, columns: &[JointColumn]) -> Option<String> {
        let count = self.steps.len();
        (count > 0).then(|| format!("{count} poses of {}", self.shown_ranges(columns)))
    }

    /// `waist -70.0..180.0°`.
    pub fn shown_ranges(&self, columns: &[JointColumn]) -> String {
        let texts: Vec<String> = self
            .joints
            .iter()
            .zip(&self.ranges)
            .filter_map(|(&joint, &(low, high))| {
                let column = columns.get(joint)?;
                Some(format!(
                    "{} {}",
                    column.name,
                    shown_range(column.unit, low, high)
                ))
            })
            .collect();
        texts.join(", ")
    }
}

/// `-70.0..180.0°`.
pub(crate) fn shown_range(unit: Unit, low: f64, high: f64) -> String {
    match unit {
        Unit::Angle => format!("{:.1}..{:.1}°", low.to_degrees(), high.to_degrees()),
        Unit::Length => format!("{:.1}..{:.1} mm", low * 1e3, high * 1e3),
    }
}

/// All combinations of equal steps through the ranges, ends included, the last joint fastest and back and forth, so
/// that consecutive poses are close together.
///
/// `poses` is the number of values of each joint; 1 requests the middle of the range.
pub fn grid(ranges: &[(f64, f64)], poses: usize) -> Vec<Step> {
    let poses = poses.max(1);
    let value = |(low, high): (f64, f64), i: usize| match poses {
        1 => (low + high) / 2.0,
        _ => low + (high - low) * i as f64 / (poses - 1) as f64,
    };
    let mut steps = vec![Step::default()];
    for &range in ranges {
        steps = steps
            .iter()
            .enumerate()
            .flat_map(|(row, step)| {
                (0..poses).map(move |i| {
                    let i = if row % 2 == 0 { i } else { poses - 1 - i };
                    let mut targets = step.targets.clone();
                    targets.push(value(range, i));
                    Step::at(targets)
                })
            })
            .collect();
    }
    if ranges.is_empty() { Vec::new() } else { steps }
}
