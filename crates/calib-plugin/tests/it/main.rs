//! The contract from both sides: plugins in C are built by the system's compiler, good ones and bad ones.
//!
//! Without a C compiler these tests say so and pass.

mod bad;
mod bed;
mod book;
mod border;
mod check;
mod compatible;
mod effect;
mod layout;
mod new_project;
mod parameters;
mod registry;
mod search;
mod shipped;
