//! A loaded axis estimator.

use super::{
    estimator::{Loaded, Raw, rejected},
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

impl Aor for Loaded<abi::AorResult> {
    fn offer(&self) -> Offer {
        self.offer.clone()
    }

    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<AorFit>, Failure> {
        self.fitted(motion, call)
    }
}

impl Raw for abi::AorResult {
    type Fit = AorFit;

    unsafe fn read(result: *const Self, _tracks: usize, rows: usize) -> Result<AorFit, String> {
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

    fn weak(fit: &mut AorFit) -> Option<&mut String> {
        fit.weak.as_mut()
    }
}
