//! Settings of all estimators in one flat struct.

use nalgebra::Matrix3;

use crate::outcome::CorError;

/// Settings; [`Options::default`] needs no knowledge of the tracker.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Position noise of one coordinate, in the unit of the points, where the tracker states it.
    /// `None`: estimated from the residuals.
    pub sigma_t: Option<f64>,
    /// Orientation noise about one axis, rad, where the tracker states it. `None`: estimated.
    pub sigma_r: Option<f64>,
    /// Covariance of each sample, marker × sample, for the estimators that weigh samples
    /// (`sphere_eiv`, `ml_sphere`); empty for equal, isotropic noise.
    pub covariances: Vec<Vec<Matrix3<f64>>>,
    /// How many single samples each row is worth (the mean of k readings: k): its noise variance is σ²/w, and σ that of a row of weight 1.
    /// Empty: one each. A row of weight 0 counts as lost.
    pub weights: Vec<f64>,
    /// `ml_sphere`: one noise level for each marker (restricted maximum likelihood) instead of a common one.
    pub noise_per_marker: bool,
    /// Probability of calling an unanswerable recording answerable. 10⁻³: the border that the golden cases use.
    pub significance: f64,
    /// σ of the weakest direction, as a part of the radius, above which the verdict is `weak`.
    pub weak_fraction: f64,
    /// Seed of the estimators that draw random starts or subsets.
    pub seed: u64,
    /// Random subsets that a consensus draws. 400: a clean 4-subset at 50 % outliers with probability 1 − 10⁻¹¹.
    pub subsets: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            sigma_t: None,
            sigma_r: None,
            covariances: Vec::new(),
            weights: Vec::new(),
            noise_per_marker: false,
            significance: 1e-3,
            weak_fraction: 0.1,
            seed: 1,
            subsets: 400,
        }
    }
}

impl Options {
    /// # Errors
    /// [`CorError::BadOption`] for a noise level, a probability or a fraction that is not a positive number.
    pub(crate) fn check(&self) -> Result<(), CorError> {
        for (name, value) in [
            ("sigma_t", self.sigma_t),
            ("sigma_r", self.sigma_r),
            ("significance", Some(self.significance)),
            ("weak_fraction", Some(self.weak_fraction)),
        ] {
            if let Some(value) = value
                && !(value.is_finite() && value > 0.0)
            {
                return Err(CorError::BadOption { name, value });
            }
        }
        Ok(())
    }
}
