//! How poses follow the readings.
//!
//! ```text
//! root_from_link(q + dq) = root_from_link(q) · exp(J dq),   J_k = Σ_i s_i ∂φ_i/∂q_k + Σ_n w_in ∂θ_in/∂q_k              (1)
//! s_i: twist of the link per unit of motion of joint i,   w_in: per unit of rotation across its axis
//! ```
//!
//! ∂φ/∂q and ∂θ/∂q are differences: effects are small against the reading, so their error is far below any tracker. The jump of
//! backlash with the sign of the load has no derivative and is left out.

use calib_geometry::so3;
use nalgebra::{Matrix3, Vector3, Vector6};

use crate::axis::Axis;
use crate::error::ModelError;
use crate::forward::{Under, Work};
use crate::model::{Joint, LinkId, Model};

/// Rad or m: truncation (harmonics of a motor have periods of some mrad) and rounding are both below 1e-7 of an effect.
const STEP: f64 = 1e-6;

impl Model {
    /// Jacobian of a link: 6 × [`Model::joints`] by columns into `out`, twists `[ω; v]` in the link's frame, all effects included. The
    /// pose of the posture is in `work` afterwards.
    ///
    /// # Errors
    /// As [`Model::forward`], and [`ModelError::Length`] of `out`.
    pub fn jacobian(
        &self,
        q: &[f64],
        link: LinkId,
        under: &Under,
        work: &mut Work,
        out: &mut [f64],
    ) -> Result<(), ModelError> {
        self.ready(q, under, work)?;
        self.known(link)?;
        if out.len() != 6 * q.len() {
            return Err(ModelError::Length {
                what: "out",
                found: out.len(),
                expected: 6 * q.len(),
            });
        }
        self.slopes(link, &self.movers[link.0], (q, under, true), work);
        self.motions(q, under, work);
        self.poses(work);
        self.columns_of(link, &self.movers[link.0], work);
        for (column, out) in work.jacobian.iter().zip(out.chunks_exact_mut(6)) {
            out.copy_from_slice(column.as_slice());
        }
        Ok(())
    }

    pub(crate) fn known(&self, link: LinkId) -> Result<(), ModelError> {
        let known = link.0 < self.links.len();
        known.then_some(()).ok_or(ModelError::ForeignWork)
    }

    /// ∂φ/∂q and ∂θ/∂q of the joints that lead to a link, by these entries of q; differences to both sides, or to one in half the time.
    pub(crate) fn slopes(
        &self,
        link: LinkId,
        entries: &[usize],
        (q, under, both): (&[f64], &Under, bool),
        work: &mut Work,
    ) {
        let mut tried = std::mem::take(&mut work.q);
        tried.copy_from_slice(q);
        let width = if both { 2.0 * STEP } else { STEP };
        // Nominal poses before this joint are those of `tried`.
        let mut known = 0;
        if !both {
            self.smooth_motions(&tried, 0, under, work);
            known = self.joints.len();
            entries
                .iter()
                .for_each(|k| self.begin_slopes(link, *k, width, work));
        }
        // From the tool to the root: what one entry leaves moved is behind the next.
        for &k in entries.iter().rev() {
            let moves = |j: &Joint| j.axis.is_some() && j.source == k;
            let first = self.joints.iter().position(moves).unwrap_or(0);
            known = known.min(first);
            if both {
                tried[k] = q[k] - STEP;
                self.smooth_motions(&tried, known, under, work);
                self.begin_slopes(link, k, width, work);
            }
            tried[k] = q[k] + STEP;
            self.smooth_motions(&tried, known, under, work);
            for &i in &self.chains[link.0] {
                let at = i * self.moved.len() + k;
                work.phi_slope[at] += work.phi[i] / width;
                work.theta_slope[at] += work.theta[i] / width;
            }
            tried[k] = q[k];
            known = first;
        }
        work.q = tried;
    }

    /// The lower ends of differences.
    fn begin_slopes(&self, link: LinkId, k: usize, width: f64, work: &mut Work) {
        for &i in &self.chains[link.0] {
            let at = i * self.moved.len() + k;
            work.phi_slope[at] = -work.phi[i] / width;
            work.theta_slope[at] = -work.theta[i] / width;
        }
    }

    /// Equation (1), with the poses and slopes of `work`.
    pub(crate) fn columns_of(&self, link: LinkId, entries: &[usize], work: &mut Work) {
        let dof = self.moved.len();
        work.jacobian.fill(Vector6::zeros());
        for &i in &self.chains[link.0] {
            let Some(about) = self.about_twist(i, link, work) else {
                continue;
            };
            let across = self.joints[i].yields.then(|| Across::of(i, link, work));
            for &k in entries {
                let at = i * dof + k;
                let mut column = about * work.phi_slope[at];
                if let Some(across) = &across {
                    column += across.twist(&work.theta_slope[at]);
                }
                work.jacobian[k] += column;
            }
        }
    }

    /// s of equation (1); `None` for a fixed joint.
    pub(crate) fn about_twist(&self, i: usize, link: LinkId, work: &Work) -> Option<Vector6<f64>> {
        let at = &work.at[link.0];
        let joint = &self.joints[i];
        let axis = work.at[joint.parent].r * joint.origin.axis;
        Some(match joint.axis? {
            Axis::Revolute(_) => stacked(&at.r, &axis, &axis.cross(&(at.t - work.at[i + 1].t))),
            Axis::Prismatic(_) => stacked(&at.r, &Vector3::zeros(), &axis),
        })
    }
}

/// How a link follows θ of a joint: Exp(θ + dθ) = Exp(θ) Exp(Jr(θ) dθ).
pub(crate) struct Across {
    /// link_from_child Jr(θ)
    turn: Matrix3<f64>,
    /// From the child to the link, in the link's axes, m.
    lever: Vector3<f64>,
}

impl Across {
    pub(crate) fn of(i: usize, link: LinkId, work: &Work) -> Self {
        let (at, child) = (&work.at[link.0], &work.at[i + 1]);
        Self {
            turn: at.r.tr_mul(&child.r) * so3::right_jacobian(&work.theta[i]),
            lever: at.r.tr_mul(&(at.t - child.t)),
        }
    }

    /// Twist `[ω; v]` of the link per change of θ, in its axes.
    pub(crate) fn twist(&self, change: &Vector3<f64>) -> Vector6<f64> {
        let omega = self.turn * change;
        let v = omega.cross(&self.lever);
        Vector6::new(omega.x, omega.y, omega.z, v.x, v.y, v.z)
    }
}

/// A twist in the root's axes, at a link's origin, in the link's axes.
fn stacked(r: &Matrix3<f64>, omega: &Vector3<f64>, v: &Vector3<f64>) -> Vector6<f64> {
    let (omega, v) = (r.tr_mul(omega), r.tr_mul(v));
    Vector6::new(omega.x, omega.y, omega.z, v.x, v.y, v.z)
}
