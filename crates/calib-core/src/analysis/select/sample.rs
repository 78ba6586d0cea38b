//! One sample of a linearized problem.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::model::layout::Model;
use crate::solve::rows::add_block;
use crate::solve::whitened::Whitened;

/// One sample, whitened by its V = LLᵀ.
pub(super) struct Sample {
    pub number: usize,
    /// Rows of all parameters that a model could free.
    pub a: DMatrix<f64>,
    pub w: DVector<f64>,
    /// L.
    pub l: DMatrix<f64>,
    /// D^(-½) L, D the covariance of the measurements alone: what makes errors of different models comparable.
    pub weighted: DMatrix<f64>,
    /// (observation, first row, rows)
    pub blocks: Vec<(usize, usize, usize)>,
}

impl Sample {
    pub(super) fn of(
        model: &Model,
        number: usize,
        (s, a): (Whitened, DMatrix<f64>),
        theta: &[f64],
    ) -> Self {
        let m = s.w.len();
        let mut weighted = DMatrix::zeros(m, m);
        for &(o, first, rows) in &s.blocks {
            let own = s.l.view((first, 0), (rows, m)).into_owned();
            let half = half_of(model, o, rows, theta, &own);
            if let Some(e) = half.solve_lower_triangular(&own) {
                weighted.view_mut((first, 0), (rows, m)).copy_from(&e);
            }
        }
        Self {
            number,
            a,
            w: s.w,
            l: s.l,
            weighted,
            blocks: s.blocks,
        }
    }

    /// εᵀLᵀD⁻¹Lε per row.
    pub(super) fn loss(&self, whitened: &DVector<f64>) -> f64 {
        (&self.weighted * whitened).norm_squared() / whitened.len() as f64
    }
}

/// R of D = RRᵀ of one observation; where it has no noise of its own, of what the rest gives it.
fn half_of(model: &Model, o: usize, rows: usize, theta: &[f64], l: &DMatrix<f64>) -> DMatrix<f64> {
    let d = measured_covariance(model, o, rows, theta);
    let factor = Cholesky::new(d).or_else(|| Cholesky::new(l * l.transpose()));
    factor.map_or_else(|| DMatrix::identity(rows, rows), |c| c.l())
}

/// D of one observation.
pub(super) fn measured_covariance(
    model: &Model,
    observation: usize,
    rows: usize,
    theta: &[f64],
) -> DMatrix<f64> {
    let mut d = DMatrix::zeros(rows, rows);
    add_block(model, observation, |i, j, group, shape| {
        d[(i, j)] += theta[group] * shape;
        if i != j {
            d[(j, i)] += theta[group] * shape;
        }
    });
    d
}
