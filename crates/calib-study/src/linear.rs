//! The efficient linear estimator of a bundle: a rigid body's markers, frame by frame.
//!
//! ```text
//! w_i = J_i x + O y_i + ε_i,   y_i of each frame its own,   P = I − O (Oᵀ O)⁻¹ Oᵀ                 (1)
//! x* = C Σ J_iᵀ P ε_i,   C = ( Σ J_iᵀ P J_i )⁻¹                                                  (2)
//! ```
//!
//! w_i are the markers' noise in the body's axes, so that O (how the body's own motion moves them) is the same in every frame.

use nalgebra::DMatrix;

/// (2) for the first unknowns.
pub(crate) struct Linear {
    /// Trace of their part of C.
    pub trace: f64,
    /// Their rows of C J_iᵀ P.
    pub gains: Vec<DMatrix<f64>>,
}

/// `own`: O; `first_known`: y of the first frame is 0, which holds the gauge. `None` where the unknowns are not determined.
pub(crate) fn linear(
    jacobians: &[DMatrix<f64>],
    own: Option<&DMatrix<f64>>,
    first_known: bool,
    keep: usize,
) -> Option<Linear> {
    let (rows, unknowns) = jacobians.first()?.shape();
    let projection = match own {
        Some(o) => {
            DMatrix::identity(rows, rows) - o * o.tr_mul(o).cholesky()?.inverse() * o.transpose()
        }
        None => DMatrix::identity(rows, rows),
    };
    let mut information = DMatrix::zeros(unknowns, unknowns);
    let mut weighted = Vec::with_capacity(jacobians.len());
    for (i, j) in jacobians.iter().enumerate() {
        let jt = if first_known && i == 0 {
            j.transpose()
        } else {
            j.tr_mul(&projection)
        };
        information += &jt * j;
        weighted.push(jt);
    }
    let c = information.cholesky()?.inverse();
    let top = c.rows(0, keep).into_owned();
    Some(Linear {
        trace: (0..keep).map(|k| c[(k, k)]).sum(),
        gains: weighted.iter().map(|jt| &top * jt).collect(),
    })
}
