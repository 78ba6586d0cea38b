//! One binary for all tests of the renderers: what people and programs read, from three hand-made reports.

mod examples;
mod page;
mod renderers;
mod scenes;
