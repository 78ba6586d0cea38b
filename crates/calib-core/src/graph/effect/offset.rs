//! Zero offset: the encoder's zero is not where the URDF draws it.

use super::{
    Confounded, DEG, Drives, Effect, EffectKind, MM, Prior, PriorKey, ProfileKeys, Quantity,
    Source, Term, always,
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
        revolute: &PriorKey {
            key: "offset_deg",
            text: "Zero offsets of joints, deg.",
            default: 1.0,
            si: DEG,
        },
        prismatic: &PriorKey {
            key: "offset_mm",
            text: "Zero offsets of prismatic joints, mm.",
            default: 10.0,
            si: MM,
        },
        least: 0.0,
    }),
    geometric: true,
    revolute_only: false,
    estimable: always,
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
        regressor: |_| 1.0,
    }],
};
