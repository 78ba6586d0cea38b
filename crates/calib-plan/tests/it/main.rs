//! Designs, candidates, orders and whole plans.

mod cameras;
mod cell;
mod design;
mod follow;
mod plans;
mod reached;
mod robots;
mod shape;
mod speed;
mod touching;
