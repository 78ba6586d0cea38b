//! One sample in dense whitened form, and the covariance of the parameters: for analyses that look at every sample.
//!
//! ```text
//! V_s = L Lᵀ,   A_s = L⁻¹ J_s,   w_s = L⁻¹ e_s,   C = H⁻¹                                     (1)
//! ```

use calib_geometry::decompose::{InverseRoot, inverse_root, lower_inverse};
use nalgebra::{DMatrix, DVector};

use crate::model::cache::State;
use crate::model::path::Derivatives;
use crate::model::values::Values;
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::parted::Parted;
use crate::solve::rows::SampleRows;

/// C of equation (1), (H + tiny ridge)⁻¹: directions that nothing determines have A v = 0 and do not matter in A C Aᵀ.
pub(crate) fn covariance_of(system: &NormalEquations) -> Option<DMatrix<f64>> {
    let (root, scale) = scaled_root(system)?;
    let mut c = root.inverse();
    for (mut column, s) in c.column_iter_mut().zip(&scale) {
        let of_rows = column.iter_mut().zip(&scale);
        of_rows.for_each(|(x, r)| *x *= r * s);
    }
    Some(c)
}

/// R of C = R Rᵀ.
pub(crate) fn root_of(system: &NormalEquations) -> Option<DMatrix<f64>> {
    let (InverseRoot { mut root, .. }, scale) = scaled_root(system)?;
    for mut column in root.column_iter_mut() {
        let of_rows = column.iter_mut().zip(&scale);
        of_rows.for_each(|(x, s)| *x *= s);
    }
    Some(root)
}

/// W and S of C = S W Wᵀ S.
fn scaled_root(system: &NormalEquations) -> Option<(InverseRoot, Vec<f64>)> {
    /// Relative ridge: far below any direction that influences a prediction.
    const RIDGE: f64 = 1e-11;
    let n = system.n;
    let scale: Vec<f64> = (0..n)
        .map(|i| {
            let d = system.h[i * n + i];
            if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 }
        })
        .collect();
    let mut scaled = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in 0..i {
            let x = system.h[j * n + i] * scale[i] * scale[j];
            (scaled[(i, j)], scaled[(j, i)]) = (x, x);
        }
    }
    let mut ridge = RIDGE;
    loop {
        scaled.fill_diagonal(1.0 + ridge);
        if let Some(root) = inverse_root(&scaled) {
            return Some((root, scale));
        }
        ridge *= 10.0;
        if ridge > 1e-6 {
            return None;
        }
    }
}

/// One sample in whitened form, V = LLᵀ: A = L⁻¹J (m × n), w (m), L⁻¹ (m × m).
#[derive(Debug, Clone)]
pub(crate) struct Whitened {
    pub a: Parted,
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
    let Workspace { cache, parts, .. } = work;
    if parts.is_empty() {
        let of = |part| SampleRows::of(model, part);
        parts.extend(model.parts.iter().map(of));
    }
    let at = State::new(&model.problem, cache, values);
    let mut log_det = 0.0;
    for rows in parts.iter_mut() {
        rows.fill(model, at, weights, sample, Derivatives::All);
        if rows.m > 0 {
            rows.covariance(model, weights, theta);
            log_det += rows.factor()?;
            rows.whiten(true);
        }
    }
    // Rows of all parts in the order of their observations.
    let mut blocks: Vec<(usize, usize, usize)> = Vec::new();
    for rows in parts.iter() {
        blocks.extend(&rows.blocks);
    }
    if blocks.is_empty() {
        return None;
    }
    blocks.sort_unstable();
    let mut m = 0;
    for (_, first, rows) in &mut blocks {
        *first = m;
        m += *rows;
    }
    let place = |o: usize| blocks[blocks.partition_point(|b| b.0 < o)].1;
    let mut out = Whitened {
        a: Parted::new(m, model.free()),
        w: DVector::zeros(m),
        l: DMatrix::zeros(m, m),
        l_inverse: DMatrix::zeros(m, m),
        log_det,
        blocks: Vec::new(),
    };
    for rows in parts.iter().filter(|rows| rows.m > 0) {
        let own = rows.blocks.iter();
        let places: Vec<usize> = own
            .flat_map(|&(o, _, count)| (0..count).map(move |i| place(o) + i))
            .collect();
        let inverse = lower_inverse(&rows.v[..rows.m * rows.m], rows.m);
        for (i, &row) in places.iter().enumerate() {
            out.w[row] = rows.r[i];
            for (j, &column) in places[..=i].iter().enumerate() {
                out.l[(row, column)] = rows.v[i * rows.m + j];
                out.l_inverse[(row, column)] = inverse[i * rows.m + j];
            }
        }
        out.a.put(&rows.part, places, &rows.j[..rows.m * rows.n]);
    }
    out.blocks = blocks;
    Some(out)
}
