//! Several places of the robot before the tracker that the recordings may mean.
//!
//! A marker that moves by little shows little more than the plane of its motion and its velocities. Turned by 180° about the normal of that plane, with
//! the marker on the other side of the joints, the robot moves it the same but for the curvature, and errors of the nominal robot decide which of the two
//! the registration takes. Each place that leaves about as much is asked by a fit of everything; the smallest cost wins, and where another is as
//! likely within chance, the recordings do not say where the robot stands.

use calib_core::Settings;
use calib_finding::{Fact, Finding, catalog};
use nalgebra::Isometry3;

use crate::error::PipelineError;
use crate::estimate::start::{Start, is_another, others};
use crate::formulate::checked::Checked;
use crate::formulate::formulation::{FreeSet, MlFit};
use crate::formulate::ml;
use crate::prepare::inputs::Inputs;

/// Twice a logarithm of likelihoods by which one place must be likelier: 1 100 times.
const LIKELIER: f64 = 14.0;
/// Costs closer than this are one minimum, found twice along a direction that nothing determines.
const SAME: f64 = 0.01;

/// Takes the start values of the likeliest place; what is said where another is about as likely.
///
/// # Errors
/// [`PipelineError::Solve`] when the problem cannot be stated.
pub(crate) fn likeliest(
    inputs: &Inputs,
    checked: &mut Checked,
    settings: &Settings,
    progress: &mut dyn FnMut(&str),
) -> Result<Option<Finding>, PipelineError> {
    let others = others(inputs, &checked.tracks, &checked.start);
    if others.is_empty() {
        return Ok(None);
    }
    progress("fit from another place of the robot");
    let from = |start: &Start| ml::state(inputs, &checked.tracks, start, FreeSet::Profile);
    let first = ml::fit(from(&checked.start), inputs, settings)?;
    let kept = first.solution.clone();
    let mut all = vec![(checked.start.clone(), first)];
    for start in others {
        let fit = ml::fit_kept(&from(&start), inputs, &kept, settings);
        all.extend(fit.map(|fit| (start, fit)));
    }
    let Some(found) = compared(&all) else {
        return Ok(None);
    };
    let finding = found.second.map(|(second, by)| {
        let between = place(&all[found.best].1).inverse() * place(&all[second].1);
        Finding::new(catalog::TWO_PLACES, calib_finding::About::Tracker)
            .with("angle", Fact::radians(between.rotation.angle()))
            .with("distance", Fact::meters(between.translation.vector.norm()))
            .with("by", Fact::number(by, calib_finding::Unit::One))
    });
    checked.start = all.swap_remove(found.best).0;
    Ok(finding)
}

/// The fit of the smallest cost, and the next one elsewhere where that is about as likely, with the difference of their costs.
struct Compared {
    best: usize,
    second: Option<(usize, f64)>,
}

fn compared(all: &[(Start, MlFit)]) -> Option<Compared> {
    let size = |fit: &MlFit| fit.solution.theta.iter().map(|t| t.ln()).sum::<f64>();
    let quietest = all
        .iter()
        .min_by(|a, b| size(&a.1).total_cmp(&size(&b.1)))?;
    let levels = quietest.1.solution.theta.iter().map(|theta| theta.sqrt());
    let levels: Vec<f64> = levels.collect();
    let of = |(i, (_, fit)): (usize, &(Start, MlFit))| Some((i, fit.solution.cost_with(&levels)?));
    let costs: Vec<(usize, f64)> = all.iter().enumerate().filter_map(of).collect();
    let least = costs.iter().map(|c| c.1).min_by(f64::total_cmp)?;
    // Of starts that end in one minimum the first stays.
    let best = costs.iter().find(|c| c.1 - least <= SAME)?.0;
    let elsewhere = |c: &&(usize, f64)| is_another(&place(&all[best].1), &place(&all[c.0].1));
    let second = costs
        .iter()
        .filter(elsewhere)
        .map(|(i, cost)| (*i, cost - least))
        // A fit that has not converged costs less still, where it does.
        .filter(|(_, by)| (SAME..LIKELIER).contains(by))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    Some(Compared { best, second })
}

fn place(fit: &MlFit) -> Isometry3<f64> {
    fit.calibration.tracker_from_root
}
