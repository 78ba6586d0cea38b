//! Points of a body with independent errors, from points whose errors are not.

use nalgebra::{DMatrix, Matrix3, Point3, Vector3};

/// What makes the errors of a body's points independent in one row: equation (3) of `condensed.rs`.
#[derive(Debug, Clone, PartialEq)]
pub struct Mixed {
    /// a of equation (3), row by row.
    pub weights: DMatrix<f64>,
    /// Shape of the covariance of each of the points u.
    pub shape: Matrix3<f64>,
}

impl Mixed {
    /// The points u_j from the v_i.
    #[must_use]
    pub fn of(&self, points: &[Point3<f64>]) -> Vec<Point3<f64>> {
        let one = |row: usize| {
            let parts = points.iter().enumerate();
            let sum = parts.map(|(i, point)| point.coords * self.weights[(row, i)]);
            Point3::from(sum.sum::<Vector3<f64>>())
        };
        (0..points.len()).map(one).collect()
    }

    /// The errors of the v_i from those of the u_j.
    #[must_use]
    pub fn back(&self, errors: &[Vector3<f64>]) -> Option<Vec<Vector3<f64>>> {
        let inverse = self.weights.clone().try_inverse()?;
        let one = |row: usize| {
            let parts = errors.iter().enumerate();
            parts.map(|(j, e)| e * inverse[(row, j)]).sum()
        };
        Some((0..errors.len()).map(one).collect())
    }
}
