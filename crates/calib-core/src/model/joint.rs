//! Derivatives of a path by the effects of a joint on it.
//!
//! Body twists at the end of the path, P being the path behind the joint, φ and θ those of its motion:
//!
//! ```text
//! forward    ∂/∂φ: Ad((Exp(θ) P)⁻¹) S            ∂/∂θ: Ad(P⁻¹) Jr(θ)                              (1)
//! backward   ∂/∂φ: −Ad((Trans(−δ) P)⁻¹) S        ∂/∂θ: −Ad((exp(−Sφ) Trans(−δ) P)⁻¹) Exp(θ) Jr(θ) (2)
//! growth     ∂/∂δ: Ad((exp(Sφ) Exp(θ) P)⁻¹) [0; p]   backward: −Ad(P⁻¹) [0; p]                      (3)
//! ```

use nalgebra::{Matrix3, Vector3, Vector6};

use calib_geometry::so3;
use calib_model::motion::{JointMotion, rotation_twist, screw, translation_twist};

use crate::graph::edge::Joint;
use crate::graph::effect::Drives;
use crate::model::pose::Pose;
use crate::model::values::Values;

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
    /// The path from this joint on, and equations (1) to (3) into `out`.
    #[inline]
    pub(crate) fn then(&self, suffix: Pose, mut out: Option<JointDerivatives<'_>>) -> Pose {
        let swing = self.motion.theta().map(|theta| {
            let r = *so3::exp(&theta).to_rotation_matrix().matrix();
            let t = Vector3::zeros();
            (Pose { r, t }, so3::right_jacobian(&theta))
        });
        if self.inverse {
            let suffix = match self.grown(&suffix, -1.0, &mut out) {
                Some(shift) => shift.inverse().then(&suffix),
                None => suffix,
            };
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
            let suffix = self.motion.screw_motion(false).then(&suffix);
            match self.grown(&suffix, 1.0, &mut out) {
                Some(shift) => shift.then(&suffix),
                None => suffix,
            }
        }
    }

    /// Trans(δ) where something grows; equation (3).
    #[inline]
    fn grown(
        &self,
        suffix: &Pose,
        sign: f64,
        out: &mut Option<JointDerivatives<'_>>,
    ) -> Option<Pose> {
        let delta = self.motion.delta()?;
        if let Some(columns) = out.as_mut().and_then(|out| out.columns.as_mut()) {
            let twist = suffix.pull_back(&translation_twist(&self.joint.reach)) * sign;
            for &(f, c) in self.columns {
                let effect = &self.joint.effects[f];
                if effect.drives == Drives::Along {
                    columns[c] += twist * effect.value(self.sample, &self.values.0);
                }
            }
        }
        Some(Pose {
            t: delta,
            ..Pose::identity()
        })
    }

    /// ∂/∂φ: S commutes with exp(Sφ), so it is the same twist on either side of it.
    #[inline]
    fn about(&self, suffix: &Pose, sign: f64, out: &mut Option<JointDerivatives<'_>>) {
        let Some(out) = out else { return };
        let column = suffix.pull_back(&screw(&self.joint.axis)) * sign;
        if let Some(columns) = &mut out.columns {
            for &(f, c) in self.columns {
                let effect = &self.joint.effects[f];
                if effect.drives == Drives::About {
                    columns[c] += column * effect.value(self.sample, &self.values.0);
                }
            }
            for &(f, i, c) in self.shares {
                if self.joint.effects[f].drives == Drives::About {
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
            if let Drives::Across(k) = effect.drives {
                columns[c] += twists[k] * effect.value(self.sample, &self.values.0);
            }
        }
        for &(f, i, c) in self.shares {
            if let Drives::Across(k) = self.joint.effects[f].drives {
                columns[c] += twists[k] * self.share(f, i);
            }
        }
    }

    /// ∂(F c)/∂x of a share: its coefficient times ∂F/∂x.
    fn share(&self, effect: usize, share: usize) -> f64 {
        let effect = &self.joint.effects[effect];
        self.values.0[effect.parameter.index()] * effect.shares[share].values[self.sample]
    }

    /// Body twist at the path's end per unit of what a term drives.
    pub(crate) fn twist(&self, drives: Drives, suffix: &Pose) -> Vector6<f64> {
        let theta = self.motion.theta().unwrap_or_else(Vector3::zeros);
        let swing = Pose {
            r: *so3::exp(&theta).to_rotation_matrix().matrix(),
            t: Vector3::zeros(),
        };
        let jr = so3::right_jacobian(&theta);
        let shift = Pose {
            t: self.motion.delta().unwrap_or_else(Vector3::zeros),
            ..Pose::identity()
        };
        let axis = &self.joint.axis;
        let along = translation_twist(&self.joint.reach);
        // Backward, all of it lies before the path's rest: Trans(−δ) first.
        let behind = || shift.inverse().then(suffix);
        match (self.inverse, drives) {
            (false, Drives::About) => swing.then(suffix).pull_back(&screw(axis)),
            (true, Drives::About) => -behind().pull_back(&screw(axis)),
            (false, Drives::Across(k)) => {
                suffix.pull_back(&rotation_twist(&(jr * axis.across()[k])))
            }
            (true, Drives::Across(k)) => -self
                .motion
                .screw_motion(true)
                .then(&behind())
                .pull_back(&rotation_twist(&(swing.r * jr * axis.across()[k]))),
            (false, Drives::Along) => {
                let moved = self.motion.screw_motion(false).then(&swing).then(suffix);
                moved.pull_back(&along)
            }
            (true, Drives::Along) => -suffix.pull_back(&along),
        }
    }
}
