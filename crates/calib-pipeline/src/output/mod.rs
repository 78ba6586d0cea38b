//! What a run leaves: the URDF, the scene, the pictures, the report as data, and the files.

pub mod assemble;
pub mod export;
pub mod shapes;
pub mod view;
