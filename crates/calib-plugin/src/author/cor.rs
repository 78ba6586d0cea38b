//! The border of a center estimator.

use super::{
    estimator::{Fit, matrix},
    motion::pointer,
};
use crate::{abi, kinds::Cor, offer::Offer};

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
            let result = abi::CorResult {
                struct_size: abi::size::<abi::CorResult>(),
                weak: i32::from(fit.weak.is_some()),
                center_m: fit.center_m,
                rms_m: fit.rms_m,
                used: fit.used,
                covariance_m2: matrix(fit.covariance_m2.as_ref()),
                body_points_m: pointer(&fit.body_points_m).cast(),
                body_point_count: fit.body_points_m.len(),
                radii_m: pointer(&fit.radii_m),
                radius_count: fit.radii_m.len(),
                rejected: pointer(&fit.rejected).cast(),
                rejected_count: fit.rejected.len(),
            };
            give(&result)?;
            Ok(fit.weak)
        })
    }
}
