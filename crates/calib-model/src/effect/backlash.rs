//! Backlash: the joint stops half of its clearance short of where its motor is, on the side that it came from.
//!
//! ```text
//! φ = q − b a,   b ≥ 0,   a: direction of approach, +1 from below                           (1)
//! ```

use super::{
    Drives, Effect, EffectKind, JointState, Prior, PriorKey, ProfileKeys, Quantity, Regressor,
    Source, Term,
};

/// Approached from both sides: otherwise backlash and zero offset are one number.
fn from_both_sides(states: &[JointState]) -> bool {
    [1.0, -1.0]
        .iter()
        .all(|side| states.iter().any(|s| s.approach == *side))
}

/// F = ∓1: against the direction of approach.
pub static EFFECT: Effect = Effect {
    id: "backlash",
    physics: "backlash (hysteresis)",
    ladder: Some((5, "backlash")),
    profile: Some(ProfileKeys {
        all: "backlash",
        all_text: "Backlash of the moved joints: half of it to either side by the direction of approach from the row before.",
        own: "backlash",
        own_text: "Backlash, by the direction of approach.",
    }),
    prior: Some(Prior {
        revolute: &PriorKey::deg("backlash_deg", "Half of a joint's backlash, deg.", 0.2),
        prismatic: &PriorKey::mm(
            "backlash_mm",
            "Half of a prismatic joint's backlash, mm.",
            0.5,
        ),
        least: 0.0,
    }),
    nonnegative: true,
    testable: Some(from_both_sides),
    terms: &[Term {
        kind: EffectKind::Backlash,
        name: "backlash",
        class: "backlash",
        formula: "backlash*(-approach)",
        quantity: Quantity::Position,
        drives: Drives::About,
        source: Source::Approach,
        regressor: Regressor::Formula(|s| -s.approach),
    }],
    ..Effect::PLAIN
};
