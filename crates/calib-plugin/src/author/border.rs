//! What all functions of a plugin's border share: the call, the text, the stop for panics.

use std::{
    ffi::{CStr, CString, c_char},
    panic::{AssertUnwindSafe, catch_unwind},
};

use crate::{
    abi,
    answer::Failure,
    call::Call,
    offer::{Offer, Value},
};

/// What a call ended with: the status, and a text to go with it.
pub(super) type Ended = Result<(abi::Status, Option<String>), Failure>;

/// The text without zero bytes, which C cannot carry.
pub(super) fn c_text(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}

/// A text of the host.
///
/// # Safety
/// `text` is null or ends with zero, and lives as long as `'a`.
pub(super) unsafe fn host_text<'a>(text: *const c_char) -> Result<&'a str, Failure> {
    if text.is_null() {
        return Ok("");
    }
    // SAFETY: not null, and the caller says that it ends with zero.
    unsafe { CStr::from_ptr(text) }
        .to_str()
        .map_err(|_| Failure::Failed("the host gave a text that is not UTF-8".into()))
}

/// A slice from a pointer and a length; empty for null.
///
/// # Safety
/// `pointer` is null or valid for `count` values during `'a`.
pub(super) unsafe fn slice<'a, T>(pointer: *const T, count: usize) -> &'a [T] {
    if pointer.is_null() || count == 0 {
        return &[];
    }
    // SAFETY: not null, and the caller says that it is valid for `count` values.
    unsafe { std::slice::from_raw_parts(pointer, count) }
}

/// The host's callbacks, which it allows from any thread.
struct Callbacks(abi::Call);
// SAFETY: the contract lets `cancelled` and `progress` be called from any thread while the function runs.
unsafe impl Sync for Callbacks {}

/// Runs an author's code: makes the [`Call`], stops panics, writes the text, returns the status.
///
/// # Safety
/// `call` is null or the host's, as the contract says.
pub(super) unsafe fn guarded(
    offer: fn() -> &'static Offer,
    call: *const abi::Call,
    body: impl FnOnce(&Call<'_>) -> Ended,
) -> abi::Status {
    if call.is_null() {
        return abi::FAILED;
    }
    // SAFETY: not null, and every host since 1.0 has all fields of this struct.
    let callbacks = Callbacks(unsafe { *call });
    let raw = &callbacks.0;
    // The closures must capture the whole struct, which is `Sync`, and not its fields.
    let shared = &callbacks;
    let ended = catch_unwind(AssertUnwindSafe(|| {
        let parameters = &offer().parameters;
        // SAFETY: the host passes `value_count` values.
        let values = unsafe { slice(raw.values, raw.value_count) };
        if values.len() != parameters.len() {
            return Err(Failure::Failed(format!(
                "the host gave {} values for {} parameters",
                values.len(),
                parameters.len()
            )));
        }
        let values = values
            .iter()
            .map(|value| {
                Ok(match value.kind {
                    abi::BOOL => Value::Bool(value.flag != 0),
                    abi::INTEGER => Value::Integer(value.integer),
                    abi::NUMBER => Value::Number(value.number),
                    // SAFETY: a text of the host.
                    _ => Value::Text(unsafe { host_text(value.text) }?.to_string()),
                })
            })
            .collect::<Result<Vec<_>, Failure>>()?;
        let cancelled = move || {
            let Callbacks(raw) = shared;
            // SAFETY: called while the function runs, with the host's context.
            raw.cancelled
                .is_some_and(|ask| unsafe { ask(raw.context) } != 0)
        };
        let progress = move |fraction: f64, text: &str| {
            let Callbacks(raw) = shared;
            if let Some(tell) = raw.progress {
                let text = c_text(text);
                // SAFETY: called while the function runs, with the host's context; the host copies the text.
                unsafe { tell(raw.context, fraction, text.as_ptr()) }
            }
        };
        body(&Call::new(parameters, &values, &cancelled, &progress))
    }));
    let (status, text) = match ended {
        Ok(Ok(ended)) => ended,
        Ok(Err(failure)) => {
            let status = match &failure {
                Failure::BadInput(_) => abi::BAD_INPUT,
                Failure::BadParameter(_) => abi::BAD_PARAMETER,
                Failure::Cancelled => abi::CANCELLED,
                Failure::Failed(_) | Failure::Contract(_) => abi::FAILED,
                Failure::Panicked(_) => abi::PANICKED,
            };
            (status, Some(failure.to_string()))
        }
        Err(payload) => {
            let text = match payload.downcast::<&str>() {
                Ok(text) => text.to_string(),
                Err(payload) => match payload.downcast::<String>() {
                    Ok(text) => *text,
                    Err(unknown) => {
                        // The drop of a foreign payload could panic again, across the border.
                        std::mem::forget(unknown);
                        "without a text".to_string()
                    }
                },
            };
            (abi::PANICKED, Some(text))
        }
    };
    if let Some(text) = text {
        // SAFETY: the buffer is the host's, `text_size` bytes long, and this is the thread of the call.
        unsafe { say(raw, &text) };
    }
    status
}

/// Writes a text into the host's buffer, cut to what fits.
///
/// # Safety
/// `call.text` is null or valid for `call.text_size` bytes.
unsafe fn say(call: &abi::Call, text: &str) {
    if call.text.is_null() || call.text_size == 0 {
        return;
    }
    let bytes = text.as_bytes();
    let mut size = bytes.len().min(call.text_size - 1);
    while !text.is_char_boundary(size) {
        size -= 1;
    }
    // SAFETY: `size` < `text_size`, and the buffers do not overlap.
    unsafe {
        std::ptr::copy_nonoverlapping(bytes.as_ptr(), call.text.cast::<u8>(), size);
        *call.text.add(size) = 0;
    }
}

/// The status of a sink as a result.
pub(super) fn accepted(status: Option<abi::Status>) -> Result<(), Failure> {
    match status {
        Some(abi::OK) => Ok(()),
        Some(_) => Err(Failure::Failed("the host refused the result".into())),
        None => Err(Failure::Failed("the host takes no such result".into())),
    }
}
