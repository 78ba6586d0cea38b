//! The Levenberg–Marquardt step inside a box, as a quadratic program for Clarabel.
//!
//! ```text
//! min ½ δᵀ(H + λ S⁻²)δ + gᵀδ      s.t.   lower ≤ x + δ ≤ upper                              (1)
//! ```

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus,
};

use crate::model::{Model, Values};
use crate::normal::NormalEquations;

/// Replaces `step` by the solution of (1) when it leaves the box; `false` when the program fails.
pub(crate) fn bounded_step(
    model: &Model,
    values: &Values,
    system: &NormalEquations,
    natural: &[f64],
    damping: f64,
    step: &mut [f64],
) -> bool {
    let n = system.n;
    let room: Vec<Option<(f64, f64)>> = model
        .columns
        .iter()
        .map(|&p| {
            let x = values.0[p];
            model.problem.parameters[p]
                .bounds
                .map(|(lower, upper)| (lower - x, upper - x))
        })
        .collect();
    let inside = |c: usize, d: f64| room[c].is_none_or(|(l, u)| l <= d && d <= u);
    if (0..n).all(|c| inside(c, step[c])) {
        return true;
    }
    // Scaled unknowns z = δ √H_ii keep the program well conditioned.
    let scale: Vec<f64> = (0..n)
        .map(|i| {
            let d = system.h[i * n + i];
            if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 }
        })
        .collect();
    let mut quadratic = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let h = system.h[j * n + i] * scale[i] * scale[j];
            quadratic[i][j] = h;
            quadratic[j][i] = h;
        }
        // A direction that nothing sees is held at 0.
        quadratic[i][i] = if system.h[i * n + i] > 0.0 {
            1.0 + 1e-10 + damping * natural[i] * scale[i] * scale[i]
        } else {
            1.0
        };
    }
    let linear: Vec<f64> = (0..n).map(|i| system.g[i] * scale[i]).collect();
    let mut a = Vec::new();
    let mut b = Vec::new();
    for (c, limits) in room.iter().enumerate() {
        if let Some((lower, upper)) = limits {
            let mut row = vec![0.0; n];
            if upper.is_finite() {
                row[c] = 1.0;
                a.push(row.clone());
                b.push(upper / scale[c]);
            }
            if lower.is_finite() {
                row[c] = -1.0;
                a.push(row);
                b.push(-lower / scale[c]);
            }
        }
    }
    let p = CscMatrix::from(&quadratic).to_triu();
    let a = CscMatrix::from(&a);
    let cones = [NonnegativeConeT(b.len())];
    let Ok(settings) = DefaultSettingsBuilder::default()
        .verbose(false)
        .tol_gap_abs(1e-12)
        .tol_gap_rel(1e-12)
        .tol_feas(1e-12)
        .build()
    else {
        return false;
    };
    let Ok(mut solver) = DefaultSolver::new(&p, &linear, &a, &b, &cones, settings) else {
        return false;
    };
    solver.solve();
    if !matches!(
        solver.solution.status,
        SolverStatus::Solved | SolverStatus::AlmostSolved | SolverStatus::InsufficientProgress
    ) {
        return false;
    }
    for c in 0..n {
        let d = solver.solution.x[c] * scale[c];
        // The interior point stops a hair inside or outside: exactly on the wall is meant.
        step[c] = room[c].map_or(d, |(lower, upper)| d.clamp(lower, upper));
    }
    step.iter().all(|x| x.is_finite())
}
