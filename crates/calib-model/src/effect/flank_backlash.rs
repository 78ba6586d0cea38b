//! Backlash by the flank that the load presses: a loaded gear rests on one flank wherever the joint came from. Where the load
//! does not overcome the joint's friction, the direction of approach decides, as in [`backlash`](super::backlash).
//!
//! ```text
//! φ = q + b f,   b ≥ 0,   f = sgn τ where |τ| > friction, else −a                            (1)
//! ```

use super::{
    Drives, Effect, EffectKind, JointState, Prior, PriorKey, ProfileKeys, Quantity, Regressor,
    Source, Term,
};

/// f of equation (1).
#[inline]
pub(crate) fn flank(s: &JointState) -> f64 {
    if s.torque.abs() > s.friction.max(NOTHING) {
        s.torque.signum()
    } else {
        -s.approach
    }
}

/// A smaller load, N m or N, is rounding.
const NOTHING: f64 = 1e-9;

/// On both flanks: otherwise backlash and zero offset are one number.
fn on_both_flanks(states: &[JointState]) -> bool {
    let on = |side: f64| states.iter().any(|s| flank(s) == side);
    on(1.0) && on(-1.0)
}

/// F = f of equation (1). It resembles compliance where the load has two values only.
pub static EFFECT: Effect = Effect {
    id: "flank_backlash",
    physics: "backlash by the loaded flank",
    profile: Some(ProfileKeys {
        all: "flank_backlash",
        all_text: "Backlash of the moved joints: half of it to the side that the load presses, or by the direction of approach where the load is below `robot.friction_nm`.",
        own: "flank_backlash",
        own_text: "Backlash, by the sign of the load.",
    }),
    prior: Some(Prior {
        revolute: &PriorKey::deg(
            "flank_backlash_deg",
            "Half of a joint's backlash by the loaded flank, deg.",
            0.2,
        ),
        prismatic: &PriorKey::mm(
            "flank_backlash_mm",
            "Half of a prismatic joint's backlash by the loaded flank, mm.",
            0.5,
        ),
        least: 0.0,
    }),
    nonnegative: true,
    estimable: on_both_flanks,
    testable: None,
    terms: &[Term {
        kind: EffectKind::FlankBacklash,
        name: "flank_backlash",
        class: "flank_backlash",
        formula: "flank_backlash*(sgn torque where |torque| > friction, else -approach)",
        quantity: Quantity::Position,
        drives: Drives::About,
        source: Source::Friction,
        regressor: Regressor::Formula(flank),
    }],
    ..Effect::PLAIN
};
