//! Physics that the model lacks.

use crate::words::selection::effect;
use crate::{MissingPhysics, Physics, TestAnswer, TestedEffect};

/// Caption of the table of tests.
pub(crate) const TESTED: &str =
    "Effects that the model lacks, tested on what is left; the most significant test of each:";

impl TestedEffect {
    /// The effect as a noun.
    #[must_use]
    pub fn words(&self) -> String {
        match &self.effect {
            Some(id) => effect(id),
            None => "drift over time".to_owned(),
        }
    }
}

impl TestAnswer {
    /// What the data do.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::AskedFor => "ask for it",
            Self::Small => "show it, but it explains little",
            Self::NotSeen => "do not show it",
        }
    }
}

impl Physics {
    /// The physics as a noun.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Effect(words) => words,
            Self::Drift => "drift of tracker or base over time (temperature)",
        }
    }
}

impl MissingPhysics {
    /// What the residuals show, without a full stop.
    #[must_use]
    pub fn evidence(&self) -> String {
        format!(
            "{} (`{}`): explains {:.0} % of χ², p = {}",
            self.physics.words(),
            self.parameter,
            100.0 * self.explains,
            super::selection::p_value(self.p_value)
        )
    }
}
