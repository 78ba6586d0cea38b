//! Joint effects: what the motion of a real joint adds to its reading. One file and one entry of [`EFFECTS`] each.
//!
//! ```text
//! φ = q + Σ_j F_j c_j,   θ = Σ_j e_j F_j c_j,   δ = p Σ_j F_j c_j
//! joint_from_child = Trans(δ) · exp(S φ) · Exp(θ)                                           (1)
//! ```
//!
//! F_j, the regressor of a term, follows from the [`JointState`]; c_j is its coefficient. p, the joint's reach, leads from the
//! joint before it that moves (or from the root) to its origin, m, in the axes of the joint, as the nominal robot has it. Everything that depends on
//! the set of effects (formulation, simulation, prediction, score tests, profile keys, export, report) reads the
//! table. To add an effect: write its file, name its terms in [`EffectKind`] and list it in [`EFFECTS`].

use serde::{Deserialize, Serialize};

use crate::axis::Axis;
use crate::unit::Unit;

pub mod backlash;
pub mod clock_offset;
pub mod compliance;
pub mod coupling;
pub mod eccentricity;
pub mod eccentricity_2;
pub mod flank_backlash;
pub mod friction;
pub mod gain;
pub mod latency;
pub mod lateral_compliance;
pub mod motor_eccentricity;
pub mod motor_eccentricity_2;
pub mod offset;
pub mod other;
mod outside;
mod prior;
mod shared;
pub mod thermal_expansion;

pub use outside::{Outside, Regressor, Stated};
pub use prior::{Prior, PriorKey};
pub use shared::{HARMONICS, LATERAL, OF_STATE, SinCos};

/// All joint effects, in the order in which their parameters are created.
pub static EFFECTS: &[&Effect] = &[
    &offset::EFFECT,
    &gain::EFFECT,
    &eccentricity::EFFECT,
    &eccentricity_2::EFFECT,
    &motor_eccentricity::EFFECT,
    &motor_eccentricity_2::EFFECT,
    &compliance::EFFECT,
    &lateral_compliance::EFFECT,
    &backlash::EFFECT,
    &flank_backlash::EFFECT,
    &friction::EFFECT,
    &coupling::EFFECT,
    &thermal_expansion::EFFECT,
    &clock_offset::EFFECT,
    &latency::EFFECT,
    &other::EFFECT,
];

/// Identity of a [`Term`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum EffectKind {
    /// F = 1.
    ZeroOffset,
    /// F = q.
    Gain,
    /// F = cos q − 1.
    EccentricityCos,
    /// F = sin q.
    EccentricitySin,
    /// F = cos 2q − 1.
    Eccentricity2Cos,
    /// F = sin 2q.
    Eccentricity2Sin,
    /// F = cos nq − 1.
    #[serde(rename = "motor_eccentricity_cos")]
    MotorCos,
    /// F = sin nq.
    #[serde(rename = "motor_eccentricity_sin")]
    MotorSin,
    /// F = cos 2nq − 1.
    #[serde(rename = "motor_eccentricity_2_cos")]
    Motor2Cos,
    /// F = sin 2nq.
    #[serde(rename = "motor_eccentricity_2_sin")]
    Motor2Sin,
    /// F = torque about (force along) the axis, N·m (N).
    TorqueCompliance,
    /// Rotation about the first axis across, F = torque about it, N·m.
    Lateral1,
    /// Rotation about the second axis across, F = torque about it, N·m.
    Lateral2,
    /// F = ∓1: against the direction of approach.
    Backlash,
    /// F = ±1: along the load, or against the direction of approach where friction holds the load.
    FlankBacklash,
    /// F = −approach · |torque|.
    Friction,
    /// F = another joint's reading.
    Coupling,
    /// Along the joint's reach, F = temperature above that of the reference, K.
    ThermalExpansion,
    /// F = joint velocity, rad/s (m/s); the coefficient is a time.
    ClockOffset,
    /// F = joint velocity, rad/s (m/s), of one joint; the coefficient is a time.
    Latency,
    /// F = whatever the caller supplies.
    Other,
    /// F of a plugin; a file of ours names it by its plugin, never so.
    #[serde(skip)]
    Outside(&'static Outside),
}

/// All that a regressor may depend on, at one joint and one sample. What is not known is 0.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointState {
    /// Reading, rad or m.
    pub q: f64,
    /// Rate of the reading, rad/s or m/s.
    pub velocity: f64,
    /// Torque that the load (gravity) exerts about the axis, force along it, N·m (N): minus what the joint holds.
    pub torque: f64,
    /// Torques that the load exerts about the two axes across ([`Axis::across`]), N·m.
    pub across: [f64; 2],
    /// Direction of approach: +1, −1, or 0 where it is not known.
    pub approach: f64,
    /// Angle of the motor: gear ratio times reading, rad; 0 where the ratio is not known.
    pub motor: f64,
    /// Load that the joint's friction holds, N·m (N).
    pub friction: f64,
    /// Reading of the joint that this one is coupled to, rad or m.
    pub other: f64,
    /// Temperature of the link before the joint above that at which the nominal lengths hold, K.
    pub warmth: f64,
    /// Regressor that the caller supplies.
    pub given: f64,
}

/// What a regressor depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Source {
    /// Nothing: it is 1.
    Constant,
    /// The reading alone.
    Reading,
    /// The torques that the load exerts.
    Load,
    /// The direction of approach.
    Approach,
    /// The angle of the motor.
    Motor,
    /// The load and the direction of approach, not in proportion to the load.
    Friction,
    /// Another joint's reading.
    OtherJoint,
    /// The temperature.
    Temperature,
    /// The joint's velocity.
    Velocity,
    /// The caller.
    Caller,
}

/// What a term adds to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drives {
    /// φ of equation (1): the motion about (along) the axis.
    About,
    /// θ of equation (1): the rotation about this axis across ([`Axis::across`]).
    Across(usize),
    /// δ of equation (1): the length that leads to the joint.
    Along,
}

/// What a coefficient measures; its unit follows with the joint's kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quantity {
    /// Same as the reading: rad or m.
    Position,
    /// A ratio.
    Ratio,
    /// Motion along the axis per load along it: rad/(N·m) or m/N.
    Compliance,
    /// Rotation across the axis per torque across it: rad/(N·m).
    LateralCompliance,
    /// A time, s.
    Time,
    /// Growth of a length per temperature, 1/K.
    Expansion,
}

impl Quantity {
    /// Unit of the coefficient at a joint.
    #[must_use]
    pub fn unit(self, prismatic: bool) -> Unit {
        match (self, prismatic) {
            (Self::Position, false) => Unit::Radian,
            (Self::Position, true) => Unit::Meter,
            (Self::Ratio, _) => Unit::One,
            (Self::Compliance, true) => Unit::MeterPerNewton,
            (Self::Compliance, false) | (Self::LateralCompliance, _) => Unit::RadianPerNewtonMeter,
            (Self::Time, _) => Unit::Second,
            (Self::Expansion, _) => Unit::PerKelvin,
        }
    }
}

/// One regressor with one coefficient.
#[derive(Debug)]
#[non_exhaustive]
pub struct Term {
    /// Identity.
    pub kind: EffectKind,
    /// Ending of the parameter's name and stem of the export key.
    pub name: &'static str,
    /// `kind` of the parameter in a report.
    pub class: &'static str,
    /// The summand in the header of an exported calibration.
    pub formula: &'static str,
    /// What the coefficient measures.
    pub quantity: Quantity,
    /// What the term adds to.
    pub drives: Drives,
    /// What the regressor depends on.
    pub source: Source,
    /// F of equation (1).
    pub regressor: Regressor,
}

/// Where a profile frees an effect.
#[derive(Debug)]
pub struct ProfileKeys {
    /// Key under `solve.free`, for all moved joints.
    pub all: &'static str,
    /// What it frees there.
    pub all_text: &'static str,
    /// Key under `solve.joints.<joint>.free`.
    pub own: &'static str,
    /// What it frees there.
    pub own_text: &'static str,
}

/// Which other parameters an effect can be confounded with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Confounded {
    /// None by construction.
    Nothing,
    /// The rotation (translation) of a neighboring frame about (along) the joint axis.
    AxisMotion,
    /// The scale of all lengths.
    Scale,
}

/// One physical effect at a joint: all that the program knows of it.
#[derive(Debug)]
#[non_exhaustive]
pub struct Effect {
    /// Stable identity.
    pub id: &'static str,
    /// The physics, in words.
    pub physics: &'static str,
    /// Name in a ladder of models (`+ <label>`), and its place there.
    pub ladder: Option<(u8, &'static str)>,
    /// Where a profile frees it; `None`: by other means.
    pub profile: Option<ProfileKeys>,
    /// Its prior; `None`: whoever frees it decides.
    pub prior: Option<Prior>,
    /// A geometric number: the `sigma_*` and `within_*` of a joint apply, and a URDF can hold it.
    pub geometric: bool,
    /// Defined for an angle only.
    pub revolute_only: bool,
    /// Physics allows no coefficient below 0.
    pub nonnegative: bool,
    /// Whether the states of the samples let the effect be estimated.
    pub estimable: fn(&[JointState]) -> bool,
    /// Whether a score test is worth making where it is not estimated; `None`: never.
    pub testable: Option<fn(&[JointState]) -> bool>,
    /// What it is confounded with.
    pub confounded: Confounded,
    /// Its terms.
    pub terms: &'static [Term],
}

impl Term {
    /// A term of the reading alone, which adds to the motion about (along) the axis; its class is its name.
    pub(crate) const fn of_reading(
        kind: EffectKind,
        name: &'static str,
        formula: &'static str,
        quantity: Quantity,
        regressor: fn(&JointState) -> f64,
    ) -> Self {
        Self {
            kind,
            name,
            class: name,
            formula,
            quantity,
            drives: Drives::About,
            source: Source::Reading,
            regressor: Regressor::Formula(regressor),
        }
    }

    /// An angle by the angle of the motor, which adds to the motion about the axis; its class is its name.
    pub(crate) const fn of_motor(
        kind: EffectKind,
        name: &'static str,
        formula: &'static str,
        regressor: fn(&JointState) -> f64,
    ) -> Self {
        Self {
            source: Source::Motor,
            ..Self::of_reading(kind, name, formula, Quantity::Position, regressor)
        }
    }
}

impl Effect {
    /// What an entry leaves unsaid: any joint, no profile key, always estimable and testable, confounded with nothing.
    pub(crate) const PLAIN: Self = Self {
        id: "",
        physics: "",
        ladder: None,
        profile: None,
        prior: None,
        geometric: false,
        revolute_only: false,
        nonnegative: false,
        estimable: always,
        testable: Some(always),
        confounded: Confounded::Nothing,
        terms: &[],
    };

    /// The same of what errs with the motor's angle: of a joint that turns and whose gear ratio is known.
    pub(crate) const GEARED: Self = Self {
        revolute_only: true,
        estimable: geared,
        testable: Some(geared),
        ..Self::PLAIN
    };
}

/// At any samples.
pub(crate) fn always(_: &[JointState]) -> bool {
    true
}

/// A smaller load, N m or N, is rounding: a joint with a vertical axis has none.
const NO_LOAD: f64 = 1e-9;

/// Where something loads the joint about its axis in some sample.
pub(crate) fn loaded(states: &[JointState]) -> bool {
    states.iter().any(|s| s.torque.abs() > NO_LOAD)
}

/// Where the gear ratio is known and the joint turns its motor.
pub(crate) fn geared(states: &[JointState]) -> bool {
    states.iter().any(|s| s.motor != 0.0)
}

/// Where something loads the joint across its axis in some sample.
pub(crate) fn loaded_across(states: &[JointState]) -> bool {
    let loaded = |s: &JointState| s.across.iter().any(|t| t.abs() > NO_LOAD);
    states.iter().any(loaded)
}

impl PartialEq for Effect {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

impl Eq for Effect {}

impl PartialOrd for Effect {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Effect {
    /// By place in the table; what is not in it by its name.
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let place = |of: &Self| EFFECTS.iter().position(|e| e.id == of.id);
        (place(self), self.id).cmp(&(place(other), other.id))
    }
}

impl Effect {
    /// Whether a joint with this axis can have it.
    #[must_use]
    pub fn applies_to(&self, axis: &Axis) -> bool {
        !self.revolute_only || matches!(axis, Axis::Revolute(_))
    }
}

impl EffectKind {
    /// Every term of the table.
    pub fn all() -> impl Iterator<Item = Self> {
        EFFECTS.iter().flat_map(|e| e.terms).map(|t| t.kind)
    }

    /// The effect and its term.
    fn entry(self) -> (&'static Effect, &'static Term) {
        if let Self::Outside(outside) = self {
            let effect = outside.effect();
            return (effect, &effect.terms[0]);
        }
        EFFECTS
            .iter()
            .find_map(|e| Some((*e, e.terms.iter().find(|t| t.kind == self)?)))
            .unwrap_or((&other::EFFECT, &other::EFFECT.terms[0]))
    }

    /// The physical effect that the term belongs to.
    #[must_use]
    pub fn effect(self) -> &'static Effect {
        self.entry().0
    }

    /// Regressor, unit and names.
    #[must_use]
    pub fn term(self) -> &'static Term {
        self.entry().1
    }

    /// Ending of the parameter's name.
    #[must_use]
    pub fn label(self) -> &'static str {
        self.term().name
    }

    /// The physics, in words, for the goodness-of-fit finding.
    #[must_use]
    pub fn physics(self) -> &'static str {
        self.effect().physics
    }

    /// What the term adds to.
    #[must_use]
    pub fn drives(self) -> Drives {
        self.term().drives
    }

    /// F of equation (1) at every state; `None` where it is 1 everywhere.
    #[must_use]
    pub fn regressors(self, states: &[JointState]) -> Option<Vec<f64>> {
        let term = self.term();
        (term.source != Source::Constant)
            .then(|| states.iter().map(|s| term.regressor.at(s)).collect())
    }

    /// F of equation (1) from the reading alone; `None` where it needs more.
    #[must_use]
    pub fn of_reading(self, q: f64) -> Option<f64> {
        let term = self.term();
        let state = JointState {
            q,
            ..JointState::default()
        };
        matches!(term.source, Source::Constant | Source::Reading).then(|| term.regressor.at(&state))
    }
}

#[cfg(test)]
mod tests;
