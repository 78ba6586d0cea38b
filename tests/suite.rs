//! The tests of the whole program, in one binary so that they share its threads: a module is a subject.
//! One subject: `cargo test -p calib-cli --test suite shown::`.

mod apply;
mod bad_input;
mod book;
mod changes;
mod clocks;
mod contacts;
mod data_faults;
mod drift;
mod effects;
mod facts;
mod fit;
mod hygiene;
mod inputs;
mod laboratory;
mod layering;
mod loads;
mod outputs;
mod plugins;
mod real_robots;
mod record;
mod robots;
mod scratch;
mod screens;
mod selection;
mod shown;
mod sizes;
mod streams;
mod structural;
mod studies;
mod third_robot;
mod truth;
mod tutorial;
mod urdf_out;
mod verdict;
