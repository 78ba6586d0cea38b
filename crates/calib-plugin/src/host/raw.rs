//! Reading what a plugin points at: sizes first, then no more than both sides know.

use std::ffi::{c_char, c_void};

/// Longest text of the contract.
const LONGEST_TEXT: usize = 65_535;

/// Size of the fields up to and including `$field`: what a struct that ends there must have.
macro_rules! size_to {
    ($type:ty, $field:ident) => {{
        // The size of a field from a function that takes a pointer to it.
        const fn size<T, F>(_: fn(&T) -> &F) -> usize {
            size_of::<F>()
        }
        std::mem::offset_of!($type, $field) + size::<$type, _>(|s| &s.$field)
    }};
}
pub(super) use size_to;

/// Copies a struct of `stated` bytes; fields beyond are zero. Fields that this side does not know are left out.
///
/// # Errors
/// A text when the pointer cannot be one or the struct is shorter than `needed`.
///
/// # Safety
/// `pointer` is null or valid for `stated` bytes, and `T` is a C struct for which all zeros are a value.
pub(super) unsafe fn prefix<T: Copy>(
    what: &str,
    pointer: *const c_void,
    stated: usize,
    needed: usize,
) -> Result<T, String> {
    if pointer.is_null() {
        return Err(format!("{what} is null"));
    }
    if !pointer.cast::<T>().is_aligned() {
        return Err(format!("{what} is at an address that is not aligned"));
    }
    if stated < needed {
        return Err(format!(
            "{what} has {stated} bytes, needs at least {needed}"
        ));
    }
    let mut value = std::mem::MaybeUninit::<T>::zeroed();
    // SAFETY: both sides are valid for the smaller of the two sizes and do not overlap; all zeros are a value.
    unsafe {
        std::ptr::copy_nonoverlapping(
            pointer.cast::<u8>(),
            value.as_mut_ptr().cast::<u8>(),
            stated.min(size_of::<T>()),
        );
        Ok(value.assume_init())
    }
}

/// The `struct_size` that a struct begins with.
///
/// # Errors
/// A text when the pointer cannot be one.
///
/// # Safety
/// `pointer` is null or valid for four bytes.
pub(super) unsafe fn stated_size(what: &str, pointer: *const c_void) -> Result<usize, String> {
    // SAFETY: as the caller says.
    unsafe { prefix::<u32>(what, pointer, 4, 4) }.map(|size| size as usize)
}

/// A struct that begins with its own size.
///
/// # Errors
/// As [`prefix`].
///
/// # Safety
/// `pointer` is null or a struct of the contract.
pub(super) unsafe fn sized<T: Copy>(
    what: &str,
    pointer: *const c_void,
    needed: usize,
) -> Result<T, String> {
    // SAFETY: as the caller says.
    unsafe {
        let stated = stated_size(what, pointer)?;
        prefix(what, pointer, stated, needed)
    }
}

/// A text of the plugin, copied.
///
/// # Errors
/// A text when it is null, too long or not UTF-8.
///
/// # Safety
/// `pointer` is null or a text that ends with zero.
pub(super) unsafe fn text(what: &str, pointer: *const c_char) -> Result<String, String> {
    if pointer.is_null() {
        return Err(format!("{what} is null"));
    }
    let mut size = 0;
    // SAFETY: stops at the zero that the contract promises within this length.
    while unsafe { *pointer.add(size) } != 0 {
        size += 1;
        if size > LONGEST_TEXT {
            return Err(format!("{what} does not end within {LONGEST_TEXT} bytes"));
        }
    }
    // SAFETY: these bytes have just been read.
    let bytes = unsafe { std::slice::from_raw_parts(pointer.cast::<u8>(), size) };
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text.to_string()),
        Err(_) => Err(format!(
            "{what} is not UTF-8: {:?}",
            String::from_utf8_lossy(bytes)
        )),
    }
}

/// `count` values of the plugin; empty for none.
///
/// # Errors
/// A text when there should be values and the pointer cannot be one.
///
/// # Safety
/// `pointer` is null or valid for `count` values while the result is used.
pub(super) unsafe fn array<'a, T>(
    what: &str,
    pointer: *const T,
    count: usize,
) -> Result<&'a [T], String> {
    if count == 0 {
        return Ok(&[]);
    }
    if pointer.is_null() || !pointer.is_aligned() {
        return Err(format!(
            "{what} points nowhere, but {count} values are stated"
        ));
    }
    if count > isize::MAX as usize / size_of::<T>().max(1) {
        return Err(format!(
            "{what} has {count} values, more than there is memory"
        ));
    }
    // SAFETY: not null, aligned, not too long, and the caller says that it is valid.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}
