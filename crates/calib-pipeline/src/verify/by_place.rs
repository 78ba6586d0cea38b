//! Errors that follow the place in the tracker's volume.

use calib_finding::{About, Fact, Finding, catalog};
use calib_profile::Usage;

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::{Inputs, range};
use crate::verify::causes::Causes;

/// Probability of chance: that of an effect of a joint, of which some sixty are tested.
const CHANCE: f64 = 1e-5;
/// Share of χ² from which it matters, as of an effect.
const RELEVANT: f64 = 0.02;

/// A joint whose readings differ by less stands still, rad or m.
const MOVED: f64 = 1e-3;

/// That a smooth displacement by the place explains the residuals better than effects of the joints do, and than a change. Where the place of an axis is not
/// estimated, its errors would look like it.
pub(super) fn by_place(inputs: &Inputs, fit: &MlFit, causes: &Causes) -> Option<Finding> {
    if !has_all_axes(inputs, fit) {
        return None;
    }
    let found = fit.solution.by_place(fit.formulation.tracker, CHANCE)?;
    let of_change = causes
        .changed
        .as_ref()
        .map_or(0.0, |change| change.explains);
    let is_most = found.more_than_effects && found.explains > of_change.max(RELEVANT);
    is_most.then(|| {
        Finding::new(catalog::ERRORS_FOLLOW_PLACE, About::Tracker)
            .with("explains", Fact::ratio(found.explains))
            .with("rms", Fact::meters(found.rms))
    })
}

/// Whether the fit estimates the axis of every joint that moves.
fn has_all_axes(inputs: &Inputs, fit: &MlFit) -> bool {
    let fitted = || {
        let recordings = inputs.recordings.values();
        let fitted = recordings.filter(|r| r.spec.usage != Usage::Validation);
        fitted.flat_map(|r| r.q.iter().flatten())
    };
    let formulation = &fit.formulation;
    let mut joints = inputs.robot.model.joint_ids();
    joints.all(|joint| {
        let moves = range(fitted(), joint).is_some_and(|(low, high)| high - low > MOVED);
        let used = formulation.joints[joint.index()].is_some();
        let origin = formulation.origins[joint.index()];
        let is_free = |origin| !formulation.problem.edge_parameters(origin).is_empty();
        !(used && moves) || origin.is_some_and(is_free)
    })
}
