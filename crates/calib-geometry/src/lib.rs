//! Rigid-body geometry that every other crate trusts.
//!
//! Poses are `nalgebra::Isometry3<f64>` named `a_from_b`: they map coordinates in `b` to coordinates
//! in `a`. Twists are `ξ = [ω; v]` (rad, m) and act on the right:
//!
//! ```text
//! x ⊞ ξ = x · exp(ξ)          exp: R⁶ → SE(3)                                       (1)
//! exp([ω; v]) = (exp ω, V(ω) v),   V(ω) = left Jacobian of SO(3)                     (2)
//! Ad(x) = [ R 0 ; [t]ₓR R ],       x · exp(ξ) · x⁻¹ = exp(Ad(x) ξ)                   (3)
//! ```
//!
//! * [`so3`], [`se3`]: exponential, logarithm, adjoint and right Jacobians, accurate at 0, 1e-8 and near π.
//! * [`mod@line`]: lines in space and screw axes of motions.
//! * [`mean`]: the chordal mean of rotations and the sign-free mean of axes.
//! * [`decompose`]: the singular value and eigenvalue decompositions used for estimation.
//! * [`plausible`]: whether readings can be radians or meters.
//! * [`registration`]: the rigid motion between two corresponding point sets.
//! * [`row_qr`]: the triangular factor of tall matrices, row by row.
//! * [`statistics`]: medians and quantiles, each under the name of its definition.
//!
//! What this crate does not do: it never decides whether data suffice for an estimate; it returns
//! spectra and named degeneracies, and the estimators judge them.

pub mod decompose;
pub mod line;
pub mod mean;
pub mod pairs;
pub mod plausible;
pub mod registration;
pub mod row_qr;
pub mod se3;
pub mod so3;
pub mod statistics;

pub use nalgebra;

pub use line::{Line, ScrewAxis};
pub use se3::Twist;

/// The README's example is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
