//! An estimate with its verdict, or why there is none.

use std::fmt::Debug;

use serde::Serialize;

use crate::verdict::Verdict;

/// What estimates of all kinds have in common.
pub trait Estimate: Debug + Clone + PartialEq + Serialize {
    /// What the data may determine where they do not determine the whole.
    type Known: Debug + Clone + PartialEq + Serialize;

    /// Nothing is known.
    const NOTHING: Self::Known;

    /// Id of the estimator.
    fn estimator(&self) -> &'static str;
    /// [`Verdict::Ok`] or [`Verdict::Weak`].
    fn verdict(&self) -> Verdict;
    /// Why the verdict is not `ok`, with numbers.
    fn reason(&self) -> Option<&str>;
    /// All numbers in it are finite.
    fn is_finite(&self) -> bool;
}

/// The functions of [`Estimate`] that read the fields `estimator`, `verdict` and `reason`, for estimates that have them.
#[macro_export]
macro_rules! estimate_fields {
    () => {
        fn estimator(&self) -> &'static str {
            self.estimator
        }

        fn verdict(&self) -> $crate::Verdict {
            self.verdict
        }

        fn reason(&self) -> Option<&str> {
            self.reason.as_deref()
        }
    };
}

/// The data cannot answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotObservable<K> {
    /// Id of the estimator.
    pub estimator: &'static str,
    /// The kind of degeneracy.
    pub verdict: Verdict,
    /// The reason, with numbers.
    pub reason: String,
    /// What the data do determine.
    pub known: K,
}

/// Estimate, or the reason why not.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(bound = "")]
pub enum Outcome<E: Estimate> {
    /// An estimate with its covariance; look at its verdict for `weak`.
    Estimate(Box<E>),
    /// No estimate.
    NotObservable(NotObservable<E::Known>),
}

impl<E: Estimate> Outcome<E> {
    /// The verdict of either branch.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        match self {
            Self::Estimate(e) => e.verdict(),
            Self::NotObservable(n) => n.verdict,
        }
    }

    /// True when the quantity is determined (`ok`); false for `weak` and all degeneracies.
    #[must_use]
    pub fn is_observable(&self) -> bool {
        self.verdict() == Verdict::Ok
    }

    /// The estimate, weak or not.
    #[must_use]
    pub fn estimate(&self) -> Option<&E> {
        match self {
            Self::Estimate(e) => Some(e),
            Self::NotObservable(_) => None,
        }
    }

    /// Why the verdict is not `ok`.
    #[must_use]
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Estimate(e) => e.reason(),
            Self::NotObservable(n) => Some(&n.reason),
        }
    }

    /// The outcome itself, unless a number in it is not finite: then it says so.
    #[must_use]
    pub fn checked(self) -> Self {
        match self {
            Self::Estimate(e) if !e.is_finite() => Self::none(
                e.estimator(),
                Verdict::Diverged,
                "the result is beyond the range of numbers".into(),
                E::NOTHING,
            ),
            outcome => outcome,
        }
    }

    /// No estimate.
    #[must_use]
    pub fn none(
        estimator: &'static str,
        verdict: Verdict,
        reason: String,
        known: E::Known,
    ) -> Self {
        Self::NotObservable(NotObservable {
            estimator,
            verdict,
            reason,
            known,
        })
    }

    /// Fewer samples than unknowns.
    #[must_use]
    pub fn too_few(estimator: &'static str, got: usize, needed: usize, of: &str) -> Self {
        Self::none(
            estimator,
            Verdict::TooFew,
            format!("{got} {of}, at least {needed} are needed"),
            E::NOTHING,
        )
    }
}
