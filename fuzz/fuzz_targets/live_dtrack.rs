//! Datagrams from the network: the tracker's, and the robot's joint values.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| calib_fuzz::datagram(bytes));
