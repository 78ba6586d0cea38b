//! The words of the enums: statuses, classes, outcomes.

use crate::{Class, Outcome, RecordingUse, Status, Verdict};

impl Verdict {
    /// The word for people.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Rejected => "rejected",
            Self::NotEvaluated => "not evaluated",
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
            Self::NotEvaluated => "not evaluated",
        }
    }
}

impl Class {
    /// The word for people.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Solid => "solid",
            Self::Weak => "weak",
            Self::Prior => "prior only",
            Self::NotObservable => "not observable",
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
