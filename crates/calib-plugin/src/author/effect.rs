//! The border of a joint effect.

use super::border::{accepted, guarded, slice};
use crate::{
    abi, answer::Failure, call::Call, effect::JointStates, kinds::JointEffect, offer::Offer,
};

/// `regressors` of `calib_effect_1`.
///
/// # Safety
/// The pointers are the host's, as the contract says.
pub unsafe fn regressors(
    it: &dyn JointEffect,
    offer: fn() -> &'static Offer,
    call: *const abi::Call,
    states: *const abi::JointStates,
    sink: *const abi::EffectSink,
) -> abi::Status {
    let body = |call: &Call<'_>| {
        // SAFETY: the host's, valid until this function returns.
        let (Some(raw), Some(sink)) = (unsafe { (states.as_ref(), sink.as_ref()) }) else {
            return Err(Failure::Failed("the host gave no states or no sink".into()));
        };
        // SAFETY: as above.
        let states = unsafe {
            JointStates {
                prismatic: raw.prismatic != 0,
                readings: slice(raw.readings, raw.samples),
                motor_rad: slice(raw.motor_rad, raw.samples),
                loads: slice(raw.loads, raw.samples),
                approaches: slice(raw.approaches, raw.samples),
            }
        };
        let values = it.regressors(&states, call)?;
        // SAFETY: the sink is the host's; the values live until the callback returns.
        let given = sink
            .result
            .map(|give| unsafe { give(sink.context, values.as_ptr(), values.len()) });
        accepted(given)?;
        Ok((abi::OK, None))
    };
    // SAFETY: the call is the host's.
    unsafe { guarded(offer, call, body) }
}
