//! Compliance: the joint yields under the load about its axis.

use super::{
    Confounded, DEG, Drives, Effect, EffectKind, Prior, PriorKey, ProfileKeys, Quantity, Source,
    Term, loaded,
};

/// Prior of compliances, shared by those across the axis.
pub(super) static PRIOR: PriorKey = PriorKey {
    key: "compliance_deg_per_nm",
    text: "Compliance, deg per N m.",
    default: 0.05,
    si: DEG,
};

/// F = torque about (force along) the axis.
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
    prior: Some(Prior {
        revolute: &PRIOR,
        prismatic: &PRIOR,
        least: 0.0,
    }),
    geometric: false,
    revolute_only: false,
    estimable: loaded,
    testable: Some(loaded),
    confounded: Confounded::Nothing,
    terms: &[Term {
        kind: EffectKind::TorqueCompliance,
        name: "compliance",
        class: "torque_compliance",
        formula: "compliance*torque",
        quantity: Quantity::Compliance,
        drives: Drives::About,
        source: Source::Load,
        regressor: |s| s.torque,
    }],
};
