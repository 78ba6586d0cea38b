//! Friction that grows with the load: the gear winds up against it, to the side that the joint came from.
//!
//! ```text
//! φ = q − f a |τ|,   f ≥ 0,   a: direction of approach, +1 from below                       (1)
//! ```
//!
//! f is the friction per load (its coefficient) over the stiffness. With one load in all samples it is backlash.

use super::{
    Drives, Effect, EffectKind, JointState, Prior, PriorKey, ProfileKeys, Quantity, Regressor,
    Source, Term, loaded,
};

/// Approached from both sides under load: otherwise it is compliance.
fn from_both_sides(states: &[JointState]) -> bool {
    let from = |side: f64| {
        let states = states.iter().filter(|s| s.approach == side);
        loaded(&states.copied().collect::<Vec<_>>())
    };
    from(1.0) && from(-1.0)
}

/// F = −a|τ|: against the direction of approach, in proportion to the load.
pub static EFFECT: Effect = Effect {
    id: "friction",
    physics: "friction that grows with the load (hysteresis)",
    profile: Some(ProfileKeys {
        all: "friction",
        all_text: "Wind-up of the moved joints by friction that grows with the load, to the side that each came from.",
        own: "friction",
        own_text: "Wind-up by friction that grows with the load.",
    }),
    prior: Some(Prior::of(&PriorKey::deg(
        "friction_deg_per_nm",
        "Wind-up by friction, deg per N m of load.",
        0.01,
    ))),
    nonnegative: true,
    estimable: from_both_sides,
    testable: None,
    terms: &[Term {
        kind: EffectKind::Friction,
        name: "friction",
        class: "friction",
        formula: "friction*(-approach*|torque|)",
        quantity: Quantity::Compliance,
        drives: Drives::About,
        source: Source::Friction,
        regressor: Regressor::Formula(|s| -s.approach * s.torque.abs()),
    }],
    ..Effect::PLAIN
};
