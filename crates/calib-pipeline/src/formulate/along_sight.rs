//! Whether the noise of bodies is another along the line of sight than across it.
//!
//! A single camera, or several on one side, measure depth less precisely than the directions across the line, and both less precisely the farther
//! away. With equal noise, correct rows are then outliers, and the precise directions get too little weight. The residuals show it,
//! [`Solution::likelier_along_sight_by`]; the fit is repeated with levels along the line, and kept where left-out poses are more likely by more than chance.
//!
//! [`Solution::likelier_along_sight_by`]: calib_core::Solution::likelier_along_sight_by

use std::collections::BTreeMap;

use calib_core::measurement::{Growth, Sight, growth as factors};
use calib_core::{AlongSight, GroupId, Likelier, MeasurementKind, PoseNoise, Settings};
use calib_finding::{About, Fact, Finding, catalog};
use calib_geometry::statistics::median;
use calib_profile::BodyKind;

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::{Inputs, Sights, stated_sights};
use crate::prepare::tracks::BodyTrack;

/// Logarithm of the likelihood ratio from which levels along the line of sight are tried.
const TRIED: f64 = 8.0;
/// The same of levels that grow instead of those that do not, or the other way round: neither has more numbers.
const GROWTH: f64 = 2.0;
/// Across the line of sight no tracker scatters by more than this many times what is stated of it, or what its markers do about their bodies.
const ACROSS: f64 = 2.0;
/// From this many times the σ across the line of sight on, the σ along it is what the finding states; below, it states the orientations.
const CLEARLY: f64 = 1.5;
/// Left-out poses must be likelier by this many standard errors (paired over the poses).
const SHOWN: f64 = 2.0;

/// The bodies whose noise the residuals show to be another along the line of sight, beside those that are known; `None` where they show no more.
#[must_use]
pub fn told(inputs: &Inputs, fit: &MlFit) -> Option<Sights> {
    let profile = &inputs.robot.profile;
    if profile.solve.noise.known {
        return None;
    }
    let measurements = fit.formulation.problem.measurements();
    let mut by_body: BTreeMap<&str, Vec<AlongSight>> = BTreeMap::new();
    for shown in fit.solution.likelier_along_sight_by() {
        let name = measurements[shown.measurement.index()].name.as_str();
        // Stated cameras say what they cause themselves, and points that stand for many markers have shapes of their own.
        let is_measured = match profile.bodies.get(name).map(|body| &body.kind) {
            Some(BodyKind::Pose) => true,
            Some(BodyKind::Markers { .. }) => {
                profile.plan.cameras.is_empty() && !inputs.condensed.contains_key(name)
            }
            None => false,
        };
        if is_measured {
            by_body.entry(name).or_default().push(shown);
        }
    }
    // The levels are those of all bodies: what they say together decides whether they grow.
    let mut all = [Likelier::default(); 2];
    for of in by_body.values().flatten() {
        all[0] += of.positions;
        all[1] += of.orientations;
    }
    let distances = by_body.values().flatten().map(|shown| shown.distance);
    let from = median(distances.collect());
    let from = from.filter(|from| *from > 0.0).map(two_digits);
    let [positions, orientations] = all.map(|all| from.filter(|_| all.growing > all.same));
    let found = Growth {
        positions,
        orientations,
    };
    let mut sights = inputs.sights.clone();
    for (name, of) in &by_body {
        let tried = match inputs.sights.get(*name) {
            None => by(of, found) > TRIED,
            Some(known) => by(of, found) - by(of, *known) > GROWTH,
        };
        if tried {
            sights.insert((*name).to_owned(), found);
        }
    }
    (sights != inputs.sights).then_some(sights)
}

/// Logarithm of the likelihood ratio of levels that grow so.
fn by(of: &[AlongSight], growth: Growth) -> f64 {
    let one = |by: Likelier, from: Option<f64>| if from.is_some() { by.growing } else { by.same };
    let of = of.iter();
    let both =
        of.map(|s| one(s.positions, growth.positions) + one(s.orientations, growth.orientations));
    both.sum()
}

/// Whether a fit with levels along the line of sight says more of left-out poses than the one before, or of rows that that one had to leave out,
/// and leaves across the line what the tracker has there: what a model lacks lies along some direction, too.
#[must_use]
pub fn is_better(
    (inputs, tracks): (&Inputs, &BTreeMap<String, BodyTrack>),
    with: &MlFit,
    before: &MlFit,
    settings: &Settings,
) -> bool {
    let kept = |fit: &MlFit| fit.solution.weights.iter().filter(|w| **w > 0.0).count();
    if !with.solution.status.is_converged() && before.solution.status.is_converged() {
        return false;
    }
    let known = |of: &OfSight<'_>| {
        let tracker = &inputs.robot.profile.tracker;
        match of.turns.is_some() {
            true => tracker.body_sigma,
            false => tracker
                .marker_sigma
                .or_else(|| tracks.get(of.body)?.marker_sigma),
        }
    };
    let plausible = |of: OfSight<'_>| {
        let most = known(&of).map(|sigma| ACROSS * sigma);
        most.is_none_or(|most| of.across <= most)
    };
    if !of_sight(with).into_iter().all(plausible) {
        return false;
    }
    // With rows left out as a whole, the two have other observations.
    if with.solution.weights.len() != before.solution.weights.len() {
        return kept(with) > kept(before);
    }
    let by = with.solution.likelier_by(&before.solution, settings);
    let enough = if before.has_sight() { 0.0 } else { SHOWN };
    by.is_some_and(|by| by > enough)
}

/// Levels of a body with noise of its own along the line of sight, m.
struct OfSight<'a> {
    body: &'a str,
    sight: Sight,
    across: f64,
    along: f64,
    /// Of orientations about the axes across it and about it, rad.
    turns: Option<[f64; 2]>,
}

fn of_sight(fit: &MlFit) -> Vec<OfSight<'_>> {
    let sigma = |group: GroupId| fit.solution.noise[group.index()].sigma;
    let measurements = fit.formulation.problem.measurements().iter();
    let of = measurements.filter_map(|measurement| {
        let (turns, across, sight) = match &measurement.kind {
            MeasurementKind::Markers(of) => (None, of.noise, of.sight?),
            MeasurementKind::Poses(of) => match of.noise {
                PoseNoise::Split {
                    position,
                    orientation,
                } => (Some(orientation), position, of.sight?),
                _ => return None,
            },
            _ => return None,
        };
        Some(OfSight {
            body: &measurement.name,
            sight,
            across: sigma(across),
            along: sigma(sight.along),
            turns: turns.and_then(|tilt| Some([sigma(tilt), sigma(sight.about?)])),
        })
    });
    of.collect()
}

/// What the noise along the line of sight was found to be, where the profile does not state it.
pub(crate) fn findings(inputs: &Inputs, fit: &MlFit) -> Vec<Finding> {
    let mut said: Vec<(GroupId, Finding)> = Vec::new();
    for of in of_sight(fit) {
        let sight = of.sight;
        // What was found is compared with what is stated; that it grows asks for nothing more.
        let is_stated = stated_sights(&inputs.robot.profile).contains_key(of.body);
        if is_stated || said.iter().any(|(along, _)| *along == sight.along) {
            continue;
        }
        let finding = |kind| {
            Finding::of_kind(catalog::NOISE_ALONG_SIGHT, kind, About::Fit)
                .with("body", Fact::name(of.body))
        };
        let depth = |kind| {
            let (across, along) = match of.turns.is_some() {
                true => ("body_sigma_mm", "body_sight_sigma_mm"),
                false => ("marker_sigma_mm", "marker_sight_sigma_mm"),
            };
            finding(kind)
                .with("along", Fact::meters(of.along))
                .with("across", Fact::meters(of.across))
                .with("key_across", Fact::name(across))
                .with("key_along", Fact::name(along))
        };
        let finding = match (of.turns, sight.growth.positions) {
            (Some([tilt, about]), _) if of.along < CLEARLY * of.across => finding("tilt")
                .with("tilt", Fact::radians(tilt))
                .with("about", Fact::radians(about)),
            (_, Some(from)) => depth("growing").with("distance", Fact::meters(from)),
            (_, None) => depth("same"),
        };
        said.push((sight.along, finding));
    }
    said.into_iter().map(|(_, finding)| finding).collect()
}

/// A distance, m, in two digits.
fn two_digits(distance: f64) -> f64 {
    let unit = 10.0_f64.powf(distance.log10().floor() - 1.0);
    (distance / unit).round() * unit
}

/// Mean variance of a coordinate over what was seen at these distances, from those across the line of sight and along it, m².
#[must_use]
pub(crate) fn coordinate(
    levels: (f64, f64),
    growth: Growth,
    distances: impl Iterator<Item = f64>,
) -> f64 {
    mean(levels, distances.map(|d| factors(growth.positions, d)))
}

/// Mean variance of a body's orientation about an axis over where it was seen, rad²; `None` where the line of sight has no level of its own.
#[must_use]
pub(crate) fn orientation(fit: &MlFit, body: &str) -> Option<f64> {
    let mut measurements = fit.formulation.problem.measurements().iter();
    let measurement = measurements.find(|m| m.name == body && m.kind.sight().is_some())?;
    let MeasurementKind::Poses(of) = &measurement.kind else {
        return None;
    };
    let PoseNoise::Split { orientation, .. } = of.noise else {
        return None;
    };
    let sight = of.sight?;
    let variance = |group: GroupId| fit.solution.noise[group.index()].sigma.powi(2);
    let distances = of.observations.iter();
    let distances = distances.map(|o| o.pose.translation.vector.norm());
    let swapped = distances.map(|d| {
        let [image, depth] = factors(sight.growth.orientations, d);
        [depth, image]
    });
    Some(mean(
        (variance(orientation), variance(sight.about?)),
        swapped,
    ))
}

/// Mean of two variances across a line and one along it, with the factors of their σ.
fn mean((across, along): (f64, f64), factors: impl Iterator<Item = [f64; 2]>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for [a, b] in factors {
        sum += (2.0 * across * a * a + along * b * b) / 3.0;
        count += 1.0;
    }
    if count > 0.0 { sum / count } else { across }
}
