//! A model that was chosen by `calib run --select`.

use std::collections::BTreeMap;

use calib_core::{NestedError, Problem};
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
    /// Values of its parameters by name: where the trial of the choice ended.
    pub values: BTreeMap<String, f64>,
    /// Its noise levels, σ² per group; empty where its noise from pose to pose is not as the profile states it.
    pub levels: Vec<f64>,
}

impl Chosen {
    /// Lets a fit of the chosen model begin where its trial ended.
    pub(crate) fn start(&self, problem: &mut Problem) {
        for (name, value) in &self.values {
            if let Some(id) = problem.find_parameter(name) {
                problem.parameter_mut(id).start = *value;
            }
        }
    }

    /// The choice with the factor that it widens the standard deviations of the fit by.
    #[must_use]
    pub fn fitted(self, fit: Option<&MlFit>) -> Selection {
        Selection {
            sigma_factor: fit.and_then(|fit| fit.widened),
            ..self.selection
        }
    }
}
