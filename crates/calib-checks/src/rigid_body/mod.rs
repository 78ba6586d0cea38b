//! A tracking body from three or more markers.
//!
//! The arrangement of the markers on the body (the *template*) is learned from all rows, also where some markers
//! are occluded, and put into a frame that depends on nothing but the markers' order:
//!
//! ```text
//! origin = m_1,   x̂ ∥ m_2 − m_1,   ŷ ∥ the part of m_3 − m_1 across x̂,   ẑ = x̂ × ŷ            (1)
//! ```
//!
//! (`m_3`: the first marker that is not on the line `m_1 m_2`). Each row's pose is the rigid registration of the
//! markers seen, if at least three are seen and do not lie on a line. With isotropic noise σ per coordinate its
//! covariance in the body frame is
//!
//! ```text
//! p_k = x · exp(ξ) · m_k:   J_k = [ −[m_k]ₓ  I ],   C = σ² ( Σ_k J_kᵀ J_k )⁻¹,   ξ = [ω; v]     (2)
//! ```
//!
//! Gower 1975, Psychometrika 40, 33–51 (generalized Procrustes); Kabsch 1976.

mod computed;
mod gross;
mod groups;
mod learn;
mod pose;
mod same;

pub use computed::computed_below;
pub(crate) use computed::decimal_grid;
pub use gross::Distances;
pub use groups::{rigid_groups, rigid_groups_of_files};
pub use learn::{MarkerFit, NotABody, Template};
pub use pose::{BodyPoses, RowPose, WithoutPose, body_from_markers, body_poses};
pub use same::is_pose_of;
