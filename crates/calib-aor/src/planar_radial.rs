//! Chang & Pollard's combined planar and radial cost: the paper's AoR.
//!
//! ```text
//! f(n) = Σ ((v_k − v̄)·n)² + Σ (‖(I − n nᵀ)(v_k − m)‖ − r)²,   r = mean ‖·‖       (paper Eqs. 9–13)
//! AoR = m + τ n,   τ = (v̄ − m)·n                                              (paper Eqs. 14, 15)
//! ```
//!
//! With m held (a center of rotation) two unknowns are left; with m free it is the orthogonal-distance circle and has
//! four. `planar_radial` walks downhill with a simplex as the paper does, `planar_radial_gn` by Gauss–Newton; they agree to
//! 10⁻⁹ rad. An error of the held center across n tilts the axis when the center lies off the circle's plane.

use argmin::{
    core::{CostFunction, Executor},
    solver::neldermead::NelderMead,
};
use calib_estimator::{InputKind, Verdict, measured::Cloud};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix4};

use crate::{
    circles::{Axis, Free, cost, information, linearize, minimize_line, spread_out},
    judge::{Candidate, inverse_or_zero, judge, prepare},
    options::{CENTERED, EstimatorInfo},
    outcome::{Known, Outcome},
    plane,
};
use calib_estimator::{EstimatorError, Input, Options, cloud_of};

/// Walks of the simplex: each starts afresh around the last end, which frees it from a collapsed shape.
const WALKS: usize = 6;
/// Surfaces through costs at the end of the walks, each around the last one's minimum, until it stands still.
const SURFACES: usize = 12;
/// Step, in rad and in sizes of the data, below which a surface only repeats rounding.
const STANDS_STILL: f64 = 1e-13;
/// Steps of one walk; four unknowns need a few hundred.
const STEPS: u64 = 2000;

/// What `planar_radial` is and needs.
pub(crate) const PLANAR_RADIAL: EstimatorInfo = EstimatorInfo {
    id: "planar_radial",
    name: "planar and radial cost, downhill simplex",
    input: InputKind::Points,
    options: CENTERED,
    summary: "the paper's AoR; center held where given, else free",
    source: "Chang & Pollard 2007; paper §4",
    fit: simplex,
};

/// By downhill simplex, center held ([`Options::center`]) or free.
///
/// # Errors
/// [`EstimatorError`] for data that are non-finite or of another kind.
pub fn simplex(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    run("planar_radial", input, options, walk)
}

/// What `planar_radial_gn` is and needs.
pub(crate) const PLANAR_RADIAL_GN: EstimatorInfo = EstimatorInfo {
    id: "planar_radial_gn",
    name: "planar and radial cost, Gauss–Newton",
    input: InputKind::Points,
    options: CENTERED,
    summary: "the same minimum in a few steps",
    source: "paper §4",
    fit: gauss_newton,
};

/// By Gauss–Newton (Levenberg–Marquardt), center held or free.
///
/// # Errors
/// As [`simplex`].
pub fn gauss_newton(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    run(
        "planar_radial_gn",
        input,
        options,
        |cloud, start, free, size| minimize_line(cloud, start, free, size).map(|(axis, _)| axis),
    )
}

fn run(
    estimator: &'static str,
    input: &Input<'_>,
    options: &Options,
    solve: impl Fn(&Cloud, Axis, Free, f64) -> Option<Axis>,
) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let cloud = cloud_of(input, options)?;
    let factor = match prepare(estimator, &cloud) {
        Ok(factor) => factor,
        Err(answer) => return Ok(answer),
    };
    let free = if options.center.is_some() {
        Free::Direction
    } else {
        Free::Line
    };
    let size = factor.s[0];
    let Some(axis) = solve(&cloud, plane::start(&cloud, &factor, options), free, size) else {
        return Ok(Outcome::none(
            estimator,
            Verdict::Diverged,
            "the estimate diverged: the arcs of the circles are straight within the noise".into(),
            Known::Nothing,
        ));
    };
    let normal = linearize(&cloud, &axis);
    let (n, markers) = (cloud.points.len(), cloud.markers());
    let unknowns = 2 * markers + if free == Free::Line { 4 } else { 2 };
    let known = information(&cloud, &axis);
    let mut unit = Matrix4::zeros();
    if free == Free::Direction {
        let h: Matrix2<f64> = known.fixed_view::<2, 2>(0, 0).into();
        unit.fixed_view_mut::<2, 2>(0, 0)
            .copy_from(&inverse_or_zero(&h));
    } else {
        unit = known.try_inverse().unwrap_or_else(Matrix4::zeros);
    }
    let candidate = Candidate {
        estimator,
        axis,
        own_centers: Vec::new(),
        cost: normal.cost,
        dof: (2 * n).saturating_sub(unknowns),
        unit_covariance: spread_out(&unit, &axis.frame),
        residuals: 2 * n,
        held: options.center,
        gain_by_turning: None,
    };
    Ok(judge(&cloud, &factor, candidate, options))
}

/// f over (turn e₁, turn e₂[, shift e₁, shift e₂]) around a start; shifts in units of the data's size.
struct Walk<'a> {
    cloud: &'a Cloud,
    start: Axis,
    size: f64,
}

impl Walk<'_> {
    fn at(&self, x: &[f64]) -> Axis {
        let f = self.start.frame;
        let shift = if x.len() == 4 {
            f.e1 * (x[2] * self.size) + f.e2 * (x[3] * self.size)
        } else {
            nalgebra::Vector3::zeros()
        };
        Axis {
            frame: f.turned(x[0], x[1]),
            point: self.start.point + shift,
        }
    }
}

impl CostFunction for Walk<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        Ok(cost(self.cloud, &self.at(x)) / (self.size * self.size))
    }
}

fn walk(cloud: &Cloud, start: Axis, free: Free, size: f64) -> Option<Axis> {
    let unknowns = if free == Free::Line { 4 } else { 2 };
    let mut axis = start;
    // A tenth of a radian, a tenth of the size; later walks start smaller.
    let mut edge = 0.1;
    for _ in 0..WALKS {
        let problem = Walk {
            cloud,
            start: axis,
            size,
        };
        let corners: Vec<Vec<f64>> = (0..=unknowns)
            .map(|k| {
                (0..unknowns)
                    .map(|j| if j + 1 == k { edge } else { 0.0 })
                    .collect()
            })
            .collect();
        // Ends when the corners' costs no longer differ: their spread is rounding.
        let solver = NelderMead::new(corners).with_sd_tolerance(1e-22).ok()?;
        let end = Executor::new(problem, solver)
            .configure(|s| s.max_iters(STEPS))
            .run()
            .ok()?;
        let best = end.state.best_param?;
        if !best.iter().all(|x| x.is_finite()) || best.iter().any(|x| x.abs() > 1e4) {
            return None;
        }
        axis = Walk {
            cloud,
            start: axis,
            size,
        }
        .at(&best);
        edge *= 0.03;
    }
    for _ in 0..SURFACES {
        let at = Walk {
            cloud,
            start: axis,
            size,
        };
        let Some(step) = quadratic_surface(&at, unknowns) else {
            break;
        };
        axis = at.at(step.as_slice());
        if step.amax() < STANDS_STILL {
            break;
        }
    }
    Some(axis)
}

/// Step to the minimum of the quadratic surface through costs around the walk's end (Nelder & Mead 1965, appendix): costs
/// near a minimum agree to half of the digits, so comparing them finds it to 10⁻⁸ only. Only costs are used.
fn quadratic_surface(walk: &Walk<'_>, unknowns: usize) -> Option<DVector<f64>> {
    /// Far enough for differences above rounding; what is left of the fifth order is below it.
    const SLOPE: f64 = 1e-4;
    /// Curvature needs fewer digits, and a wider stencil.
    const CURVATURE: f64 = 1e-3;
    /// A walk that ended away from the minimum is not mended here.
    const NEAR: f64 = 1e-2;
    let at = |moves: &[(usize, f64)]| {
        let mut x = vec![0.0; unknowns];
        for (k, by) in moves {
            x[*k] += by;
        }
        cost(walk.cloud, &walk.at(&x)) / (walk.size * walk.size)
    };
    let here = at(&[]);
    let mut gradient = DVector::zeros(unknowns);
    let mut hessian = DMatrix::zeros(unknowns, unknowns);
    for i in 0..unknowns {
        // Fourth order: (8 (f₁ − f₋₁) − (f₂ − f₋₂)) / 12h
        let apart = |by: f64| at(&[(i, by)]) - at(&[(i, -by)]);
        gradient[i] = (8.0 * apart(SLOPE) - apart(2.0 * SLOPE)) / (12.0 * SLOPE);
        let h = CURVATURE;
        hessian[(i, i)] = (at(&[(i, h)]) + at(&[(i, -h)]) - 2.0 * here) / (h * h);
        for j in 0..i {
            let mixed = at(&[(i, h), (j, h)]) - at(&[(i, h), (j, -h)]) - at(&[(i, -h), (j, h)])
                + at(&[(i, -h), (j, -h)]);
            hessian[(i, j)] = mixed / (4.0 * h * h);
            hessian[(j, i)] = hessian[(i, j)];
        }
    }
    let step = -hessian.cholesky()?.solve(&gradient);
    (step.amax() < NEAR).then_some(step)
}
