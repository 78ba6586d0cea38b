//! The profile and the recordings as one likelihood problem.

pub mod bad_rows;
pub mod by_closed_forms;
pub mod by_likelihood;
pub mod checked;
pub mod chosen;
pub mod clock;
pub(crate) mod completed;
pub mod contacts;
pub mod formulation;
pub mod found;
pub(crate) mod gear_ratio;
pub mod kinematics;
pub(crate) mod memory;
pub mod ml;
pub mod model_checks;
pub(crate) mod noise;
pub mod parts;
pub(crate) mod priors;
pub mod realign;
pub mod row_checks;
pub mod selection;
pub mod solved;
pub(crate) mod starts;
pub mod structural;
mod wanted;
pub mod without_effects;
