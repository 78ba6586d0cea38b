//! The likelihood of a pivot for given noise levels: cost, gradient and curvature of (1) of [`crate::hotspot_ml`].

use calib_estimator::{levenberg::Problem, measured::Pose};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use crate::hotspot::stack;

/// Poses with their weights, and the noise of a pose of weight 1.
pub(crate) struct Likelihood<'a> {
    pub poses: Vec<(&'a Pose, f64)>,
    /// Centers are relative to it.
    pub origin: Vector3<f64>,
    pub sigma_t: f64,
    pub sigma_r: f64,
    /// Size of the unknowns.
    pub scale: f64,
}

/// The normal equations at a point.
pub(crate) struct Normal {
    pub hessian: Matrix6<f64>,
    /// The part of the Hessian that the distances |q| contribute.
    pub of_radial: Matrix6<f64>,
    gradient: Vector6<f64>,
    pub cost: f64,
    /// Σ (|q| − |p|)².
    pub radial: f64,
    /// Σ ∠² |q||p|: squared arcs.
    pub arc: f64,
}

/// Angle from its sine (≥ 0) and cosine: accurate at both ends.
fn angle(sine: f64, cosine: f64) -> f64 {
    // The series of the arc sine: what follows is below rounding. Most residuals are this small, and the arc tangent is slow.
    if sine < 0.01 && cosine > 0.0 {
        let s2 = sine * sine;
        return sine * (1.0 + s2 * (1.0 / 6.0 + s2 * (3.0 / 40.0 + s2 * (5.0 / 112.0))));
    }
    sine.atan2(cosine)
}

impl Problem for Likelihood<'_> {
    type Point = Vector6<f64>;
    type Normal = Normal;
    type Step = Vector6<f64>;

    fn linearize(&self, x: &Vector6<f64>) -> Normal {
        let (o, p): (Vector3<f64>, Vector3<f64>) =
            (x.fixed_rows::<3>(0).into(), x.fixed_rows::<3>(3).into());
        let (t2, r2) = (self.sigma_t * self.sigma_t, self.sigma_r * self.sigma_r);
        let length_p = p.norm();
        let unit_p = p / length_p;
        let across_p = Matrix3::identity() - unit_p * unit_p.transpose();
        let (mut turned, mut turned2) = (Vector3::zeros(), Matrix3::zeros());
        let (mut sum_b, mut sum_bww) = (0.0, Matrix3::zeros());
        let (mut sum_cr, mut sum_w) = (Matrix3::zeros(), 0.0);
        let (mut g_o, mut g_q, mut along_p) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        let (mut n, mut cost, mut radial, mut arc, mut sum_e) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for &(pose, row) in &self.poses {
            // In the world: ŵ = R q̂ needs no rotation.
            let d = o - (pose.translation - self.origin);
            let length_q = d.norm();
            let unit_w = d / length_q;
            let unit_q = pose.rotation.tr_mul(&unit_w);
            let e = length_q - length_p;
            let (sine, cosine) = (unit_q.cross(&unit_p).norm(), unit_q.dot(&unit_p));
            let phi = angle(sine, cosine);
            let ratio = if sine > 1e-9 { phi / sine } else { 1.0 };
            let product = length_q * length_p;
            // A row of weight `row` has both noises smaller by its root.
            let e_row = row * e;
            let w_alone = 1.0 / (r2 + t2 / product);
            let w = row * w_alone;
            n += row;
            cost += e_row * e / t2 + phi * phi * w;
            radial += e_row * e;
            arc += row * phi * phi * product;
            // ∇_q ∠²/2 = φ/sin φ (cos φ q̂ − p̂)/|q|, and likewise for p; ∂w/∂|q| = w² σ_t²/(|q|²|p|)
            let pull = 0.5 * phi * phi * w * w_alone * t2 / product;
            let swing = ratio * w;
            g_o += unit_w * (e_row / t2 + (pull + swing * cosine) / length_q)
                - pose.rotation * unit_p * (swing / length_q);
            g_q += unit_q * swing;
            along_p += pull + swing * cosine;
            // Gauss–Newton blocks: radial q̂, p̂; tangential (I − q̂q̂ᵀ)/|q|, (I − p̂p̂ᵀ)/|p|
            let b = w / (length_q * length_q);
            let c = w / product;
            let ww = unit_w * unit_w.transpose();
            turned += unit_w * row;
            turned2 += ww * row;
            sum_b += b;
            sum_bww += ww * b;
            sum_cr += (pose.rotation - unit_w * unit_q.transpose()) * c;
            sum_w += w;
            sum_e += e_row;
        }
        let g_p = unit_p * (along_p / length_p - sum_e / t2) - g_q / length_p;
        let h_oo = turned2 / t2 + Matrix3::identity() * sum_b - sum_bww;
        let h_op = -(turned * unit_p.transpose()) / t2 - sum_cr * across_p;
        let h_pp =
            unit_p * unit_p.transpose() * (n / t2) + across_p * (sum_w / (length_p * length_p));
        let mut hessian = Matrix6::zeros();
        hessian.fixed_view_mut::<3, 3>(0, 0).copy_from(&h_oo);
        hessian.fixed_view_mut::<3, 3>(0, 3).copy_from(&h_op);
        hessian
            .fixed_view_mut::<3, 3>(3, 0)
            .copy_from(&h_op.transpose());
        hessian.fixed_view_mut::<3, 3>(3, 3).copy_from(&h_pp);
        // Σ (R q̂, −p̂)(R q̂, −p̂)ᵀ / σ_t²
        let mut of_radial = Matrix6::zeros();
        let side = -turned * unit_p.transpose() / t2;
        of_radial
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(turned2 / t2));
        of_radial.fixed_view_mut::<3, 3>(0, 3).copy_from(&side);
        of_radial
            .fixed_view_mut::<3, 3>(3, 0)
            .copy_from(&side.transpose());
        of_radial
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&(unit_p * unit_p.transpose() * (n / t2)));
        Normal {
            hessian,
            of_radial,
            gradient: stack(&g_o, &g_p),
            cost,
            radial,
            arc,
        }
    }

    fn cost(&self, normal: &Normal) -> f64 {
        normal.cost
    }

    fn solve(&self, normal: &Normal, damping: f64) -> Option<(Vector6<f64>, f64)> {
        let mut h = normal.hessian;
        for k in 0..6 {
            h[(k, k)] *= 1.0 + damping;
        }
        let step = -h.cholesky()?.solve(&normal.gradient);
        Some((
            step,
            -(step.dot(&normal.gradient) * 2.0 + step.dot(&(normal.hessian * step))),
        ))
    }

    fn retract(&self, x: &Vector6<f64>, step: &Vector6<f64>) -> Vector6<f64> {
        x + step
    }

    fn is_negligible(&self, _: &Vector6<f64>, step: &Vector6<f64>) -> bool {
        step.norm() <= 1e-15 * self.scale
    }
}
