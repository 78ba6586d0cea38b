//! What a solution is worth: held-out errors, loops, residuals, accuracy over the workspace.

pub mod accuracy;
pub(crate) mod agreement;
mod applied;
mod base_moves;
mod by_place;
pub mod causes;
pub mod changes;
pub mod closure;
pub mod deviations;
pub(crate) mod dh_table;
mod displaced;
mod elimination;
mod gains;
pub mod hayati;
pub mod held_out;
pub mod information;
pub mod invariants;
pub mod known;
pub mod left_out;
mod mimics;
pub(crate) mod motions;
pub mod moved;
pub(crate) mod proportions;
pub mod readings;
pub mod residuals;
pub mod robot_changes;
mod scatter;
mod seen;
mod suspects;
mod sways;
pub(crate) mod tracker_noise;
mod tried;
mod unfreed;
mod unseen;
mod zeros;

use std::collections::BTreeMap;

use calib_core::Solution;
use calib_finding::{About, Fact, Finding, catalog};
use calib_report::{HeldOut, LoopClosure, ResidualRow};

use crate::formulate::checked::Checked;
use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::Calibration;
use crate::formulate::solved::Solved;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;
use crate::verify::base_moves::base_moves;
use crate::verify::by_place::by_place;
use crate::verify::causes::{Causes, causes};
use crate::verify::closure::close_loops;
use crate::verify::known::{Known, Number, known_numbers};
use crate::verify::moved::moved;
use crate::verify::residuals::residual_rows;
use crate::verify::sways::sways;
use crate::verify::unfreed::unfreed;

/// What a solution is worth.
#[derive(Debug)]
pub struct Verified {
    /// Changes while a recording ran or between two.
    pub findings: Vec<Finding>,
    /// The loops of the frame graph.
    pub loops: Vec<LoopClosure>,
    /// Errors on poses that were not fitted.
    pub held_out: Option<HeldOut>,
    /// The numbers of the URDF that are known, with σ.
    pub known: BTreeMap<Number, Known>,
    /// Every residual.
    pub residuals: Vec<ResidualRow>,
    /// σ of the robot's numbers, by name, where that of the fit holds only for ratios that nobody measured.
    pub sigmas: BTreeMap<String, f64>,
    /// What made the residuals, each cause beside the others.
    pub causes: Causes,
}

/// Verifies `solved`; the scan for changes takes as long as the rest together and runs beside it.
#[must_use]
pub fn verified(
    inputs: &Inputs,
    checked: &Checked,
    nominal: &Calibration,
    solved: &Solved,
    refitted: Option<&Calibration>,
) -> Verified {
    let fit = solved.fit.as_ref();
    let tracks = &checked.tracks;
    let (causes, mut verified) = rayon::join(
        || {
            fit.map_or_else(Causes::default, |fit| {
                causes(inputs, fit, &checked.findings, None)
            })
        },
        || Verified {
            findings: moved(inputs, tracks, &solved.robot, fit),
            loops: close_loops(inputs, tracks, &solved.body_from_origin(), &solved.fk),
            held_out: held_out(inputs, tracks, nominal, solved, refitted),
            known: fit.map_or_else(Default::default, |fit| known_numbers(inputs, fit)),
            residuals: residual_rows(inputs, tracks, &solved.robot, fit),
            sigmas: BTreeMap::new(),
            causes: Causes::default(),
        },
    );
    verified.causes = causes;
    let held = fit.and_then(|fit| unfreed(inputs, checked, fit, &verified.causes));
    if let Some(held) = held {
        verified.causes.explained_by_held_joints();
        verified.findings.push(held);
    }
    if let Some((sways, share)) = sways(inputs, &verified.residuals) {
        verified.causes.leave_change_that_explains_less(share);
        verified.findings.push(sways);
    }
    if let Some(moves) = base_moves(inputs, &verified.residuals) {
        // Where the robot leans with its arm, effects of the arm are sought in vain.
        verified.causes.leave_effects();
        verified.findings.push(moves);
    } else if verified.findings.is_empty()
        && let Some(found) = fit.and_then(|fit| by_place(inputs, fit, &verified.causes))
    {
        verified.causes.leave_effects();
        verified.findings.push(found);
    }
    verified.findings.extend(fit.and_then(not_tested));
    let missing = verified.causes.goodness.as_ref();
    let missing = missing.is_some_and(|g| !g.missing.is_empty());
    if missing && !verified.findings.is_empty() {
        verified.findings = applied::still_moved(inputs, checked, &verified);
    }
    // Beside missing physics, what a joint does is that.
    let scatter = verified.causes.scatter.clone().filter(|_| !missing);
    verified.findings.extend(scatter);
    let gain = fit.and_then(|fit| gains::of_held_out(inputs, checked, fit, &verified));
    verified.findings.extend(gain);
    let displaced = fit.map(|fit| displaced::displaced(inputs, fit, &verified));
    verified.findings.extend(displaced.unwrap_or_default());
    if let Some(changed) = verified.causes.change.clone() {
        verified.findings = one_cause(changed, verified.findings);
    }
    let missing = verified.causes.goodness.as_ref();
    let missing = missing.map_or(&[][..], |goodness| &goodness.missing);
    let of_ratios = fit.map(|fit| mimics::ratios(inputs, checked, fit, missing));
    let of_ratios = of_ratios.unwrap_or_default();
    verified.findings.extend(of_ratios.findings);
    verified.sigmas = of_ratios.sigmas;
    verified
}

/// That the fit leaves too little to be tested.
fn not_tested(fit: &MlFit) -> Option<Finding> {
    (!fit.solution.is_testable()).then(|| {
        let freedom = fit.solution.degrees_of_freedom.max(0.0) as usize;
        Finding::new(catalog::NOT_TESTED, About::Fit)
            .with("freedom", Fact::count(freedom))
            .with("needed", Fact::count(Solution::TESTABLE as usize))
    })
}

/// What moved within the fitted recordings seems to have moved before the validation too: the fit has the mean of both places.
/// One cause, one finding: the change, as severe as the worse of the two.
fn one_cause(changed: Finding, before_validation: Vec<Finding>) -> Vec<Finding> {
    let kinds = ["body", "tracker", "joint", "axis"];
    let kind = changed.facts.get("kind").and_then(Fact::word);
    if changed.facts.get("physics").is_some() || !kind.is_some_and(|kind| kinds.contains(&kind)) {
        return std::iter::once(changed).chain(before_validation).collect();
    }
    let (same, other): (Vec<Finding>, Vec<Finding>) = before_validation
        .into_iter()
        .partition(|f| f.subject.about == changed.subject.about);
    let severity = same.iter().map(|f| f.severity).max();
    let severity = severity.map_or(changed.severity, |s| s.max(changed.severity));
    std::iter::once(changed.with_severity(severity))
        .chain(other)
        .collect()
}

/// Errors on held-out recordings; without any, on fitted poses that are left out in turn.
#[must_use]
pub fn held_out(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    nominal: &Calibration,
    solved: &Solved,
    refitted: Option<&Calibration>,
) -> Option<HeldOut> {
    let urdf_alone = solved.robot.urdf_alone();
    let robots = held_out::Robots {
        nominal: Some(nominal),
        registered: solved.registered.as_ref(),
        calibrated: &solved.robot,
        urdf_alone: urdf_alone.as_ref(),
        refitted,
    };
    let fit = solved.fit.as_ref();
    held_out::held_out(inputs, tracks, &robots, fit)
        .or_else(|| left_out::left_out(inputs, tracks, &robots, fit?, solved.registration.as_ref()))
}
