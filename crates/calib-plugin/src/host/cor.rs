//! A loaded center estimator.

use super::{
    estimator::{Loaded, Raw, rejected},
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

impl Cor for Loaded<abi::CorResult> {
    fn offer(&self) -> Offer {
        self.offer.clone()
    }

    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
        self.fitted(motion, call)
    }
}

impl Raw for abi::CorResult {
    type Fit = CorFit;

    unsafe fn read(result: *const Self, tracks: usize, rows: usize) -> Result<CorFit, String> {
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

    fn weak(fit: &mut CorFit) -> Option<&mut String> {
        fit.weak.as_mut()
    }
}
