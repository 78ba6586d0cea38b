//! What is estimated, priors, noise levels and limits.

use super::*;
use crate::profile::{JointException, Limits, Noise, Prior, Solve};
use crate::raw::{
    ANGLE, MASS, MASS_CENTER, POSITION, PRIOR_KEYS, RawFree, RawJointFree, RawJointSolve,
    RawLimits, RawMethod, RawNoiseModel, RawPrior, RawSolve,
};
use calib_core::NoiseModel;
use calib_core::effect::{Effect, PriorKey, Source};

impl Checker<'_> {
    pub(super) fn solve(&mut self, raw: &RawSolve) -> Solve {
        let mut joints = BTreeMap::new();
        for (name, exception) in &raw.joints {
            let path = ["solve", "joints", name.as_str()];
            let Some(joint) = self.joint(&path, name) else {
                continue;
            };
            let exception = self.exception(name, exception);
            joints.insert(joint, exception);
        }
        self.masses_load_something(raw);
        self.what_nobody_states_is_free(raw);
        let prior = self.prior(&raw.prior);
        if let Some(sigma) = raw.noise.joint_deg {
            self.not_negative(&["solve", "noise", "joint_deg"], sigma);
        }
        let limits = self.limits(&raw.limits);
        Solve {
            method: raw.method,
            start_from: raw.start_from,
            free: raw.free.iter().copied().collect(),
            joints,
            prior,
            noise: Noise {
                model: noise_model(raw.noise.model),
                joint: raw.noise.joint_deg.map(|s| s * DEG),
                known: raw.noise.known,
            },
            load: raw.load,
            robust: raw.robust,
            limits,
        }
    }

    /// The pose of the tracker, and a mount that is not stated, come from the nominal robot where they are not estimated: held there, its
    /// errors would count as those of what is estimated, with a small σ.
    fn what_nobody_states_is_free(&mut self, raw: &RawSolve) {
        if raw.method != RawMethod::Ml || raw.free.is_empty() || self.raw.bodies.is_empty() {
            return;
        }
        let free = |what| raw.free.contains(&what);
        if !free(RawFree::Tracker) {
            self.key_problem(
                &["solve", "free"],
                "`tracker` is not free: its pose would be held where the nominal robot puts it",
                "add `tracker` to `solve.free`",
            );
        }
        let mut bodies = self.raw.bodies.iter();
        let unstated = bodies.find(|(_, body)| body.mount.is_none());
        if let (Some((name, _)), false) = (unstated, free(RawFree::Bodies)) {
            self.key_problem(
                &["solve", "free"],
                format!("`bodies` is not free: the mount of `{name}` would be held where the nominal robot puts it"),
                "add `bodies` to `solve.free`, or state the body's `mount`",
            );
        }
    }

    /// Masses show by what yields to them.
    fn masses_load_something(&mut self, raw: &RawSolve) {
        if !raw.free.contains(&RawFree::Masses) || !self.raw.robot.stiffness_nm_per_rad.is_empty() {
            return;
        }
        let by_load = |effect: &Effect| effect.terms.iter().any(|t| t.source == Source::Load);
        let all = raw.free.iter();
        let all = all.filter_map(|free| match free {
            RawFree::Effect(effect) => Some(*effect),
            _ => None,
        });
        let own = raw.joints.values().flat_map(|j| &j.free).flatten();
        let own = own.filter_map(|free| match free {
            RawJointFree::Effect(effect) => Some(*effect),
            _ => None,
        });
        if !all.chain(own).any(by_load) {
            self.problem(
                &["solve", "free"],
                "`masses` is free, and no joint yields to its load",
                "free `compliance` or `lateral_compliance` too, or state `robot.stiffness_nm_per_rad`",
            );
        }
    }

    fn exception(&mut self, name: &str, raw: &RawJointSolve) -> JointException {
        let mut coupled_to = Vec::new();
        for (i, other) in raw.coupled_to.iter().enumerate() {
            let at = i.to_string();
            coupled_to.extend(self.joint(&["solve", "joints", name, "coupled_to", &at], other));
        }
        for (key, value) in [
            ("sigma_mm", raw.sigma_mm),
            ("sigma_deg", raw.sigma_deg),
            ("within_mm", raw.within_mm),
            ("within_deg", raw.within_deg),
        ] {
            if let Some(value) = value {
                self.positive(&["solve", "joints", name, key], value);
            }
        }
        JointException {
            free: raw.free.as_ref().map(|list| list.iter().copied().collect()),
            sigma_m: raw.sigma_mm.map(|s| s * MM),
            sigma_rad: raw.sigma_deg.map(|s| s * DEG),
            within_m: raw.within_mm.map(|w| w * MM),
            within_rad: raw.within_deg.map(|w| w * DEG),
            coupled_to,
            effects: raw.effects.clone(),
            outside: Vec::new(),
        }
    }

    fn prior(&mut self, raw: &RawPrior) -> Prior {
        for key in PRIOR_KEYS.iter() {
            self.positive(&["solve", "prior", key.key], raw.get(key));
        }
        let si = |key: &PriorKey| raw.get(key) * key.si;
        Prior {
            position: si(&POSITION),
            angle: si(&ANGLE),
            mass: si(&MASS),
            mass_center: si(&MASS_CENTER),
            by_key: PRIOR_KEYS.iter().map(|key| (key.key, si(key))).collect(),
            stated: PRIOR_KEYS
                .iter()
                .filter(|key| raw.states(key))
                .map(|key| key.key)
                .collect(),
        }
    }

    fn limits(&mut self, raw: &RawLimits) -> Limits {
        for loop_name in raw.loop_mean_mm.keys() {
            self.known(
                "loop",
                &["solve", "limits", "loop_mean_mm", loop_name],
                loop_name,
                self.raw.loops.keys(),
            );
        }
        for (key, limit) in [
            ("held_out_rms_mm", raw.held_out_rms_mm),
            ("held_out_max_mm", raw.held_out_max_mm),
            ("held_out_rms_deg", raw.held_out_rms_deg),
            ("held_out_max_deg", raw.held_out_max_deg),
            ("origin_sigma_mm", raw.origin_sigma_mm),
        ] {
            if let Some(limit) = limit {
                self.above_zero(&["solve", "limits", key], limit);
            }
        }
        for (loop_name, limit) in &raw.loop_mean_mm {
            self.above_zero(&["solve", "limits", "loop_mean_mm", loop_name], *limit);
        }
        Limits {
            held_out_rms: raw.held_out_rms_mm.map(|l| l * MM),
            held_out_max: raw.held_out_max_mm.map(|l| l * MM),
            held_out_rms_rad: raw.held_out_rms_deg.map(f64::to_radians),
            held_out_max_rad: raw.held_out_max_deg.map(f64::to_radians),
            loop_mean: raw
                .loop_mean_mm
                .iter()
                .map(|(name, l)| (name.clone(), l * MM))
                .collect(),
            origin_sigma: raw.origin_sigma_mm.map(|l| l * MM),
        }
    }
}

fn noise_model(raw: RawNoiseModel) -> Option<NoiseModel> {
    match raw {
        RawNoiseModel::Auto => None,
        RawNoiseModel::White => Some(NoiseModel::White),
        RawNoiseModel::Joint => Some(NoiseModel::Joint),
        RawNoiseModel::BodyPose => Some(NoiseModel::BodyPose),
        RawNoiseModel::JointAndSlide => Some(NoiseModel::JointAndSlide),
        RawNoiseModel::JointEach => Some(NoiseModel::JointEach),
    }
}
