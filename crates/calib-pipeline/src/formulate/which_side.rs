//! Which of the two ends of a measured pose has the instrument: the tracker that sees a body, or a camera on the robot that sees the tracker's frame.
//!
//! The columns say it as far as they are taken from a detector; software also writes where a camera is in front of a board, or the other way round.
//! The residuals tell, [`Solution::other_side_likelier_by`]; what they say is tried by fitting again, and taken where left-out poses are likelier.
//!
//! [`Solution::other_side_likelier_by`]: calib_core::Solution::other_side_likelier_by

use std::collections::{BTreeMap, BTreeSet};

use calib_finding::{Finding, Subject, catalog};
use calib_profile::BodyKind;

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;

/// Logarithm of the likelihood ratio from which the other end is tried.
const TRIED: f64 = 8.0;

/// Longer recordings are not copied to have their rows judged again.
const COPIED: usize = 20_000;

/// Whether the recordings have poses whose other end may be tried, and few enough rows to be kept as they were read.
#[must_use]
pub(crate) fn matters(inputs: &Inputs) -> bool {
    let mut bodies = inputs.robot.profile.bodies.values();
    let rows = inputs.recordings.values().map(|loaded| loaded.poses.len());
    bodies.any(|body| body.kind == BodyKind::Pose) && rows.sum::<usize>() <= COPIED
}

/// Bodies whose poses have the errors of the other end.
#[must_use]
pub(crate) fn told(inputs: &Inputs, fit: &MlFit) -> BTreeSet<String> {
    let bodies = &inputs.robot.profile.bodies;
    // What was computed from markers was seen as these.
    let is_measured =
        |name: &str| matches!(bodies.get(name), Some(body) if body.kind == BodyKind::Pose);
    let measurements = fit.formulation.problem.measurements();
    let mut by_body: BTreeMap<&str, f64> = BTreeMap::new();
    for (measurement, by) in fit.solution.other_side_likelier_by() {
        let name = measurements[measurement.index()].name.as_str();
        if is_measured(name) {
            *by_body.entry(name).or_default() += by;
        }
    }
    let told = by_body.into_iter().filter(|(_, by)| *by > TRIED);
    told.map(|(name, _)| name.to_owned()).collect()
}

/// Gives the poses of these bodies the errors of the other end, in all recordings that show them.
pub(crate) fn exchange(
    inputs: &mut Inputs,
    tracks: &mut BTreeMap<String, BodyTrack>,
    bodies: &BTreeSet<String>,
) {
    for name in bodies {
        let Some(track) = tracks.get_mut(name) else {
            continue;
        };
        for (recording, loaded) in &mut inputs.recordings {
            if !loaded.poses.bodies.contains_key(name) {
                continue;
            }
            if !loaded.meta.inverse_bodies.remove(name) {
                loaded.meta.inverse_bodies.insert(name.clone());
            }
            if !track.inverse.remove(recording) {
                track.inverse.insert(recording.clone());
            }
        }
    }
}

/// What the recordings say against their columns.
pub(crate) fn findings(inputs: &Inputs, bodies: &BTreeSet<String>) -> Vec<Finding> {
    let of = |name: &String| {
        let mut recordings = inputs.recordings.values();
        let sees = recordings.any(|loaded| loaded.meta.inverse_bodies.contains(name));
        let kind = if sees { "body_sees" } else { "tracker_sees" };
        Finding::of_kind(catalog::NOISE_OF_INVERSE, kind, Subject::body(name))
    };
    bodies.iter().map(of).collect()
}
