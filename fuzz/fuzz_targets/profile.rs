//! A profile, checked against a shipped robot.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(text) = std::str::from_utf8(bytes) {
        calib_fuzz::robot::profile(text);
    }
});
