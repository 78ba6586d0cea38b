//! What the estimators of centers, axes, frames and hand-eye transforms share.
//!
//! * [`measured`]: samples with gaps, poses, marker tracks and the gathered cloud, checked once.
//! * [`Input`], [`Options`], [`EstimatorError`]: what an estimator is given and what it refuses.
//! * [`Outcome`], [`Verdict`]: an estimate with its verdict, or why there is none.
//! * [`EstimatorInfo`]: one entry of a table of estimators, with the options that it uses; [`mod@parameter`] says which of them a
//!   profile can set.
//! * [`mod@factor`], [`pose_sums`]: the sums that planes, spheres and shared axes need.
//! * [`mod@noise`]: a noise level, stated or seen, and whether both agree.
//! * [`levenberg`]: the minimizer of small problems on a manifold. [`chance`]: tail probabilities.
//!
//! # One registry
//!
//! `calib-cor`, `calib-aor` and `calib-handeye` each hold one constant table of [`EstimatorInfo`] per [`Kind`]. Every caller finds an
//! estimator in it with [`find`] and calls it with [`EstimatorInfo::run`], which refuses data of another kind and options that the
//! estimator does not use, and lets no non-finite number out:
//!
//! ```text
//! calib fit, --all, --list      table ── find(id) ── run(input, options)
//! profile                       plugin tables ── built-in: adapter on the same entry ── run
//!                                             └─ plugin: its own library
//! ```
//!
//! The plugin ABI is known only to the adapter in the pipeline. An estimator of one's own needs an entry and a function:
//!
//! ```
//! use calib_estimator::{
//!     Estimate, EstimatorError, EstimatorInfo, Input, InputKind, Kind, OptionId, Options, Outcome, Verdict, find,
//! };
//! use nalgebra::Point3;
//!
//! /// The mean of the points.
//! #[derive(Debug, Clone, PartialEq, serde::Serialize)]
//! struct Mean(Point3<f64>);
//!
//! impl Estimate for Mean {
//!     type Known = ();
//!     const NOTHING: () = ();
//!     fn estimator(&self) -> &'static str {
//!         "mean"
//!     }
//!     fn verdict(&self) -> Verdict {
//!         Verdict::Ok
//!     }
//!     fn reason(&self) -> Option<&str> {
//!         None
//!     }
//!     fn is_finite(&self) -> bool {
//!         self.0.iter().all(|v| v.is_finite())
//!     }
//! }
//!
//! fn mean(input: &Input<'_>, _: &Options) -> Result<Outcome<Mean>, EstimatorError> {
//!     let Input::Points([track, ..]) = *input else {
//!         return Err(input.wrong(InputKind::Points));
//!     };
//!     let seen: Vec<_> = track.iter().flatten().collect();
//!     if seen.is_empty() {
//!         return Ok(Outcome::none("mean", Verdict::TooFew, "no sample".to_owned(), ()));
//!     }
//!     let sum: nalgebra::Vector3<f64> = seen.iter().map(|p| p.coords).sum();
//!     Ok(Outcome::Estimate(Box::new(Mean(Point3::from(sum / seen.len() as f64)))))
//! }
//!
//! static TABLE: [EstimatorInfo<Mean>; 1] = [EstimatorInfo {
//!     id: "mean",
//!     name: "mean of the points",
//!     input: InputKind::Points,
//!     options: &[OptionId::SigmaT],
//!     summary: "the mean of all points of one marker",
//!     source: "",
//!     fit: mean,
//! }];
//!
//! let track = [vec![Some(Point3::new(1.0, 0.0, 0.0)), None, Some(Point3::new(3.0, 0.0, 0.0))]];
//! let outcome = find(Kind::Center, &TABLE, "mean")?.run(&Input::Points(&track), &Options::default())?;
//! assert!(outcome.estimate().is_some_and(|m| m.0.x == 2.0));
//! assert!(find(Kind::Center, &TABLE, "maen").is_err());
//! # Ok::<(), EstimatorError>(())
//! ```

pub mod chance;
mod error;
pub mod factor;
mod frame;
mod input;
mod kind;
pub mod levenberg;
pub mod measured;
pub mod noise;
mod option_id;
mod options;
mod outcome;
pub mod parameter;
pub mod pose_sums;
mod registry;
pub mod verdict;

pub use error::{EstimatorError, Rule};
pub use frame::{FrameAxes, FrameAxis, FrameSample, PlaneFit};
pub use input::{CenterBy, Input, cloud_of};
pub use kind::{InputKind, Kind};
pub use nalgebra;
pub use option_id::OptionId;
pub use options::Options;
pub use outcome::{Estimate, NotObservable, Outcome};
pub use parameter::{Parameter, Value};
pub use registry::{EstimatorInfo, Fit, find};
pub use verdict::Verdict;

/// The README's example is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
