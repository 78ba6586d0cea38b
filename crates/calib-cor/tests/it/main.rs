//! The estimators of centers of rotation.

mod common;
mod coverage;
mod degenerate;
mod depth;
mod efficiency;
mod golden;
mod outliers;
mod properties;
mod real_data;
mod small_samples;
mod weights;
