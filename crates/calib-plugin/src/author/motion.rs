//! The host's arrays as a borrowed [`Motion`].

use super::border::slice;
use crate::{
    abi,
    answer::Failure,
    motion::{Motion, Shape},
};

/// # Safety
/// `motion` is null or the host's, as the contract says, and lives as long as `'a`.
pub(super) unsafe fn view<'a>(motion: *const abi::Motion) -> Result<Motion<'a>, Failure> {
    // SAFETY: null or valid, as the caller says.
    let Some(raw) = (unsafe { motion.as_ref() }) else {
        return Err(Failure::Failed("the host gave no data".into()));
    };
    let shape = Shape::ALL
        .into_iter()
        .find(|shape| *shape as u32 == raw.shape)
        .ok_or_else(|| Failure::BadInput(format!("data of an unknown shape ({})", raw.shape)))?;
    let rows = raw
        .tracks
        .checked_mul(raw.samples)
        .ok_or_else(|| Failure::BadInput("more samples than there is memory".into()))?;
    // SAFETY: the host passes arrays of these sizes, or null; [f64; 3] and [[f64; 3]; 3] are 3 and 9 doubles.
    unsafe {
        Ok(Motion {
            shape,
            tracks: raw.tracks,
            samples: raw.samples,
            seen: slice(raw.seen, rows),
            points_m: slice(raw.points_m.cast(), rows),
            rotations: slice(raw.rotations.cast(), rows),
            translations_m: slice(raw.translations_m.cast(), rows),
            covariances_m2: (!raw.covariances_m2.is_null())
                .then(|| slice(raw.covariances_m2.cast(), rows)),
            angles_rad: (!raw.angles_rad.is_null()).then(|| slice(raw.angles_rad, raw.samples)),
            center_m: raw.center_m.cast::<[f64; 3]>().as_ref().copied(),
            towards: raw.towards.cast::<[f64; 3]>().as_ref().copied(),
            sigma_t_m: (raw.sigma_t_m > 0.0).then_some(raw.sigma_t_m),
            sigma_r_rad: (raw.sigma_r_rad > 0.0).then_some(raw.sigma_r_rad),
            significance: raw.significance,
            seed: raw.seed,
        })
    }
}

/// Null for an empty slice.
pub(super) fn pointer<T>(values: &[T]) -> *const T {
    if values.is_empty() {
        std::ptr::null()
    } else {
        values.as_ptr()
    }
}
