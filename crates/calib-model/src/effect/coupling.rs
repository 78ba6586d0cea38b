//! Coupling: the joint also moves by a share of another joint's motion (belt, parallelogram).

use super::{
    Confounded, Drives, Effect, EffectKind, Prior, Quantity, Regressor, Source, Term, gain,
};

/// F = the other joint's reading. Freed by `solve.joints.<joint>.coupled_to`.
pub static EFFECT: Effect = Effect {
    id: "coupling",
    physics: "coupling with another joint",
    prior: Some(Prior {
        revolute: &gain::PRIOR,
        prismatic: &gain::PRIOR,
        // A belt or parallelogram passes on the whole motion: a share of 1 is an ordinary value.
        least: 1.0,
    }),
    testable: None,
    confounded: Confounded::Scale,
    terms: &[Term {
        kind: EffectKind::Coupling,
        name: "coupling",
        class: "coupling",
        formula: "sum(coupling*q_other)",
        quantity: Quantity::Ratio,
        drives: Drives::About,
        source: Source::OtherJoint,
        regressor: Regressor::Formula(|s| s.other),
    }],
    ..Effect::PLAIN
};
