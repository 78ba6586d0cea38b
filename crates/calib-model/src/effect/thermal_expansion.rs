//! Thermal expansion: the link before a joint grows with its temperature.
//!
//! ```text
//! δ = α (T − T₀) p                                                                          (1)
//! ```
//!
//! p is the joint's reach: from the joint before it that moves, or from the root, to its origin. At one temperature the growth is a
//! change of the origin; a temperature that only rises from the first row to the last resembles a drift of the tracker.

use super::{
    Drives, Effect, EffectKind, JointState, Prior, PriorKey, ProfileKeys, Quantity, Regressor,
    Source, Term,
};

/// °C at which lengths hold where nothing else is stated: ISO 1.
pub const REFERENCE_TEMPERATURE_C: f64 = 20.0;

/// K: at less, a meter of aluminium grows by a hundredth of a millimeter, which no tracker tells from its noise.
const SPREAD: f64 = 0.5;

/// At more than one temperature.
fn at_several_temperatures(states: &[JointState]) -> bool {
    let (low, high) = states
        .iter()
        .map(|s| s.warmth)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), w| {
            (low.min(w), high.max(w))
        });
    high - low > SPREAD
}

/// F = T − T₀.
pub static EFFECT: Effect = Effect {
    id: "thermal_expansion",
    physics: "thermal expansion of a link",
    ladder: None,
    profile: Some(ProfileKeys {
        all: "thermal_expansion",
        all_text: "Growth of the links before the moved joints with the temperature that the recordings have.",
        own: "thermal_expansion",
        own_text: "Growth of the link before the joint with its temperature.",
    }),
    prior: Some(Prior::of(&PriorKey::ppm_per_k(
        "thermal_expansion_ppm_per_k",
        "Thermal expansion of a link, millionths per kelvin: steel has 12, aluminium 23.",
        20.0,
    ))),
    estimable: at_several_temperatures,
    testable: Some(at_several_temperatures),
    terms: &[Term {
        kind: EffectKind::ThermalExpansion,
        name: "thermal_expansion",
        class: "thermal_expansion",
        formula: "thermal_expansion*(T - T0)",
        quantity: Quantity::Expansion,
        drives: Drives::Along,
        source: Source::Temperature,
        regressor: Regressor::Formula(|s| s.warmth),
    }],
    ..Effect::PLAIN
};
