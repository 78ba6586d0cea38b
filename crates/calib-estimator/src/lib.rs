//! What the estimators of centers, axes, frames and hand-eye transforms share.
//!
//! * [`measured`]: samples with gaps, poses, marker tracks and the gathered cloud, checked once.
//! * [`Input`], [`Options`], [`EstimatorError`]: what an estimator is given and what it refuses.
//! * [`Outcome`], [`Verdict`]: an estimate with its verdict, or why there is none.
//! * [`EstimatorInfo`]: one entry of a table of estimators, with the options that it uses. [`Registry`]: all estimators by name.
//! * [`mod@factor`], [`pose_sums`]: the sums that planes, spheres and shared axes need.
//! * [`levenberg`]: the minimizer of small problems on a manifold. [`chance`]: tail probabilities.

mod by_name;
pub mod chance;
mod error;
pub mod factor;
mod frame;
mod input;
pub mod levenberg;
pub mod measured;
mod options;
mod outcome;
pub mod parameter;
pub mod pose_sums;
mod registry;
pub mod verdict;

pub use by_name::{
    About, Answer, AxisFit, CenterFit, FrameFit, HandEyeFit, Named, Registry, Table,
};
pub use error::{EstimatorError, Fault, Rule};
pub use frame::{FrameAxes, FrameAxis, FrameSample, PlaneFit};
pub use input::{CenterBy, Input, InputKind, cloud_of};
pub use nalgebra;
pub use options::{OptionId, Options};
pub use outcome::{Estimate, NotObservable, Outcome};
pub use parameter::{Parameter, ParameterError, Parameters, Value};
pub use registry::{EstimatorInfo, Fit, Kind, find};
pub use verdict::Verdict;

/// The README's example is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
