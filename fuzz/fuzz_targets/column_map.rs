//! Somebody else's table. The first line is the column map as JSON, the rest is the table.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| calib_fuzz::read_mapped(bytes));
