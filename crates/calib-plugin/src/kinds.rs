//! The kinds as traits. Built-in code, plugins written in Rust and loaded plugins all implement them: a plugin
//! is a built-in with a border around it.

use crate::{
    answer::{Answer, AorFit, CorFit, Failure},
    call::Call,
    effect::{EffectTerm, JointStates},
    motion::Motion,
    offer::Offer,
    streams::{ReportFile, ReportInput, Source, Streams},
};

/// A center-of-rotation estimator, `calib.cor/1`.
pub trait Cor: Send + Sync {
    /// Its description; does no work.
    fn offer(&self) -> Offer;
    /// Finds the center.
    ///
    /// # Errors
    /// [`Failure`]; data that cannot answer are [`Answer::NotObservable`].
    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<CorFit>, Failure>;
}

/// An axis-of-rotation estimator, `calib.aor/1`.
pub trait Aor: Send + Sync {
    /// Its description; does no work.
    fn offer(&self) -> Offer;
    /// Finds the axis.
    ///
    /// # Errors
    /// [`Failure`]; data that cannot answer are [`Answer::NotObservable`].
    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<AorFit>, Failure>;
}

/// A reader of recordings, `calib.reader/1`.
pub trait Reader: Send + Sync {
    /// Its description; does no work.
    fn offer(&self) -> Offer;
    /// True when these first bytes (at most 4096) look like its format.
    fn recognizes(&self, _head: &[u8]) -> bool {
        false
    }
    /// Reads a file.
    ///
    /// # Errors
    /// [`Failure::BadInput`] with line and column for a file that is not what it reads.
    fn read(&self, source: &Source<'_>, call: &Call<'_>) -> Result<Streams, Failure>;
}

/// A report writer, `calib.report/1`.
pub trait ReportWriter: Send + Sync {
    /// Its description; does no work.
    fn offer(&self) -> Offer;
    /// Makes files; writes none.
    ///
    /// # Errors
    /// [`Failure`].
    fn write(&self, report: &ReportInput<'_>, call: &Call<'_>) -> Result<Vec<ReportFile>, Failure>;
}

/// An effect of a joint, `calib.effect/1`: a regressor F whose coefficient the fit estimates.
pub trait JointEffect: Send + Sync {
    /// Its description; does no work.
    fn offer(&self) -> Offer;
    /// What is stated of its coefficient; does no work.
    fn term(&self) -> EffectTerm;
    /// F at each state: a function of that state alone, without jumps in the reading.
    ///
    /// # Errors
    /// [`Failure`].
    fn regressors(&self, states: &JointStates<'_>, call: &Call<'_>) -> Result<Vec<f64>, Failure>;
}

/// A description and a function: how existing functions enter a registry without a type of their own.
///
/// ```
/// use calib_plugin::{Answer, ByFn, Call, Cor, CorFit, Failure, Kind, Motion, Offer};
///
/// let nothing = ByFn::new(Offer::new(Kind::Cor, "nothing", "never answers"), |_: &Motion<'_>, _: &Call<'_>| {
///     Ok::<Answer<CorFit>, Failure>(Answer::NotObservable("it never answers".into()))
/// });
/// assert_eq!(Cor::offer(&nothing).name, "nothing");
/// ```
pub struct ByFn<F> {
    offer: Offer,
    function: F,
}

impl<F> ByFn<F> {
    /// The two together.
    pub fn new(offer: Offer, function: F) -> Self {
        Self { offer, function }
    }
}

impl<F> Cor for ByFn<F>
where
    F: Fn(&Motion<'_>, &Call<'_>) -> Result<Answer<CorFit>, Failure> + Send + Sync,
{
    fn offer(&self) -> Offer {
        self.offer.clone()
    }
    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
        (self.function)(motion, call)
    }
}

impl<F> Aor for ByFn<F>
where
    F: Fn(&Motion<'_>, &Call<'_>) -> Result<Answer<AorFit>, Failure> + Send + Sync,
{
    fn offer(&self) -> Offer {
        self.offer.clone()
    }
    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<AorFit>, Failure> {
        (self.function)(motion, call)
    }
}

impl<F> Reader for ByFn<F>
where
    F: Fn(&Source<'_>, &Call<'_>) -> Result<Streams, Failure> + Send + Sync,
{
    fn offer(&self) -> Offer {
        self.offer.clone()
    }
    fn read(&self, source: &Source<'_>, call: &Call<'_>) -> Result<Streams, Failure> {
        (self.function)(source, call)
    }
}

impl<F> ReportWriter for ByFn<F>
where
    F: Fn(&ReportInput<'_>, &Call<'_>) -> Result<Vec<ReportFile>, Failure> + Send + Sync,
{
    fn offer(&self) -> Offer {
        self.offer.clone()
    }
    fn write(&self, report: &ReportInput<'_>, call: &Call<'_>) -> Result<Vec<ReportFile>, Failure> {
        (self.function)(report, call)
    }
}
