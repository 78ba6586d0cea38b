//! Residuals (1) and their normal equations.

use calib_estimator::{levenberg::Problem, measured::Pose};
use calib_geometry::{
    decompose::symmetric_eigen_small,
    se3::{self, Twist},
    so3,
};
use nalgebra::{Isometry3, SMatrix, SVector, UnitQuaternion};

/// Scaled information below which a direction of the unknowns is not seen at all.
const UNSEEN: f64 = 1e-10;

pub(super) type Matrix12 = SMatrix<f64, 12, 12>;
pub(super) type Vector12 = SVector<f64, 12>;

/// The unknowns: W and Y.
#[derive(Clone)]
pub(super) struct State {
    pub w: Isometry3<f64>,
    pub y: Isometry3<f64>,
}

/// A sample that counts.
pub(super) struct Seen {
    /// The joint's turn by its angles.
    pub turn: UnitQuaternion<f64>,
    pub pose: Pose,
    /// The pose's rotation.
    pub measured: UnitQuaternion<f64>,
    pub weight: f64,
}

/// Sum of the weights.
pub(super) fn total(seen: &[Seen]) -> f64 {
    seen.iter().map(|s| s.weight).sum()
}

/// The problem with its noise levels.
pub(super) struct Joint<'a> {
    pub seen: &'a [Seen],
    pub sigma_t: f64,
    pub sigma_r: f64,
    pub with_rotations: bool,
    pub scale: f64,
}

/// Information of each kind of residual, gradient and sums of squares.
pub(super) struct Normal {
    pub of_positions: Matrix12,
    pub of_rotations: Matrix12,
    pub gradient: Vector12,
    pub cost: f64,
    pub t2: f64,
    pub r2: f64,
}

impl Joint<'_> {
    /// Lengths in the unknowns are measured in `scale`, so that turns and shifts compare.
    fn scaling(&self) -> Vector12 {
        Vector12::from_fn(|i, _| if i % 6 < 3 { 1.0 } else { self.scale })
    }

    fn hessian(&self, normal: &Normal) -> Matrix12 {
        let mut h = normal.of_positions + normal.of_rotations;
        if !self.with_rotations {
            // Positions do not see the body's own orientation: hold it.
            for k in 6..9 {
                h[(k, k)] += 1.0;
            }
        }
        h
    }

    /// H⁻¹, or `None` where the data leave a direction free.
    pub fn inverse(&self, normal: &Normal) -> Option<Matrix12> {
        let h = self.hessian(normal);
        // Each unknown in units of its own information: turns, shifts, exact and noisy residuals compare.
        let unit = h
            .diagonal()
            .map(|x| if x > 0.0 { x.sqrt().recip() } else { 0.0 });
        let s = Matrix12::from_diagonal(&unit);
        let scaled = s * h * s;
        let eigen = symmetric_eigen_small(&scaled);
        if eigen.values[0] <= UNSEEN * eigen.values[11] {
            return None;
        }
        Some(s * scaled.cholesky()?.inverse() * s)
    }
}

impl Problem for Joint<'_> {
    type Point = State;
    type Normal = Normal;
    type Step = Vector12;

    fn linearize(&self, x: &State) -> Normal {
        let mut normal = Normal {
            of_positions: Matrix12::zeros(),
            of_rotations: Matrix12::zeros(),
            gradient: Vector12::zeros(),
            cost: 0.0,
            t2: 0.0,
            r2: 0.0,
        };
        for sample in self.seen {
            let Seen {
                turn,
                pose,
                measured,
                weight,
            } = sample;
            let (wt, wr) = (
                weight * self.sigma_t.powi(-2),
                weight * self.sigma_r.powi(-2),
            );
            let behind = turn * x.y;
            let predicted = x.w * behind;
            // W exp(a) · A Y exp(b):   δ = Ad((A Y)⁻¹) a + b,  residual falls by δ
            let ad = se3::adjoint(&behind.inverse());
            let u =
                predicted.rotation.inverse() * (pose.translation - predicted.translation.vector);
            let phi = so3::log(&(predicted.rotation.inverse() * measured));
            let top = ad.fixed_rows::<3>(0);
            let bottom = ad.fixed_rows::<3>(3);
            let mut j_t = SMatrix::<f64, 3, 12>::zeros();
            j_t.fixed_view_mut::<3, 6>(0, 0).copy_from(&bottom);
            j_t.fixed_view_mut::<3, 3>(0, 9).fill_with_identity();
            normal.of_positions += j_t.transpose() * j_t * wt;
            normal.gradient -= j_t.transpose() * u * wt;
            normal.t2 += weight * u.norm_squared();
            normal.r2 += weight * phi.norm_squared();
            normal.cost += u.norm_squared() * wt;
            if self.with_rotations {
                let mut j_r = SMatrix::<f64, 3, 12>::zeros();
                j_r.fixed_view_mut::<3, 6>(0, 0).copy_from(&top);
                j_r.fixed_view_mut::<3, 3>(0, 6).fill_with_identity();
                normal.of_rotations += j_r.transpose() * j_r * wr;
                normal.gradient -= j_r.transpose() * phi * wr;
                normal.cost += phi.norm_squared() * wr;
            }
        }
        normal
    }

    fn cost(&self, normal: &Normal) -> f64 {
        normal.cost
    }

    fn solve(&self, normal: &Normal, damping: f64) -> Option<(Vector12, f64)> {
        let mut h = self.hessian(normal);
        for k in 0..12 {
            h[(k, k)] *= 1.0 + damping;
        }
        let step = -h.cholesky()?.solve(&normal.gradient);
        Some((step, -step.dot(&normal.gradient)))
    }

    fn retract(&self, x: &State, step: &Vector12) -> State {
        let part = |at: usize| se3::exp(&Twist(step.fixed_rows::<6>(at).into()));
        let renormalized = |mut i: Isometry3<f64>| {
            i.rotation.renormalize();
            i
        };
        State {
            w: renormalized(x.w * part(0)),
            y: renormalized(x.y * part(6)),
        }
    }

    fn is_negligible(&self, _: &State, step: &Vector12) -> bool {
        step.component_div(&self.scaling()).amax() <= 1e-15
    }
}
