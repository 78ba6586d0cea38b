//! Structural hypotheses: what, if it were wrong, would explain the data.
//!
//! Row i has joint readings, from which the nominal robot gives the pose `root_from_link = (R_i, t_i)` of the link that a body is
//! mounted on, and measured points y_ik of the body's markers in the tracker frame. With correct data and a perfect robot
//!
//! ```text
//! Q y_ik + c = R_i m_k + t_i        (Q, c) = root_from_tracker,  m_k the marker in its link            (1)
//! ```
//!
//! A hypothesis h (a wrong sign, exchanged columns, a wrong unit, …) changes the readings, the points or the claimed link. It is
//! scored by the residual of the best *registration*, the robot at its nominal geometry:
//!
//! ```text
//! f_h = min over Q ∈ SO(3), c, m_k of  Σ w_ik |Q y_ik + c − R_i m_k − t_i|²                            (2)
//! rms_h = √(3 f_h / (3 Σ w − 6 − 3 points))
//! ```
//!
//! A full fit with free geometry would absorb most faults; a registration cannot, and it is linear in everything but Q. With
//! x = [vec Q; c], z̃ = [y; 1], D = z̃ᵀ ⊗ I the sums over the rows that see marker k are exact, lost samples or not:
//!
//! ```text
//! W = Σ w,  B = Σ w Rᵀ D,  u = Σ w Rᵀ t,  m_k = (B x − u)/W                                            (3)
//! H = Σ_k (Σ w z̃ z̃ᵀ ⊗ I − BᵀB/W),   g = Σ_k (−Σ w Dᵀ t + Bᵀu/W),   f = xᵀ H x + 2 gᵀ x + d            (4)
//! c = −H_cc⁻¹ (H_cq q + g_c),          f(Q) = qᵀ A q + 2 bᵀ q + d'                                     (5)
//! ```
//!
//! (5) is minimized by Newton on SO(3) from the linear minimum and the best two of the 24 cube rotations. Sums of recordings add
//! up, so that each hypothesis in one recording only, or in all but one, costs a solution of (5) and no further pass over the
//! rows. Bodies share (Q, c) and have markers of their own; a pose counts as four points at the arm σ_position/σ_orientation.
//!
//! Hypotheses that multiply measured coordinates by s are compared by the density of what was measured:
//! `ln score = ln rms − share · ln s`.
//!
//! **Decision.** A hypothesis is named where it divides the score of the data as they are by 1.5 or more, and no further hypothesis
//! does so after it was applied; else the likeliest beside errors of the robot is asked for, and pairs are tried. Where few
//! samples are left, a single bad row is the rival. What the design cannot tell apart from the winner is found on
//! noise-free twins and named with it. Where nothing is named, a change at one row is looked for ([`Jump`]), and the readings of each joint are left out in turn ([`WrongReadings`]). Gross outliers are screened under the leading hypotheses, by the one with
//! the smallest robust scale, never under one alone. Gains and fractional couplings are found by score tests.
//!
//! What this module does not do: it fits no geometry and writes no sentence; it lists the rows that deviate ([`deviations`]), and the caller judges them; the outcome is data.
//!
//! ```
//! use calib_checks::structural::{explain, Data, DataError, Decision, Options};
//!
//! fn suspicious(data: &Data) -> Result<bool, DataError> {
//!     let outcome = explain(data, &Options::default())?;
//!     Ok(!matches!(outcome.decision, Decision::Consistent { .. }) || outcome.continuous.is_some())
//! }
//! ```

mod apply;
mod axes;
mod candidates;
mod chain;
mod channels;
mod continuous;
mod correct;
mod data;
mod decide;
mod expected;
mod few;
mod further;
mod hypothesis;
mod ids;
mod jump;
mod likelihood;
mod linear;
mod lost;
mod mirror;
mod moments;
mod moved;
mod naming;
mod nonlinear;
mod order;
mod outcome;
mod pairs;
mod ranking;
mod readings;
mod registration;
mod rotation;
mod rounding;
mod rows;
mod scan;
mod score;
mod screen;
mod sized;
mod special;
mod swept;
mod tested;
mod thinning;
mod twin;
mod units;
mod whitened;

pub use apply::{apply, apply_all};
pub use chain::{Chain, ChainError, ChainJoint, Motion};
pub use continuous::Continuous;
pub use data::{Body, Data, DataError, Measured};
pub use decide::{explain, registration_residual};
pub use hypothesis::{Direction, Hypothesis, PoseMistake, QuarterTurns, Scope, Scoped};
pub use ids::{BodyIndex, JointIndex, LinkIndex, RecordingIndex, SampleIndex};
pub use jump::{Jump, Moved, Size};
pub use likelihood::{KnownNoise, log_odds};
pub use order::{ColumnOrder, Columns};
pub use outcome::{
    Allowing, Correction, Decision, Design, Evidence, Expected, Named, Options, Outcome,
};
pub use readings::WrongReadings;
pub use registration::{PointRows, Registered, registration, registrations};
pub use rotation::axes_rotation;
pub use rounding::{Rounding, by_rounding_alone, rounding};
pub use rows::{Deviation, Deviations, deviations};
pub use thinning::thin;
pub use units::{Length, TRACKER_UNITS, UnitMistake};
