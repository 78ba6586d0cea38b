//! A loaded center estimator.

use std::ffi::c_void;

use super::{
    estimator::{Fitted, Target, fitted, rejected},
    raw::{array, size_to, sized},
};
use crate::{
    abi,
    answer::{Answer, CorFit, Failure},
    call::Call,
    kinds::Cor,
    motion::Motion,
    offer::Offer,
};

/// `fit` of the table.
pub(super) type Fit =
    unsafe extern "C" fn(*const abi::Call, *const abi::Motion, *const abi::CorSink) -> abi::Status;

pub(super) struct LoadedCor {
    pub offer: Offer,
    pub fit: Fit,
}

impl Cor for LoadedCor {
    fn offer(&self) -> Offer {
        self.offer.clone()
    }

    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
        fitted(motion, call, |call, motion, target| {
            let sink = abi::CorSink {
                struct_size: abi::size::<abi::CorSink>(),
                reserved: 0,
                context: target.cast(),
                result: Some(take),
            };
            // SAFETY: all arguments are alive until the function returns. Sizes were verified by `Bound`, the only way here.
            unsafe { (self.fit)(call, motion, &raw const sink) }
        })
    }
}

impl Fitted for CorFit {
    fn weak(&mut self) -> Option<&mut String> {
        self.weak.as_mut()
    }
}

unsafe extern "C" fn take(context: *mut c_void, result: *const abi::CorResult) -> abi::Status {
    // SAFETY: the context of `fit`, used by this thread only.
    let Some(target) = (unsafe { context.cast::<Target<CorFit>>().as_mut() }) else {
        return abi::FAILED;
    };
    // SAFETY: a result of the contract, alive until this function returns.
    let fit = unsafe { read(result, target.tracks, target.rows) };
    target.got.take(fit)
}

/// # Safety
/// `result` is null or a result of the contract.
unsafe fn read(
    result: *const abi::CorResult,
    tracks: usize,
    rows: usize,
) -> Result<CorFit, String> {
    // SAFETY, for all blocks: the caller's promise; sizes are checked before anything is read.
    let raw: abi::CorResult = unsafe {
        sized(
            "calib_cor_result",
            result.cast(),
            size_to!(abi::CorResult, rejected_count),
        )?
    };
    if raw.radius_count != 0 && raw.radius_count != tracks {
        return Err(format!("{} radii for {tracks} markers", raw.radius_count));
    }
    if raw.body_point_count != 0 && raw.body_point_count != tracks {
        return Err(format!(
            "{} body points for {tracks} bodies",
            raw.body_point_count
        ));
    }
    let radii_m = unsafe { array("radii_m", raw.radii_m, raw.radius_count)? }.to_vec();
    let body_points_m = unsafe {
        array(
            "body_points_m",
            raw.body_points_m.cast(),
            raw.body_point_count,
        )?
    }
    .to_vec();
    Ok(CorFit {
        center_m: raw.center_m,
        covariance_m2: unsafe { raw.covariance_m2.cast::<[[f64; 3]; 3]>().as_ref() }.copied(),
        body_points_m,
        radii_m,
        rms_m: raw.rms_m,
        used: raw.used,
        rejected: unsafe { rejected(raw.rejected, raw.rejected_count, rows)? },
        weak: (raw.weak != 0).then(String::new),
    })
}
