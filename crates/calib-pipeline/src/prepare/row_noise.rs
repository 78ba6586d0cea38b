//! The noise of single rows, as the holds of recordings tell it: a hold's mean has less.

use calib_core::NoiseKind;
use nalgebra::{Matrix3, Matrix6};

/// Usual variances of a coordinate in a single row about the mean of its hold; zero where they are not known.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RowNoise {
    /// Of markers and bodies, m².
    pub position: f64,
    /// Of bodies, rad².
    pub orientation: f64,
}

impl RowNoise {
    /// From the covariance of each hold's rows, for each marker and each body (rotation first).
    pub(crate) fn of<'a>(
        markers: impl Iterator<Item = &'a Vec<Option<Matrix3<f64>>>>,
        bodies: impl Iterator<Item = &'a Vec<Option<Matrix6<f64>>>>,
    ) -> Self {
        let (mut position, mut orientation) = (Vec::new(), Vec::new());
        for holds in markers {
            position.extend(middle(holds.iter().flatten().map(Matrix3::trace)));
        }
        for holds in bodies {
            let trace = |first: usize| {
                let of = move |c: &Matrix6<f64>| (first..first + 3).map(|i| c[(i, i)]).sum();
                holds.iter().flatten().map(of)
            };
            orientation.extend(middle(trace(0)));
            position.extend(middle(trace(3)));
        }
        let usual = |traces: Vec<f64>| middle(traces.into_iter()).map_or(0.0, |t| t / 3.0);
        Self {
            position: usual(position),
            orientation: usual(orientation),
        }
    }

    /// The variance of one kind of noise, m² or rad²; zero of joints.
    pub(crate) fn of_kind(&self, kind: NoiseKind) -> f64 {
        match kind {
            NoiseKind::Position => self.position,
            NoiseKind::Orientation => self.orientation,
            _ => 0.0,
        }
    }
}

/// The upper middle value.
pub(crate) fn middle(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
