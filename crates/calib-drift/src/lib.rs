#![doc = include_str!("../README.md")]
//! # What is computed
//!
//! Each calibration k gives U_k with `U_kᵀU_k = J_kᵀJ_k`, the data's information without any prior, and the values x̃_k that
//! the data alone would give (see [`calib_report::DataInformation`]). The tracker and the bodies are placed again each
//! time: those columns are projected out. With A_k for the rest and y_k = A_k x̃_k, whitened,
//!
//! ```text
//! s = min over x of Σ_k |A_k x − y_k|²  ~  χ²(ν),   ν = rank A₁ + rank A₂ − rank [A₁; A₂]          (1)
//! z = (g₂ᵀx̃₂ − g₁ᵀx̃₁) / √(g₁ᵀC₁g₁ + g₂ᵀC₂g₂),   C_k = (U_kᵀU_k)⁺                                  (2)
//! ```
//!
//! if nothing changed. A_k and y_k are taken about x_ref, the mean of the two estimates, so that a gauge, which is a curve,
//! is straight between them. (1) asks whether *anything* that both data saw is different: no convention, no prior and no frame
//! enters. (2) asks it of one number that both data determine (g_k ⊥ null U_k). As the noise was estimated, χ² is F and z is Student's t,
//! with the degrees of freedom that Welch and Satterthwaite give for the two residuals together. False alarms of everything that is said together: [`FALSE_ALARMS`];
//! half of it for (1), half for all (2) by Holm's procedure.
//!
//! Parameters are displacements from a nominal URDF. Where the two calibrations start from different ones (the second from the URDF that
//! the first was applied to), (1) is asked of the numbers alone that do not depend on it: d = x̃₂ − x̃₁ of them, s = dᵀ (G₁C₁G₁ᵀ + G₂C₂G₂ᵀ)⁺ d.
//! The step to x̃ is linear; directions and numbers that a recording leaves open by more than 1° or 1 cm are left out, and said to be.
//!
//! What it does **not** protect against: what is the same in both recordings and was modeled in neither (backlash, heat)
//! may show up as a change where the poses differ.

mod compare;
mod error;
mod evidence;
mod freedom;
mod history;
mod render;
mod render_history;

pub use compare::{Changed, Drift, Joint, Undecided, compare};
pub use error::DriftError;
pub use evidence::{Evidence, Number};
pub use history::{Calibration, History, Track, Value, history};
pub use render::{json, text};
pub use render_history::{history_json, history_page, history_text};

use std::path::Path;

/// The probability that two calibrations of an unchanged robot are said to differ in anything.
pub const FALSE_ALARMS: f64 = 0.01;

/// Compares two reports, or folders of results.
///
/// # Errors
/// [`DriftError`] when one is not a report, holds no covariance, or belongs to another robot.
pub fn drift(old: &Path, new: &Path) -> Result<Drift, DriftError> {
    let read = |path: &Path| {
        let report = calib_report::read_report(path)?;
        Evidence::of(
            &report,
            &calib_report::report_path(path).display().to_string(),
        )
    };
    compare(&read(old)?, &read(new)?)
}
