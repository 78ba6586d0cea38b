//! Physics that the model lacks.

use crate::{MissingPhysics, Physics};

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
            "{} (`{}`): explains {:.0} % of χ², p = {:.0e}",
            self.physics.words(),
            self.parameter,
            100.0 * self.explains,
            self.p_value.max(1e-300)
        )
    }
}
