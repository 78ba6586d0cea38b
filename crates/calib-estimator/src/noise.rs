//! The level of a noise: stated by the caller, or seen in the residuals.

use serde::{Deserialize, Serialize};

use crate::chance::chi2_tail;

/// A noise level with what it rests on.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Level {
    /// Standard deviation.
    pub sigma: f64,
    /// Degrees of freedom of the residuals behind it; `None` where it was stated.
    pub degrees_of_freedom: Option<f64>,
    /// What was stated, where the residuals show more.
    pub contradicts: Option<Contradiction>,
}

/// A stated noise that the residuals exceed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Contradiction {
    /// Standard deviation that was stated.
    pub stated: f64,
    /// What the residuals show, in units of what was stated.
    pub ratio: f64,
    /// Chance of residuals as large.
    pub chance: f64,
}

impl Level {
    /// What was stated; where nothing was, or the residuals show that the noise is larger, what they show.
    ///
    /// ```
    /// use calib_estimator::noise::Level;
    ///
    /// assert_eq!(Level::of(Some(1.0), 1.1, 20.0, 1e-3).sigma, 1.0);
    /// let more = Level::of(Some(1.0), 3.0, 20.0, 1e-3);
    /// assert!(more.sigma == 3.0 && more.contradicts.is_some());
    /// assert_eq!(Level::of(None, 3.0, 20.0, 1e-3).degrees_of_freedom, Some(20.0));
    /// ```
    #[must_use]
    pub fn of(stated: Option<f64>, seen: f64, degrees_of_freedom: f64, significance: f64) -> Self {
        let shown = Self {
            sigma: seen,
            degrees_of_freedom: Some(degrees_of_freedom),
            contradicts: None,
        };
        let Some(stated) = stated else {
            return shown;
        };
        // ν s²/σ² ~ χ²(ν)
        let square = (seen / stated).powi(2) * degrees_of_freedom;
        let chance = chi2_tail(square, degrees_of_freedom);
        if chance < significance {
            return Self {
                contradicts: Some(Contradiction {
                    stated,
                    ratio: seen / stated,
                    chance,
                }),
                ..shown
            };
        }
        Self {
            sigma: stated,
            degrees_of_freedom: None,
            contradicts: None,
        }
    }

    /// A level that no residual can test.
    #[must_use]
    pub fn stated(sigma: f64) -> Self {
        Self {
            sigma,
            degrees_of_freedom: None,
            contradicts: None,
        }
    }
}
