//! The border of an axis estimator.

use super::{
    border::{accepted, guarded},
    motion::{pointer, view},
};
use crate::{abi, answer::Answer, kinds::Aor, offer::Offer};

/// `fit` of `calib_aor_1`.
///
/// # Safety
/// The pointers are the host's, as the contract says.
pub unsafe fn fit(
    it: &dyn Aor,
    offer: fn() -> &'static Offer,
    call: *const abi::Call,
    motion: *const abi::Motion,
    sink: *const abi::AorSink,
) -> abi::Status {
    let body = |call: &crate::Call<'_>| {
        // SAFETY: the host's, valid until this function returns.
        let (motion, sink) = unsafe { (view(motion)?, sink.as_ref()) };
        let fit = match it.fit(&motion, call)? {
            Answer::NotObservable(reason) => return Ok((abi::NOT_OBSERVABLE, Some(reason))),
            Answer::Found(fit) => fit,
        };
        let in_child = fit.in_child.map(|line| [line.point_m, line.direction]);
        let result = abi::AorResult {
            struct_size: abi::size::<abi::AorResult>(),
            weak: i32::from(fit.weak.is_some()),
            point_m: fit.line.point_m,
            direction: fit.line.direction,
            rms_m: fit.rms_m,
            used: fit.used,
            covariance: fit
                .covariance
                .as_ref()
                .map_or(std::ptr::null(), |c| std::ptr::from_ref(c).cast()),
            in_child: in_child
                .as_ref()
                .map_or(std::ptr::null(), |line| std::ptr::from_ref(line).cast()),
            rejected: pointer(&fit.rejected).cast(),
            rejected_count: fit.rejected.len(),
        };
        // SAFETY: the sink is the host's; the arrays live until the callback returns.
        accepted(sink.and_then(|s| {
            s.result
                .map(|give| unsafe { give(s.context, &raw const result) })
        }))?;
        Ok((abi::OK, fit.weak))
    };
    // SAFETY: the call is the host's.
    unsafe { guarded(offer, call, body) }
}
