//! The calibrated robot's model file.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| calib_fuzz::robot::model_file(bytes));
