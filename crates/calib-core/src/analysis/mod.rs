//! What a minimum means: covariance, observability, goodness of fit, prediction of new poses.

pub(crate) mod admit;
pub(crate) mod bounds;
pub(crate) mod change;
pub(crate) mod closure;
pub(crate) mod compare;
pub(crate) mod dependence;
pub(crate) mod estimate;
pub(crate) mod folds;
pub(crate) mod gauge;
pub(crate) mod goodness;
pub(crate) mod information;
mod less_noise;
mod looked_at;
pub(crate) mod observability;
pub(crate) mod sandwich;
pub(crate) mod score;
pub(crate) mod scores;
pub(crate) mod select;
pub(crate) mod settings;
pub(crate) mod solution;
pub(crate) mod spread;
mod standardized;
pub(crate) mod starts;
pub(crate) mod untested;
pub(crate) mod validate;
pub(crate) mod weigh;
pub(crate) mod widths;
