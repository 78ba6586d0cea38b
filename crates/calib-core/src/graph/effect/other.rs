//! Any other effect, by a regressor that the caller supplies.

use super::{Confounded, Drives, Effect, EffectKind, Quantity, Source, Term, always};

/// F = whatever the caller supplies.
pub static EFFECT: Effect = Effect {
    id: "other",
    physics: "an effect that the caller named",
    ladder: None,
    profile: None,
    prior: None,
    geometric: false,
    revolute_only: false,
    estimable: always,
    testable: None,
    confounded: Confounded::Nothing,
    terms: &[Term {
        kind: EffectKind::Other,
        name: "effect",
        class: "other",
        formula: "effect*regressor",
        quantity: Quantity::Ratio,
        drives: Drives::About,
        source: Source::Caller,
        regressor: |s| s.given,
    }],
};
