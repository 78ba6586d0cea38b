//! Any other effect, by a regressor that the caller supplies.

use super::{Drives, Effect, EffectKind, Quantity, Regressor, Source, Term};

/// F = whatever the caller supplies.
pub static EFFECT: Effect = Effect {
    id: "other",
    physics: "an effect that the caller named",
    testable: None,
    terms: &[Term {
        kind: EffectKind::Other,
        name: "effect",
        class: "other",
        formula: "effect*regressor",
        quantity: Quantity::Ratio,
        drives: Drives::About,
        source: Source::Caller,
        regressor: Regressor::Formula(|s| s.given),
    }],
    ..Effect::PLAIN
};
