//! Eccentricity of the gear train at the motor: the joint errs once per turn of its motor, n times per turn of the joint.
//!
//! Readings at steps of whole motor turns cannot tell it from the zero offset; the observability analysis says so.

use super::{Effect, EffectKind, Prior, PriorKey, ProfileKeys, Term};

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
    terms: &[
        Term::of_motor(
            EffectKind::MotorCos,
            "motor_eccentricity_cos",
            "motor_eccentricity_cos*(cos n q - 1)",
            |s| s.motor.cos() - 1.0,
        ),
        Term::of_motor(
            EffectKind::MotorSin,
            "motor_eccentricity_sin",
            "motor_eccentricity_sin*sin n q",
            |s| s.motor.sin(),
        ),
    ],
    ..Effect::GEARED
};
