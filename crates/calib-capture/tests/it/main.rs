//! Tests of calib-capture through its public interface: with senders of our own on this computer's own network.

mod follow;
mod fuzz_seeds;
mod loopback;
mod order;
mod plain;
mod senders;
mod session;
mod still;
mod table;
mod vrpn;
