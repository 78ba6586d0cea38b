//! A VRPN server's stream. The first byte says in what pieces it arrives.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| calib_fuzz::stream(bytes));
