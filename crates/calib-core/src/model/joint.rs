//! Motion of one joint with its effects: the one place where they are evaluated.
//!
//! ```text
//! φ = q + Σ_j F_j c_j,   θ = Σ_j e_j F_j c_j,   joint_from_child = exp(S φ) · Exp(θ)        (1)
//! ```
//!
//! Derivatives are body twists at the end of a path, P being the path behind the joint:
//!
//! ```text
//! forward    ∂/∂φ: Ad((Exp(θ) P)⁻¹) S           ∂/∂θ: Ad(P⁻¹) Jr(θ)                         (2)
//! backward   ∂/∂φ: −Ad(P⁻¹) S                   ∂/∂θ: −Ad((exp(−Sφ) P)⁻¹) Exp(θ) Jr(θ)      (3)
//! ```

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3, Vector6};

use calib_geometry::so3;

use crate::graph::axis::Axis;
use crate::graph::edge::Joint;
use crate::graph::effect::EffectKind;
use crate::model::pose::Pose;
use crate::model::values::Values;

/// φ and θ of equation (1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointMotion {
    axis: Axis,
    phi: f64,
    /// Sine and cosine of φ at a revolute joint.
    sin: f64,
    cos: f64,
    theta: Option<Vector3<f64>>,
}

impl JointMotion {
    /// From the reading (rad or m) and the amount F·c of every term.
    pub fn new(axis: Axis, q: f64, amounts: impl IntoIterator<Item = (EffectKind, f64)>) -> Self {
        let amounts = amounts.into_iter();
        Self::sum(axis, q, amounts.map(|(kind, a)| (kind.lateral(), a)))
    }

    /// Equation (1); the terms by the axis across that they drive.
    #[inline]
    pub(crate) fn sum(
        axis: Axis,
        q: f64,
        amounts: impl Iterator<Item = (Option<usize>, f64)>,
    ) -> Self {
        let mut phi = q;
        let mut theta: Option<Vector3<f64>> = None;
        for (lateral, amount) in amounts {
            match lateral {
                None => phi += amount,
                Some(k) => *theta.get_or_insert_with(Vector3::zeros) += axis.across()[k] * amount,
            }
        }
        let (sin, cos) = match axis {
            Axis::Revolute(_) => phi.sin_cos(),
            Axis::Prismatic(_) => (0.0, 1.0),
        };
        Self {
            axis,
            phi,
            sin,
            cos,
            theta,
        }
    }

    /// A revolute joint from (sin, cos) of its reading and of the constant that is added to it:
    ///
    /// ```text
    /// sin(q + c) = sin q cos c + cos q sin c,   cos(q + c) = cos q cos c − sin q sin c
    /// ```
    #[inline]
    pub(crate) fn shifted(
        axis: Axis,
        (sin_q, cos_q): (f64, f64),
        (sin_c, cos_c): (f64, f64),
    ) -> Self {
        let (sin, cos) = (sin_q * cos_c + cos_q * sin_c, cos_q * cos_c - sin_q * sin_c);
        Self {
            axis,
            phi: f64::NAN,
            sin,
            cos,
            theta: None,
        }
    }

    /// φ: the motion about (along) the axis, rad or m.
    #[must_use]
    pub fn phi(&self) -> f64 {
        self.phi
    }

    /// The same θ with another φ: for joints that follow the motion of this one.
    #[must_use]
    pub fn with_phi(&self, phi: f64) -> Self {
        let theta = self.theta;
        Self {
            theta,
            ..Self::sum(self.axis, phi, std::iter::empty())
        }
    }

    /// `joint_from_child`: equation (1) in quaternions, where the solver's inner loop has matrices.
    #[must_use]
    pub fn joint_from_child(&self) -> Isometry3<f64> {
        let mut x = match self.axis {
            Axis::Revolute(a) => Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&a, self.phi),
            ),
            Axis::Prismatic(a) => Isometry3::from_parts(
                Translation3::from(a.into_inner() * self.phi),
                UnitQuaternion::identity(),
            ),
        };
        if let Some(theta) = self.theta {
            x.rotation *= so3::exp(&theta);
        }
        x
    }

    /// Equation (1), or its inverse.
    pub(crate) fn pose(&self, inverse: bool) -> Pose {
        let mut x = self.screw_motion(false);
        if let Some(theta) = self.theta {
            x.r *= so3::exp(&theta).to_rotation_matrix().matrix();
        }
        x.oriented(inverse)
    }

    /// exp(S φ), or exp(−S φ).
    #[inline]
    fn screw_motion(&self, inverse: bool) -> Pose {
        let sign = if inverse { -1.0 } else { 1.0 };
        match &self.axis {
            Axis::Revolute(a) => {
                // R = cos φ I + sin φ [a]ₓ + (1 − cos φ) a aᵀ
                let (s, c) = (self.sin * sign, self.cos);
                let k = 1.0 - c;
                let (x, y, z) = (a.x, a.y, a.z);
                Pose {
                    r: Matrix3::new(
                        c + k * x * x,
                        k * x * y - s * z,
                        k * x * z + s * y,
                        k * x * y + s * z,
                        c + k * y * y,
                        k * y * z - s * x,
                        k * x * z - s * y,
                        k * y * z + s * x,
                        c + k * z * z,
                    ),
                    t: Vector3::zeros(),
                }
            }
            Axis::Prismatic(a) => Pose {
                r: Matrix3::identity(),
                t: a.into_inner() * (self.phi * sign),
            },
        }
    }
}

fn screw(axis: &Axis) -> Vector6<f64> {
    let a = axis.direction();
    match axis {
        Axis::Revolute(_) => Vector6::new(a.x, a.y, a.z, 0.0, 0.0, 0.0),
        Axis::Prismatic(_) => Vector6::new(0.0, 0.0, 0.0, a.x, a.y, a.z),
    }
}

/// What a joint on a path adds to: local columns of its free effects, and the slot of its noise.
#[derive(Debug, Clone, Copy)]
pub(crate) struct JointPass<'a> {
    pub joint: &'a Joint,
    pub motion: JointMotion,
    pub inverse: bool,
    pub sample: usize,
    pub values: &'a Values,
    /// (effect, local column)
    pub columns: &'a [(usize, usize)],
    /// (effect, share, local column)
    pub shares: &'a [(usize, usize, usize)],
    pub slot: Option<usize>,
}

/// Where derivatives go.
pub(crate) struct JointDerivatives<'a> {
    /// By local column; `None`: not wanted.
    pub columns: Option<&'a mut [Vector6<f64>]>,
    /// By local slot.
    pub slots: &'a mut [Vector6<f64>],
}

impl JointPass<'_> {
    /// The path from this joint on, and equations (2) and (3) into `out`.
    #[inline]
    pub(crate) fn then(&self, suffix: Pose, mut out: Option<JointDerivatives<'_>>) -> Pose {
        let swing = self.motion.theta.map(|theta| {
            let r = *so3::exp(&theta).to_rotation_matrix().matrix();
            let t = Vector3::zeros();
            (Pose { r, t }, so3::right_jacobian(&theta))
        });
        if self.inverse {
            self.about(&suffix, -1.0, &mut out);
            let suffix = self.motion.screw_motion(true).then(&suffix);
            match swing {
                None => suffix,
                Some((r, jr)) => {
                    self.across(&suffix, &(r.r * jr), -1.0, &mut out);
                    r.inverse().then(&suffix)
                }
            }
        } else {
            let suffix = match swing {
                None => suffix,
                Some((r, jr)) => {
                    self.across(&suffix, &jr, 1.0, &mut out);
                    r.then(&suffix)
                }
            };
            self.about(&suffix, 1.0, &mut out);
            self.motion.screw_motion(false).then(&suffix)
        }
    }

    /// ∂/∂φ: S commutes with exp(Sφ), so it is the same twist on either side of it.
    #[inline]
    fn about(&self, suffix: &Pose, sign: f64, out: &mut Option<JointDerivatives<'_>>) {
        let Some(out) = out else { return };
        let column = suffix.pull_back(&screw(&self.joint.axis)) * sign;
        if let Some(columns) = &mut out.columns {
            for &(f, c) in self.columns {
                let effect = &self.joint.effects[f];
                if effect.lateral.is_none() {
                    columns[c] += column * effect.value(self.sample, &self.values.0);
                }
            }
            for &(f, i, c) in self.shares {
                if self.joint.effects[f].lateral.is_none() {
                    columns[c] += column * self.share(f, i);
                }
            }
        }
        if let Some(k) = self.slot {
            out.slots[k] += column;
        }
    }

    /// ∂/∂θ: `map` is Jr(θ) or Exp(θ) Jr(θ).
    #[inline]
    fn across(
        &self,
        suffix: &Pose,
        map: &Matrix3<f64>,
        sign: f64,
        out: &mut Option<JointDerivatives<'_>>,
    ) {
        let Some(columns) = out.as_mut().and_then(|out| out.columns.as_mut()) else {
            return;
        };
        let twists = self.joint.axis.across().map(|e| {
            let w = map * e * sign;
            suffix.pull_back(&rotation_twist(&w))
        });
        for &(f, c) in self.columns {
            let effect = &self.joint.effects[f];
            if let Some(k) = effect.lateral {
                columns[c] += twists[k] * effect.value(self.sample, &self.values.0);
            }
        }
        for &(f, i, c) in self.shares {
            if let Some(k) = self.joint.effects[f].lateral {
                columns[c] += twists[k] * self.share(f, i);
            }
        }
    }

    /// ∂(F c)/∂x of a share: its coefficient times ∂F/∂x.
    fn share(&self, effect: usize, share: usize) -> f64 {
        let effect = &self.joint.effects[effect];
        self.values.0[effect.parameter.index()] * effect.shares[share].values[self.sample]
    }

    /// Body twist at the path's end per unit of φ (`None`) or of θ about one of the axes across.
    pub(crate) fn twist(&self, lateral: Option<usize>, suffix: &Pose) -> Vector6<f64> {
        let theta = self.motion.theta.unwrap_or_else(Vector3::zeros);
        let swing = Pose {
            r: *so3::exp(&theta).to_rotation_matrix().matrix(),
            t: Vector3::zeros(),
        };
        let jr = so3::right_jacobian(&theta);
        let axis = &self.joint.axis;
        match (self.inverse, lateral) {
            (false, None) => swing.then(suffix).pull_back(&screw(axis)),
            (true, None) => -suffix.pull_back(&screw(axis)),
            (false, Some(k)) => suffix.pull_back(&rotation_twist(&(jr * axis.across()[k]))),
            (true, Some(k)) => -self
                .motion
                .screw_motion(true)
                .then(suffix)
                .pull_back(&rotation_twist(&(swing.r * jr * axis.across()[k]))),
        }
    }
}

fn rotation_twist(w: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0)
}
