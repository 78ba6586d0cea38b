//! A loaded joint effect.

use std::ffi::c_void;

use super::{
    call::{Got, across},
    raw::array,
};
use crate::{
    abi,
    answer::Failure,
    call::Call,
    effect::{Coefficient, DependsOn, EffectTerm, JointStates},
    kinds::JointEffect,
    offer::Offer,
};

pub(super) struct LoadedEffect {
    pub offer: Offer,
    pub term: EffectTerm,
    pub regressors: abi::Regressors,
}

/// What the table of an effect states.
///
/// # Errors
/// A text that names the number which is wrong.
pub(super) fn term(raw: &abi::Effect1) -> Result<EffectTerm, String> {
    let depends_on = DependsOn::from_number(raw.depends_on)
        .ok_or_else(|| format!("depends_on is {}, which there is not", raw.depends_on))?;
    let coefficient = Coefficient::from_number(raw.coefficient)
        .ok_or_else(|| format!("coefficient is {}, which there is not", raw.coefficient))?;
    if !(raw.prior_sigma > 0.0 && raw.prior_sigma.is_finite()) {
        return Err(format!(
            "prior_sigma is {}, not a number above 0",
            raw.prior_sigma
        ));
    }
    Ok(EffectTerm {
        depends_on,
        coefficient,
        prior_sigma: raw.prior_sigma,
        revolute_only: raw.revolute_only != 0,
    })
}

struct Target {
    got: Got<Vec<f64>>,
    samples: usize,
}

impl JointEffect for LoadedEffect {
    fn offer(&self) -> Offer {
        self.offer.clone()
    }

    fn term(&self) -> EffectTerm {
        self.term
    }

    fn regressors(&self, states: &JointStates<'_>, call: &Call<'_>) -> Result<Vec<f64>, Failure> {
        fn pointer(values: &[f64]) -> *const f64 {
            match values.is_empty() {
                true => std::ptr::null(),
                false => values.as_ptr(),
            }
        }
        let raw = abi::JointStates {
            struct_size: abi::size::<abi::JointStates>(),
            prismatic: i32::from(states.prismatic),
            samples: states.samples(),
            readings: states.readings.as_ptr(),
            motor_rad: pointer(states.motor_rad),
            loads: pointer(states.loads),
            approaches: pointer(states.approaches),
        };
        let mut target = Target {
            got: Got::Nothing,
            samples: states.samples(),
        };
        let sink = abi::EffectSink {
            struct_size: abi::size::<abi::EffectSink>(),
            reserved: 0,
            context: (&raw mut target).cast(),
            result: Some(take),
        };
        // SAFETY: all arguments are alive until the function returns. Sizes were verified by `Bound`, the only way here.
        let ended = across(call, |call| unsafe {
            (self.regressors)(call, &raw const raw, &raw const sink)
        });
        match ended.with(target.got)? {
            Ok((values, _)) => Ok(values),
            Err(_) => Err(Failure::Contract(
                "a joint effect cannot say `not observable`".into(),
            )),
        }
    }
}

unsafe extern "C" fn take(context: *mut c_void, values: *const f64, count: usize) -> abi::Status {
    // SAFETY: the context of `regressors`, used by this thread only.
    let Some(target) = (unsafe { context.cast::<Target>().as_mut() }) else {
        return abi::FAILED;
    };
    let taken = if count == target.samples {
        // SAFETY: the plugin's array, alive until this function returns.
        unsafe { array("regressors", values, count) }.map(<[f64]>::to_vec)
    } else {
        Err(format!("{count} regressors for {} samples", target.samples))
    };
    target.got.take(taken)
}
