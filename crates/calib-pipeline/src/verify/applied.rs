//! What of the held-out errors is left to explain once the effects that are missing are in the model.

use calib_core::Settings;
use calib_finding::Finding;

use crate::formulate::checked::Checked;
use crate::formulate::completed::of_tests;
use crate::formulate::formulation::{FreeSet, MlFit};
use crate::formulate::ml;
use crate::formulate::parts::{RobotPart, with_parts};
use crate::formulate::starts;
use crate::prepare::inputs::Inputs;
use crate::verify::Verified;
use crate::verify::moved::moved;

/// The motions before held-out recordings that are found with the missing effects free as well; all of them where the effects cannot be freed.
pub(super) fn still_moved(inputs: &Inputs, checked: &Checked, verified: &Verified) -> Vec<Finding> {
    let all = || verified.findings.clone();
    let missing = verified.causes.goodness.as_ref().map(|g| &g.missing);
    let parts = missing.map_or_else(Vec::new, |missing| of_tests(inputs, missing));
    let Some((inputs, fit)) = with_free(inputs, checked, &parts) else {
        return all();
    };
    let again = moved(&inputs, &checked.tracks, &fit.calibration, Some(&fit));
    let found = |finding: &Finding| {
        let same = |other: &Finding| other.id == finding.id && other.subject == finding.subject;
        again.iter().any(same)
    };
    all().into_iter().filter(found).collect()
}

/// The fit with these parts free as well; `None` without any.
fn with_free(inputs: &Inputs, checked: &Checked, parts: &[RobotPart]) -> Option<(Inputs, MlFit)> {
    if parts.is_empty() {
        return None;
    }
    let mut inputs = inputs.clone();
    inputs.robot.profile.solve = with_parts(&inputs, parts);
    again(inputs, checked)
}

/// The fit of other inputs, as the profile states it.
pub(super) fn again(mut inputs: Inputs, checked: &Checked) -> Option<(Inputs, MlFit)> {
    let mut settings = Settings::default();
    settings.robust.enabled = inputs.robot.profile.solve.robust;
    let fit = |inputs: &Inputs| {
        let stated = ml::state(inputs, &checked.tracks, &checked.start, FreeSet::Profile);
        ml::fit(stated, inputs, &settings).ok()
    };
    let first = fit(&inputs)?;
    let told = |inputs: &Inputs, fit: &MlFit| starts::fitted_first(inputs, starts::told(fit));
    let sides = told(&inputs, &first);
    if sides.is_empty() {
        return Some((inputs, first));
    }
    starts::take(&mut inputs, &sides);
    let second = fit(&inputs)?;
    // Those of held-out recordings, which change no parameter.
    let sides = told(&inputs, &second);
    starts::take(&mut inputs, &sides);
    Some((inputs, second))
}
