//! What loaded estimators of all kinds share: the arrays of a motion, the call, and where the result goes.

use super::{
    call::{Got, across},
    raw::array,
};
use crate::{
    abi,
    answer::{Answer, Failure},
    call::Call,
    motion::Motion,
};

/// A result that may be weak.
pub(super) trait Fitted {
    /// The reason why it is weak, where it is.
    fn weak(&mut self) -> Option<&mut String>;
}

/// Where a result goes; the sizes that it may have.
pub(super) struct Target<T> {
    pub got: Got<T>,
    pub tracks: usize,
    pub rows: usize,
}

/// Calls an estimator's function, which is given the call, the arrays and where the result goes.
pub(super) fn fitted<F: Fitted>(
    motion: &Motion<'_>,
    call: &Call<'_>,
    function: impl FnOnce(*const abi::Call, *const abi::Motion, *mut Target<F>) -> abi::Status,
) -> Result<Answer<F>, Failure> {
    let mut target = Target {
        got: Got::Nothing,
        tracks: motion.tracks,
        rows: motion.tracks * motion.samples,
    };
    let raw = raw(motion);
    let ended = across(call, |call| function(call, &raw const raw, &raw mut target));
    Ok(match ended.with(target.got)? {
        Err(reason) => Answer::NotObservable(reason),
        Ok((mut fit, text)) => {
            if let Some(weak) = fit.weak() {
                *weak = if text.is_empty() {
                    "the plugin gave no reason".into()
                } else {
                    text
                };
            }
            Answer::Found(fit)
        }
    })
}

/// The arrays of a motion that was verified.
fn raw(motion: &Motion<'_>) -> abi::Motion {
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
