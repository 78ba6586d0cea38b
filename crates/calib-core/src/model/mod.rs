//! A stated problem compiled: which unknown stands where, and the pose of one frame in another at given values.

pub(crate) mod cache;
pub(crate) mod derived;
pub(crate) mod joint;
pub(crate) mod layout;
pub(crate) mod null_space;
pub(crate) mod parts;
pub(crate) mod path;
pub(crate) mod values;
pub(crate) mod walk;

pub(crate) use calib_model::pose;
