//! Axis of rotation (AoR) of a one-degree-of-freedom joint, and the frame of a joint with two axes.
//!
//! ```text
//! points:  n·(x_pk − c) = h_p,  ‖(I − n nᵀ)(x_pk − c)‖ = r_p     for sample k of marker p        (1)
//! markers: v_ip = c + F Rz(θ_i) β_p                             a rigid body on a hinge         (2)
//! poses:   R_i a_child = a_parent,  R_i x_child + t_i = x_parent  for the axis's points           (3)
//! frame:   world_from_body_i = W · Rot(proximal, α_i) · Rot(distal, β_i) · joint_from_body       (4)
//! ```
//!
//! Find the line (n, c), or the frame, its covariance, and whether the data determine it at all. Lengths are in the
//! unit of the input (m inside `calib`), angles in rad. An axis has no sign of its own: joint angles give it one where
//! they are known, a reference direction where it is given.
//!
//! ```
//! use calib_aor::{Input, Options, fit};
//! use nalgebra::{Point3, Vector3};
//!
//! // A quarter circle around the z axis through (1, 2, ·).
//! let sample = |k: u32| {
//!     let angle = f64::from(k) * 0.15;
//!     Some(Point3::new(1.0 + 0.1 * angle.cos(), 2.0 + 0.1 * angle.sin(), 0.5))
//! };
//! let marker = vec![(0..10).map(sample).collect::<Vec<_>>()];
//! let outcome = fit("planar_radial_gn", &Input::Points(&marker), &Options::default())?;
//! let estimate = outcome.estimate().expect("a quarter circle determines its axis");
//! assert!(estimate.line.direction.cross(&Vector3::z()).norm() < 1e-9);
//! assert!((estimate.circles[0].center - Point3::new(1.0, 2.0, 0.5)).norm() < 1e-9);
//! # Ok::<(), calib_aor::EstimatorError>(())
//! ```
//!
//! "The data cannot answer" is a result ([`Outcome::NotObservable`]) with a verdict and a reason in numbers. What this does
//! not protect against: a joint that slides along its axis while it turns, and markers that are not rigid to the limb.

mod axis_frame;
pub mod bounds;
mod circles;
pub mod frame;
mod frame_grid;
pub mod frame_ml;
pub mod frame_planes;
mod frame_settings;
pub mod halvorsen;
pub mod hinge_bundle;
pub mod hinge_poses;
mod judge;
pub mod line_ml;
mod options;
mod outcome;
pub mod planar_radial;
pub mod plane;
mod products;
mod registry;
pub mod robust_frame;
pub mod robust_line;
pub mod shared_axis;
mod straight;

pub use calib_estimator::measured::{DataError, Pose, Tracks};
pub use calib_estimator::{
    EstimatorError, FrameAxes, FrameAxis, FrameSample, Input, InputKind, OptionId, Options,
    PlaneFit, Verdict,
};
pub use frame::{FrameEstimate, FrameFromAxes, FrameOutcome, frame_from_axes};
pub use frame_planes::{Center, CenterOf};
pub use options::{EstimatorInfo, FrameInfo};
pub use outcome::{AorEstimate, Circle, Known, NotObservable, Outcome};
pub use registry::{estimator, estimators, fit, frame_estimator, frame_estimators};
