//! A loaded center estimator.

use std::ffi::c_void;

use super::{
    call::{Got, across},
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

/// Where a result goes; the sizes that it may have.
pub(super) struct Target<T> {
    pub got: Got<T>,
    pub tracks: usize,
    pub rows: usize,
}

impl Cor for LoadedCor {
    fn offer(&self) -> Offer {
        self.offer.clone()
    }

    fn fit(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
        let mut target: Target<CorFit> = Target {
            got: Got::Nothing,
            tracks: motion.tracks,
            rows: motion.tracks * motion.samples,
        };
        let sink = abi::CorSink {
            struct_size: abi::size::<abi::CorSink>(),
            reserved: 0,
            context: (&raw mut target).cast(),
            result: Some(take),
        };
        let raw = raw(motion);
        // SAFETY: all arguments are alive until the function returns. Sizes were verified by `Bound`, the only way here.
        let ended = across(call, |call| unsafe {
            (self.fit)(call, &raw const raw, &raw const sink)
        });
        Ok(match ended.with(target.got)? {
            Err(reason) => Answer::NotObservable(reason),
            Ok((mut fit, text)) => {
                if fit.weak.is_some() {
                    fit.weak = Some(if text.is_empty() {
                        "the plugin gave no reason".into()
                    } else {
                        text
                    });
                }
                Answer::Found(fit)
            }
        })
    }
}

/// The arrays of a motion that was verified.
pub(super) fn raw(motion: &Motion<'_>) -> abi::Motion {
    fn pointer<T>(values: &[T]) -> *const f64 {
        if values.is_empty() {
            std::ptr::null()
        } else {
            values.as_ptr().cast()
        }
    }
    fn vector(vector: Option<&[f64; 3]>) -> *const f64 {
        vector.map_or(std::ptr::null(), |v| v.as_ptr())
    }
    abi::Motion {
        struct_size: abi::size::<abi::Motion>(),
        shape: motion.shape as u32,
        tracks: motion.tracks,
        samples: motion.samples,
        seen: motion.seen.as_ptr(),
        points_m: pointer(motion.points_m),
        rotations: pointer(motion.rotations),
        translations_m: pointer(motion.translations_m),
        covariances_m2: motion.covariances_m2.map_or(std::ptr::null(), pointer),
        angles_rad: motion.angles_rad.map_or(std::ptr::null(), pointer),
        center_m: vector(motion.center_m.as_ref()),
        towards: vector(motion.towards.as_ref()),
        sigma_t_m: motion.sigma_t_m.unwrap_or(0.0),
        sigma_r_rad: motion.sigma_r_rad.unwrap_or(0.0),
        significance: motion.significance,
        seed: motion.seed,
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

/// Pairs (track, sample).
///
/// # Safety
/// `pairs` is null or valid for `2 · count` numbers.
pub(super) unsafe fn rejected(
    pairs: *const usize,
    count: usize,
    rows: usize,
) -> Result<Vec<[usize; 2]>, String> {
    if count > rows {
        return Err(format!("{count} samples rejected of {rows}"));
    }
    // SAFETY: as the caller says.
    Ok(unsafe { array("rejected", pairs.cast::<[usize; 2]>(), count)? }.to_vec())
}
