//! What a run leaves: the URDF, the scene, the pictures, the report as data, and the files.

pub mod assemble;
mod counts;
pub mod evidence;
pub(crate) mod exit;
pub mod export;
mod facts;
pub(crate) mod files;
pub mod model_file;
pub(crate) mod of_data;
mod of_fit;
mod open;
mod points;
pub mod scene;
pub mod shapes;
mod verdict;
pub mod view;
pub mod weak;
mod widths;
mod written;
