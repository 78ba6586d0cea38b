//! Latency: the readings of one joint are older than those of the others.

use super::{Drives, Effect, EffectKind, Quantity, Regressor, Source, Term};

/// F = joint velocity; one coefficient for the joint.
pub static EFFECT: Effect = Effect {
    id: "latency",
    physics: "readings of a joint that are late",
    terms: &[Term {
        kind: EffectKind::Latency,
        name: "latency",
        class: "latency",
        formula: "latency*velocity",
        quantity: Quantity::Time,
        drives: Drives::About,
        source: Source::Velocity,
        regressor: Regressor::Formula(|s| s.velocity),
    }],
    ..Effect::PLAIN
};
