//! What is estimated, with priors, noise levels and limits of the verdict.

use super::{Free, JointFree, Load, Method, ParameterValue, StartFrom};
use crate::raw::{ANGLE, POSITION};
use calib_core::EFFECTS;
use calib_core::NoiseModel;
use calib_core::effect::{Effect, PriorKey};
use calib_urdf::JointId;
use std::collections::BTreeMap;
use std::collections::BTreeSet;

/// How to solve.
#[derive(Debug, Clone, PartialEq)]
pub struct Solve {
    /// Closed forms or maximum likelihood.
    pub method: Method,
    /// Where maximum likelihood starts.
    pub start_from: StartFrom,
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
    /// Limit of its position numbers about the nominal URDF, m.
    pub within_m: Option<f64>,
    /// Limit of its angle numbers about the nominal URDF, rad.
    pub within_rad: Option<f64>,
    /// Joints whose motion it follows by an unknown share.
    pub coupled_to: Vec<JointId>,
    /// Effects of plugins that it has, by name, with their parameters.
    pub effects: BTreeMap<String, BTreeMap<String, ParameterValue>>,
    /// The same ready to be estimated: empty until the plugins are loaded.
    pub outside: Vec<FreeEffect>,
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
    /// Effects, in the order of the table, then those of plugins.
    pub effects: Vec<FreeEffect>,
    /// Joints whose motion it follows.
    pub coupled_to: Vec<JointId>,
    /// Prior of position numbers, m.
    pub position_sigma: f64,
    /// Prior of orientation numbers, rad.
    pub angle_sigma: f64,
    /// Where the prior of the position numbers is from; `None`: stated for this joint.
    pub position_width: Option<SharedWidth>,
    /// Where the prior of the orientation numbers is from; `None`: stated for this joint.
    pub angle_width: Option<SharedWidth>,
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
            effects: Vec::new(),
            coupled_to: Vec::new(),
            ..self
        }
    }
}

impl Solve {
    /// What is to be stated under `free` of a joint, so that an effect is free beside what is free of it now.
    #[must_use]
    pub fn free_with(
        &self,
        joint: JointId,
        slides: bool,
        effect: &'static Effect,
    ) -> BTreeSet<JointFree> {
        let now = self.free_set(joint, true, slides);
        let origin = match now.origin {
            OriginFreeSet::Held => None,
            OriginFreeSet::Axis => Some(JointFree::Axis),
            OriginFreeSet::Full => Some(JointFree::Origin),
        };
        // What plugins have is stated elsewhere.
        let effects = now
            .effects
            .iter()
            .filter(|free| free.effect.profile.is_some());
        let effects = effects.map(|free| JointFree::Effect(free.effect));
        let all = origin.into_iter().chain(effects);
        all.chain([JointFree::Effect(effect)]).collect()
    }

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
        let (own_sigma, own_within) = if slides {
            (exception.sigma_m, exception.within_m)
        } else {
            (exception.sigma_rad, exception.within_rad)
        };
        let effects = EFFECTS.iter().copied();
        let effects = effects.filter(|effect| {
            let possible = !(slides && effect.revolute_only);
            possible && has(JointFree::Effect(effect), Free::Effect(effect))
        });
        let effects = effects.map(|effect| {
            let own_sigma = own_sigma.filter(|_| effect.geometric);
            let prior = effect.prior.as_ref().filter(|_| own_sigma.is_none());
            FreeEffect {
                effect,
                sigma: own_sigma.or_else(|| self.prior.of(effect, slides)),
                width: prior.map(|prior| self.prior.shared(prior.key(slides))),
                within: own_within.filter(|_| effect.geometric),
            }
        });
        let outside = exception.outside.into_iter();
        let width = |own: Option<f64>, key: &'static PriorKey| {
            own.is_none().then(|| self.prior.shared(key))
        };
        JointFreeSet {
            origin,
            effects: effects.chain(outside).collect(),
            coupled_to: exception.coupled_to,
            position_sigma: exception.sigma_m.unwrap_or(self.prior.position),
            angle_sigma: exception.sigma_rad.unwrap_or(self.prior.angle),
            position_width: width(exception.sigma_m, &POSITION),
            angle_width: width(exception.sigma_rad, &ANGLE),
            position_within: exception.within_m,
            angle_within: exception.within_rad,
        }
    }
}

/// A prior width that several joints share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharedWidth {
    /// Its key under `solve.prior`.
    pub key: &'static PriorKey,
    /// Whether the profile states it; else it is the default.
    pub stated: bool,
}

/// A joint effect that is estimated.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeEffect {
    /// The effect.
    pub effect: &'static Effect,
    /// Prior σ of its coefficients, SI.
    pub sigma: Option<f64>,
    /// Where that is from; `None`: stated for this joint, or there is none.
    pub width: Option<SharedWidth>,
    /// Limit of its coefficients about 0, SI.
    pub within: Option<f64>,
}

/// Prior standard deviations, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// Position numbers of joint origins, m.
    pub position: f64,
    /// Orientation numbers of joint origins, rad.
    pub angle: f64,
    /// Masses, as a share.
    pub mass: f64,
    /// Centers of mass, m.
    pub mass_center: f64,
    /// By key of `solve.prior`.
    pub(crate) by_key: BTreeMap<&'static str, f64>,
    /// Keys that the profile states.
    pub(crate) stated: BTreeSet<&'static str>,
}

impl Prior {
    /// Prior σ of an effect's coefficients; `None` where the table has none.
    #[must_use]
    pub fn of(&self, effect: &Effect, prismatic: bool) -> Option<f64> {
        let prior = effect.prior.as_ref()?;
        let key = prior.key(prismatic);
        let sigma = self.by_key.get(key.key).copied();
        Some(sigma.unwrap_or(key.default * key.si).max(prior.least))
    }

    fn shared(&self, key: &'static PriorKey) -> SharedWidth {
        SharedWidth {
            key,
            stated: self.stated.contains(key.key),
        }
    }
}

/// Noise levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// What is random from pose to pose; `None`: what the recordings speak for.
    pub model: Option<NoiseModel>,
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
    /// rms orientation error on held-out poses, rad.
    pub held_out_rms_rad: Option<f64>,
    /// Largest orientation error on held-out poses, rad.
    pub held_out_max_rad: Option<f64>,
    /// Mean translation error by loop, m.
    pub loop_mean: BTreeMap<String, f64>,
    /// Standard deviation of an origin's observable position, m.
    pub origin_sigma: Option<f64>,
}
