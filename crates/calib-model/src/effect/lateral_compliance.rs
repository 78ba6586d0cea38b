//! Lateral compliance: the joint's bearing yields under the torques across its axis.

use super::{
    Drives, Effect, EffectKind, Prior, ProfileKeys, Quantity, Regressor, Source, Term, compliance,
    loaded_across,
};

/// F = torque that the load exerts about each of the two axes across: c > 0 gives way.
pub static EFFECT: Effect = Effect {
    id: "lateral_compliance",
    physics: "lateral compliance",
    ladder: Some((4, "lateral compliance")),
    profile: Some(ProfileKeys {
        all: "lateral_compliance",
        all_text: "Tilt of the moved joints' axes per gravity torque across them.",
        own: "lateral_compliance",
        own_text: "Compliance across the axis.",
    }),
    prior: Some(Prior::of(&compliance::PRIOR)),
    nonnegative: true,
    estimable: loaded_across,
    testable: None,
    terms: &[
        Term {
            kind: EffectKind::Lateral1,
            name: "lateral_1",
            class: "lateral_compliance",
            formula: "lateral_1*torque_across_1",
            quantity: Quantity::LateralCompliance,
            drives: Drives::Across(0),
            source: Source::Load,
            regressor: Regressor::Formula(|s| s.across[0]),
        },
        Term {
            kind: EffectKind::Lateral2,
            name: "lateral_2",
            class: "lateral_compliance",
            formula: "lateral_2*torque_across_2",
            quantity: Quantity::LateralCompliance,
            drives: Drives::Across(1),
            source: Source::Load,
            regressor: Regressor::Formula(|s| s.across[1]),
        },
    ],
    ..Effect::PLAIN
};
