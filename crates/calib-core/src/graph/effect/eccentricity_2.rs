//! Second harmonic of eccentricity: two faults per turn, as of an oval gear or a strain-wave drive.

use super::{
    Confounded, DEG, Drives, Effect, EffectKind, Prior, PriorKey, ProfileKeys, Quantity, Source,
    Term, always,
};

static PRIOR: PriorKey = PriorKey {
    key: "eccentricity_2_deg",
    text: "Second harmonic of eccentricity, deg.",
    // A strain-wave drive errs by some 0.02° twice per turn; an oval ring of a large bearing by a few times that.
    default: 0.1,
    si: DEG,
};

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
            kind: EffectKind::Eccentricity2Cos,
            name: "eccentricity_2_cos",
            class: "eccentricity_2_cos",
            formula: "eccentricity_2_cos*(cos 2q - 1)",
            quantity: Quantity::Position,
            drives: Drives::About,
            source: Source::Reading,
            regressor: |s| (2.0 * s.q).cos() - 1.0,
        },
        Term {
            kind: EffectKind::Eccentricity2Sin,
            name: "eccentricity_2_sin",
            class: "eccentricity_2_sin",
            formula: "eccentricity_2_sin*sin 2q",
            quantity: Quantity::Position,
            drives: Drives::About,
            source: Source::Reading,
            regressor: |s| (2.0 * s.q).sin(),
        },
    ],
};
