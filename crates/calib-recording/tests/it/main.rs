//! Tests of calib-recording through its public interface.

mod bad_tables;
mod bags;
mod blank_rows;
mod fixtures;
mod fuzz_seeds;
mod map_faults;
mod mapped;
mod mutations;
mod real_formats;
mod real_tables;
mod tables;
mod unit_rows;

/// Property tests that are the same on every run.
fn fixed_seed() -> proptest::test_runner::Config {
    proptest::test_runner::Config {
        rng_seed: proptest::test_runner::RngSeed::Fixed(20_110),
        failure_persistence: None,
        ..Default::default()
    }
}
