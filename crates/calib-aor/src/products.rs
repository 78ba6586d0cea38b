//! Σ w v vᵀ of vectors across an axis: three numbers, where a product of matrices would add sixteen.

use nalgebra::{Matrix2, Vector2};

/// Weighted sums of the products of two coordinates.
#[derive(Clone, Copy)]
pub(crate) struct Products([f64; 3]);

impl Products {
    pub const ZERO: Self = Self([0.0; 3]);

    pub fn add(&mut self, weight: f64, v: Vector2<f64>) {
        for (sum, product) in self.0.iter_mut().zip([v.x * v.x, v.x * v.y, v.y * v.y]) {
            *sum += weight * product;
        }
    }

    pub fn matrix(&self) -> Matrix2<f64> {
        let [xx, xy, yy] = self.0;
        Matrix2::new(xx, xy, xy, yy)
    }
}
