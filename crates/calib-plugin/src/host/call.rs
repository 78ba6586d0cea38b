//! One call from the host's side: cancellation, progress, values, the buffer for texts.

use std::{
    ffi::{CString, c_char, c_void},
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use crate::{abi, answer::Failure, call::Call, offer::Value};

/// Longest text that a call can give back, with its zero.
const TEXT_SIZE: usize = 2048;

/// A wish to stop, shared between the one who wishes and the call that is to stop.
#[derive(Debug, Clone, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// Nobody wishes to stop yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Stop.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// True after [`Cancel::cancel`].
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Is told how far, 0 to 1, and at what; from any thread.
pub type Progress<'a> = dyn Fn(f64, &str) + Sync + 'a;

/// How the caller watches and stops a call. The default: nobody does.
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    /// Asked by the call every now and then.
    pub cancel: Option<&'a Cancel>,
    /// Told how far, 0 to 1, and at what; from any thread.
    pub progress: Option<&'a Progress<'a>>,
}

impl<'a> Control<'a> {
    /// A call that can be cancelled.
    #[must_use]
    pub fn cancelled_by(cancel: &'a Cancel) -> Self {
        Self {
            cancel: Some(cancel),
            progress: None,
        }
    }
}

unsafe extern "C" fn cancelled(context: *mut c_void) -> i32 {
    // SAFETY: the context of `across`, alive while the plugin's function runs; `Call` may be shared between threads.
    let Some(call) = (unsafe { context.cast::<Call<'_>>().as_ref() }) else {
        return 1;
    };
    // A panic in the caller's function stops the call.
    catch_unwind(AssertUnwindSafe(|| i32::from(call.keep_going().is_err()))).unwrap_or(1)
}

unsafe extern "C" fn progress(context: *mut c_void, fraction: f64, text: *const c_char) {
    // SAFETY: as in `cancelled`.
    let Some(call) = (unsafe { context.cast::<Call<'_>>().as_ref() }) else {
        return;
    };
    if !fraction.is_finite() {
        return;
    }
    let text = if text.is_null() {
        String::new()
    } else {
        // SAFETY: not null, and it ends with zero.
        unsafe { super::raw::text("progress", text) }.unwrap_or_default()
    };
    // A panic in the caller's function must not cross the plugin; the call goes on.
    let _ = catch_unwind(AssertUnwindSafe(|| {
        call.progress(fraction.clamp(0.0, 1.0), &text)
    }));
}

/// What a plugin's function ended with.
pub(super) struct Ended {
    status: abi::Status,
    text: String,
}

/// Calls a plugin's function.
pub(super) fn across(
    call: &Call<'_>,
    function: impl FnOnce(*const abi::Call) -> abi::Status,
) -> Ended {
    let mut texts = Vec::new();
    let values: Vec<abi::Value> = call
        .values()
        .iter()
        .map(|value| {
            let mut out = abi::Value {
                kind: 0,
                flag: 0,
                integer: 0,
                number: 0.0,
                text: std::ptr::null(),
            };
            match value {
                Value::Bool(flag) => (out.kind, out.flag) = (abi::BOOL, i32::from(*flag)),
                Value::Integer(integer) => (out.kind, out.integer) = (abi::INTEGER, *integer),
                Value::Number(number) => (out.kind, out.number) = (abi::NUMBER, *number),
                Value::Text(text) => {
                    // Zero bytes were refused with the parameters.
                    let text = CString::new(text.as_str()).unwrap_or_default();
                    (out.kind, out.text) = (abi::TEXT, text.as_ptr());
                    texts.push(text);
                }
            }
            out
        })
        .collect();
    let mut buffer = [0_u8; TEXT_SIZE];
    let raw = abi::Call {
        struct_size: abi::size::<abi::Call>(),
        reserved: 0,
        values: values.as_ptr(),
        value_count: values.len(),
        text: buffer.as_mut_ptr().cast(),
        text_size: TEXT_SIZE,
        context: std::ptr::from_ref(call).cast_mut().cast(),
        cancelled: Some(cancelled),
        progress: Some(progress),
    };
    let status = function(&raw const raw);
    let size = buffer.iter().position(|b| *b == 0).unwrap_or(TEXT_SIZE);
    let text = String::from_utf8_lossy(&buffer[..size])
        .trim()
        .replace(['\n', '\r'], " ");
    Ended { status, text }
}

/// What came through a sink.
pub(super) enum Got<T> {
    Nothing,
    One(T),
    Broken(String),
}

impl<T> Got<T> {
    /// Takes one result; a second one, or one that breaks the contract, spoils it.
    pub(super) fn take(&mut self, result: Result<T, String>) -> abi::Status {
        *self = match (std::mem::replace(self, Self::Nothing), result) {
            (Self::Broken(problem), _) | (_, Err(problem)) => Self::Broken(problem),
            (Self::Nothing, Ok(one)) => Self::One(one),
            (Self::One(_), Ok(_)) => Self::Broken("two results from one call".into()),
        };
        if matches!(self, Self::One(_)) {
            abi::OK
        } else {
            abi::FAILED
        }
    }
}

impl Ended {
    /// A result that counts, with the text beside it; or the reason why the data cannot answer; or what failed.
    pub(super) fn with<T>(self, got: Got<T>) -> Result<Result<(T, String), String>, Failure> {
        if let Got::Broken(problem) = got {
            return Err(Failure::Contract(problem));
        }
        let or = |other: &str| {
            if self.text.is_empty() {
                other.to_string()
            } else {
                self.text.clone()
            }
        };
        match (self.status, got) {
            (abi::OK, Got::One(one)) => Ok(Ok((one, self.text))),
            (abi::OK, _) => Err(Failure::Contract("it said OK and gave no result".into())),
            (abi::NOT_OBSERVABLE, _) => Ok(Err(or("the plugin gave no reason"))),
            (abi::BAD_INPUT, _) => Err(Failure::BadInput(or("refused without a reason"))),
            (abi::BAD_PARAMETER, _) => Err(Failure::BadParameter(or("refused without a reason"))),
            (abi::CANCELLED, _) => Err(Failure::Cancelled),
            (abi::FAILED, _) => Err(Failure::Failed(or("failed without a reason"))),
            (abi::PANICKED, _) => Err(Failure::Panicked(or("without a text"))),
            (other, _) => Err(Failure::Contract(format!("unknown status {other}"))),
        }
    }
}
