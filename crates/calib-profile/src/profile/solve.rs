//! What is estimated, with priors, noise levels and limits of the verdict.

use super::{Free, JointFree, Load, Method};
use calib_urdf::JointId;
use std::collections::BTreeMap;
use std::collections::BTreeSet;

/// How to solve.
#[derive(Debug, Clone, PartialEq)]
pub struct Solve {
    /// Closed forms or maximum likelihood.
    pub method: Method,
    /// What is free for all moved joints.
    pub free: BTreeSet<Free>,
    /// Exceptions by joint.
    pub joints: BTreeMap<JointId, JointException>,
    /// Prior standard deviations.
    pub prior: Prior,
    /// Noise levels.
    pub noise: Noise,
    /// Where the torques of compliance come from.
    pub load: Load,
    /// Detect and remove outliers and swapped markers.
    pub robust: bool,
    /// Limits of the verdict.
    pub limits: Limits,
}

/// What one joint does differently.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointException {
    /// What is free, instead of the general list.
    pub free: Option<BTreeSet<JointFree>>,
    /// Prior of its position numbers, m.
    pub sigma_m: Option<f64>,
    /// Prior of its angle numbers, rad.
    pub sigma_rad: Option<f64>,
    /// Limit of its position numbers about the description, m.
    pub within_m: Option<f64>,
    /// Limit of its angle numbers about the description, rad.
    pub within_rad: Option<f64>,
    /// Joints whose motion it follows by an unknown share.
    pub coupled_to: Vec<JointId>,
}

/// How much of a joint origin is free.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OriginFreeSet {
    /// Held at the URDF's value.
    Held,
    /// The axis line: two tilts, two shifts.
    Axis,
    /// All six numbers.
    Full,
}

/// What is free of one joint, with its priors.
#[derive(Debug, Clone, PartialEq)]
pub struct JointFreeSet {
    /// Its origin.
    pub origin: OriginFreeSet,
    /// Zero offset.
    pub offset: bool,
    /// Gain.
    pub gain: bool,
    /// First-harmonic eccentricity.
    pub eccentricity: bool,
    /// Compliance about the axis.
    pub compliance: bool,
    /// Compliance across the axis.
    pub lateral_compliance: bool,
    /// Play by the direction of approach.
    pub backlash: bool,
    /// Joints whose motion it follows.
    pub coupled_to: Vec<JointId>,
    /// Prior of position numbers, m.
    pub position_sigma: f64,
    /// Prior of orientation numbers, rad.
    pub angle_sigma: f64,
    /// Prior of the zero offset, rad (or m for a prismatic joint).
    pub offset_sigma: f64,
    /// Prior of half the play, rad (or m for a prismatic joint).
    pub backlash_sigma: f64,
    /// Limit of the position numbers, m.
    pub position_within: Option<f64>,
    /// Limit of the angle numbers, rad.
    pub angle_within: Option<f64>,
}

impl JointFreeSet {
    /// The same joint with nothing free.
    #[must_use]
    pub fn held(self) -> Self {
        Self {
            origin: OriginFreeSet::Held,
            offset: false,
            gain: false,
            eccentricity: false,
            compliance: false,
            lateral_compliance: false,
            backlash: false,
            coupled_to: Vec::new(),
            ..self
        }
    }
}

impl Solve {
    /// What is free of `joint`; `moved` tells whether the fitted recordings move it, `slides` whether it is prismatic.
    #[must_use]
    pub fn free_set(&self, joint: JointId, moved: bool, slides: bool) -> JointFreeSet {
        let exception = self.joints.get(&joint).cloned().unwrap_or_default();
        let general = |free: Free| moved && self.free.contains(&free);
        let has = |own: JointFree, all: Free| match &exception.free {
            Some(list) => list.contains(&own),
            None => general(all),
        };
        let origin = if has(JointFree::Origin, Free::JointOrigins) {
            OriginFreeSet::Full
        } else if has(JointFree::Axis, Free::JointAxes) {
            OriginFreeSet::Axis
        } else {
            OriginFreeSet::Held
        };
        let offset_prior = if slides {
            self.prior.offset_m
        } else {
            self.prior.offset_rad
        };
        JointFreeSet {
            origin,
            offset: has(JointFree::Offset, Free::JointOffsets),
            gain: has(JointFree::Gain, Free::JointGains),
            eccentricity: has(JointFree::Eccentricity, Free::Eccentricity),
            compliance: has(JointFree::Compliance, Free::Compliance),
            lateral_compliance: has(JointFree::LateralCompliance, Free::LateralCompliance),
            backlash: has(JointFree::Backlash, Free::Backlash),
            coupled_to: exception.coupled_to,
            position_sigma: exception.sigma_m.unwrap_or(self.prior.position),
            angle_sigma: exception.sigma_rad.unwrap_or(self.prior.angle),
            offset_sigma: if slides {
                exception.sigma_m
            } else {
                exception.sigma_rad
            }
            .unwrap_or(offset_prior),
            backlash_sigma: if slides {
                self.prior.backlash_m
            } else {
                self.prior.backlash_rad
            },
            position_within: exception.within_m,
            angle_within: exception.within_rad,
        }
    }
}

/// Prior standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Position numbers of joint origins, m.
    pub position: f64,
    /// Orientation numbers of joint origins, rad.
    pub angle: f64,
    /// Zero offsets of revolute joints, rad.
    pub offset_rad: f64,
    /// Zero offsets of prismatic joints, m.
    pub offset_m: f64,
    /// Gains and couplings, 1.
    pub gain: f64,
    /// Eccentricity, rad.
    pub eccentricity: f64,
    /// Compliance, rad per N m.
    pub compliance: f64,
    /// Half the play of a revolute joint, rad.
    pub backlash_rad: f64,
    /// Half the play of a prismatic joint, m.
    pub backlash_m: f64,
}

/// Noise levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Joint angle from pose to pose, rad.
    pub joint: Option<f64>,
    /// Take stated levels as true.
    pub known: bool,
}

/// Limits of the verdict.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Limits {
    /// rms position error on held-out poses, m.
    pub held_out_rms: Option<f64>,
    /// Largest position error on held-out poses, m.
    pub held_out_max: Option<f64>,
    /// Mean translation error by loop, m.
    pub loop_mean: BTreeMap<String, f64>,
    /// Standard deviation of an origin's observable position, m.
    pub origin_sigma: Option<f64>,
}
