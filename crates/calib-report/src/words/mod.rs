//! The one place where the data of a result become sentences: one file per notion.
//!
//! The report's data carry facts: ids, enums, values with their SI unit. What a person reads about a fact is made here and
//! nowhere else; renderers only lay it out, and no code reads a sentence back. A new fact gets its words in the file of its
//! notion, or a new file and one line below.

pub(crate) mod accuracy;
pub(crate) mod answers;
pub(crate) mod budget;
pub(crate) mod check;
pub(crate) mod clock;
pub(crate) mod dh;
pub(crate) mod diagnosis;
pub(crate) mod files;
pub(crate) mod fit;
pub(crate) mod headline;
pub(crate) mod held_out;
mod limit;
mod next_steps;
pub(crate) mod noise;
pub(crate) mod observability;
pub(crate) mod physics;
pub(crate) mod prose;
mod rejected_for;
pub(crate) mod rejection;
pub(crate) mod remarks;
pub(crate) mod robot;
pub(crate) mod scope;
pub(crate) mod selection;
mod terms;
pub(crate) mod transforms;
pub(crate) mod verdict;
pub(crate) mod weak;
