//! The names of the settings, for tables, messages and profiles.

/// One field of [`crate::Options`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum OptionId {
    /// [`crate::Options::sigma_t`].
    SigmaT,
    /// [`crate::Options::sigma_r`].
    SigmaR,
    /// [`crate::Options::covariances`].
    Covariances,
    /// [`crate::Options::weights`].
    Weights,
    /// [`crate::Options::noise_per_marker`].
    NoisePerMarker,
    /// [`crate::Options::center`].
    Center,
    /// [`crate::Options::angles`].
    Angles,
    /// [`crate::Options::towards`].
    Towards,
    /// [`crate::Options::separation`].
    Separation,
    /// [`crate::Options::significance`].
    Significance,
    /// [`crate::Options::weak_fraction`].
    WeakFraction,
    /// [`crate::Options::weak_angle`].
    WeakAngle,
    /// [`crate::Options::seed`].
    Seed,
    /// [`crate::Options::subsets`].
    Subsets,
    /// [`crate::Options::axes`].
    Axes,
    /// [`crate::Options::plane_fit`].
    PlaneFit,
    /// [`crate::Options::same_angle`].
    SameAngle,
}

impl OptionId {
    /// All, in the order of the fields.
    pub const ALL: [Self; 17] = [
        Self::SigmaT,
        Self::SigmaR,
        Self::Covariances,
        Self::Weights,
        Self::NoisePerMarker,
        Self::Center,
        Self::Angles,
        Self::Towards,
        Self::Separation,
        Self::Significance,
        Self::WeakFraction,
        Self::WeakAngle,
        Self::Seed,
        Self::Subsets,
        Self::Axes,
        Self::PlaneFit,
        Self::SameAngle,
    ];

    /// The name of the field.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::SigmaT => "sigma_t",
            Self::SigmaR => "sigma_r",
            Self::Covariances => "covariances",
            Self::Weights => "weights",
            Self::NoisePerMarker => "noise_per_marker",
            Self::Center => "center",
            Self::Angles => "angles",
            Self::Towards => "towards",
            Self::Separation => "separation",
            Self::Significance => "significance",
            Self::WeakFraction => "weak_fraction",
            Self::WeakAngle => "weak_angle",
            Self::Seed => "seed",
            Self::Subsets => "subsets",
            Self::Axes => "axes",
            Self::PlaneFit => "plane_fit",
            Self::SameAngle => "same_angle",
        }
    }
}
