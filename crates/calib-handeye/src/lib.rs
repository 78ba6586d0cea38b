//! Hand–eye calibration: `A_i X = Z B_i` (robot–world) and `A X = X B`, with a certificate.
//!
//! ```text
//! f(X, Z) = Σ_i w_R ‖R_A R_X − R_Z R_B‖²_F + w_t ‖R_A t_X + t_A − R_Z t_B − t_Z‖²             (1)
//! ```
//!
//! With the translations eliminated f is a quadratic form `rᵀQr`, r = [vec R_X; vec R_Z; 1] ∈ R¹⁹, over
//! quadratic constraints C_k (orthonormal rows and columns, right-handedness). At a local optimum r* the
//! multipliers follow by least squares from
//!
//! ```text
//! H(λ) r* = 0,   H(λ) = Q + Σ_k λ_k C_k − γ E,   ‖r‖² = 7                                    (2)
//! f* − f_min ≤ 7·max(0, −λ_min(H)) + (f* − γ)                                               (3)
//! ```
//!
//! so a positive semidefinite H proves that no other pair of rotations is better. The closed form starts from
//! the linear problem and projects onto SO(3); Gauss–Newton on (1) finishes. Statistical weighting with
//! body-frame noise is the business of a solver over a graph of frames (one pose measurement per row); (1) is the
//! quadratic cost that can be certified.
//!
//! The estimators of the table ([`estimators`]) also judge: noise and covariance from the residuals, rows with gross errors, and
//! structural mistakes of the tables (order of quaternions, inverted poses, units, shifted rows), each verified by applying its correction.
//!
//! Lengths of two scales, and a body or tracker that was moved between two rows, are fitted beside X and Z and named.
//!
//! Where the poses fit inverted as well, as any three do, the direction is said to be open.
//!
//! What this does not protect against: swapped tables, which leave no residual. X and Z come out as their inverses.
//!
//! ```
//! use calib_handeye::{HandEyeWeights, solve_ax_zb};
//! use nalgebra::{Isometry3, Vector3};
//!
//! let x = Isometry3::new(Vector3::new(0.05, 0.0, 0.1), Vector3::new(0.0, 0.3, 0.0));
//! let z = Isometry3::new(Vector3::new(1.0, -0.5, 0.2), Vector3::new(0.1, 0.0, 1.2));
//! let base_from_flange: Vec<_> = (0..8)
//!     .map(|i| f64::from(i))
//!     .map(|i| Isometry3::new(Vector3::new(0.1 * i, 0.02 * i * i, 0.3), Vector3::new(0.2 * i, 0.1 * i * i, 0.3)))
//!     .collect();
//! let tracker_from_body: Vec<_> = base_from_flange.iter().map(|a| z.inverse() * a * x).collect();
//! let found = solve_ax_zb(&base_from_flange, &tracker_from_body, HandEyeWeights::default())?;
//! assert!((found.x.translation.vector - x.translation.vector).norm() < 1e-9);
//! assert!(found.certified);
//! # Ok::<(), calib_handeye::HandEyeError>(())
//! ```

mod by_input;
mod certificate;
mod correction;
mod direction;
mod dual_quaternion;
mod gross;
mod input;
mod judge;
mod minimum;
mod moving;
mod options;
mod outcome;
mod problem;
mod registry;
mod relative;
mod residuals;
mod simulated;
mod start;
mod structure;
mod unmodelled;

pub use correction::{Correction, Explanation, Side};
pub use direction::OpenDirection;
pub use input::HandEyeError;
pub use moving::solve_ax_zb;
pub use nalgebra;
pub use options::HandEyeInfo;
pub use outcome::{Covariance, HandEye, HandEyeNoise};
pub use problem::HandEyeWeights;
pub use registry::{estimator, estimators};
pub use relative::{relative_motions, solve_ax_xb};
pub use residuals::Residuals;
pub use structure::explained_as_written;

/// The README's example is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
