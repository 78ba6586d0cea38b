//! Bodies of which the fit leaves no more than the decimals of the file do: a controller that knows its own calibration computed them, or a simulation.

use std::collections::BTreeMap;

use calib_checks::structural::{BodyIndex, rounding};
use calib_core::{GroupId, MeasurementKind, NoiseKind, PoseNoise};
use calib_finding::{Fact, Finding, Subject, catalog};

use crate::formulate::formulation::MlFit;
use crate::formulate::structural::{Layout, chain};
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;

/// No tracker sees a robot repeat better, m: three decimals of a millimeter are 0.5 µm.
const RESOLVED: f64 = 3e-6;
/// What steps of 0.1 mm leave, and some of the joints' readings, m: larger ones hide the noise of good trackers.
const FINE: f64 = 6e-5;
/// What 35 coordinates or more leave of rounding exceeds its average by less in 95 of 100 sessions: 1 + 1.65/√(2 · 35).
const BY_CHANCE: f64 = 1.2;

/// What the fit says of where the coordinates of each body came from.
pub(crate) fn of_bodies(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    fit: &MlFit,
) -> Vec<Finding> {
    let Some((chain, _)) = chain(inputs, tracks) else {
        return Vec::new();
    };
    let layout = Layout::new(inputs, tracks, &chain, false);
    let of = |(body, name): (usize, &&str)| {
        let rounded = rounding(&layout.data, BodyIndex(body))?;
        // left² = 3 σ² + arm² σ_joint²
        let of_joints = rounded.arm * joints(fit);
        let left = (3.0 * position(fit, name)?.powi(2) + of_joints * of_joints).sqrt();
        let shown = rounded.step > 0.0 && left > RESOLVED;
        let limit = match shown && rounded.left < FINE {
            true => BY_CHANCE * rounded.left,
            false => RESOLVED,
        };
        let finding = || {
            let finding = Finding::of_kind(catalog::NOT_MEASURED, "fitted", Subject::body(*name))
                .with("body", Fact::name(*name))
                .with("left", Fact::meters(left));
            match shown {
                true => finding.with("rounding", Fact::meters(rounded.left)),
                false => finding,
            }
        };
        (left < limit).then(finding)
    };
    layout.bodies.iter().enumerate().filter_map(of).collect()
}

/// σ that the fit found for a coordinate of the body, m; `None` where the residuals did not decide it.
fn position(fit: &MlFit, body: &str) -> Option<f64> {
    let measurements = fit.formulation.problem.measurements().iter();
    let groups = measurements
        .filter(|m| m.name == body)
        .map(|m| match &m.kind {
            MeasurementKind::Markers(markers) => Some(markers.noise),
            MeasurementKind::Poses(poses) => match poses.noise {
                PoseNoise::Split { position, .. } => Some(position),
                _ => None,
            },
            _ => None,
        });
    let groups: Vec<GroupId> = groups.collect::<Option<_>>()?;
    let sigma = groups.into_iter().map(|group| {
        let found = &fit.solution.noise[group.index()];
        found.estimated.then_some(found.sigma)
    });
    let sigma: Vec<f64> = sigma.collect::<Option<_>>()?;
    // What is found at its least is that or less.
    sigma.into_iter().max_by(f64::total_cmp)
}

/// The largest σ of a joint that turns, rad.
fn joints(fit: &MlFit) -> f64 {
    let noise = fit.solution.noise.iter();
    let of_joints = noise.filter(|n| n.kind == NoiseKind::Joint && n.samples > 0);
    of_joints.map(|n| n.sigma).fold(0.0, f64::max)
}
