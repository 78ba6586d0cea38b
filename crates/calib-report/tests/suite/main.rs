//! One binary for all tests of the renderers: what people and programs read, from three hand-made reports.

mod browser;
mod examples;
mod glb;
mod mcap;
mod page;
mod parts;
mod renderers;
mod scenes;
mod verdict_facts;
mod verdicts;
