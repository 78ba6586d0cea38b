//! Compliance: the joint yields under the load about its axis.
//!
//! ```text
//! φ = q + c τ,   c = 1/K ≥ 0,   τ: what the load exerts = − what the joint holds            (1)
//! ```

use super::{
    Drives, Effect, EffectKind, Prior, PriorKey, ProfileKeys, Quantity, Regressor, Source, Term,
    loaded,
};

/// Prior of compliances, shared by those across the axis.
pub(super) static PRIOR: PriorKey =
    PriorKey::deg("compliance_deg_per_nm", "Compliance, deg per N m.", 0.05);

/// F = torque that the load exerts about (force that it exerts along) the axis: c > 0 gives way.
pub static EFFECT: Effect = Effect {
    id: "compliance",
    physics: "compliance under gravity",
    ladder: Some((3, "compliance")),
    profile: Some(ProfileKeys {
        all: "compliance",
        all_text: "Rotation of the moved joints per gravity torque about their axis.",
        own: "compliance",
        own_text: "Compliance about the axis.",
    }),
    prior: Some(Prior::of(&PRIOR)),
    nonnegative: true,
    estimable: loaded,
    testable: Some(loaded),
    terms: &[Term {
        kind: EffectKind::TorqueCompliance,
        name: "compliance",
        class: "torque_compliance",
        formula: "compliance*torque",
        quantity: Quantity::Compliance,
        drives: Drives::About,
        source: Source::Load,
        regressor: Regressor::Formula(|s| s.torque),
    }],
    ..Effect::PLAIN
};
