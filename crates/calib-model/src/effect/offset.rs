//! Zero offset: the encoder's zero is not where the URDF draws it.

use super::{
    Confounded, Drives, Effect, EffectKind, Prior, PriorKey, ProfileKeys, Quantity, Regressor,
    Source, Term,
};

/// F = 1.
pub static EFFECT: Effect = Effect {
    id: "offset",
    physics: "zero offset of the encoder",
    ladder: Some((1, "joint offsets")),
    profile: Some(ProfileKeys {
        all: "joint_offsets",
        all_text: "Zero offsets of the moved joints.",
        own: "offset",
        own_text: "Zero offset.",
    }),
    prior: Some(Prior {
        revolute: &PriorKey::deg("offset_deg", "Zero offsets of joints, deg.", 1.0),
        prismatic: &PriorKey::mm("offset_mm", "Zero offsets of prismatic joints, mm.", 10.0),
        least: 0.0,
    }),
    geometric: true,
    testable: None,
    confounded: Confounded::AxisMotion,
    terms: &[Term {
        kind: EffectKind::ZeroOffset,
        name: "offset",
        class: "zero_offset",
        formula: "offset",
        quantity: Quantity::Position,
        drives: Drives::About,
        source: Source::Constant,
        regressor: Regressor::Formula(|_| 1.0),
    }],
    ..Effect::PLAIN
};
