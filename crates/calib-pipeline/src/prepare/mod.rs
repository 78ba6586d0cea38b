//! From a profile to checked inputs: robot, recordings, clocks, tracks of bodies.

pub mod align;
pub mod checks;
pub mod clock;
pub mod conditions;
pub mod inspect;
pub mod load;
pub mod loads;
pub mod model_checks;
pub(crate) mod paths;
pub mod readers;
pub mod relabel;
pub mod streams;
pub mod tracks;
