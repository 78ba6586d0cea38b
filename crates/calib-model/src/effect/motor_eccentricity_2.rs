//! Second harmonic of the gear train at the motor: twice per motor turn, as the wave generator of a strain-wave drive errs.

use super::{Effect, EffectKind, Prior, PriorKey, ProfileKeys, Term};

static PRIOR: PriorKey = PriorKey::deg(
    "motor_eccentricity_2_deg",
    "Second harmonic of eccentricity at the motor: twice per motor turn, deg.",
    0.05,
);

/// F = cos 2 n q − 1 and F = sin 2 n q: both vanish at q = 0, where the zero offset is defined; n is the gear ratio.
pub static EFFECT: Effect = Effect {
    id: "motor_eccentricity_2",
    physics: "second harmonic of eccentricity at the motor",
    ladder: Some((10, "motor_eccentricity_2")),
    profile: Some(ProfileKeys {
        all: "motor_eccentricity_2",
        all_text: "Second harmonic of eccentricity at the motor (twice per motor turn) of the joints whose `robot.gear_ratio` is stated.",
        own: "motor_eccentricity_2",
        own_text: "Second harmonic of eccentricity at the motor, twice per motor turn; needs `robot.gear_ratio`.",
    }),
    prior: Some(Prior::of(&PRIOR)),
    terms: &[
        Term::of_motor(
            EffectKind::Motor2Cos,
            "motor_eccentricity_2_cos",
            "motor_eccentricity_2_cos*(cos 2 n q - 1)",
            |s| (2.0 * s.motor).cos() - 1.0,
        ),
        Term::of_motor(
            EffectKind::Motor2Sin,
            "motor_eccentricity_2_sin",
            "motor_eccentricity_2_sin*sin 2 n q",
            |s| (2.0 * s.motor).sin(),
        ),
    ],
    ..Effect::GEARED
};
