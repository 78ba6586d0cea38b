//! Circles of one or several markers around one axis: the cost all circle estimators share, and its minimum.
//!
//! ```text
//! a = n·(x − c),  w = x − c − a n
//! e_a = a − h_p,  e_r = |w| − r_p,       f = Σ e_a² + e_r²                (paper Eqs. 9–13, with I − n nᵀ)
//! h_p = mean a,  r_p = mean |w|          best for given n, c
//! ```
//!
//! The planar part does not depend on c and the radial part only on c across n. One marker with c free is the
//! orthogonal-distance circle; several markers share n and c (one line), or n alone.

use calib_estimator::{
    levenberg::{Problem, Stop, minimize},
    measured::Cloud,
};
use nalgebra::{Matrix2, Matrix4, Matrix6, Vector2, Vector3, Vector4};

use crate::{axis_frame::AxisFrame, products::Products};

const MAX_STEPS: usize = 200;

/// An axis through a point; both relative to the cloud's origin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axis {
    pub frame: AxisFrame,
    pub point: Vector3<f64>,
}

/// Normal equations over (turn about e₁-direction a, b; shift g, d): n ← n + a e₁ + b e₂, c ← c + g e₁ + d e₂.
#[derive(Debug, Clone)]
pub(crate) struct Normal {
    pub hessian: Matrix4<f64>,
    pub gradient: Vector4<f64>,
    pub cost: f64,
}

/// Linearizes f for the samples of one marker, with their weights.
pub(crate) fn linearize_marker(
    samples: impl Iterator<Item = (Vector3<f64>, f64)> + Clone,
    axis: &Axis,
) -> Normal {
    let AxisFrame { e1, e2, n } = axis.frame;
    let (mut total, mut cost, mut mean_a, mut mean_r) = (0.0, 0.0, 0.0, 0.0);
    // Σ w of d, û and a û across the axis, and of their products: all that the two rows of a sample consist of.
    let (mut of_d, mut of_u, mut of_au) = (Vector2::zeros(), Vector2::zeros(), Vector2::zeros());
    let (mut dd, mut uu, mut auu, mut aauu) = (
        Products::ZERO,
        Products::ZERO,
        Products::ZERO,
        Products::ZERO,
    );
    let (mut pull_d, mut pull_u, mut pull_au) =
        (Vector2::zeros(), Vector2::zeros(), Vector2::zeros());
    // Residuals relative to the first sample's: differences keep their digits.
    let first = samples
        .clone()
        .next()
        .map_or(Vector3::zeros(), |(x, _)| x - axis.point);
    let (a0, r0) = (first.dot(&n), (first - n * first.dot(&n)).norm());
    for (x, weight) in samples {
        let d = x - axis.point;
        let a = d.dot(&n);
        let w = d - n * a;
        let length = w.norm();
        let u = if length > 0.0 {
            w / length
        } else {
            Vector3::zeros()
        };
        // ∂a = d·(α e₁ + β e₂);  ∂|w| = −a û·(α e₁ + β e₂) − û·(γ e₁ + δ e₂)
        let across_d = Vector2::new(d.dot(&e1), d.dot(&e2));
        let across_u = Vector2::new(u.dot(&e1), u.dot(&e2));
        let (e_a, e_r) = (a - a0, length - r0);
        dd.add(weight, across_d);
        uu.add(weight, across_u);
        auu.add(weight * a, across_u);
        aauu.add(weight * a * a, across_u);
        pull_d += across_d * (weight * e_a);
        pull_u += across_u * (weight * e_r);
        pull_au += across_u * (weight * a * e_r);
        cost += weight * (e_a * e_a + e_r * e_r);
        of_d += across_d * weight;
        of_u += across_u * weight;
        of_au += across_u * (weight * a);
        mean_a += weight * e_a;
        mean_r += weight * e_r;
        total += weight;
    }
    let mut hessian = Matrix4::zeros();
    hessian
        .fixed_view_mut::<2, 2>(0, 0)
        .copy_from(&(dd.matrix() + aauu.matrix()));
    hessian
        .fixed_view_mut::<2, 2>(0, 2)
        .copy_from(&auu.matrix());
    hessian
        .fixed_view_mut::<2, 2>(2, 0)
        .copy_from(&auu.matrix());
    hessian.fixed_view_mut::<2, 2>(2, 2).copy_from(&uu.matrix());
    let of = |head: Vector2<f64>, tail: Vector2<f64>| Vector4::new(head.x, head.y, tail.x, tail.y);
    let mut gradient = of(pull_d - pull_au, -pull_u);
    let (sum_a, sum_r) = (of(of_d, Vector2::zeros()), of(-of_au, -of_u));
    // Heights and radii are means: center residuals and rows.
    mean_a /= total;
    mean_r /= total;
    hessian -= (sum_a * sum_a.transpose() + sum_r * sum_r.transpose()) / total;
    gradient -= sum_a * mean_a + sum_r * mean_r;
    cost -= total * (mean_a * mean_a + mean_r * mean_r);
    Normal {
        hessian,
        gradient,
        cost: cost.max(0.0),
    }
}

/// f alone, to the last digit that of [`linearize`]: a search that compares costs needs no derivatives.
pub(crate) fn cost(cloud: &Cloud, axis: &Axis) -> f64 {
    (0..cloud.markers())
        .map(|p| cost_of_marker(cloud.samples(p), axis))
        .sum()
}

/// f for the samples of one marker: squares about the mean height and the mean radius.
fn cost_of_marker(samples: impl Iterator<Item = (Vector3<f64>, f64)> + Clone, axis: &Axis) -> f64 {
    let n = axis.frame.n;
    let of = |x: Vector3<f64>| {
        let d = x - axis.point;
        let a = d.dot(&n);
        (a, (d - n * a).norm())
    };
    let (a0, r0) = samples.clone().next().map_or((0.0, 0.0), |(x, _)| of(x));
    let (mut total, mut cost, mut mean_a, mut mean_r) = (0.0, 0.0, 0.0, 0.0);
    for (x, weight) in samples {
        let (a, length) = of(x);
        let (e_a, e_r) = (a - a0, length - r0);
        cost += weight * (e_a * e_a + e_r * e_r);
        mean_a += weight * e_a;
        mean_r += weight * e_r;
        total += weight;
    }
    mean_a /= total;
    mean_r /= total;
    (cost - total * (mean_a * mean_a + mean_r * mean_r)).max(0.0)
}

/// Linearizes f for all markers around one line.
pub(crate) fn linearize(cloud: &Cloud, axis: &Axis) -> Normal {
    let mut total = Normal {
        hessian: Matrix4::zeros(),
        gradient: Vector4::zeros(),
        cost: 0.0,
    };
    for p in 0..cloud.markers() {
        let part = linearize_marker(cloud.samples(p), axis);
        total.hessian += part.hessian;
        total.gradient += part.gradient;
        total.cost += part.cost;
    }
    total
}

/// Curvature of f at the modeled circles: levers of the measured points would count their noise as knowledge.
pub(crate) fn information(cloud: &Cloud, axis: &Axis) -> Matrix4<f64> {
    let mut total = Matrix4::zeros();
    for p in 0..cloud.markers() {
        total += information_of_marker(cloud.samples(p), axis);
    }
    total
}

/// [`information`] of one marker.
pub(crate) fn information_of_marker(
    samples: impl Iterator<Item = (Vector3<f64>, f64)> + Clone,
    axis: &Axis,
) -> Matrix4<f64> {
    let n = axis.frame.n;
    let apart = |(x, weight): (Vector3<f64>, f64)| {
        let d = x - axis.point;
        let a = d.dot(&n);
        (a, d - n * a, weight)
    };
    let (mut height, mut radius, mut total) = (0.0, 0.0, 0.0);
    for (a, w, weight) in samples.clone().map(apart) {
        height += weight * a;
        radius += weight * w.norm();
        total += weight;
    }
    let middle = axis.point + n * (height / total);
    let modeled = samples.map(apart).map(|(_, w, weight)| {
        let on_circle = w * (radius / total / w.norm().max(f64::MIN_POSITIVE));
        (middle + on_circle, weight)
    });
    linearize_marker(modeled, axis).hessian
}

/// Which unknowns move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Free {
    /// Direction and place.
    Line,
    /// Direction only; the point is held.
    Direction,
    /// Place only; the direction is held.
    Point,
}

struct CommonLine<'a> {
    cloud: &'a Cloud,
    free: Free,
    size: f64,
}

impl Problem for CommonLine<'_> {
    type Point = Axis;
    type Normal = Normal;
    type Step = Vector4<f64>;

    fn linearize(&self, x: &Axis) -> Normal {
        linearize(self.cloud, x)
    }

    fn cost(&self, normal: &Normal) -> f64 {
        normal.cost
    }

    fn solve(&self, normal: &Normal, damping: f64) -> Option<(Vector4<f64>, f64)> {
        let mut h = normal.hessian;
        for k in 0..4 {
            h[(k, k)] *= 1.0 + damping;
        }
        let step = match self.free {
            Free::Line => -h.cholesky()?.solve(&normal.gradient),
            Free::Direction => {
                let block: Matrix2<f64> = h.fixed_view::<2, 2>(0, 0).into();
                let g: Vector2<f64> = normal.gradient.fixed_rows::<2>(0).into();
                let s = -block.cholesky()?.solve(&g);
                Vector4::new(s.x, s.y, 0.0, 0.0)
            }
            Free::Point => {
                let block: Matrix2<f64> = h.fixed_view::<2, 2>(2, 2).into();
                let g: Vector2<f64> = normal.gradient.fixed_rows::<2>(2).into();
                let s = -block.cholesky()?.solve(&g);
                Vector4::new(0.0, 0.0, s.x, s.y)
            }
        };
        Some((
            step,
            -(step.dot(&normal.gradient) * 2.0 + step.dot(&(normal.hessian * step))),
        ))
    }

    fn retract(&self, x: &Axis, step: &Vector4<f64>) -> Axis {
        Axis {
            frame: x.frame.turned(step[0], step[1]),
            point: x.point + x.frame.e1 * step[2] + x.frame.e2 * step[3],
        }
    }

    fn is_negligible(&self, _: &Axis, step: &Vector4<f64>) -> bool {
        step[0].hypot(step[1]) <= 1e-15 && step[2].hypot(step[3]) <= 1e-15 * self.size
    }
}

/// The line (or the direction through a held point) of least f from `start`; `None` where it diverges.
pub(crate) fn minimize_line(
    cloud: &Cloud,
    start: Axis,
    free: Free,
    size: f64,
) -> Option<(Axis, Normal)> {
    let problem = CommonLine { cloud, free, size };
    let end = minimize(&problem, start, MAX_STEPS);
    let far = (end.x.point - start.point).norm() > 1e4 * size;
    if end.stop == Stop::Broken || !end.normal.cost.is_finite() || far {
        return None;
    }
    Some(problem.settled(end.x, end.normal))
}

impl CommonLine<'_> {
    /// Newton's steps from where Gauss–Newton's cost no longer tells: around a center held in the wrong place the residuals are
    /// large, Gauss–Newton halves its error at best, and its cost stands still at 10⁻⁸ rad.
    fn settled(&self, mut x: Axis, mut normal: Normal) -> (Axis, Normal) {
        const STEPS: usize = 6;
        const SETTLED: f64 = 1e-13;
        let size_of = |s: &Vector4<f64>| {
            let shift = if self.size > 0.0 { self.size } else { 1.0 };
            s[0].hypot(s[1]).max(s[2].hypot(s[3]) / shift)
        };
        // What Gauss–Newton would still do.
        let Some((step, _)) = self.solve(&normal, 0.0) else {
            return (x, normal);
        };
        let mut last = size_of(&step);
        if last <= SETTLED {
            return (x, normal);
        }
        for _ in 0..STEPS {
            let curved = Normal {
                hessian: self.curvature(&x),
                ..normal.clone()
            };
            let Some((step, _)) = self.solve(&curved, 0.0) else {
                break;
            };
            let length = size_of(&step);
            // Beside a minimum Newton's steps shrink; where they do not, the place stays Gauss–Newton's.
            if length.is_nan() || length > 10.0 * last {
                break;
            }
            x = self.retract(&x, &step);
            normal = self.linearize(&x);
            if length <= SETTLED || length > 0.5 * last && length < 1e-9 {
                break;
            }
            last = length;
        }
        (x, normal)
    }

    /// The Hessian in full, from differences of the gradient.
    fn curvature(&self, x: &Axis) -> Matrix4<f64> {
        const H: f64 = 1e-5;
        let mut hessian = Matrix4::zeros();
        for k in 0..4 {
            let h = if k < 2 { H } else { H * self.size };
            if h <= 0.0 {
                continue;
            }
            let mut by = Vector4::zeros();
            by[k] = h;
            let ahead = self.linearize(&self.retract(x, &by)).gradient;
            let behind = self.linearize(&self.retract(x, &-by)).gradient;
            hessian.set_column(k, &((ahead - behind) / (2.0 * h)));
        }
        (hessian + hessian.transpose()) * 0.5
    }
}

/// The axis along a held direction whose circles are nearest to the samples; `start` where it diverges.
pub(crate) fn placed(cloud: &Cloud, start: Axis, size: f64) -> Axis {
    minimize_line(cloud, start, Free::Point, size).map_or(start, |(axis, _)| axis)
}

/// The direction that several markers share, each with its own center.
pub(crate) struct OwnCenters<'a> {
    pub cloud: &'a Cloud,
    pub size: f64,
}

/// Direction and one center for each marker.
#[derive(Debug, Clone)]
pub(crate) struct Centers {
    pub frame: AxisFrame,
    pub points: Vec<Vector3<f64>>,
}

impl Problem for OwnCenters<'_> {
    type Point = Centers;
    type Normal = Vec<Normal>;
    type Step = (Vector2<f64>, Vec<Vector2<f64>>);

    fn linearize(&self, x: &Centers) -> Vec<Normal> {
        (0..self.cloud.markers())
            .map(|p| {
                let axis = Axis {
                    frame: x.frame,
                    point: x.points[p],
                };
                linearize_marker(self.cloud.samples(p), &axis)
            })
            .collect()
    }

    fn cost(&self, normals: &Vec<Normal>) -> f64 {
        normals.iter().map(|n| n.cost).sum()
    }

    fn solve(&self, normals: &Vec<Normal>, damping: f64) -> Option<(Self::Step, f64)> {
        let (h, g, own) = self.reduced(normals, damping)?;
        let turn = -h.cholesky()?.solve(&g);
        let mut predicted = 0.0;
        let shifts = own
            .iter()
            .zip(normals)
            .map(|((inverse, coupling), normal)| {
                let g_own: Vector2<f64> = normal.gradient.fixed_rows::<2>(2).into();
                let g_turn: Vector2<f64> = normal.gradient.fixed_rows::<2>(0).into();
                let shift = -(inverse * (g_own + coupling * turn));
                predicted -= shift.dot(&g_own) + turn.dot(&g_turn);
                shift
            })
            .collect();
        Some(((turn, shifts), predicted))
    }

    fn retract(&self, x: &Centers, (turn, shifts): &Self::Step) -> Centers {
        Centers {
            frame: x.frame.turned(turn.x, turn.y),
            points: x
                .points
                .iter()
                .zip(shifts)
                .map(|(c, s)| c + x.frame.e1 * s.x + x.frame.e2 * s.y)
                .collect(),
        }
    }

    fn is_negligible(&self, _: &Centers, (turn, shifts): &Self::Step) -> bool {
        turn.norm() <= 1e-15 && shifts.iter().all(|s| s.norm() <= 1e-15 * self.size)
    }
}

/// Normal equations of the direction with the own centers eliminated, and per marker (H_cc⁻¹, H_cn).
type Eliminated = (
    Matrix2<f64>,
    Vector2<f64>,
    Vec<(Matrix2<f64>, Matrix2<f64>)>,
);

impl OwnCenters<'_> {
    pub fn reduced(&self, normals: &[Normal], damping: f64) -> Option<Eliminated> {
        let (mut h, mut g) = (Matrix2::zeros(), Vector2::zeros());
        let mut own = Vec::with_capacity(normals.len());
        for normal in normals {
            let mut damped = normal.hessian;
            for k in 0..4 {
                damped[(k, k)] *= 1.0 + damping;
            }
            let inverse = damped
                .fixed_view::<2, 2>(2, 2)
                .into_owned()
                .cholesky()?
                .inverse();
            let coupling: Matrix2<f64> = normal.hessian.fixed_view::<2, 2>(2, 0).into();
            let g_own: Vector2<f64> = normal.gradient.fixed_rows::<2>(2).into();
            h += damped.fixed_view::<2, 2>(0, 0) - coupling.transpose() * inverse * coupling;
            g += normal.gradient.fixed_rows::<2>(0) - coupling.transpose() * inverse * g_own;
            own.push((inverse, coupling));
        }
        Some((h, g, own))
    }

    pub fn minimize(&self, start: Centers) -> Option<(Centers, Vec<Normal>)> {
        let end = minimize(self, start, MAX_STEPS);
        let cost = self.cost(&end.normal);
        (end.stop != Stop::Broken && cost.is_finite()).then_some((end.x, end.normal))
    }
}

/// Linear least-squares center of circles in the plane across n, common to all markers given: a start. Noise pulls it
/// towards the samples, on short arcs by more than its own error.
pub(crate) fn flat_center(
    cloud: &Cloud,
    frame: &AxisFrame,
    markers: std::ops::Range<usize>,
) -> Vector3<f64> {
    // m across n from  Σ (q − q̄)(|q|² − mean)  =  2 Σ (q − q̄)(q − q̄)ᵀ m
    let (mut a, mut b) = (Matrix2::zeros(), Vector2::zeros());
    let flat = |x: &Vector3<f64>| Vector2::new(x.dot(&frame.e1), x.dot(&frame.e2));
    let mut height = 0.0;
    let mut total = 0.0;
    for p in markers {
        let points = || cloud.samples(p).map(|(x, w)| (flat(&x), w));
        let own = cloud.total(cloud.range(p));
        let mean = points().map(|(q, w)| q * w).sum::<Vector2<f64>>() / own;
        let mean_w = points().map(|(q, w)| w * q.norm_squared()).sum::<f64>() / own;
        for (flat, w) in points() {
            let q = (flat - mean) * w;
            a += q * (flat - mean).transpose();
            b += q * (0.5 * (flat.norm_squared() - mean_w));
        }
        height += cloud
            .samples(p)
            .map(|(x, w)| w * x.dot(&frame.n))
            .sum::<f64>();
        total += own;
    }
    let m = a.cholesky().map_or(Vector2::zeros(), |c| c.solve(&b));
    frame.e1 * m.x + frame.e2 * m.y + frame.n * (height / total)
}

/// 6 × 6 over [direction; point] from a 4 × 4 over (turn, shift).
pub(crate) fn spread_out(covariance: &Matrix4<f64>, frame: &AxisFrame) -> Matrix6<f64> {
    let mut basis = nalgebra::SMatrix::<f64, 6, 4>::zeros();
    basis.fixed_view_mut::<3, 1>(0, 0).copy_from(&frame.e1);
    basis.fixed_view_mut::<3, 1>(0, 1).copy_from(&frame.e2);
    basis.fixed_view_mut::<3, 1>(3, 2).copy_from(&frame.e1);
    basis.fixed_view_mut::<3, 1>(3, 3).copy_from(&frame.e2);
    basis * covariance * basis.transpose()
}
