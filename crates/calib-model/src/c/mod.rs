//! The library for C: `include/calib_model.h`, function by function.
//!
//! Nothing unwinds across this border: a panic becomes a status. Pointers are checked for null; that they point to as many numbers as
//! the header says is the caller's part.
#![allow(unsafe_code)] // It speaks C: raw pointers become references here and nowhere else.
#![allow(clippy::too_many_arguments)] // The border has no structs of references.

mod calls;

use std::ffi::{CStr, CString, c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::approach::Approach;
use crate::error::ModelError;
use crate::forward::Work;
use crate::model::Model;

/// `CALIB_MODEL_OK` and the other values of `calib_model_status`.
mod status {
    use std::ffi::c_int;
    pub const OK: c_int = 0;
    pub const OUT_OF_SCOPE: c_int = 1;
    pub const NEARER: c_int = 2;
    pub const NOT_REACHED: c_int = 3;
    pub const BEYOND_LIMITS: c_int = 4;
    pub const BAD_FILE: c_int = -1;
    pub const BAD_ARGUMENT: c_int = -2;
    pub const NO_UNCERTAINTY: c_int = -3;
    pub const FAILED: c_int = -4;
}

/// `calib_model`.
#[allow(missing_docs)]
pub struct CModel {
    model: Model,
    joints: Vec<CString>,
    links: Vec<CString>,
}

/// `calib_model_work`.
#[allow(missing_docs)]
pub struct CWork {
    work: Work,
    approach: Approach,
    /// Of the link before each joint, °C.
    temperature_c: Vec<f64>,
}

fn status_of(error: &ModelError) -> c_int {
    match error {
        ModelError::Syntax { .. } | ModelError::Version { .. } | ModelError::Value { .. } => {
            status::BAD_FILE
        }
        ModelError::NoUncertainty => status::NO_UNCERTAINTY,
        _ => status::BAD_ARGUMENT,
    }
}

/// A call whose errors and panics become a status.
fn guarded(call: impl FnOnce() -> Result<c_int, ModelError>) -> c_int {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(done)) => done,
        Ok(Err(error)) => status_of(&error),
        Err(_) => status::FAILED,
    }
}

/// References from what a caller gives; an error for null.
mod given {
    use super::ModelError;

    const NULL: ModelError = ModelError::Length {
        what: "pointer",
        found: 0,
        expected: 1,
    };

    pub(super) unsafe fn shared<'a, T>(pointer: *const T) -> Result<&'a T, ModelError> {
        // SAFETY: the header asks for a valid pointer or null.
        unsafe { pointer.as_ref() }.ok_or(NULL)
    }

    pub(super) unsafe fn unique<'a, T>(pointer: *mut T) -> Result<&'a mut T, ModelError> {
        // SAFETY: the header asks for a valid pointer of this thread alone, or null.
        unsafe { pointer.as_mut() }.ok_or(NULL)
    }

    pub(super) unsafe fn numbers<'a>(p: *const f64, n: usize) -> Result<&'a [f64], ModelError> {
        if p.is_null() {
            return Err(NULL);
        }
        // SAFETY: the header asks for as many numbers.
        Ok(unsafe { std::slice::from_raw_parts(p, n) })
    }

    pub(super) unsafe fn room<'a>(p: *mut f64, n: usize) -> Result<&'a mut [f64], ModelError> {
        if p.is_null() {
            return Err(NULL);
        }
        // SAFETY: the header asks for room for as many numbers, of this thread alone.
        Ok(unsafe { std::slice::from_raw_parts_mut(p, n) })
    }
}

/// Puts a text with its closing 0 into a caller's buffer, cut to its size.
unsafe fn put(text: &str, buffer: *mut c_char, size: usize) {
    if buffer.is_null() || size == 0 {
        return;
    }
    let bytes = text.as_bytes();
    let n = bytes.len().min(size - 1);
    // SAFETY: n + 1 ≤ size bytes, which the header asks for.
    unsafe {
        std::ptr::copy_nonoverlapping(bytes.as_ptr(), buffer.cast(), n);
        *buffer.add(n) = 0;
    }
}

/// Reads a model from the text of a file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_load(
    json: *const c_char,
    length: usize,
    model: *mut *mut CModel,
    message: *mut c_char,
    message_size: usize,
) -> c_int {
    let call = || -> Result<c_int, ModelError> {
        let out = unsafe { given::unique(model) }?;
        *out = std::ptr::null_mut();
        let json = unsafe { given::shared(json.cast::<u8>()) }?;
        // SAFETY: the header asks for `length` bytes.
        let bytes = unsafe { std::slice::from_raw_parts(json, length) };
        let read = Model::from_json(bytes)?;
        let c = |name: &str| CString::new(name.replace('\0', " ")).unwrap_or_default();
        let boxed = Box::new(CModel {
            joints: read.joints().iter().map(|j| c(&j.name)).collect(),
            links: read.links().iter().map(|l| c(l)).collect(),
            model: read,
        });
        *out = Box::into_raw(boxed);
        Ok(status::OK)
    };
    let done = catch_unwind(AssertUnwindSafe(call));
    let (code, text) = match done {
        Ok(Ok(code)) => (code, String::new()),
        Ok(Err(error)) => (status_of(&error), error.to_string()),
        Err(_) => (status::FAILED, "internal error".to_owned()),
    };
    unsafe { put(&text, message, message_size) };
    code
}

/// Frees a model; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_free(model: *mut CModel) {
    if !model.is_null() {
        // SAFETY: it came from `calib_model_load`, and is freed once.
        drop(unsafe { Box::from_raw(model) });
    }
}

/// Number of joints that the controller moves.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_joints(model: *const CModel) -> usize {
    unsafe { model.as_ref() }.map_or(0, |m| m.joints.len())
}

/// Number of links.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_links(model: *const CModel) -> usize {
    unsafe { model.as_ref() }.map_or(0, |m| m.links.len())
}

/// Name of a joint, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_joint_name(model: *const CModel, i: usize) -> *const c_char {
    let name = unsafe { model.as_ref() }.and_then(|m| m.joints.get(i));
    name.map_or(std::ptr::null(), |n| n.as_ptr())
}

/// Name of a link, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_link_name(model: *const CModel, i: usize) -> *const c_char {
    let name = unsafe { model.as_ref() }.and_then(|m| m.links.get(i));
    name.map_or(std::ptr::null(), |n| n.as_ptr())
}

/// Index of a link.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_link(
    model: *const CModel,
    name: *const c_char,
    link: *mut usize,
) -> c_int {
    guarded(|| {
        let model = unsafe { given::shared(model) }?;
        unsafe { given::shared(name) }?;
        // SAFETY: the header asks for a text that ends with 0.
        let name = unsafe { CStr::from_ptr(name) }.to_string_lossy();
        *unsafe { given::unique(link) }? = model.model.link(&name)?.0;
        Ok(status::OK)
    })
}

/// Every link is as warm as where the model's lengths hold.
fn reference(model: &Model) -> Vec<f64> {
    vec![model.reference_temperature_c(); model.joints().len()]
}

/// Working memory for one thread, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_work_new(model: *const CModel) -> *mut CWork {
    let made = catch_unwind(AssertUnwindSafe(|| {
        let model = unsafe { model.as_ref() }?;
        Some(Box::new(CWork {
            work: model.model.work(),
            approach: Approach::new(&model.model),
            temperature_c: reference(&model.model),
        }))
    }));
    made.ok()
        .flatten()
        .map_or(std::ptr::null_mut(), Box::into_raw)
}

/// Frees working memory; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn calib_model_work_free(work: *mut CWork) {
    if !work.is_null() {
        // SAFETY: it came from `calib_model_work_new`, and is freed once.
        drop(unsafe { Box::from_raw(work) });
    }
}
