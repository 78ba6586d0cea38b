//! How to solve: limits of the minimization, outliers, rounds for the noise levels.

use crate::solve::minimize::MinimizeSettings;
use crate::solve::robust::RobustSettings;

/// How to solve.
///
/// Non-exhaustive: start from [`Settings::default`] or [`Settings::plain`] and change what differs.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Settings {
    /// Limits of the minimization.
    pub minimize: MinimizeSettings,
    /// Treatment of outliers; on by default.
    pub robust: RobustSettings,
    /// Rounds of minimizing and re-estimating noise levels; they settle to 0.1 % in 5 to 15.
    pub noise_rounds: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            minimize: MinimizeSettings::default(),
            robust: RobustSettings::default(),
            noise_rounds: 60,
        }
    }
}

impl Settings {
    /// Every observation counts fully, noise levels as stated: the plain least-squares fit.
    #[must_use]
    pub fn plain() -> Self {
        let mut settings = Self::default();
        settings.robust.enabled = false;
        settings.noise_rounds = 0;
        settings
    }

    /// The same with these limits of the minimization.
    #[must_use]
    pub fn with_minimize(mut self, minimize: MinimizeSettings) -> Self {
        self.minimize = minimize;
        self
    }

    /// The same with this treatment of outliers.
    #[must_use]
    pub fn with_robust(mut self, robust: RobustSettings) -> Self {
        self.robust = robust;
        self
    }

    /// The same with this number of rounds for the noise levels; 0 keeps them as stated.
    #[must_use]
    pub fn with_noise_rounds(mut self, rounds: usize) -> Self {
        self.noise_rounds = rounds;
        self
    }
}
