//! The noise from pose to pose by evidence, and what it says of the model.

use std::collections::BTreeMap;

use calib_core::{
    GroupId, MeasurementKind, NoiseEstimate, NoiseKind, NoiseModel, PointId, Settings,
};
use calib_finding::{About, Fact, Finding, catalog};

use crate::formulate::formulation::MlFit;
use crate::formulate::ml::calibration;
use crate::prepare::inputs::Inputs;

/// More than this is no encoder's noise, rad (0.06°): 1 mm at a meter.
const ENCODER: f64 = 1e-3;

/// Relative standard errors of a level within which it lies, 99.9 % on the side that counts.
const CERTAIN: f64 = 3.0;

/// Takes the noise that the recordings speak for, where the profile does not state it; whether that changed the solution.
pub(crate) fn by_evidence(fit: &mut MlFit, inputs: &Inputs, settings: &Settings) -> bool {
    let stated = inputs.robot.profile.solve.noise;
    let mut changed = !stated.known && own_levels(fit, inputs, settings);
    if stated.model.is_none()
        && !stated.known
        && let Some(weighed) = fit.solution.weighed(&NoiseModel::ALL, settings)
    {
        let chosen = weighed.choice.chosen;
        if let Some(solution) = weighed.solution {
            fit.formulation = fit.formulation.clone().with_noise(chosen);
            fit.calibration = calibration(&fit.formulation, &solution, inputs);
            fit.solution = solution;
            changed = true;
        }
        fit.noise = Some(weighed.choice);
    }
    changed
}

/// Takes a level for each body, and for markers that scatter unlike the others, where left-out poses speak for it; whether they did.
fn own_levels(fit: &mut MlFit, inputs: &Inputs, settings: &Settings) -> bool {
    let mut changed = false;
    let by_body = fit.formulation.problem.with_noise_by_body();
    if let Some(own) = by_body
        && let Some(solution) = fit.solution.with_levels_by_body(settings)
    {
        fit.formulation.problem = own.problem;
        fit.solution = solution;
        fit.levels.by_body = true;
        changed = true;
    }
    if let Some((solution, apart)) = fit.solution.with_levels_by_marker(settings)
        && let Some(own) = fit.formulation.problem.with_noise_by_marker(&apart)
    {
        fit.formulation.problem = own.problem;
        fit.solution = solution;
        fit.levels.markers = apart;
        changed = true;
    }
    if changed {
        fit.calibration = calibration(&fit.formulation, &fit.solution, inputs);
    }
    changed
}

/// Markers that have a noise level of their own.
pub(crate) fn of_markers(fit: &MlFit) -> Vec<Finding> {
    /// Levels that differ by less than this, as logarithms, are the same.
    const ALIKE: f64 = 0.1;
    /// A marker that scatters by so many times the noise of the others is not only seen worse.
    const LOOSE: f64 = 3.0;
    let mut findings = Vec::new();
    let sigma = |group: GroupId| fit.solution.noise[group.index()].sigma;
    for measurement in fit.formulation.problem.measurements() {
        let MeasurementKind::Markers(markers) = &measurement.kind else {
            continue;
        };
        for (point, level) in &markers.own {
            let of = |(body, names): (&String, &BTreeMap<String, PointId>)| {
                let marker = names.iter().find(|(_, p)| *p == point)?.0.clone();
                Some((body.clone(), marker))
            };
            let Some((body, marker)) = fit.formulation.points.iter().find_map(of) else {
                continue;
            };
            let (own, others) = (sigma(*level), sigma(markers.noise));
            // The final levels may be alike although those of the choice were not.
            if (own / others).ln().abs() < ALIKE {
                continue;
            }
            let kind = if own > LOOSE * others {
                "loose"
            } else {
                "differs"
            };
            let finding = Finding::of_kind(catalog::MARKER_NOISE, kind, About::Fit)
                .with("marker", Fact::name(marker))
                .with("body", Fact::name(body))
                .with("sigma", Fact::meters(own))
                .with("others", Fact::meters(others));
            findings.push(finding);
        }
    }
    findings
}

/// What the noise says of the model; where physics is missing, the uncertainty is that of the poses' own scatter.
pub(crate) fn meaning(fit: &mut MlFit) -> Vec<Finding> {
    let mut findings = Vec::new();
    findings.extend(swallowed(fit).or_else(|| no_encoder(fit)));
    findings.extend(readmitted(fit));
    // What the residuals of a pose have in common is in no noise model then: the poses' own scatter tells what is known.
    if !findings.is_empty()
        && let Some(wider) = fit.solution.with_cluster_covariance()
    {
        fit.solution = wider;
    }
    findings
}

/// Joint noise would be likeliest, but it is too large for joints or its weights predict worse.
fn swallowed(fit: &MlFit) -> Option<Finding> {
    let choice = fit.noise.as_ref()?;
    let model = choice.swallowed?;
    let candidate = choice.candidates.iter().find(|c| c.model == model)?;
    let of_joints = candidate
        .levels
        .iter()
        .filter(|l| l.kind == NoiseKind::Joint);
    let largest = of_joints.map(|l| l.sigma).fold(0.0, f64::max);
    if largest > ENCODER {
        return Some(of_no_encoder(largest));
    }
    (largest > 0.0).then(|| {
        Finding::of_kind(catalog::NOISE_IS_PHYSICS, "swallowed", About::Fit)
            .with("sigma", Fact::radians(largest))
            .with("poses", Fact::count(choice.poses))
    })
}

fn of_no_encoder(sigma: f64) -> Finding {
    Finding::of_kind(catalog::NOISE_IS_PHYSICS, "no_encoder", About::Fit)
        .with("sigma", Fact::radians(sigma))
}

/// The noise of a joint is far larger than that of an encoder.
fn no_encoder(fit: &MlFit) -> Option<Finding> {
    let noise = fit.solution.noise.iter();
    let of_joints = noise.filter(|n| n.kind == NoiseKind::Joint && n.samples > 0 && n.estimated);
    // What of the level is beyond doubt: that of a joint with few degrees of freedom is found within a factor of two.
    let certain = |n: &&NoiseEstimate| {
        let doubt = n.relative_error.map_or(0.0, |relative| CERTAIN * relative);
        n.sigma > ENCODER * (1.0 + doubt)
    };
    let largest = of_joints.filter(certain).map(|n| n.sigma);
    largest.max_by(f64::total_cmp).map(of_no_encoder)
}

/// Rejected vectors that take part after all.
fn readmitted(fit: &MlFit) -> Option<Finding> {
    let admission = fit.noise.as_ref()?.admission?;
    (admission.readmitted > 0).then(|| {
        Finding::new(catalog::REJECTED_TAKE_PART, About::Fit)
            .with("readmitted", Fact::count(admission.readmitted))
            .with("rejected", Fact::count(admission.rejected))
            .with("better", Fact::ratio(1.0 - admission.ratio))
    })
}
