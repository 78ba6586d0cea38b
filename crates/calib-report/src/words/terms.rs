//! The words of the enums: statuses, classes, outcomes.

use crate::{Class, Outcome, RecordingUse, Status, Verdict};

impl Verdict {
    /// The word for people.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::AcceptedWithWarnings => "accepted with warnings",
            Self::Rejected => "rejected",
            Self::NotEvaluated => "not decided",
        }
    }
}

impl Outcome {
    /// The word for people.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Met => "met",
            Self::Exceeded => "exceeded",
            Self::Undecided => "undecided",
            Self::NotEvaluated => "not evaluated",
        }
    }
}

impl Class {
    /// The word for people.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Solid => "identifiable",
            Self::Weak => "weakly identifiable",
            Self::Prior => "prior only",
            Self::Convention => "convention",
            Self::NotObservable => "not identifiable",
        }
    }
}

impl Status {
    /// The word for people and files.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Calibrated => "calibrated",
            Self::Assumed => "assumed",
        }
    }
}

impl RecordingUse {
    /// The word for people.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Sweep => "sweep",
            Self::Static => "static poses",
            Self::Validation => "validation",
        }
    }
}
