#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| calib_fuzz::read_as("ros2_mcap", bytes));
