//! The command line of calib.

fn main() {}
