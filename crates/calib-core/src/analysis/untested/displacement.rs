//! Displacements of the point over all postures.

use nalgebra::{DVector, DVectorViewMut, Vector3};

/// A displacement of all u_m/√M.
#[derive(Clone)]
pub(super) struct Displacement {
    pub(super) d: DVector<f64>,
    /// K d.
    pub(super) open: DVector<f64>,
}

impl Displacement {
    pub(super) fn scaled(&self, factor: f64) -> Self {
        Self {
            d: &self.d * factor,
            open: &self.open * factor,
        }
    }

    pub(super) fn add(&mut self, factor: f64, other: &Self) {
        self.d.axpy(factor, &other.d, 1.0);
        self.open.axpy(factor, &other.open, 1.0);
    }

    /// dᵀK d
    pub(super) fn along(&self) -> f64 {
        self.d.dot(&self.open)
    }
}

/// Adds d_m/√M to what is displaced over all postures.
pub(super) fn add_motion(to: &mut DVectorViewMut<'_, f64>, at: impl Iterator<Item = Vector3<f64>>) {
    let root = (to.len() as f64 / 3.0).sqrt();
    for (m, moved) in at.enumerate() {
        let mut place = to.rows_mut(3 * m, 3);
        place += moved / root;
    }
}
