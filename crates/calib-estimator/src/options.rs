//! Settings of all estimators in one flat struct, and which of them an estimator uses.

use calib_geometry::plausible::{Unlikely, unlikely_radians};
use nalgebra::{Matrix3, Point3, Unit, Vector3};

use crate::{
    error::{EstimatorError, Rule},
    frame::{FrameAxes, PlaneFit},
    option_id::OptionId,
};

/// Settings; [`Options::default`] needs no knowledge of the tracker.
///
/// ```
/// use calib_estimator::Options;
///
/// let options = Options::default().with_sigma_t(1e-4).with_seed(7);
/// assert_eq!(options.sigma_t, Some(1e-4));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Position noise of one coordinate, in the unit of the points, where the tracker states it.
    /// `None`: estimated from the residuals.
    pub sigma_t: Option<f64>,
    /// Orientation noise about one axis, rad, where the tracker states it. `None`: estimated.
    pub sigma_r: Option<f64>,
    /// Covariance of each sample, marker × sample, for the estimators that weigh samples; empty for equal, isotropic noise.
    pub covariances: Vec<Vec<Matrix3<f64>>>,
    /// How many single samples each row is worth (the mean of k readings: k): its noise variance is σ²/w, and σ that of a row of weight 1.
    /// Empty: one each. A row of weight 0 counts as lost.
    pub weights: Vec<f64>,
    /// Centers: one noise level for each marker (restricted maximum likelihood) instead of a common one.
    pub noise_per_marker: bool,
    /// Axes: a center of rotation that the axis must pass through; `None`: free.
    pub center: Option<Point3<f64>>,
    /// Axes: joint angle of every row, rad, from the encoders. They give the axis its sign, and the hinge
    /// bundle takes them as exact. Empty: unknown.
    pub angles: Vec<f64>,
    /// Axes: direction that the axis is reported towards where angles do not decide its sign.
    pub towards: Option<Unit<Vector3<f64>>>,
    /// `halvorsen_line`: rows between the two samples of a pair; `None`: all pairs.
    pub separation: Option<usize>,
    /// Probability of calling an unanswerable recording answerable. 10⁻³: the border that the golden cases use.
    pub significance: f64,
    /// σ of the weakest direction of a center, as a part of the radius (of a frame's origin: of its distance from the body), above
    /// which the verdict is `weak`.
    pub weak_fraction: f64,
    /// σ of a direction, rad, above which the verdict is `weak`. 10°: beyond it a covariance on the
    /// tangent plane no longer describes the direction.
    pub weak_angle: f64,
    /// Seed of the estimators that draw random starts or subsets.
    pub seed: u64,
    /// Random subsets that a consensus draws. 400: a clean 4-subset at 50 % outliers with probability 1 − 10⁻¹¹.
    pub subsets: usize,
    /// Frames: which coordinate axes the joints rotate about.
    pub axes: FrameAxes,
    /// Frames: how the axis of each plane of circles is fitted.
    pub plane_fit: PlaneFit,
    /// Frames: angles closer than this count as the same grid line, rad. 0.01 (0.6°): above encoder noise,
    /// below any sensible grid step.
    pub same_angle: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            sigma_t: None,
            sigma_r: None,
            covariances: Vec::new(),
            weights: Vec::new(),
            noise_per_marker: false,
            center: None,
            angles: Vec::new(),
            towards: None,
            separation: None,
            significance: 1e-3,
            weak_fraction: 0.1,
            weak_angle: 10.0_f64.to_radians(),
            seed: 1,
            subsets: 400,
            axes: FrameAxes::default(),
            plane_fit: PlaneFit::PlanarRadial,
            same_angle: 0.01,
        }
    }
}

impl Options {
    /// The options that differ from their defaults.
    #[must_use]
    pub fn given(&self) -> Vec<OptionId> {
        let none = Self::default();
        let differs = |id: &OptionId| match id {
            OptionId::SigmaT => self.sigma_t.is_some(),
            OptionId::SigmaR => self.sigma_r.is_some(),
            OptionId::Covariances => !self.covariances.is_empty(),
            OptionId::Weights => !self.weights.is_empty(),
            OptionId::NoisePerMarker => self.noise_per_marker,
            OptionId::Center => self.center.is_some(),
            OptionId::Angles => !self.angles.is_empty(),
            OptionId::Towards => self.towards.is_some(),
            OptionId::Separation => self.separation.is_some(),
            OptionId::Significance => self.significance.to_bits() != none.significance.to_bits(),
            OptionId::WeakFraction => self.weak_fraction.to_bits() != none.weak_fraction.to_bits(),
            OptionId::WeakAngle => self.weak_angle.to_bits() != none.weak_angle.to_bits(),
            OptionId::Seed => self.seed != none.seed,
            OptionId::Subsets => self.subsets != none.subsets,
            OptionId::Axes => self.axes != none.axes,
            OptionId::PlaneFit => self.plane_fit != none.plane_fit,
            OptionId::SameAngle => self.same_angle.to_bits() != none.same_angle.to_bits(),
        };
        OptionId::ALL.into_iter().filter(differs).collect()
    }

    /// The same with every option that is not in `used` at its default: what is known of a recording, for an estimator that may not use
    /// all of it.
    #[must_use]
    pub fn only(&self, used: &[OptionId]) -> Self {
        let mut out = self.clone();
        let none = Self::default();
        for id in OptionId::ALL.iter().filter(|id| !used.contains(id)) {
            match id {
                OptionId::SigmaT => out.sigma_t = none.sigma_t,
                OptionId::SigmaR => out.sigma_r = none.sigma_r,
                OptionId::Covariances => out.covariances = Vec::new(),
                OptionId::Weights => out.weights = Vec::new(),
                OptionId::NoisePerMarker => out.noise_per_marker = none.noise_per_marker,
                OptionId::Center => out.center = none.center,
                OptionId::Angles => out.angles = Vec::new(),
                OptionId::Towards => out.towards = none.towards,
                OptionId::Separation => out.separation = none.separation,
                OptionId::Significance => out.significance = none.significance,
                OptionId::WeakFraction => out.weak_fraction = none.weak_fraction,
                OptionId::WeakAngle => out.weak_angle = none.weak_angle,
                OptionId::Seed => out.seed = none.seed,
                OptionId::Subsets => out.subsets = none.subsets,
                OptionId::Axes => out.axes = none.axes,
                OptionId::PlaneFit => out.plane_fit = none.plane_fit,
                OptionId::SameAngle => out.same_angle = none.same_angle,
            }
        }
        out
    }

    /// # Errors
    /// [`EstimatorError::BadOption`] for a noise level, a probability or a limit that is not a finite number above zero, an angle or a
    /// center that is not finite, or two joints of a frame that rotate about the same coordinate axis.
    pub fn check(&self) -> Result<(), EstimatorError> {
        for (name, value) in [
            ("sigma_t", self.sigma_t),
            ("sigma_r", self.sigma_r),
            ("significance", Some(self.significance)),
            ("weak_fraction", Some(self.weak_fraction)),
            ("weak_angle", Some(self.weak_angle)),
            ("same_angle", Some(self.same_angle)),
        ] {
            if let Some(value) = value
                && !(value.is_finite() && value > 0.0)
            {
                let rule = Rule::Positive;
                return Err(EstimatorError::BadOption { name, rule, value });
            }
        }
        let center = self.center.iter().flat_map(|c| c.iter().copied());
        for (name, value) in self
            .angles
            .iter()
            .map(|a| ("angles", *a))
            .chain(center.map(|x| ("center", x)))
        {
            if !value.is_finite() {
                let rule = Rule::Finite;
                return Err(EstimatorError::BadOption { name, rule, value });
            }
        }
        if self.axes.proximal == self.axes.distal {
            return Err(EstimatorError::BadOption {
                name: "axes",
                rule: Rule::DifferentAxes,
                value: self.axes.distal.index() as f64,
            });
        }
        Ok(())
    }

    /// With the position noise that the tracker states, one coordinate, in the unit of the points.
    #[must_use]
    pub fn with_sigma_t(mut self, sigma: f64) -> Self {
        self.sigma_t = Some(sigma);
        self
    }

    /// With the orientation noise that the tracker states, about one axis, rad.
    #[must_use]
    pub fn with_sigma_r(mut self, sigma: f64) -> Self {
        self.sigma_r = Some(sigma);
        self
    }

    /// With the covariance of each sample, marker × sample.
    #[must_use]
    pub fn with_covariances(mut self, covariances: Vec<Vec<Matrix3<f64>>>) -> Self {
        self.covariances = covariances;
        self
    }

    /// With the weight of each row.
    #[must_use]
    pub fn with_weights(mut self, weights: Vec<f64>) -> Self {
        self.weights = weights;
        self
    }

    /// Why the joint angles are hardly rad; `None` where they may well be, or where there are none. Ask before you run an estimator that
    /// takes them: degrees give a hinge that is wrong, not an error.
    ///
    /// ```
    /// use calib_estimator::Options;
    ///
    /// assert!(Options::default().with_angles(vec![-90.0, 0.0, 45.0]).unlikely_angles().is_some());
    /// assert!(Options::default().with_angles(vec![-1.57, 0.0, 0.79]).unlikely_angles().is_none());
    /// ```
    #[must_use]
    pub fn unlikely_angles(&self) -> Option<Unlikely> {
        unlikely_radians(&self.angles)
    }

    /// With the joint angle of each row, rad.
    #[must_use]
    pub fn with_angles(mut self, angles: Vec<f64>) -> Self {
        self.angles = angles;
        self
    }

    /// With a center that the axis passes through.
    #[must_use]
    pub fn with_center(mut self, center: Point3<f64>) -> Self {
        self.center = Some(center);
        self
    }

    /// With the side that the axis is reported towards.
    #[must_use]
    pub fn with_towards(mut self, towards: Unit<Vector3<f64>>) -> Self {
        self.towards = Some(towards);
        self
    }

    /// With the coordinate axes that the two joints of a frame rotate about.
    #[must_use]
    pub fn with_axes(mut self, axes: FrameAxes) -> Self {
        self.axes = axes;
        self
    }

    /// With the seed of random starts and subsets.
    #[must_use]
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }
}
