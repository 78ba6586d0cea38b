//! Gain: the joint moves by more or less than its encoder says, in proportion.

use super::{Confounded, Effect, EffectKind, Prior, PriorKey, ProfileKeys, Quantity, Term};

/// Prior of gains, shared by couplings.
pub(super) static PRIOR: PriorKey = PriorKey {
    key: "gain_percent",
    text: "Gains and couplings, percent.",
    default: 1.0,
    si: 0.01,
};

/// F = q.
pub static EFFECT: Effect = Effect {
    id: "gain",
    physics: "encoder gain",
    ladder: Some((7, "gains")),
    profile: Some(ProfileKeys {
        all: "joint_gains",
        all_text: "Gains of the moved joints: true angle per indicated angle.",
        own: "gain",
        own_text: "Gain.",
    }),
    prior: Some(Prior::of(&PRIOR)),
    confounded: Confounded::Scale,
    terms: &[Term::of_reading(
        EffectKind::Gain,
        "gain",
        "gain*q",
        Quantity::Ratio,
        |s| s.q,
    )],
    ..Effect::PLAIN
};
