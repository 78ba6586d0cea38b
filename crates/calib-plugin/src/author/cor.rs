//! The border of a center estimator.

use super::{
    border::{accepted, guarded},
    motion::{pointer, view},
};
use crate::{abi, answer::Answer, kinds::Cor, offer::Offer};

/// `fit` of `calib_cor_1`.
///
/// # Safety
/// The pointers are the host's, as the contract says.
pub unsafe fn fit(
    it: &dyn Cor,
    offer: fn() -> &'static Offer,
    call: *const abi::Call,
    motion: *const abi::Motion,
    sink: *const abi::CorSink,
) -> abi::Status {
    let body = |call: &crate::Call<'_>| {
        // SAFETY: the host's, valid until this function returns.
        let (motion, sink) = unsafe { (view(motion)?, sink.as_ref()) };
        let fit = match it.fit(&motion, call)? {
            Answer::NotObservable(reason) => return Ok((abi::NOT_OBSERVABLE, Some(reason))),
            Answer::Found(fit) => fit,
        };
        let result = abi::CorResult {
            struct_size: abi::size::<abi::CorResult>(),
            weak: i32::from(fit.weak.is_some()),
            center_m: fit.center_m,
            rms_m: fit.rms_m,
            used: fit.used,
            covariance_m2: fit
                .covariance_m2
                .as_ref()
                .map_or(std::ptr::null(), |c| std::ptr::from_ref(c).cast()),
            body_points_m: pointer(&fit.body_points_m).cast(),
            body_point_count: fit.body_points_m.len(),
            radii_m: pointer(&fit.radii_m),
            radius_count: fit.radii_m.len(),
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
