//! The solver and what is made of its result.

mod baseline;
mod change;
mod common;
mod dependence;
mod effects;
mod estimate;
mod flat;
mod gauges;
mod gear_ratio;
mod goodness;
mod jacobians;
mod justin;
mod laws;
mod limits;
mod long;
mod noise;
mod own_levels;
mod robust;
mod select;
mod spread;
mod starts;
mod tiago;
mod untested;
mod validate;
mod weigh;
mod widths;
