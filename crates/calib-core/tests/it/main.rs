//! The solver and what is made of its result.

mod baseline;
mod change;
mod common;
mod dependence;
mod effects;
mod estimate;
mod flat;
mod gauges;
mod goodness;
mod jacobians;
mod justin;
mod laws;
mod limits;
mod long;
mod noise;
mod robust;
mod select;
mod spread;
mod starts;
mod tiago;
mod untested;
mod validate;
mod weigh;
mod widths;
