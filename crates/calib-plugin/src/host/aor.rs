//! A loaded axis estimator.

use std::ffi::c_void;

use super::{
    estimator::{Fitted, Target, fitted, rejected},
    raw::{size_to, sized},
};
use crate::{
    abi,
    answer::{Answer, AorFit, AxisLine, Failure},
    call::Call,
    kinds::Aor,
    motion::Motion,
    offer::Offer,
};

/// `fit` of the table.
pub(super) type Fit =
    unsafe extern "C" fn(*const abi::Call, *const abi::Motion, *const abi::AorSink) -> abi::Status;

pub(super) struct LoadedAor {
    pub offer: Offer,
    pub fit: Fit,
}

impl Aor for LoadedAor {
    fn offer(&self) -> Offer {
        self.offer.clone()
    }

    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<AorFit>, Failure> {
        fitted(motion, call, |call, motion, target| {
            let sink = abi::AorSink {
                struct_size: abi::size::<abi::AorSink>(),
                reserved: 0,
                context: target.cast(),
                result: Some(take),
            };
            // SAFETY: all arguments are alive until the function returns. Sizes were verified by `Bound`, the only way here.
            unsafe { (self.fit)(call, motion, &raw const sink) }
        })
    }
}

impl Fitted for AorFit {
    fn weak(&mut self) -> Option<&mut String> {
        self.weak.as_mut()
    }
}

unsafe extern "C" fn take(context: *mut c_void, result: *const abi::AorResult) -> abi::Status {
    // SAFETY: the context of `fit`, used by this thread only.
    let Some(target) = (unsafe { context.cast::<Target<AorFit>>().as_mut() }) else {
        return abi::FAILED;
    };
    // SAFETY: a result of the contract, alive until this function returns.
    let fit = unsafe { read(result, target.rows) };
    target.got.take(fit)
}

/// # Safety
/// `result` is null or a result of the contract.
unsafe fn read(result: *const abi::AorResult, rows: usize) -> Result<AorFit, String> {
    // SAFETY, for all blocks: the caller's promise; sizes are checked before anything is read.
    let raw: abi::AorResult = unsafe {
        sized(
            "calib_aor_result",
            result.cast(),
            size_to!(abi::AorResult, rejected_count),
        )?
    };
    let in_child = unsafe { raw.in_child.cast::<[[f64; 3]; 2]>().as_ref() };
    Ok(AorFit {
        line: AxisLine {
            point_m: raw.point_m,
            direction: raw.direction,
        },
        covariance: unsafe { raw.covariance.cast::<[[f64; 6]; 6]>().as_ref() }.copied(),
        in_child: in_child.map(|line| AxisLine {
            point_m: line[0],
            direction: line[1],
        }),
        rms_m: raw.rms_m,
        used: raw.used,
        rejected: unsafe { rejected(raw.rejected, raw.rejected_count, rows)? },
        weak: (raw.weak != 0).then(String::new),
    })
}
