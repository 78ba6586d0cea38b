//! The Levenberg–Marquardt step inside a box, as a quadratic program.
//!
//! ```text
//! min ½ δᵀ(H + λ S⁻²)δ + gᵀδ      s.t.   lower ≤ x + δ ≤ upper                              (1)
//! ```
//!
//! The walls that are active are found by the primal-dual active-set method (Hintermüller, Ito & Kunisch 2002): a few Cholesky factors,
//! and exact where it ends. It may cycle: then Clarabel's interior-point method finds them.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::model::layout::Model;
use crate::model::values::Values;
use crate::solve::equations::NormalEquations;

/// What (1) asks beside the system.
#[derive(Clone, Copy)]
pub(crate) struct Damped<'a> {
    /// Second-order part of H, where it is known.
    pub curvature: Option<&'a [f64]>,
    /// Diagonal of S⁻².
    pub natural: &'a [f64],
    /// λ
    pub damping: f64,
}

/// Replaces `step` by the solution of (1) when it leaves the box; `false` when the program fails.
pub(crate) fn bounded_step(
    model: &Model,
    values: &Values,
    system: &NormalEquations,
    damped: Damped<'_>,
    step: &mut [f64],
) -> bool {
    let n = system.n;
    let parameters = &model.problem.parameters;
    let columns = model.columns.iter();
    // lower − x, upper − x
    let room: Vec<Option<(f64, f64)>> = columns
        .map(|&p| {
            let bounds = parameters[p].bounds;
            bounds.map(|(lower, upper)| (lower - values.0[p], upper - values.0[p]))
        })
        .collect();
    let inside = |c: usize, d: f64| room[c].is_none_or(|(l, u)| l <= d && d <= u);
    if (0..n).all(|c| inside(c, step[c])) {
        return true;
    }
    let program = Program::new(system, damped);
    if let Some(exact) = active_set(&program, &room)
        && exact.iter().all(|x| x.is_finite())
    {
        step.copy_from_slice(&exact);
        return true;
    }
    let walls = walls(&room);
    let Some((z, pressed)) = interior_point(&program, &walls) else {
        return false;
    };
    for c in 0..n {
        let d = z[c] * program.scale[c];
        step[c] = room[c].map_or(d, |(lower, upper)| d.clamp(lower, upper));
    }
    // The interior point stops slightly short of the walls. Only the set of active walls is taken from it where the
    // rest can be solved exactly: otherwise a strong gradient against a wall would hide that the minimum is reached.
    if let Some(exact) = program.exact_step(&pressed)
        && (0..n).all(|c| inside(c, exact[c]))
    {
        step.copy_from_slice(&exact);
    }
    step.iter().all(|x| x.is_finite())
}

/// The solution of (1) by active sets; `None` where they do not settle.
fn active_set(program: &Program, room: &[Option<(f64, f64)>]) -> Option<Vec<f64>> {
    /// It settles in two to six rounds, or cycles.
    const ROUNDS: usize = 12;
    let n = room.len();
    let mut pressed: Vec<Option<f64>> = vec![None; n];
    for _ in 0..ROUNDS {
        let step = program.exact_step(&pressed)?;
        let gradient = program.gradient(&step);
        let next: Vec<Option<f64>> = (0..n)
            .map(|c| {
                let (lower, upper) = room[c]?;
                match pressed[c] {
                    // A wall holds what would go beyond it.
                    Some(wall) if wall <= lower => (gradient[c] > 0.0).then_some(wall),
                    Some(wall) => (gradient[c] < 0.0).then_some(wall),
                    None if step[c] < lower => Some(lower),
                    None if step[c] > upper => Some(upper),
                    None => None,
                }
            })
            .collect();
        if next == pressed {
            return Some(step);
        }
        pressed = next;
    }
    None
}

/// A finite bound on a step: its coordinate, +1 for an upper and −1 for a lower one, the largest step towards it.
struct Wall {
    column: usize,
    side: f64,
    at: f64,
}

fn walls(room: &[Option<(f64, f64)>]) -> Vec<Wall> {
    let of = |(column, limits): (usize, &Option<(f64, f64)>)| {
        let (lower, upper) = limits.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        [(1.0, upper), (-1.0, lower)].map(|(side, at)| Wall { column, side, at })
    };
    let walls = room.iter().enumerate().flat_map(of);
    walls.filter(|w| w.at.is_finite()).collect()
}

/// Equation (1) in scaled unknowns z = δ √H_ii, which keep the program well conditioned.
struct Program {
    /// 1/√H_ii
    scale: Vec<f64>,
    quadratic: Vec<Vec<f64>>,
    linear: Vec<f64>,
}

impl Program {
    fn new(system: &NormalEquations, damped: Damped<'_>) -> Self {
        let Damped {
            curvature,
            natural,
            damping,
            ..
        } = damped;
        let n = system.n;
        let scale: Vec<f64> = (0..n)
            .map(|i| {
                let d = system.h[i * n + i];
                if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 }
            })
            .collect();
        let mut quadratic = vec![vec![0.0; n]; n];
        for i in 0..n {
            for j in 0..=i {
                let more = curvature.map_or(0.0, |s| s[i * n + j]);
                let h = (system.h[j * n + i] + more) * scale[i] * scale[j];
                quadratic[i][j] = h;
                quadratic[j][i] = h;
            }
            // A direction that nothing determines is held at 0.
            quadratic[i][i] = if system.h[i * n + i] > 0.0 {
                quadratic[i][i] + 1e-10 + damping * natural[i] * scale[i] * scale[i]
            } else {
                1.0
            };
        }
        let linear = (0..n).map(|i| system.g[i] * scale[i]).collect();
        Self {
            scale,
            quadratic,
            linear,
        }
    }

    /// Derivative of (1) in scaled unknowns.
    fn gradient(&self, step: &[f64]) -> Vec<f64> {
        let z: Vec<f64> = step.iter().zip(&self.scale).map(|(d, s)| d / s).collect();
        let rows = self.quadratic.iter().zip(&self.linear);
        rows.map(|(row, g)| g + row.iter().zip(&z).map(|(q, z)| q * z).sum::<f64>())
            .collect()
    }

    /// The minimizer of (1) with the pressed coordinates on their walls and the others free.
    fn exact_step(&self, pressed: &[Option<f64>]) -> Option<Vec<f64>> {
        let Self {
            scale,
            quadratic,
            linear,
        } = self;
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
}

/// z, and per coordinate the wall that is active.
type Pressed = (Vec<f64>, Vec<Option<f64>>);

/// The minimum of (1) by an interior-point method; `None` when the solver fails.
#[cfg(feature = "clarabel")]
fn interior_point(program: &Program, walls: &[Wall]) -> Option<Pressed> {
    use clarabel::algebra::CscMatrix;
    use clarabel::solver::{
        DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus,
    };

    let n = program.linear.len();
    // ±z_c ≤ ±wall/scale_c
    let rows: Vec<Vec<f64>> = walls
        .iter()
        .map(|w| {
            let mut row = vec![0.0; n];
            row[w.column] = w.side;
            row
        })
        .collect();
    let b: Vec<f64> = walls
        .iter()
        .map(|w| w.side * w.at / program.scale[w.column])
        .collect();
    let triangle = CscMatrix::from(&program.quadratic).to_triu();
    let a = CscMatrix::from(&rows);
    let cones = [NonnegativeConeT(b.len())];
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .tol_gap_abs(1e-12)
        .tol_gap_rel(1e-12)
        .tol_feas(1e-12)
        .build()
        .ok()?;
    let mut solver =
        DefaultSolver::new(&triangle, &program.linear, &a, &b, &cones, settings).ok()?;
    solver.solve();
    let solution = &solver.solution;
    let solved = matches!(
        solution.status,
        SolverStatus::Solved | SolverStatus::AlmostSolved | SolverStatus::InsufficientProgress
    );
    let mut pressed = vec![None; n];
    for (k, wall) in walls.iter().enumerate() {
        // Complementary slackness: the multiplier of an active wall exceeds its slack.
        if solution.z[k] > solution.s[k] {
            pressed[wall.column] = Some(wall.at);
        }
    }
    solved.then(|| (solution.x.clone(), pressed))
}

/// Without the solver a problem with bounds is refused before it comes here.
#[cfg(not(feature = "clarabel"))]
fn interior_point(_: &Program, _: &[Wall]) -> Option<Pressed> {
    None
}
