//! Why samples did not take part in the fit.

use crate::{Rejected, RejectedFor};

impl RejectedFor {
    /// The reason, without a full stop.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Copied => "a copy of an earlier row",
            Self::OutOfPlace => {
                "far from where the other markers of the body show it: a reflection or another marker"
            }
            Self::OnTheWay => {
                "not settled: explained by interpolating the joint values toward an adjacent row"
            }
            Self::RestlessHold => "not settled: the hold drifts or scatters",
            Self::HeldReadings => {
                "the joint readings repeat those of an earlier row, and the body had moved"
            }
            Self::StuckReading => {
                "the readings of a joint did not change, although the joint had moved"
            }
            Self::NotSettled => {
                "not settled: the whole body is displaced, or a joint reading is wrong"
            }
            Self::Occlusion => "occlusion: a pose needed to predict it was lost",
            Self::Outlier => "outlier: residual too large for the noise",
            Self::Swap => "swapped with another marker of the body",
            Self::Screened => "gross outlier among the held-out errors",
            Self::Unstated => "rejected",
        }
    }

    /// At which stage they were taken out, as a participle: what a count of rejected measurements includes, and what it does not.
    pub(crate) fn stage(self) -> &'static str {
        match self {
            Self::Copied
            | Self::OutOfPlace
            | Self::OnTheWay
            | Self::RestlessHold
            | Self::HeldReadings
            | Self::StuckReading => "excluded before the fit",
            Self::NotSettled | Self::Occlusion | Self::Outlier | Self::Swap => {
                "rejected by the fit"
            }
            Self::Screened => "screened out of the held-out errors",
            Self::Unstated => "rejected",
        }
    }
}

impl Rejected {
    /// Rows of a body or marker, with the words of their cause.
    #[must_use]
    pub fn new(
        recording: impl Into<String>,
        subject: impl Into<String>,
        rows: Vec<u64>,
        cause: RejectedFor,
    ) -> Self {
        Self {
            recording: recording.into(),
            subject: subject.into(),
            measurements: rows.len(),
            rows,
            cause,
            reason: cause.words().to_owned(),
        }
    }
}
