//! The plugin contract, its host and the Rust side for authors.
