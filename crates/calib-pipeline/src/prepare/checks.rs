//! Data checks before anything is fitted: what the recordings say against what the profile asks.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use calib_checks::rigid_body::Template;
use calib_checks::{Expectations, checks, held_out_in_training, other_scales, other_shapes};
use calib_core::effect::{Drives, Effect, Source};
use calib_finding::{About, Fact, Finding, Severity, Subject, Unit, catalog};
use calib_profile::{BodyKind, Contact, Free, JointFree, Load, Profile, Usage};
use calib_recording::Poses;
use calib_report::RejectedFor;
use calib_urdf::{JointId, JointKind, RobotModel};

use crate::prepare::conditions::{missing_temperatures, missing_torques};
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::slides::scales;
use crate::prepare::untracked::missing_bodies;

/// Fewest rows of a recording that a fit can use: a sphere has four unknowns, and one row must check it.
const MIN_POSES: usize = 5;

/// All findings of all recordings, recordings in order.
#[must_use]
pub fn check(inputs: &Inputs) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, loaded) in &inputs.recordings {
        let tracked = without_coordinates(inputs, loaded);
        let missing = missing_bodies(inputs, loaded).into_iter();
        findings.extend(missing.map(|finding| finding.in_recording(name)));
        let mut of_data = checks(&tracked, &expectations(inputs, loaded));
        // Rows that this took out had been seen.
        if let Some(rest) = without_held(inputs, loaded, &tracked) {
            of_data.retain(|f| f.id != catalog::MANY_LOST);
            let of_rest = checks(&rest, &expectations(inputs, loaded)).into_iter();
            of_data.extend(of_rest.filter(|f| f.id == catalog::MANY_LOST));
        }
        for mut finding in of_data {
            let same = |earlier: &&mut Finding| {
                earlier.id == catalog::MISSING_MARKER
                    && earlier.facts == finding.facts
                    && earlier.subject.about == finding.subject.about
            };
            // A name that is wrong in the profile is wrong for every recording: it is one finding.
            if let Some(earlier) = findings.iter_mut().find(same) {
                earlier.subject.recordings.push(name.clone());
                continue;
            }
            finding = finding.in_recording(name);
            findings.push(finding);
        }
    }
    let is = |r: &&Loaded, validation: bool| (r.spec.usage == Usage::Validation) == validation;
    for held_out in inputs.recordings.values().filter(|r| is(r, true)) {
        for training in inputs.recordings.values().filter(|r| is(r, false)) {
            findings.extend(held_out_in_training(&held_out.poses, &training.poses).map(
                |finding| {
                    finding
                        .in_recording(&held_out.name)
                        .with("training", Fact::name(&training.name))
                },
            ));
        }
    }
    findings.extend(shapes(inputs));
    findings.extend(missing_torques(inputs));
    findings.extend(missing_temperatures(inputs));
    findings.extend(no_masses(inputs));
    findings.extend(stood_still(inputs));
    findings
}

/// Bodies with another shape, and lengths of another scale, in another recording.
fn shapes(inputs: &Inputs) -> Vec<Finding> {
    let Some(any) = inputs.recordings.values().next() else {
        return Vec::new();
    };
    let all = inputs.recordings.values();
    let all: Vec<(&str, &Poses)> = all.map(|r| (r.name.as_str(), &r.poses)).collect();
    let expected = expectations(inputs, any);
    let mut findings = other_shapes(&all, &expected);
    findings.extend(other_scales(&all, &expected));
    findings
}

/// What the tracker saw: coordinates of touched points are stated, and in a frame of their own.
fn without_coordinates<'a>(inputs: &Inputs, loaded: &'a Loaded) -> Cow<'a, Poses> {
    let mut poses = Cow::Borrowed(&loaded.poses);
    let contacts = inputs.robot.profile.contacts.values();
    for columns in contacts.filter_map(Contact::coordinates) {
        if poses.markers.contains_key(columns) {
            poses.to_mut().markers.remove(columns);
        }
    }
    poses
}

/// The rows that are not copies of another one and do not have its joint readings; `None` where that is all of them.
fn without_held(inputs: &Inputs, loaded: &Loaded, tracked: &Poses) -> Option<Poses> {
    let out = inputs.excluded.iter();
    let out = out.filter(|out| out.recording == loaded.name);
    let held: BTreeSet<usize> = out
        .filter(|out| matches!(out.cause, RejectedFor::HeldReadings | RejectedFor::Copied))
        .map(|out| out.row)
        .collect();
    let rest: Vec<usize> = (0..tracked.len())
        .filter(|row| !held.contains(row))
        .collect();
    (!held.is_empty()).then(|| tracked.select(&rest))
}

/// Rows that a recording needs. Poses that are fitted together may be spread over as many recordings as one likes.
fn fewest_poses(inputs: &Inputs, loaded: &Loaded) -> usize {
    let fitted = inputs.recordings.values();
    let mut origins = inputs.robot.profile.origins.values();
    let is_swept = origins.any(|origin| origin.sweep == loaded.name);
    let fitted = fitted.filter(|r| r.spec.usage != Usage::Validation);
    let poses: usize = fitted.map(|r| r.poses.len()).sum();
    let copies = inputs.excluded.iter();
    let copies = copies.filter(|out| out.cause == RejectedFor::Copied);
    let copies = copies.filter(|out| out.recording == loaded.name);
    let copies: BTreeSet<usize> = copies.map(|out| out.row).collect();
    match loaded.spec.usage {
        // Its measurements are in another recording.
        _ if !copies.is_empty() && copies.len() == loaded.poses.len() => 0,
        Usage::Validation => 1,
        Usage::Static if poses >= MIN_POSES => 1,
        // What is no origin's sweep is fitted with all others.
        Usage::Sweep if !is_swept && poses >= MIN_POSES => 1,
        Usage::Static | Usage::Sweep => MIN_POSES,
    }
}

/// A joint that moves less than this stood still, rad, or m where the robot is large: encoders flicker by less.
const STILL: f64 = 1e-3;

/// Joints of what is measured that are in the recordings and that no recording moves.
fn stood_still(inputs: &Inputs) -> Option<Finding> {
    let model = &inputs.robot.model;
    let profile = &inputs.robot.profile;
    let bodies = profile.bodies.values().map(|b| b.link);
    let links = bodies.chain(profile.points.values().map(|p| p.link));
    let carrying: BTreeSet<JointId> = links
        .flat_map(|link| model.chain(model.root(), link))
        .map(|step| step.joint)
        .collect();
    let declared = |joint: &JointId| {
        let own = profile.solve.joints.get(joint);
        own.is_some_and(|own| {
            let held = own.free.as_ref().is_some_and(BTreeSet::is_empty);
            held || !own.coupled_to.is_empty()
        })
    };
    let scales = scales(inputs);
    let still = |joint: &JointId| {
        let name = &model.joint(*joint).name;
        let columns = inputs.recordings.values();
        let columns = columns.filter_map(|r| r.poses.joints.get(name));
        let mut values = columns.flatten().flatten().copied().peekable();
        values.peek().is_some() && {
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| {
                (l.min(q), h.max(q))
            });
            high - low < STILL * scales[joint.index()]
        }
    };
    let names: Vec<String> = carrying
        .into_iter()
        .filter(|j| model.joint(*j).mimic.is_none() && !declared(j) && still(j))
        .map(|j| model.joint(j).name.clone())
        .collect();
    (!names.is_empty()).then(|| {
        Finding::new(catalog::JOINTS_STOOD_STILL, About::Fit).with("joints", Fact::names(names))
    })
}

/// The masses were assumed, and an effect of their load is free.
fn no_masses(inputs: &Inputs) -> Option<Finding> {
    let mass = inputs.robot.masses.assumed?;
    let profile = &inputs.robot.profile;
    let measured = profile.solve.load == Load::Measured;
    let by_gravity = |effect: &Effect| {
        let mut terms = effect.terms.iter();
        terms.any(|t| t.source == Source::Load && !(measured && t.drives == Drives::About))
    };
    let all = profile.solve.free.iter();
    let freed = all.filter_map(|f| match f {
        Free::Effect(effect) => Some(*effect),
        _ => None,
    });
    let own = profile
        .solve
        .joints
        .values()
        .flat_map(|j| &j.free)
        .flatten();
    let own = own.filter_map(|f| match f {
        JointFree::Effect(effect) => Some(*effect),
        _ => None,
    });
    let outside = profile.solve.joints.values().flat_map(|j| &j.outside);
    let outside = outside.map(|free| free.effect);
    let needed =
        freed.chain(own).chain(outside).any(by_gravity) || !profile.load.stiffness.is_empty();
    let kind = match profile.load.total_mass {
        Some(_) => "stated",
        None => "assumed",
    };
    needed.then(|| {
        let about = Subject::from(About::File(profile.urdf.clone()));
        Finding::of_kind(catalog::NO_MASSES, kind, about)
            .with("mass", Fact::number(mass, Unit::Kilogram))
    })
}

/// Whether a finding forbids to go on.
#[must_use]
pub fn stops(findings: &[Finding]) -> bool {
    findings.iter().any(|f| f.severity == Severity::Error)
}

/// Joint → what the joints that mimic it turn and slide for a unit of its reading, of those without readings of their own.
fn followers(model: &RobotModel, loaded: &Loaded) -> BTreeMap<String, [f64; 2]> {
    let mut out: BTreeMap<String, [f64; 2]> = BTreeMap::new();
    for id in model.joint_ids() {
        let joint = model.joint(id);
        if joint.law.source == id || loaded.poses.joints.contains_key(&joint.name) {
            continue;
        }
        let source = model.joint(joint.law.source).name.clone();
        let slides = usize::from(matches!(joint.kind, JointKind::Prismatic { .. }));
        out.entry(source).or_default()[slides] += joint.law.multiplier.abs();
    }
    out
}

/// The markers of each body that the table shows, and the templates that are stated of them.
pub(super) fn of_markers(
    profile: &Profile,
    poses: &Poses,
) -> (BTreeMap<String, Vec<String>>, BTreeMap<String, Template>) {
    let (mut bodies, mut templates) = (BTreeMap::new(), BTreeMap::new());
    for (body, spec) in &profile.bodies {
        let BodyKind::Markers { names, template } = &spec.kind else {
            continue;
        };
        if !names.iter().any(|m| poses.markers.contains_key(m)) {
            continue;
        }
        bodies.insert(body.clone(), names.clone());
        if let Some(points) = template {
            let template = Template {
                names: names.clone(),
                points: points.clone(),
            };
            templates.insert(body.clone(), template);
        }
    }
    (bodies, templates)
}

pub(crate) fn expectations(inputs: &Inputs, loaded: &Loaded) -> Expectations {
    let model = &inputs.robot.model;
    let profile = &inputs.robot.profile;
    let name = |id: &calib_urdf::JointId| model.joint(*id).name.clone();
    let (bodies, templates) = of_markers(profile, &loaded.poses);
    Expectations {
        bodies,
        templates,
        followers: followers(model, loaded),
        template_sigmas: profile
            .bodies
            .iter()
            .filter_map(|(body, spec)| Some((body.clone(), spec.template_sigma?)))
            .collect(),
        limits: model
            .joint_ids()
            // The reading of a coupled joint is not its position.
            .filter(|id| {
                let own = profile.solve.joints.get(id);
                own.is_none_or(|own| own.coupled_to.is_empty())
            })
            .filter_map(|id| Some((name(&id), model.joint(id).limits.range()?)))
            .collect(),
        asked: loaded
            .spec
            .ranges
            .iter()
            .map(|(id, range)| (name(id), *range))
            .collect(),
        reach: None,
        min_poses: fewest_poses(inputs, loaded),
        marker_sigma: profile.tracker.marker_coordinate(),
    }
}
