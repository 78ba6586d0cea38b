//! Settings of all estimators in one flat struct.

use nalgebra::{Point3, Unit, Vector3};

use crate::outcome::AorError;

/// Settings; [`Options::default`] needs no knowledge of the tracker.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Position noise of one coordinate, in the unit of the points, where the tracker states it.
    pub sigma_t: Option<f64>,
    /// Orientation noise about one axis, rad, where the tracker states it.
    pub sigma_r: Option<f64>,
    /// A center of rotation that the axis must pass through (`planar_radial`); `None`: free.
    pub center: Option<Point3<f64>>,
    /// Joint angle of every row, rad, from the encoders. They give the axis its sign, and the hinge
    /// bundle takes them as exact. Empty: unknown.
    pub angles: Vec<f64>,
    /// How many single samples each row is worth (the mean of k readings: k): its noise variance is σ²/w, and σ that of a row of weight 1.
    /// Empty: one each. A row of weight 0 counts as lost.
    pub weights: Vec<f64>,
    /// Direction that the axis is reported towards where angles do not decide its sign.
    pub towards: Option<Unit<Vector3<f64>>>,
    /// `halvorsen_line`: rows between the two samples of a pair; `None`: all pairs.
    pub separation: Option<usize>,
    /// Probability of calling an unanswerable recording answerable.
    pub significance: f64,
    /// σ of the direction, rad, above which the verdict is `weak`. 10°: beyond it a covariance on the
    /// tangent plane no longer describes the direction.
    pub weak_angle: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            sigma_t: None,
            sigma_r: None,
            center: None,
            angles: Vec::new(),
            weights: Vec::new(),
            towards: None,
            separation: None,
            significance: 1e-3,
            weak_angle: 10.0_f64.to_radians(),
        }
    }
}

impl Options {
    /// # Errors
    /// [`AorError::BadOption`] for a value that is not a positive number, or an angle or center that is none.
    pub(crate) fn check(&self) -> Result<(), AorError> {
        for (name, value) in [
            ("sigma_t", self.sigma_t),
            ("sigma_r", self.sigma_r),
            ("significance", Some(self.significance)),
            ("weak_angle", Some(self.weak_angle)),
        ] {
            if let Some(value) = value
                && !(value.is_finite() && value > 0.0)
            {
                return Err(AorError::BadOption { name, value });
            }
        }
        if let Some(value) = self.angles.iter().copied().find(|a| !a.is_finite()) {
            return Err(AorError::BadOption {
                name: "angles",
                value,
            });
        }
        if let Some(value) = self
            .center
            .iter()
            .flat_map(|c| c.iter().copied())
            .find(|x| !x.is_finite())
        {
            return Err(AorError::BadOption {
                name: "center",
                value,
            });
        }
        Ok(())
    }
}
