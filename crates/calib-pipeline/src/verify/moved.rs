//! Did the tracker, a body or the zero of a joint change between the fitted recordings and a held-out one?
//!
//! Held-out errors of a robot that is right are small; of one that is wrong they differ from posture to posture. Errors that one motion
//! explains are neither: something moved. It is named where r(none) / r(best) ≥ 3, with r as in `tried.rs`.
//!
//! Several zeros may have changed at once, as where the robot was homed: they are named where nothing simpler explains nearly as much.
//!
//! One number of a joint can also be what the fit does not know: a zero counts as changed where the errors are beyond what the fit states of
//! their prediction, once in a thousand validations.

use std::collections::{BTreeMap, BTreeSet};

use calib_finding::{About, Fact, Finding, Severity, Subject, catalog};
use calib_profile::Usage;
use calib_report::Agreement;
use calib_urdf::JointId;

use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::Calibration;
use crate::formulate::row_levels::HeldOutLevels;
use crate::prepare::conditions::conditions;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;
use crate::verify::seen::{Seen, View};
use crate::verify::tried::{Motion, Tried, ZeroStep, remounted, rows, tracker};
use crate::verify::zeros::zeros_changed;

/// r(none) / r(best) from which a motion is named: over ten times the variance.
const NAMED: f64 = 3.0;
/// What comes within this factor of the best is named beside it.
const ALIKE: f64 = 1.5;
/// A motion that leaves fewer than this part of the points explains nothing: the others would be gross outliers beside it.
const KEPT: f64 = 0.75;
/// Standard deviations from which the zero of one of several joints counts as changed.
const CLEAR: f64 = 3.0;
/// Fewer postures than this are explained by any motion.
const POSTURES: usize = 5;

/// Findings about held-out recordings before which something moved; `fit`: what the robot was fitted with, if it states uncertainties.
#[must_use]
pub fn moved(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    robot: &Calibration,
    fit: Option<&MlFit>,
) -> Vec<Finding> {
    let recordings = inputs.recordings.values();
    let held_out = recordings.filter(|r| r.spec.usage == Usage::Validation);
    // One cause, one finding: the recordings that it holds in are listed.
    let mut found: Vec<(Tried, Vec<Tried>, Vec<&str>)> = Vec::new();
    for loaded in held_out {
        let under = conditions(loaded, &inputs.robot, inputs.robot.profile.solve.load);
        let view = View {
            inputs,
            tracks,
            robot,
            loaded,
            under: &under,
        };
        let Some((best, rivals)) = explained(&view, fit) else {
            continue;
        };
        match found.iter_mut().find(|f| f.0.motion == best.motion) {
            Some(same) => {
                same.2.push(&loaded.name);
                if best.none > same.0.none {
                    (same.0, same.1) = (best, rivals);
                }
            }
            None => found.push((best, rivals, vec![&loaded.name])),
        }
    }
    let findings = found.into_iter();
    findings
        .map(|(best, rivals, names)| finding(inputs, &best, &rivals, &names))
        .collect()
}

fn finding(inputs: &Inputs, best: &Tried, rivals: &[Tried], recordings: &[&str]) -> Finding {
    let model = &inputs.robot.model;
    let code = |motion: &Motion| match motion {
        Motion::Tracker => Some("moved(tracker)".to_owned()),
        Motion::Body(name) => Some(format!("remounted({name})")),
        Motion::Joint(_) | Motion::Zeros => None,
    };
    let joint = |tried: &Tried| match tried.motion {
        Motion::Joint(joint) => Some(model.joint(joint).name.clone()),
        _ => None,
    };
    let [distance, sigma] = [best.shift, best.sigma].map(Fact::meters);
    let finding = match &best.motion {
        Motion::Tracker => Finding::of_kind(catalog::TRACKER_MOVED, "held_out", About::Tracker)
            .with("distance", distance)
            .with("sigma", sigma),
        Motion::Body(name) => {
            let subject = Subject::body(name.clone());
            Finding::of_kind(catalog::BODY_REMOUNTED, "held_out", subject)
                .with("body", Fact::name(name.clone()))
                .with("distance", distance)
                .with("sigma", sigma)
        }
        Motion::Joint(_) | Motion::Zeros => {
            let joint = model.joint(best.steps[0].joint);
            let kind = match best.motion {
                Motion::Zeros => "several",
                _ => "one",
            };
            let of_joint = |value| match joint.kind.turns() {
                true => Fact::radians(value),
                false => Fact::meters(value),
            };
            let subject = Subject::joint(&joint.name);
            Finding::of_kind(catalog::JOINT_ZERO_CHANGED, kind, subject)
                .with("joint", Fact::name(&joint.name))
                .with("step", of_joint(best.shift))
                .with("sigma", of_joint(best.sigma))
        }
    };
    let names = |all: Vec<String>| (!all.is_empty()).then(|| Fact::names(all));
    // Those that changed together, or each of which explains as much.
    let joints: Vec<String> = match best.motion {
        Motion::Zeros => clear(best)
            .map(|step| model.joint(step.joint).name.clone())
            .collect(),
        _ => rivals.iter().filter_map(joint).collect(),
    };
    let mut finding = finding
        .with("recordings", Fact::names(recordings.iter().copied()))
        .with("none", Fact::meters(best.none))
        .with("best", Fact::meters(best.left))
        .with_some("angle", best.angle.map(Fact::radians))
        .with_some(
            "equivalent",
            names(rivals.iter().filter_map(|r| code(&r.motion)).collect()),
        )
        .with_some("joints", names(joints));
    finding.subject.recordings = recordings.iter().map(|name| (*name).to_owned()).collect();
    let limit = inputs.robot.profile.solve.limits.held_out_rms;
    let harmless = limit.is_some_and(|limit| best.none * 3.0_f64.sqrt() < limit);
    if harmless {
        finding.with_severity(Severity::Warning)
    } else {
        finding
    }
}

/// The motion that explains the errors of a recording, and those that are as good.
fn explained(view: &View<'_>, fit: Option<&MlFit>) -> Option<(Tried, Vec<Tried>)> {
    let points = view.points(&[]);
    if rows(&points) < POSTURES {
        return None;
    }
    let mut bodies: Vec<&str> = points.iter().map(|p| p.body).collect();
    bodies.sort_unstable();
    bodies.dedup();
    let places: Vec<Tried> = std::iter::once(tracker(&points))
        .chain(bodies.into_iter().map(|body| remounted(&points, body)))
        .flatten()
        .filter(explains)
        .collect();
    let place = best(&places);
    let beyond = |without: &BTreeSet<usize>| {
        fit.is_some_and(|fit| beyond_stated(view.inputs, fit, view.loaded, without))
    };
    // Where neither can be named, no joint is asked.
    if place.is_none() && !beyond(&BTreeSet::new()) {
        return None;
    }
    let all: Vec<JointId> = view.inputs.robot.model.independent_joints().collect();
    let joints: Vec<Tried> = all
        .iter()
        .filter_map(|joint| zeros_changed(view, &points, &[*joint]))
        .filter(explains)
        .collect();
    let least = |all: &[Tried]| all.iter().map(|t| t.left).fold(f64::INFINITY, f64::min);
    let simplest = f64::min(least(&places), least(&joints));
    let together = together(view, &points, &all)
        .filter(|zeros| ALIKE * zeros.left < simplest && beyond(&gross(&points, zeros)));
    if let Some(zeros) = together {
        return Some((zeros, Vec::new()));
    }
    // One number that explains more than six is the cause, and neither tracker nor body moved.
    let (mut own, mut others, found) = match place {
        Some(place) if ALIKE * least(&joints) >= places[place].left => (places, joints, place),
        _ => {
            let found = best(&joints)?;
            beyond(&gross(&points, &joints[found])).then_some((joints, places, found))?
        }
    };
    let found = own.remove(found);
    own.append(&mut others);
    own.retain(|t| t.left < ALIKE * found.left);
    own.sort_by(|a, b| a.left.total_cmp(&b.left));
    Some((found, own))
}

/// Steps of the zeros that changed.
fn clear(zeros: &Tried) -> impl Iterator<Item = &ZeroStep> {
    zeros.steps.iter().filter(|step| step.clearness() > CLEAR)
}

/// The zeros of all joints together, where that can be named: more than one of them changed.
fn together(view: &View<'_>, points: &[Seen<'_>], joints: &[JointId]) -> Option<Tried> {
    if joints.len() < 2 || rows(points) <= joints.len() {
        return None;
    }
    let zeros = zeros_changed(view, points, joints)?;
    let named = zeros.none >= NAMED * zeros.left && explains(&zeros);
    (named && clear(&zeros).count() > 1).then_some(zeros)
}

/// Whether a motion explains nearly what a named one does. Where it has nothing to do with a body whose errors are large, these are its
/// outliers: what is left of the others is as small with it as without, or they are too many for outliers.
fn explains(tried: &Tried) -> bool {
    let kept = tried.kept.iter().filter(|kept| **kept).count() as f64;
    ALIKE * tried.none >= NAMED * tried.left && kept >= KEPT * tried.kept.len() as f64
}

/// Number of the best of these, if it can be named.
fn best(all: &[Tried]) -> Option<usize> {
    let numbered = all.iter().enumerate();
    let (number, best) = numbered.min_by(|a, b| a.1.left.total_cmp(&b.1.left))?;
    (best.none >= NAMED * best.left).then_some(number)
}

/// Rows with gross outliers beside a motion.
fn gross(points: &[Seen<'_>], tried: &Tried) -> BTreeSet<usize> {
    let outliers = points.iter().zip(&tried.kept).filter(|(_, kept)| !**kept);
    outliers.map(|(point, _)| point.row).collect()
}

/// Whether the errors of a recording, but for these rows, are beyond what the fit states of their prediction.
fn beyond_stated(inputs: &Inputs, fit: &MlFit, loaded: &Loaded, without: &BTreeSet<usize>) -> bool {
    let samples = &fit.formulation.samples;
    let other =
        |(recording, row): &(String, usize)| *recording != loaded.name || without.contains(row);
    let numbered = samples.iter().enumerate();
    let others: BTreeSet<usize> = numbered.filter(|s| other(s.1)).map(|s| s.0).collect();
    let levels = HeldOutLevels::of(inputs, samples);
    let level = |_, kind, found| levels.level(loaded, kind, found);
    let chi2 = fit.solution.held_out_chi2(&others, &level);
    chi2.is_some_and(|(chi2, rows)| {
        let stated = Agreement::of(chi2, rows, fit.solution.degrees_of_freedom);
        stated.value > stated.high
    })
}
