//! Input that no estimator can read, and options that do not fit.

use crate::{
    kind::{InputKind, Kind},
    measured::DataError,
    option_id::OptionId,
    verdict::Verdict,
};

/// What an option must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Rule {
    /// A finite number above zero.
    Positive,
    /// A finite number.
    Finite,
    /// The two joints of a frame rotate about different coordinate axes.
    DifferentAxes,
    /// A weight: a finite number from zero up.
    Weight,
}

impl std::fmt::Display for Rule {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Positive => "must be a finite number > 0",
            Self::Finite => "must be finite",
            Self::DifferentAxes => "must name two different coordinate axes",
            Self::Weight => "must be a finite number ≥ 0",
        })
    }
}

/// Why an estimator did not run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EstimatorError {
    /// No estimator of this name.
    #[error("unknown {kind} estimator `{id}`, expected one of {}", known.join(", "))]
    Unknown {
        /// The kind.
        kind: Kind,
        /// The name asked for.
        id: String,
        /// The names that exist.
        known: Vec<String>,
    },
    /// The estimator needs another kind of data.
    #[error("this estimator needs {expects}, got {got}")]
    WrongInput {
        /// What it needs.
        expects: InputKind,
        /// What was given.
        got: InputKind,
    },
    /// Samples that cannot be read.
    #[error(transparent)]
    Data(#[from] DataError),
    /// An option that is not a usable number.
    #[error("option {name} {rule}, got {value}")]
    BadOption {
        /// Its name.
        name: &'static str,
        /// What it must be.
        rule: Rule,
        /// Its value.
        value: f64,
    },
    /// An option was set that the estimator does not use.
    #[error("`{id}` does not use the option {}", option.name())]
    Ignored {
        /// The estimator.
        id: String,
        /// The option.
        option: OptionId,
    },
}

impl EstimatorError {
    /// The verdict word that belongs to this error, for those that describe data.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        match self {
            Self::Data(error) => error.verdict(),
            _ => None,
        }
    }
}
