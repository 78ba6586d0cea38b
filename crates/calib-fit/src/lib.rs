//! One estimator on one table of measurements, without a profile.
