//! The minimum of the stated problem: rows, normal equations, steps, noise, robust weights.

pub(crate) mod bounded;
pub(crate) mod chunks;
pub(crate) mod components;
pub(crate) mod compressed;
pub(crate) mod contraction;
pub(crate) mod curvature;
pub(crate) mod dense;
pub(crate) mod equations;
pub(crate) mod kept_rows;
pub(crate) mod minimize;
pub(crate) mod noise;
pub(crate) mod normal;
pub(crate) mod panel;
pub(crate) mod parted;
pub(crate) mod predicted;
pub(crate) mod relabel;
pub(crate) mod robust;
pub(crate) mod rows;
pub(crate) mod six_rows;
pub(crate) mod step;
pub(crate) mod structured;
pub(crate) mod turned;
pub(crate) mod whitened;
