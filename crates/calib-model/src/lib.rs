//! A calibrated robot at work: where its links are with all joint effects, how certain that is, and which command moves its tool to
//! where the nominal model would have it.
//!
//! ```text
//! load_i = a_i · Σ (h_k + m_k (o_k − o_i)) × g       over the links k that joint i carries, nominal geometry          (1)
//! φ_i = q_i + Σ_t c_t F_t(q_i, load_i, …),   θ_i = Σ_t e_t c_t F_t,   δ_i = p_i Σ_t c_t F_t                             (2)
//! root_from_link = Π_i parent_from_joint_i · Trans(δ_i) · exp(S_i φ_i) · Exp(θ_i)                                                 (3)
//! Cov = (G R)(G R)ᵀ,   G = ∂[ω; v]/∂numbers,   R: root of the covariance in the file                                 (4)
//! root_from_tool(q_command) = nominal root_from_tool(q_desired)                                                      (5)
//! ```
//!
//! Equation (2) is evaluated by [`effect`] and [`motion`], which the solver uses too. [`Model`] is read from
//! `<robot>.calibrated.model.json` ([`mod@file`]); it never changes. What changes from call to call is a [`Work`], one for each thread:
//! after it was made, no call allocates. Positions `q` are in the order of [`Model::joints`], rad or m, as the controller reads them.
//! Twists are `[ω; v]` in the frame of the link that is asked for; lengths m, angles rad.
//!
//! It does **not** know: dynamics, contact, temperature beyond the growth of links ([`Under::temperature_c`]), and postures outside the recorded range ([`Model::scope`] says so).
//!
//! ```
//! use calib_model::{Model, Options, Under};
//! # let text = include_str!("../tests/it/arm.model.json");
//! let model = Model::from_json(text.as_bytes())?;
//! let mut work = model.work();
//! let q = [0.3, -0.5];
//! let tool = model.link("tool")?;
//!
//! model.forward(&q, &Under::default(), &mut work)?;
//! let there = work.root_from_link(tool);
//!
//! let mut command = [0.0; 2];
//! let done = model.correct(&q, tool, &Options::default(), &Under::default(), &mut work, &mut command)?;
//! assert!(done.outcome.is_usable());
//! # assert!(there.t.norm() > 0.1);
//! # Ok::<(), calib_model::ModelError>(())
//! ```

pub use nalgebra;

mod approach;
pub mod axis;
mod c;
mod correct;
pub mod effect;
mod error;
pub mod file;
mod forward;
mod jacobian;
mod model;
pub mod motion;
mod origin;
pub mod pose;
mod read;
mod spread;
pub mod unit;

pub use approach::Approach;
pub use correct::{Aim, Correction, Options, Outcome};
pub use error::ModelError;
pub use forward::{Under, Work};
pub use model::{FindOutside, JointInfo, LinkId, Model, Place, STOOD_STILL, Scope};
pub use pose::Pose;

/// The README's example is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
