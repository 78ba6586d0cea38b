//! The library's public interface.

mod approach;
mod common;
mod correct;
mod forward;
mod hostile;
mod slopes;
