//! What limits the accuracy, and the uncertainty over the workspace.

use super::prose::code;
use crate::{AccuracyLimit, ErrorSource, Unit, Workspace, number};

impl ErrorSource {
    /// The source, how its share was determined, and what reduces it.
    fn words(self) -> [&'static str; 3] {
        match self {
            Self::TrackerNoise => [
                "tracker noise",
                "one measurement of the body in a held-out pose",
                "Average several frames per pose.",
            ],
            Self::JointNoise => [
                "joint repeatability",
                "the joint position differs from the encoder reading, differently in each pose",
                "Let the robot settle before each measurement, and warm it up first.",
            ],
            Self::Parameters => [
                "geometry",
                "uncertainty of the estimated geometry",
                "Record more poses, spread over the range of motion.",
            ],
            Self::NotModeled => [
                "unexplained",
                "residual that neither noise nor parameter uncertainty explains",
                "`--select` tries the effects that the model lacks; what it leaves is none of them.",
            ],
        }
    }
}

impl AccuracyLimit {
    /// A source of error with its standard deviation at the tool (m) and its share of the variance.
    #[must_use]
    pub fn new(kind: ErrorSource, sigma_m: f64, share: f64) -> Self {
        let [source, text, remedy] = kind.words().map(str::to_owned);
        Self {
            kind,
            source,
            sigma_m: Some(sigma_m),
            share: Some(share),
            text,
            remedy,
        }
    }
}

/// The uncertainty of the tool over the recorded postures.
pub(crate) fn workspace(workspace: &Workspace) -> String {
    let frame = if workspace.relative_to.is_empty() {
        &workspace.frame
    } else {
        &workspace.relative_to
    };
    format!(
        "Predicted position of {} in {} over {} recorded postures: σ = {} rms, {} maximum. This is the contribution of the parameters alone; the noise of a single measurement adds to it (see below).",
        code(&workspace.link),
        code(frame),
        workspace.points.len(),
        number::plain(workspace.rms_sigma_m, Unit::Meter),
        number::plain(workspace.max_sigma_m, Unit::Meter)
    )
}
