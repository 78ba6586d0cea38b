//! The Levenberg–Marquardt step inside a box, as a quadratic program for Clarabel.
//!
//! ```text
//! min ½ δᵀ(H + λ S⁻²)δ + gᵀδ      s.t.   lower ≤ x + δ ≤ upper                              (1)
//! ```

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus,
};

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::model::layout::Model;
use crate::model::values::Values;
use crate::solve::normal::NormalEquations;

/// Replaces `step` by the solution of (1) when it leaves the box; `false` when the program fails.
pub(crate) fn bounded_step(
    model: &Model,
    values: &Values,
    system: &NormalEquations,
    curvature: Option<&[f64]>,
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
    let quadratic = quadratic(system, curvature, natural, damping, &scale);
    let linear: Vec<f64> = (0..n).map(|i| system.g[i] * scale[i]).collect();
    let (a, b, walls) = walls(&room, &scale);
    let triangle = CscMatrix::from(&quadratic).to_triu();
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
    let Ok(mut solver) = DefaultSolver::new(&triangle, &linear, &a, &b, &cones, settings) else {
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
        step[c] = room[c].map_or(d, |(lower, upper)| d.clamp(lower, upper));
    }
    // The interior point stops a hair off the walls. Which of them press is all that is taken from it where the rest
    // can be solved exactly: otherwise a strong gradient against a wall would hide that the minimum is reached.
    let mut pressed = vec![None; n];
    for (k, &(c, wall)) in walls.iter().enumerate() {
        if solver.solution.z[k] > solver.solution.s[k] {
            pressed[c] = Some(wall);
        }
    }
    if let Some(exact) = exact_step(&quadratic, &linear, &scale, &pressed)
        && (0..n).all(|c| inside(c, exact[c]))
    {
        step.copy_from_slice(&exact);
    }
    step.iter().all(|x| x.is_finite())
}

/// The matrix of (1) in the scaled unknowns.
///
/// ```text
/// Q_ij = (H_ij + S_ij) s_i s_j,   Q_ii += λ N_i s_i²
/// ```
fn quadratic(
    system: &NormalEquations,
    curvature: Option<&[f64]>,
    natural: &[f64],
    damping: f64,
    scale: &[f64],
) -> Vec<Vec<f64>> {
    let n = system.n;
    let mut quadratic = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let more = curvature.map_or(0.0, |s| s[i * n + j]);
            let h = (system.h[j * n + i] + more) * scale[i] * scale[j];
            quadratic[i][j] = h;
            quadratic[j][i] = h;
        }
        // A direction that nothing sees is held at 0.
        quadratic[i][i] = if system.h[i * n + i] > 0.0 {
            quadratic[i][i] + 1e-10 + damping * natural[i] * scale[i] * scale[i]
        } else {
            1.0
        };
    }
    quadratic
}

/// The walls `A z ≤ b` in the scaled unknowns, and the column and place of each.
#[expect(clippy::type_complexity, reason = "three lists, one entry per wall")]
fn walls(
    room: &[Option<(f64, f64)>],
    scale: &[f64],
) -> (Vec<Vec<f64>>, Vec<f64>, Vec<(usize, f64)>) {
    let (mut a, mut b, mut walls) = (Vec::new(), Vec::new(), Vec::new());
    for (c, limits) in room.iter().enumerate() {
        let Some((lower, upper)) = limits else {
            continue;
        };
        for (wall, side) in [(*upper, 1.0), (*lower, -1.0)] {
            if wall.is_finite() {
                let mut row = vec![0.0; room.len()];
                row[c] = side;
                a.push(row);
                b.push(side * wall / scale[c]);
                walls.push((c, wall));
            }
        }
    }
    (a, b, walls)
}

/// The minimiser of (1) with the pressed coordinates on their walls and the others free.
fn exact_step(
    quadratic: &[Vec<f64>],
    linear: &[f64],
    scale: &[f64],
    pressed: &[Option<f64>],
) -> Option<Vec<f64>> {
    let n = linear.len();
    let free: Vec<usize> = (0..n).filter(|&c| pressed[c].is_none()).collect();
    let held: Vec<f64> = (0..n)
        .map(|c| pressed[c].map_or(0.0, |wall| wall / scale[c]))
        .collect();
    let h = DMatrix::from_fn(free.len(), free.len(), |i, j| quadratic[free[i]][free[j]]);
    let g = DVector::from_fn(free.len(), |i, _| {
        let row = &quadratic[free[i]];
        linear[free[i]] + row.iter().zip(&held).map(|(q, z)| q * z).sum::<f64>()
    });
    let z = Cholesky::new(h)?.solve(&-g);
    let mut step: Vec<f64> = (0..n).map(|c| held[c] * scale[c]).collect();
    for (i, &c) in free.iter().enumerate() {
        step[c] = z[i] * scale[c];
    }
    // Exactly on the wall, not a rounding beside it.
    for (c, wall) in pressed.iter().enumerate() {
        step[c] = wall.unwrap_or(step[c]);
    }
    Some(step)
}
