//! One step of a minimization, and where it leads.

use calib_geometry::decompose::solve_positive;

use crate::graph::edge::EdgeKind;
use crate::model::layout::Model;
use crate::model::values::{Values, coordinates};
use crate::solve::curvature::Curvature;
use crate::solve::equations::NormalEquations;

/// Relative ridge: keeps the factorization positive along directions that nothing sees, and is far too
/// small to slow down the others.
const RIDGE: f64 = 1e-10;

/// Solves (1) of [`minimize`](crate::solve::minimize), with (2) where it is known, by Cholesky of the column-scaled system; `false` when it is not
/// positive definite.
pub(crate) fn damped_step(
    system: &NormalEquations,
    curvature: &mut Curvature,
    natural: &[f64],
    damping: f64,
    factor: &mut [f64],
    step: &mut [f64],
) -> bool {
    let n = system.n;
    // Scaled to unit diagonal, scales 1/√H_ii.
    let scale: Vec<f64> = (0..n)
        .map(|i| {
            let d = system.h[i * n + i];
            if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }
        })
        .collect();
    let mut with = curvature.known;
    loop {
        for i in 0..n {
            step[i] = -system.g[i] * scale[i];
            for j in 0..i {
                factor[i * n + j] = system.h[j * n + i] * scale[i] * scale[j];
            }
            factor[i * n + i] = 1.0 + RIDGE + damping * natural[i] * scale[i] * scale[i];
            if scale[i] == 0.0 {
                factor[i * n + i] = 1.0;
            }
            if with {
                for j in 0..=i {
                    factor[i * n + j] += curvature.s[i * n + j] * scale[i] * scale[j];
                }
            }
        }
        if solve_positive(factor, n, step) {
            break;
        }
        if !with {
            return false;
        }
        // A saddle as far as (2) knows: forget it.
        with = false;
        curvature.known = false;
        curvature.s.fill(0.0);
    }
    for i in 0..n {
        step[i] *= scale[i];
    }
    step.iter().all(|x| x.is_finite())
}

/// x ⊞ δ: coordinates add; a rotation vector that passed π is replaced by the shorter one.
pub(crate) fn retract(model: &Model, values: &Values, step: &[f64], out: &mut Values) {
    out.0.copy_from_slice(&values.0);
    for (c, &p) in model.columns.iter().enumerate() {
        out.0[p] += step[c];
    }
    for edge in &model.problem.edges {
        let EdgeKind::Unknown(u) = &edge.kind else {
            continue;
        };
        if let [Some(a), Some(b), Some(c), ..] = u.parameters {
            let ids = [a.index(), b.index(), c.index()];
            if ids.iter().any(|&p| model.column_of[p].is_none()) {
                continue;
            }
            let omega = coordinates(u, out).fixed_rows::<3>(0).into_owned();
            let angle = omega.norm();
            if angle > std::f64::consts::PI {
                let shorter = omega * (1.0 - 2.0 * std::f64::consts::PI / angle);
                for (i, &p) in ids.iter().enumerate() {
                    out.0[p] = shorter[i];
                }
            }
        }
    }
}
