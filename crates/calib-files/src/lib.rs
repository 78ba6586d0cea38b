#![doc = include_str!("../README.md")]

mod disk;
mod error;
#[cfg(test)]
mod fault;
mod file;
mod folder;
pub mod input;
mod name;
mod output;
mod results;
mod scratch;
mod staged;
mod state;
mod stream;
#[cfg(test)]
mod walk;

pub use error::{FileError, cannot_write};
pub use file::OutputFile;
pub use folder::{folder_of, make_folder};
pub use name::{LONGEST_NAME, MANIFEST, NameFault, check_name};
pub use output::{check_writable, new_folder, remove, replace, resume, start, write_new};
pub use results::{GrowingFile, ResultsFolder, is_unfinished, write_results};
pub use scratch::ScratchFolder;
pub use state::StateFile;
pub use stream::{Pieces, write_pieces};
