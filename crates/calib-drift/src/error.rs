//! Why two calibrations cannot be compared.

use calib_report::{NotAReport, ReportError};

/// Why two calibrations cannot be compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DriftError {
    /// A report cannot be read.
    #[error(transparent)]
    Report(#[from] NotAReport),
    /// A report holds no information matrix.
    #[error(
        "{file}: it has no `data_information`, so the covariance of its parameters is not known\n  help: run the calibration again with `--method ml` and this version of calib"
    )]
    NoInformation {
        /// The report.
        file: String,
    },
    /// The tables of a report contradict each other.
    #[error("{file}: its `data_information` is inconsistent\n  help: run the calibration again")]
    Inconsistent {
        /// The report.
        file: String,
    },
    /// The reports are of two robots.
    #[error(
        "{} is of robot `{}`, {} of robot `{}`\n  help: compare two calibrations of one robot",
        old.0, old.1, new.0, new.1
    )]
    OtherRobot {
        /// The old report and its robot.
        old: (String, String),
        /// The new report and its robot.
        new: (String, String),
    },
    /// Loads or approach of a report may have the signs of an earlier version.
    #[error(
        "{file}: it was written before reports stated the signs of loads: whether {} is counted as giving way is not known\n  help: run that calibration again with this version of calib, from the same recordings",
        parameters.join(", ")
    )]
    OldSigns {
        /// The report.
        file: String,
        /// Its parameters that have a sign.
        parameters: Vec<String>,
    },
    /// No parameter of the robot is estimated in both.
    #[error(
        "{old} and {new} have nothing of the robot in common that both determine\n  help: estimate the same parameters in both calibrations, of joints that have the same names in both URDFs"
    )]
    NothingInCommon {
        /// The old report.
        old: String,
        /// The new report.
        new: String,
    },
    /// The comparison has no JSON form.
    #[error("the comparison cannot be written: {0}")]
    Unwritable(#[from] ReportError),
}

impl DriftError {
    /// Whether the reports can be read but should not be compared.
    #[must_use]
    pub fn is_refusal(&self) -> bool {
        matches!(
            self,
            Self::OtherRobot { .. } | Self::OldSigns { .. } | Self::NothingInCommon { .. }
        )
    }
}
