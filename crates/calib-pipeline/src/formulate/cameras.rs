//! Noise of markers as the cameras of the profile cause it.
//!
//! What a few cameras on one side say of a marker's depth is several times less certain than what they say across it. Equal weights spend
//! that on the robot; the covariances of a triangulation, [`PlanSpec::covariance`], do not. They are relative: their traces are those of the
//! σ per coordinate, on average over all that was seen. Where the recordings are likelier with equal noise, or have no
//! fit with this one, it stays equal.
//!
//! [`PlanSpec::covariance`]: calib_profile::PlanSpec::covariance

use calib_core::Settings;
use calib_finding::{About, Fact, Finding, catalog};
use calib_geometry::decompose::symmetric_eigen_small;
use calib_geometry::statistics::median;
use calib_profile::BodyKind;
use nalgebra::Matrix3;

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::{Inputs, Loaded};

/// Equal noise must be likelier by so many standard errors before the stated cameras are doubted.
const DOUBTED: f64 = 2.0;
/// Covariances within this ratio of σ are nothing to speak of.
const ROUND: f64 = 1.2;

/// Gives the markers of all recordings the covariances that the cameras of the profile cause; whether that gave any. Those that have a shape by
/// what they scattered keep it.
pub fn take(inputs: &mut Inputs) -> bool {
    let plan = &inputs.robot.profile.plan;
    // Recordings of a twin have them already.
    let given = inputs.recordings.values().any(|l| !l.by_camera.is_empty());
    if plan.cameras.is_empty() || given {
        return false;
    }
    let bodies = inputs.robot.profile.bodies.iter();
    let single = bodies.filter(|(name, _)| !inputs.condensed.contains_key(*name));
    let names = single.filter_map(|(_, body)| match &body.kind {
        BodyKind::Markers { names, .. } => Some(names),
        BodyKind::Pose => None,
    });
    let names: Vec<&String> = names.flatten().collect();
    let (mut sum, mut count) = (0.0, 0);
    for loaded in inputs.recordings.values_mut() {
        for &name in &names {
            let Some(track) = loaded.poses.markers.get(name) else {
                continue;
            };
            if loaded.shapes.contains_key(name) {
                continue;
            }
            let of = |seen: &Option<_>| seen.as_ref().and_then(|at| plan.covariance(at));
            let shapes: Vec<Option<Matrix3<f64>>> = track.iter().map(of).collect();
            if shapes.iter().all(Option::is_none) {
                continue;
            }
            let seen = shapes.iter().flatten();
            sum += seen.clone().map(Matrix3::trace).sum::<f64>();
            count += seen.count();
            loaded.shapes.insert(name.clone(), shapes);
            loaded.by_camera.insert(name.clone());
        }
    }
    if count == 0 || sum <= 0.0 {
        return false;
    }
    let scale = 3.0 * count as f64 / sum;
    for loaded in inputs.recordings.values_mut() {
        by_camera(loaded).for_each(|shape| *shape *= scale);
    }
    true
}

/// Makes the noise of these markers equal again.
pub fn make_equal(inputs: &mut Inputs) {
    for loaded in inputs.recordings.values_mut() {
        for name in std::mem::take(&mut loaded.by_camera) {
            loaded.shapes.remove(&name);
        }
    }
}

/// What the covariances of [`take`] are over those that the cameras state without a scale; `None` where it gave none.
#[must_use]
pub fn scale(inputs: &Inputs) -> Option<f64> {
    let plan = &inputs.robot.profile.plan;
    let of = |loaded: &Loaded| {
        let name = loaded.by_camera.first()?;
        let seen = loaded.poses.markers[name].iter().zip(&loaded.shapes[name]);
        let mut both =
            seen.filter_map(|(at, shape)| Some((plan.covariance(at.as_ref()?)?, shape.as_ref()?)));
        both.next()
            .map(|(stated, shape)| shape.trace() / stated.trace())
    };
    inputs.recordings.values().find_map(of)
}

/// What becomes of the cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// They are the weights.
    Taken,
    /// Left-out poses are likelier with equal noise.
    Doubted,
    /// With them there is no fit, or one that has not converged where that with equal noise has.
    NoFit,
}

/// Of a fit `with` the cameras, where there is one, beside that with equal noise.
#[must_use]
pub fn outcome(with: Option<&MlFit>, equal: &MlFit, settings: &Settings) -> Outcome {
    let converged = |fit: &MlFit| fit.solution.status.is_converged();
    let Some(with) = with.filter(|with| converged(with) || !converged(equal)) else {
        return Outcome::NoFit;
    };
    let by = with.solution.likelier_by(&equal.solution, settings);
    match by.is_some_and(|by| by < -DOUBTED) {
        true => Outcome::Doubted,
        false => Outcome::Taken,
    }
}

/// What became of the cameras; `None` where they see all directions alike.
pub(crate) fn finding(inputs: &mut Inputs, outcome: Outcome) -> Option<Finding> {
    let ratio = |shape: &mut Matrix3<f64>| {
        let of = symmetric_eigen_small(shape).values;
        (of.max() / of.min()).sqrt()
    };
    let shapes = inputs.recordings.values_mut().flat_map(by_camera);
    let ratio = median(shapes.map(ratio).collect()).filter(|ratio| *ratio > ROUND)?;
    let form = match outcome {
        Outcome::Taken => "taken",
        Outcome::Doubted => "doubted",
        Outcome::NoFit => "no_fit",
    };
    let finding = Finding::of_kind(catalog::CAMERA_NOISE, form, About::Fit);
    Some(finding.with("ratio", Fact::ratio(ratio)))
}

fn by_camera(loaded: &mut Loaded) -> impl Iterator<Item = &mut Matrix3<f64>> {
    let own = &loaded.by_camera;
    let shapes = loaded
        .shapes
        .iter_mut()
        .filter(|(name, _)| own.contains(*name));
    shapes.flat_map(|(_, shapes)| shapes.iter_mut().flatten())
}
