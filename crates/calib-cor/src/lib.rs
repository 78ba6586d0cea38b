//! Center of rotation (CoR) of a ball joint, or of a joint with several axes through one point.
//!
//! ```text
//! points:  |x_pk − m| = r_p                        for every sample k of marker p            (1)
//! poses:   R_i p + t_i = o                         for every pose world_from_body_i          (2)
//! markers: o + R_i b_p = v_ip                      a rigid body with unknown layout b         (3)
//! bodies:  R_i c₁ + t_i = S_i c₂ + d_i             both sides of the joint move              (4)
//! ```
//!
//! Find the center (m, o, or c) in the tracker's frame, its covariance, and whether the data determine it at
//! all. Lengths are in the unit of the input (m inside `calib`), angles in rad; every estimator is invariant
//! to the unit, to rigid motion of the tracker's frame, to far origins and to the order of samples.
//!
//! ```
//! use calib_cor::{Input, Options, fit};
//! use nalgebra::Point3;
//!
//! // The corners of a cube around (1, 2, 3).
//! let corner = |i: u32| Some(Point3::new(
//!     1.0 + if i & 1 == 0 { 0.1 } else { -0.1 },
//!     2.0 + if i & 2 == 0 { 0.1 } else { -0.1 },
//!     3.0 + if i & 4 == 0 { 0.1 } else { -0.1 },
//! ));
//! let marker = vec![(0..8).map(corner).collect::<Vec<_>>()];
//! let outcome = fit("sfe", &Input::Points(&marker), &Options::default())?;
//! let estimate = outcome.estimate().expect("a cube determines its center");
//! assert!((estimate.center - Point3::new(1.0, 2.0, 3.0)).norm() < 1e-12);
//! # Ok::<(), calib_cor::EstimatorError>(())
//! ```
//!
//! "The data cannot answer" is a result ([`Outcome::NotObservable`]) with a verdict, a reason in numbers, and what
//! is still known: a sweep about one axis determines a line, not a point. The test is statistical, against the noise in
//! the data: an exact one-axis sweep and a noisy one give the same verdict. What it does not protect against: a
//! joint whose axes do not meet has no center, and residuals near the noise do not show it.

pub mod algebraic;
pub mod ball_bundle;
pub mod bend;
pub mod bounds;
pub mod gamage;
pub mod hotspot;
pub mod hotspot_mixture;
pub mod hotspot_ml;
pub mod hyper_n;
mod noise_ratio;
mod options;
mod outcome;
mod pivot;
mod registry;
pub mod robust;
pub mod score;
mod seeded;
pub mod sfa;
mod sphere;
pub mod sphere_eiv;
pub mod sphere_ml;
mod systematic;

pub use calib_estimator::measured::{DataError, Pose, Tracks};
pub use calib_estimator::{EstimatorError, Input, InputKind, OptionId, Options, Verdict};
pub use options::EstimatorInfo;
pub use outcome::{
    CorEstimate, Known, Noise, NotObservable, Outcome, RejectReason, Rejected, Shape,
};
pub use registry::{estimator, estimators, fit};
