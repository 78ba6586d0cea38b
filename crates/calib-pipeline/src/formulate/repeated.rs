//! The fit of recordings that a robot of the same kind gives in the same postures, stated as an earlier fit chose it.
//!
//! What is found by comparing whole fits is taken over: which noise levels there are, and that the joints scatter. Levels, values, widths of priors and
//! covariance are found from the new recordings. No mistake in the data is looked for.

use calib_core::{NoiseModel, Settings};

use crate::formulate::by_likelihood::ml_result;
use crate::formulate::checked::Checked;
use crate::formulate::formulation::{Formulation, FreeSet, MlFit};
use crate::formulate::memory::with_memory;
use crate::formulate::solved::Solved;
use crate::formulate::{clock, ml, noise, priors};
use crate::prepare::inputs::Inputs;

/// Whether the noise of a fit is as its statement says: what follows from several fits together, as the covariance of an estimate under the noise of
/// another, is not repeated.
#[must_use]
pub fn is_repeatable(fit: &MlFit) -> bool {
    let as_stated = fit.noise.as_ref().is_none_or(|choice| {
        let admitted = choice.admission.is_some_and(|a| a.readmitted > 0);
        choice.chosen == NoiseModel::Joint && choice.swallowed.is_none() && !admitted
    });
    as_stated && fit.widened.is_none()
}

/// The fit, from where the earlier one ended, with the memory of its noise looked for where that one had it. `None` where the recordings do not show the
/// same parameters, or the fit cannot be evaluated.
pub(crate) fn repeated(
    inputs: &mut Inputs,
    checked: &mut Checked,
    like: &MlFit,
    has_memory: bool,
) -> Option<Solved> {
    let mut settings = Settings::default();
    settings.robust.enabled = inputs.robot.profile.solve.robust;
    let stated = ml::state(inputs, &checked.tracks, &checked.start, FreeSet::Profile);
    let stated = with_levels(stated, like)?;
    let mut fit = ml::fit_near(stated, inputs, &like.solution, &settings)?;
    fit.levels = like.levels.clone();
    priors::by_evidence(&mut fit, inputs, &settings);
    checked.findings.extend(noise::meaning(&mut fit));
    if has_memory {
        checked.findings.extend(with_memory(&mut fit));
    }
    clock::correct(inputs, &fit);
    ml_result(inputs, fit, None).ok()
}

/// The noise levels that the earlier fit took.
fn with_levels(mut stated: Formulation, like: &MlFit) -> Option<Formulation> {
    if like.levels.by_body {
        stated.problem = stated.problem.with_noise_by_body()?.problem;
    }
    if !like.levels.markers.is_empty() {
        let markers = &like.levels.markers;
        stated.problem = stated.problem.with_noise_by_marker(markers)?.problem;
    }
    Some(stated)
}
