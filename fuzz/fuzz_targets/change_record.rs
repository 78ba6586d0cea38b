//! A change record in the first line, then the text that it belongs to.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(text) = std::str::from_utf8(bytes) {
        calib_fuzz::robot::change_record(text);
    }
});
