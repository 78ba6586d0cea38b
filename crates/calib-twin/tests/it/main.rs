//! The public interface of the crate.

mod replays;
mod robots;
mod studies;
mod twins;
mod unlike;
