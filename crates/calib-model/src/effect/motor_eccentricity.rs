//! Eccentricity of the gear train at the motor: the joint errs once per turn of its motor, n times per turn of the joint.
//!
//! Readings at steps of whole motor turns cannot tell it from the zero offset; the observability analysis says so.

use super::{
    Drives, Effect, EffectKind, Prior, PriorKey, ProfileKeys, Quantity, Regressor, Source, Term,
    geared,
};

static PRIOR: PriorKey = PriorKey::deg(
    "motor_eccentricity_deg",
    "Eccentricity at the motor: once per motor turn, deg.",
    0.05,
);

/// F = cos n q − 1 and F = sin n q: both vanish at q = 0, where the zero offset is defined; n is the gear ratio.
pub static EFFECT: Effect = Effect {
    id: "motor_eccentricity",
    physics: "eccentricity at the motor",
    ladder: Some((9, "motor_eccentricity")),
    profile: Some(ProfileKeys {
        all: "motor_eccentricity",
        all_text: "Eccentricity at the motor (once per motor turn) of the joints whose `robot.gear_ratio` is stated.",
        own: "motor_eccentricity",
        own_text: "Eccentricity at the motor, once per motor turn; needs `robot.gear_ratio`.",
    }),
    prior: Some(Prior::of(&PRIOR)),
    revolute_only: true,
    estimable: geared,
    testable: Some(geared),
    terms: &[
        Term {
            kind: EffectKind::MotorCos,
            name: "motor_eccentricity_cos",
            class: "motor_eccentricity_cos",
            formula: "motor_eccentricity_cos*(cos n q - 1)",
            quantity: Quantity::Position,
            drives: Drives::About,
            source: Source::Motor,
            regressor: Regressor::Formula(|s| s.motor.cos() - 1.0),
        },
        Term {
            kind: EffectKind::MotorSin,
            name: "motor_eccentricity_sin",
            class: "motor_eccentricity_sin",
            formula: "motor_eccentricity_sin*sin n q",
            quantity: Quantity::Position,
            drives: Drives::About,
            source: Source::Motor,
            regressor: Regressor::Formula(|s| s.motor.sin()),
        },
    ],
    ..Effect::PLAIN
};
