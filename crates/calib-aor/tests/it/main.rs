//! The estimators of axes and frames of joints.

mod common;
mod coverage;
mod degenerate;
mod efficiency;
mod frames;
mod golden;
mod properties;
mod real_data;
mod short_arcs;
mod small_samples;
mod two_bodies;
mod two_solvers;
mod weights;
