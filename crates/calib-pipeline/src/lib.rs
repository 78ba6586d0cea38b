//! The stages of a calibration, in order.
