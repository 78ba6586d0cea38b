//! The pipeline between its stages.

mod forward;
mod hand_eye_by_graph;
mod model_file;
mod never_worse;
mod one_model;
mod two_routes;
