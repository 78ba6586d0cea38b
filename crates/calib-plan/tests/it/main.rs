//! Designs, candidates, orders and whole plans.

mod design;
mod plans;
mod reached;
mod robots;
mod shape;
mod speed;
