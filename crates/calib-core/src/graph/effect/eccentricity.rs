//! Eccentricity: a gear or encoder disk that does not run true, first harmonic.

use super::{
    Confounded, DEG, Drives, Effect, EffectKind, Prior, PriorKey, ProfileKeys, Quantity, Source,
    Term, always,
};

static PRIOR: PriorKey = PriorKey {
    key: "eccentricity_deg",
    text: "Eccentricity, deg.",
    default: 0.5,
    si: DEG,
};

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
    prior: Some(Prior {
        revolute: &PRIOR,
        prismatic: &PRIOR,
        least: 0.0,
    }),
    geometric: false,
    revolute_only: true,
    estimable: always,
    testable: Some(always),
    confounded: Confounded::Nothing,
    terms: &[
        Term {
            kind: EffectKind::EccentricityCos,
            name: "eccentricity_cos",
            class: "eccentricity_cos",
            formula: "eccentricity_cos*(cos q - 1)",
            quantity: Quantity::Position,
            drives: Drives::About,
            source: Source::Reading,
            regressor: |s| s.q.cos() - 1.0,
        },
        Term {
            kind: EffectKind::EccentricitySin,
            name: "eccentricity_sin",
            class: "eccentricity_sin",
            formula: "eccentricity_sin*sin q",
            quantity: Quantity::Position,
            drives: Drives::About,
            source: Source::Reading,
            regressor: |s| s.q.sin(),
        },
    ],
};
