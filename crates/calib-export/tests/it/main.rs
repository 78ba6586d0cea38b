//! Predictions, corrections and exports of robots by chance.

mod arms;
mod exports;
mod names;
mod tables;

/// Robots by chance.
#[path = "../../../calib-model/tests/it/common.rs"]
#[allow(dead_code)]
mod common;
