//! One sample in dense whitened form, and the covariance of the parameters: for analyses that look at every sample.
//!
//! ```text
//! V_s = L Lᵀ,   A_s = L⁻¹ J_s,   w_s = L⁻¹ e_s,   C = H⁻¹                                     (1)
//! ```

use nalgebra::{DMatrix, DVector};

use crate::model::cache::State;
use crate::model::path::Derivatives;
use crate::model::values::Values;
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::minimize::{cholesky_in_place, solve_in_place};

/// C of equation (1), (H + tiny ridge)⁻¹: directions that nothing determines have A v = 0 and do not matter in A C Aᵀ.
pub(crate) fn covariance_of(system: &NormalEquations) -> Option<DMatrix<f64>> {
    /// Relative ridge: far below any direction that influences a prediction.
    const RIDGE: f64 = 1e-11;
    let n = system.n;
    let scale: Vec<f64> = (0..n)
        .map(|i| {
            let d = system.h[i * n + i];
            if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 }
        })
        .collect();
    let mut l = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..i {
            l[i * n + j] = system.h[j * n + i] * scale[i] * scale[j];
        }
        l[i * n + i] = 1.0 + RIDGE;
    }
    let mut ridge = RIDGE;
    let full = l.clone();
    while !cholesky_in_place(&mut l, n) {
        ridge *= 10.0;
        if ridge > 1e-6 {
            return None;
        }
        l.copy_from_slice(&full);
        for i in 0..n {
            l[i * n + i] = 1.0 + ridge;
        }
    }
    let mut c = DMatrix::zeros(n, n);
    let mut y = vec![0.0; n];
    for k in 0..n {
        y.fill(0.0);
        y[k] = 1.0;
        solve_in_place(&l, n, &mut y);
        for i in 0..n {
            c[(i, k)] = y[i] * scale[i] * scale[k];
        }
    }
    Some(c)
}

/// One sample in whitened form, V = LLᵀ: A = L⁻¹J (m × n), w (m), L⁻¹ (m × m).
pub(crate) struct Whitened {
    pub a: DMatrix<f64>,
    pub w: DVector<f64>,
    pub l: DMatrix<f64>,
    pub l_inverse: DMatrix<f64>,
    pub log_det: f64,
    /// (observation, first row, rows)
    pub blocks: Vec<(usize, usize, usize)>,
}

/// Rows of a sample, whitened by their V; `None` when V is not positive definite or there are none.
pub(crate) fn whitened(
    objective: Objective,
    values: &Values,
    sample: usize,
    work: &mut Workspace,
) -> Option<Whitened> {
    let Objective {
        model,
        weights,
        theta,
    } = objective;
    let rows = &mut work.rows;
    let at = State::new(&model.problem, &work.cache, values);
    rows.fill(model, at, weights, sample, Derivatives::All);
    if rows.m == 0 {
        return None;
    }
    let (m, n) = (rows.m, rows.n);
    rows.covariance(model, weights, theta);
    let log_det = rows.factor()?;
    rows.whiten(true);
    let mut l = DMatrix::zeros(m, m);
    let mut l_inverse = DMatrix::zeros(m, m);
    for i in 0..m {
        for j in 0..=i {
            l[(i, j)] = rows.v[i * m + j];
        }
    }
    // L L⁻¹ = I, column by column
    for c in 0..m {
        for i in c..m {
            let mut sum = if i == c { 1.0 } else { 0.0 };
            for j in c..i {
                sum -= l[(i, j)] * l_inverse[(j, c)];
            }
            l_inverse[(i, c)] = sum / l[(i, i)];
        }
    }
    Some(Whitened {
        a: DMatrix::from_row_slice(m, n, &rows.j[..m * n]),
        w: DVector::from_row_slice(&rows.r[..m]),
        l,
        l_inverse,
        log_det,
        blocks: rows.blocks.clone(),
    })
}
