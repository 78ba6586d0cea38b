//! Clock offset: the tracker's time is not the encoders' time, so a moving joint is read early or late.

use super::{Drives, Effect, EffectKind, Quantity, Regressor, Source, Term};

/// F = joint velocity; one coefficient for all joints of a recording.
pub static EFFECT: Effect = Effect {
    id: "clock_offset",
    physics: "clock offset between tracker and encoders",
    terms: &[Term {
        kind: EffectKind::ClockOffset,
        name: "clock_offset",
        class: "clock_offset",
        formula: "clock_offset*velocity",
        quantity: Quantity::Time,
        drives: Drives::About,
        source: Source::Velocity,
        regressor: Regressor::Formula(|s| s.velocity),
    }],
    ..Effect::PLAIN
};
