//! What loaded estimators of all kinds share: the arrays of a motion, the call, and where the result goes.

use std::ffi::c_void;

use super::{
    call::{Got, across},
    raw::array,
};
use crate::{
    abi,
    answer::{Answer, Failure},
    call::Call,
    motion::Motion,
    offer::Offer,
};

/// A result as it crosses the border.
pub(super) trait Raw: Sized {
    /// What it becomes.
    type Fit;

    /// Reads it. `tracks` and `rows` are those of the motion.
    ///
    /// # Safety
    /// `result` is null or a result of the contract.
    unsafe fn read(result: *const Self, tracks: usize, rows: usize) -> Result<Self::Fit, String>;

    /// The reason why the estimate is weak, where it is.
    fn weak(fit: &mut Self::Fit) -> Option<&mut String>;
}

/// A loaded estimator, whose sizes were verified by `Bound`.
pub(super) struct Loaded<R> {
    pub offer: Offer,
    pub fit: abi::Fit<R>,
}

/// Where a result goes; the sizes that it may have.
struct Target<T> {
    got: Got<T>,
    tracks: usize,
    rows: usize,
}

impl<R: Raw> Loaded<R> {
    /// Calls the estimator's function.
    pub fn fitted(&self, motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<R::Fit>, Failure> {
        let mut target = Target::<R::Fit> {
            got: Got::Nothing,
            tracks: motion.tracks,
            rows: motion.tracks * motion.samples,
        };
        let sink = abi::EstimatorSink {
            struct_size: abi::size::<abi::EstimatorSink<R>>(),
            reserved: 0,
            context: (&raw mut target).cast(),
            result: Some(take::<R>),
        };
        let raw = raw(motion);
        // SAFETY: all arguments are alive until the function returns. Sizes were verified by `Bound`, the only way here.
        let ended = across(call, |call| unsafe {
            (self.fit)(call, &raw const raw, &raw const sink)
        });
        Ok(match ended.with(target.got)? {
            Err(reason) => Answer::NotObservable(reason),
            Ok((mut fit, text)) => {
                if let Some(weak) = R::weak(&mut fit) {
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
}

unsafe extern "C" fn take<R: Raw>(context: *mut c_void, result: *const R) -> abi::Status {
    // SAFETY: the context of `fitted`, used by this thread only.
    let Some(target) = (unsafe { context.cast::<Target<R::Fit>>().as_mut() }) else {
        return abi::FAILED;
    };
    // SAFETY: a result of the contract, alive until this function returns.
    let fit = unsafe { R::read(result, target.tracks, target.rows) };
    target.got.take(fit)
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
