//! The border of estimators of all kinds.

use super::{
    border::{accepted, guarded},
    motion::view,
};
use crate::{
    abi,
    answer::{Answer, Failure},
    call::Call,
    motion::Motion,
    offer::Offer,
};

/// What the host passed to `fit` of an estimator's table, and the offer that it called.
pub(super) struct Fit<R> {
    pub offer: fn() -> &'static Offer,
    pub call: *const abi::Call,
    pub motion: *const abi::Motion,
    pub sink: *const abi::EstimatorSink<R>,
}

impl<R> Fit<R> {
    /// Runs the estimator. `put` builds the C struct of an estimate, hands it to the host by the function that it is given while
    /// its arrays live, and returns the reason of a weak estimate.
    ///
    /// # Safety
    /// The pointers are the host's, as the contract says.
    pub unsafe fn run<F>(
        self,
        estimator: impl FnOnce(&Motion<'_>, &Call<'_>) -> Result<Answer<F>, Failure>,
        put: impl FnOnce(F, &dyn Fn(&R) -> Result<(), Failure>) -> Result<Option<String>, Failure>,
    ) -> abi::Status {
        let body = |call: &Call<'_>| {
            // SAFETY: the host's, valid until this function returns.
            let (motion, sink) = unsafe { (view(self.motion)?, self.sink.as_ref()) };
            let fit = match estimator(&motion, call)? {
                Answer::NotObservable(reason) => return Ok((abi::NOT_OBSERVABLE, Some(reason))),
                Answer::Found(fit) => fit,
            };
            // SAFETY: the sink is the host's; the arrays live until the callback returns.
            let give = |result: &R| {
                accepted(sink.and_then(|s| s.result.map(|give| unsafe { give(s.context, result) })))
            };
            Ok((abi::OK, put(fit, &give)?))
        };
        // SAFETY: the call is the host's.
        unsafe { guarded(self.offer, self.call, body) }
    }
}

/// The numbers of a matrix, or null.
pub(super) fn matrix<T>(matrix: Option<&T>) -> *const f64 {
    matrix.map_or(std::ptr::null(), |m| std::ptr::from_ref(m).cast())
}
