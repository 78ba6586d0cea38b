//! The words for what data can and cannot answer, shared by all estimators.

use serde::{Deserialize, Serialize};

/// Why an estimate is trusted, or what stands in its way.
///
/// `Ok` and `Weak` come with numbers, every other word means that the data do not determine the
/// quantity, whatever a formula would return.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Verdict {
    /// Determined by the data.
    Ok,
    /// Determined, but less well than a tenth of the geometry's size along its weakest direction.
    Weak,
    /// The points stay in one plane (or in parallel planes, one for each marker).
    Coplanar,
    /// The points stay on one line.
    Collinear,
    /// The points do not differ.
    Coincident,
    /// All rotations share one axis: an axis line is known, no point on it.
    SingleAxis,
    /// The body does not turn.
    NoRotation,
    /// A given matrix is not a rotation (scaled, sheared, reflected).
    NotRotation,
    /// Two axes that must differ are parallel.
    Parallel,
    /// Several answers are equally good.
    NotUnique,
    /// Fewer samples than unknowns.
    TooFew,
    /// The iteration left the neighborhood of the data.
    Diverged,
    /// A sample is NaN or infinite.
    NotFinite,
}

impl Verdict {
    /// The word as it stands in reports and golden cases.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Weak => "weak",
            Self::Coplanar => "coplanar",
            Self::Collinear => "collinear",
            Self::Coincident => "coincident",
            Self::SingleAxis => "single_axis",
            Self::NoRotation => "no_rotation",
            Self::NotRotation => "not_rotation",
            Self::Parallel => "parallel",
            Self::NotUnique => "not_unique",
            Self::TooFew => "too_few",
            Self::Diverged => "diverged",
            Self::NotFinite => "not_finite",
        }
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.as_str())
    }
}
