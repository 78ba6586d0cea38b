//! Eccentricity: a gear or encoder disk that does not run true, first harmonic.

use super::{Effect, EffectKind, Prior, PriorKey, ProfileKeys, Quantity, Term};

static PRIOR: PriorKey = PriorKey::deg("eccentricity_deg", "Eccentricity, deg.", 0.5);

/// F = cos q − 1 and F = sin q: both vanish at q = 0, where the zero offset is defined.
pub static EFFECT: Effect = Effect {
    id: "eccentricity",
    physics: "gear eccentricity",
    ladder: Some((6, "eccentricity")),
    profile: Some(ProfileKeys {
        all: "eccentricity",
        all_text: "First-harmonic eccentricity of the moved joints' gears or encoders.",
        own: "eccentricity",
        own_text: "First-harmonic eccentricity.",
    }),
    prior: Some(Prior::of(&PRIOR)),
    revolute_only: true,
    terms: &[
        Term::of_reading(
            EffectKind::EccentricityCos,
            "eccentricity_cos",
            "eccentricity_cos*(cos q - 1)",
            Quantity::Position,
            |s| s.q.cos() - 1.0,
        ),
        Term::of_reading(
            EffectKind::EccentricitySin,
            "eccentricity_sin",
            "eccentricity_sin*sin q",
            Quantity::Position,
            |s| s.q.sin(),
        ),
    ],
    ..Effect::PLAIN
};
