//! Effects whose regressor is computed outside of this program: those of plugins.

use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::OnceLock;

use super::{Drives, Effect, EffectKind, JointState, Quantity, Source, Term};

/// F of equation (1) at the state of one sample.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub enum Regressor {
    /// A formula of the table.
    Formula(fn(&JointState) -> f64),
    /// A function of somebody else, which lives as long as the program.
    Outside(&'static (dyn Fn(&JointState) -> f64 + Send + Sync)),
}

impl Regressor {
    /// F at a state, in the unit that makes coefficient times F rad or m.
    #[inline]
    #[must_use]
    pub fn at(&self, state: &JointState) -> f64 {
        match self {
            Self::Formula(f) => f(state),
            Self::Outside(f) => f(state),
        }
    }
}

impl fmt::Debug for Regressor {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(match self {
            Self::Formula(_) => "Formula",
            Self::Outside(_) => "Outside",
        })
    }
}

/// An effect that is not in the table. Two with the same key are the same effect.
pub struct Outside {
    key: String,
    effect: OnceLock<Effect>,
}

/// What is stated of an effect outside of the table.
pub struct Stated {
    /// Its identity: name and parameters, the same text for the same function.
    pub key: String,
    /// Ending of the parameter's name.
    pub name: String,
    /// The physics, in words.
    pub physics: String,
    /// The summand, in symbols.
    pub formula: String,
    /// What the coefficient measures.
    pub quantity: Quantity,
    /// What the regressor depends on.
    pub source: Source,
    /// Defined for an angle only.
    pub revolute_only: bool,
    /// F of equation (1).
    pub regressor: Box<dyn Fn(&JointState) -> f64 + Send + Sync>,
}

impl Outside {
    /// An effect that adds to the motion about (along) the axis. It is never freed, as the library that computes it is not.
    #[must_use]
    pub fn new(stated: Stated) -> &'static Self {
        let this: &'static Self = Box::leak(Box::new(Self {
            key: stated.key,
            effect: OnceLock::new(),
        }));
        let name: &'static str = stated.name.leak();
        let terms = Box::leak(Box::new([Term {
            kind: EffectKind::Outside(this),
            name,
            class: "plugin_effect",
            formula: stated.formula.leak(),
            quantity: stated.quantity,
            drives: Drives::About,
            source: stated.source,
            regressor: Regressor::Outside(Box::leak(stated.regressor)),
        }]));
        this.effect.get_or_init(|| Effect {
            id: name,
            physics: stated.physics.leak(),
            revolute_only: stated.revolute_only,
            testable: None,
            terms,
            ..Effect::PLAIN
        });
        this
    }

    /// The effect.
    #[must_use]
    pub fn effect(&self) -> &Effect {
        // Set by `new`, the only way to get one.
        self.effect.get().unwrap_or(&super::other::EFFECT)
    }
}

impl fmt::Debug for Outside {
    /// Its key: the effect's term leads back to it.
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(to, "{:?}", self.key)
    }
}

impl PartialEq for Outside {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

impl Eq for Outside {}

impl PartialOrd for Outside {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Outside {
    fn cmp(&self, other: &Self) -> Ordering {
        self.key.cmp(&other.key)
    }
}

impl Hash for Outside {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.key.hash(state);
    }
}
