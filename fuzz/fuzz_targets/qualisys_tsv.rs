#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| calib_fuzz::read_as("qualisys_tsv", bytes));
