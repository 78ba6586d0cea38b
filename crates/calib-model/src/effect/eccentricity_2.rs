//! Second harmonic of eccentricity: two faults per turn, as of an oval gear or a strain-wave drive.

use super::{Effect, EffectKind, Prior, PriorKey, ProfileKeys, Quantity, Term};

/// A strain-wave drive errs by some 0.02° twice per turn; an oval ring of a large bearing by a few times that.
static PRIOR: PriorKey = PriorKey::deg(
    "eccentricity_2_deg",
    "Second harmonic of eccentricity, deg.",
    0.1,
);

/// F = cos 2q − 1 and F = sin 2q: both vanish at q = 0, where the zero offset is defined.
pub static EFFECT: Effect = Effect {
    id: "eccentricity_2",
    physics: "second harmonic of gear eccentricity",
    ladder: Some((8, "eccentricity_2")),
    profile: Some(ProfileKeys {
        all: "eccentricity_2",
        all_text: "Second-harmonic eccentricity of the moved joints' gears or encoders.",
        own: "eccentricity_2",
        own_text: "Second-harmonic eccentricity.",
    }),
    prior: Some(Prior::of(&PRIOR)),
    revolute_only: true,
    terms: &[
        Term::of_reading(
            EffectKind::Eccentricity2Cos,
            "eccentricity_2_cos",
            "eccentricity_2_cos*(cos 2q - 1)",
            Quantity::Position,
            |s| (2.0 * s.q).cos() - 1.0,
        ),
        Term::of_reading(
            EffectKind::Eccentricity2Sin,
            "eccentricity_2_sin",
            "eccentricity_2_sin*sin 2q",
            Quantity::Position,
            |s| (2.0 * s.q).sin(),
        ),
    ],
    ..Effect::PLAIN
};
