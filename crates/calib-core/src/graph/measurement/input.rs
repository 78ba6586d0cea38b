//! What every kind of measurement asks of its numbers.

use nalgebra::{Cholesky, Isometry3, SMatrix, Unit, Vector3};

use crate::graph::error::Error;
use crate::graph::ids::PointId;

/// The measurement under check, and what it may ask of the problem.
pub(crate) struct Input<'a> {
    /// Name of the measurement.
    pub name: &'a str,
    /// Is the point one of the measured frame?
    pub at_frame: &'a dyn Fn(PointId) -> Result<(), Error>,
}

impl Input<'_> {
    /// All numbers of a sample are finite.
    pub(crate) fn finite(&self, sample: usize, values: &[f64]) -> Result<(), Error> {
        self.require(sample, values.iter().all(|v| v.is_finite()))
    }

    /// All numbers of a sample's pose are finite.
    pub(crate) fn pose(&self, sample: usize, x: &Isometry3<f64>) -> Result<(), Error> {
        self.finite(sample, x.translation.vector.as_slice())?;
        self.finite(sample, x.rotation.coords.as_slice())
    }

    /// A direction must be finite and of length 1: `Unit::new_normalize` of a zero vector is neither.
    pub(crate) fn direction(&self, sample: usize, d: &Unit<Vector3<f64>>) -> Result<(), Error> {
        /// Rounding of a normalization, and of numbers read from text with six digits.
        const LENGTH: f64 = 1e-5;
        // NaN compares false.
        self.require(sample, (d.norm() - 1.0).abs() < LENGTH)
    }

    /// A covariance must be positive definite; its `determinant` is told where it is not.
    pub(crate) fn definite<const N: usize>(
        &self,
        shape: SMatrix<f64, N, N>,
        determinant: f64,
    ) -> Result<(), Error> {
        if Cholesky::new(shape).is_some() {
            Ok(())
        } else {
            Err(Error::NotPositive {
                what: format!("{} covariance", self.name),
                value: determinant,
            })
        }
    }

    fn require(&self, sample: usize, holds: bool) -> Result<(), Error> {
        if holds {
            Ok(())
        } else {
            Err(Error::NotFinite {
                what: self.name.to_owned(),
                sample,
            })
        }
    }
}
