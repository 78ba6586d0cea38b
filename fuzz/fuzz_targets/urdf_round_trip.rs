//! A URDF: read, changed, read again, reverted.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(text) = std::str::from_utf8(bytes) {
        calib_fuzz::robot::urdf_round_trip(text);
    }
});
