//! The border of an axis estimator.

use super::{
    estimator::{Fit, matrix},
    motion::pointer,
};
use crate::{abi, kinds::Aor, offer::Offer};

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
    let host = Fit {
        offer,
        call,
        motion,
        sink,
    };
    let estimator = |motion: &crate::Motion<'_>, call: &crate::Call<'_>| it.fit(motion, call);
    // SAFETY: as the caller says.
    unsafe {
        host.run(estimator, |fit, give| {
            let in_child = fit.in_child.map(|line| [line.point_m, line.direction]);
            let result = abi::AorResult {
                struct_size: abi::size::<abi::AorResult>(),
                weak: i32::from(fit.weak.is_some()),
                point_m: fit.line.point_m,
                direction: fit.line.direction,
                rms_m: fit.rms_m,
                used: fit.used,
                covariance: matrix(fit.covariance.as_ref()),
                in_child: matrix(in_child.as_ref()),
                rejected: pointer(&fit.rejected).cast(),
                rejected_count: fit.rejected.len(),
            };
            give(&result)?;
            Ok(fit.weak)
        })
    }
}
