//! A model that was chosen by `calib run --select`.

use calib_core::NestedError;
use calib_profile::Solve;
use calib_report::Selection;

use crate::formulate::formulation::MlFit;

/// What was chosen: what to solve for, and how it was found.
#[derive(Debug, Clone)]
pub struct Chosen {
    /// The profile's choice with the parts that were added.
    pub solve: Solve,
    /// How it was found.
    pub selection: Selection,
    /// What it costs in folds; `None` where nothing was added or there are too few poses.
    pub nested: Option<NestedError>,
}

impl Chosen {
    /// The choice with the factor that it widens the standard deviations of the fit by.
    #[must_use]
    pub fn fitted(self, fit: Option<&MlFit>) -> Selection {
        Selection {
            sigma_factor: fit.and_then(|fit| fit.widened),
            ..self.selection
        }
    }
}
