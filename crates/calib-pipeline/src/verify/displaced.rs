//! Did the tracker, a body, what follows a joint, or the zero of a joint change before a held-out recording, by less than `moved` tells from its
//! noise?
//!
//! A motion that all held-out errors of a recording share is seen from a fraction of the noise of one. It is asked by a score test over the errors
//! and what the fit states of them ([`calib_core::Solution::held_out_motions`]), where nothing else explains them:
//!
//! ```text
//! T = Δ/s² − k ln h,   s² = max(1, (F − Δ)/(h − k) of the largest Δ)        the best counts
//! (Δ/k) / s²  ~  F(k, h − k)
//! ```
//!
//! h numbers, k unknowns. Errors that are smaller than stated, as of means where rows are expected, are no reason to take what the parameters leave
//! open for smaller: s² is at least 1. A motion is named where chance makes it so large in one of 10⁵ validations, where it explains a tenth of the errors or more, and
//! where what it leaves agrees with what the fit states: errors of a model that lacks something have a part in common as well.

use std::collections::{BTreeMap, BTreeSet};

use calib_core::{Displaced, FrameId, HeldOutMotion};
use calib_finding::{About, Fact, Finding, Severity, Subject, catalog};
use calib_profile::{Body, Usage};
use calib_report::{Agreement, HeldOut};
use calib_urdf::{JointId, LinkId, RobotModel};
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Vector3};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::formulate::formulation::MlFit;
use crate::formulate::row_levels::HeldOutLevels;
use crate::prepare::conditions::conditions;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::verify::Verified;
use crate::verify::accuracy::body_of;
use crate::verify::agreement::screened;

/// Chance of a motion where nothing moved, in one validation.
const CHANCE: f64 = 1e-5;
/// Part of the errors that it explains.
const SHARE: f64 = 0.1;
/// T by which another motion is less likely: 20 : 1.
const DISTINCT: f64 = 6.0;
/// σ of a rotation, rad, from which on nothing shows it.
const UNSEEN: f64 = 0.05;
/// Fewer postures than this are explained by any motion.
const POSTURES: usize = 5;

/// What may have moved.
#[derive(Debug, Clone, PartialEq, Eq)]
enum What {
    Tracker,
    Body(String),
    /// What follows a joint, on the link that the joint is mounted on.
    Origin(JointId),
    Zero(JointId),
}

/// One of them, and what it moves.
struct Candidate {
    what: What,
    displaced: Displaced,
    /// Names of the bodies that show it.
    bodies: BTreeSet<String>,
    /// The link whose axes it has, and the place on it.
    on: (LinkId, Isometry3<f64>),
}

/// What was tried, with its T.
type Tried<'a> = (&'a Candidate, &'a HeldOutMotion, f64);

/// Findings about held-out recordings before which something moved a little, where nothing else was found to explain their errors.
pub(super) fn displaced(inputs: &Inputs, fit: &MlFit, verified: &Verified) -> Vec<Finding> {
    let Some(held_out) = verified.held_out.as_ref().filter(|h| !h.left_out) else {
        return Vec::new();
    };
    let missing = verified.causes.goodness.as_ref();
    let explained = missing.is_none_or(|goodness| !goodness.missing.is_empty())
        || verified.causes.change.is_some()
        || !verified.findings.is_empty();
    if explained {
        return Vec::new();
    }
    let candidates = candidates(inputs, fit);
    let of = |loaded: &Loaded| of_recording(inputs, fit, held_out, &candidates, loaded);
    let recordings = inputs.recordings.values();
    let validation = recordings.filter(|r| r.spec.usage == Usage::Validation);
    validation.filter_map(of).collect()
}

fn of_recording(
    inputs: &Inputs,
    fit: &MlFit,
    held_out: &HeldOut,
    candidates: &[Candidate],
    loaded: &Loaded,
) -> Option<Finding> {
    let samples = &fit.formulation.samples;
    let mut without = screened(inputs, fit, Some(held_out));
    let numbered = samples.iter().enumerate();
    without.extend(numbered.filter(|s| s.1.0 != loaded.name).map(|s| s.0));
    let places = Places::of(inputs, fit, loaded);
    let place = |k: usize, sample: usize| {
        let (link, on_link) = &candidates[k].on;
        places.at(*link, samples[sample].1) * on_link
    };
    let levels = HeldOutLevels::of(inputs, samples);
    let level_of = |_, kind, found| levels.level(loaded, kind, found);
    let asked: Vec<Displaced> = candidates.iter().map(|c| c.displaced.clone()).collect();
    let found = fit
        .solution
        .held_out_motions(&without, &level_of, &asked, &place)?;
    if found.samples < POSTURES {
        return None;
    }
    let h = found.rows as f64;
    let all = || found.motions.iter().flatten();
    let largest = all().map(|m| m.explains).fold(0.0, f64::max);
    let unknowns = all().map(|m| m.unknowns).fold(0.0, f64::max);
    let level = ((found.chi2 - largest) / (h - unknowns).max(1.0)).max(1.0);
    let t = |motion: &HeldOutMotion| motion.explains / level - motion.unknowns * h.ln();
    let tried = candidates.iter().zip(&found.motions);
    let tried = tried.filter_map(|(c, motion)| Some((c, motion.as_ref()?, t(motion.as_ref()?))));
    let mut tried: Vec<Tried<'_>> = tried.collect();
    tried.sort_by(|a, b| b.2.total_cmp(&a.2));
    let highest = tried.first()?.2;
    tried.retain(|one| one.2 > highest - DISTINCT);
    // Bodies come loose more often than joints.
    let usual = |one: &&Tried<'_>| !matches!(one.0.what, What::Origin(_));
    let best = *tried.iter().find(usual).unwrap_or(&tried[0]);
    let freedom = fit.solution.degrees_of_freedom;
    let before = Agreement::of(found.chi2, found.rows, freedom);
    let left = found.chi2 - best.1.explains;
    let after = Agreement::of(left, found.rows, freedom);
    let is_named = chance(best.1, level, h) * (candidates.len() as f64) < CHANCE
        && best.1.explains > SHARE * found.chi2
        && !after.is_beyond();
    if !is_named {
        return None;
    }
    let all = tried.iter().map(|one| one.0);
    let rivals: Vec<&Candidate> = all.filter(|c| c.what != best.0.what).collect();
    let rms = rms(inputs, held_out, &loaded.name, &best.0.bodies)?;
    Some(finding(
        inputs,
        (&best, &rivals),
        &loaded.name,
        [before, after],
        rms,
    ))
}

/// Chance of an explanation so large.
fn chance(motion: &HeldOutMotion, level: f64, h: f64) -> f64 {
    let (k, rest) = (motion.unknowns, h - motion.unknowns);
    let value = motion.explains / k / level;
    let of = FisherSnedecor::new(k, rest);
    of.map_or(1.0, |of| of.sf(value.max(0.0)))
}

fn finding(
    inputs: &Inputs,
    (best, rivals): (&Tried<'_>, &[&Candidate]),
    recording: &str,
    [before, after]: [Agreement; 2],
    rms: f64,
) -> Finding {
    let model = &inputs.robot.model;
    let (candidate, motion, _) = best;
    let joint_name = |joint: JointId| model.joint(joint).name.clone();
    let finding = match &candidate.what {
        What::Tracker => Finding::of_kind(catalog::TRACKER_MOVED, "displaced", About::Tracker),
        What::Body(name) => {
            let subject = Subject::body(name.clone());
            Finding::of_kind(catalog::BODY_REMOUNTED, "displaced", subject)
                .with("body", Fact::name(name.clone()))
        }
        What::Zero(joint) => {
            let named = model.joint(*joint);
            let fact = match named.kind.turns() {
                true => Fact::radians,
                false => Fact::meters,
            };
            let subject = Subject::joint(&named.name);
            Finding::of_kind(catalog::JOINT_ZERO_CHANGED, "displaced", subject)
                .with("joint", Fact::name(&named.name))
                .with("step", fact(motion.motion[0]))
                .with("sigma", fact(motion.covariance[(0, 0)].sqrt()))
        }
        What::Origin(joint) => {
            let named = model.joint(*joint);
            let subject = Subject::joint(&named.name);
            Finding::new(catalog::JOINT_ORIGIN_MOVED, subject)
                .with("joint", Fact::name(&named.name))
                .with("link", Fact::name(&model.link(named.parent).name))
        }
    };
    let finding = match motion.motion[..] {
        [wx, wy, wz, x, y, z] => {
            let (distance, sigma) = size(motion, Vector3::new(x, y, z));
            let angle = Vector3::new(wx, wy, wz).norm();
            let turns = motion.covariance.diagonal().rows(0, 3).sum().sqrt();
            let is_seen = turns < UNSEEN;
            finding
                .with("distance", Fact::meters(distance))
                .with("sigma", Fact::meters(sigma))
                .with_some("angle", is_seen.then(|| Fact::radians(angle)))
        }
        _ => finding,
    };
    let code = |c: &&Candidate| match &c.what {
        What::Tracker => Some("moved(tracker)".to_owned()),
        What::Body(name) => Some(format!("remounted({name})")),
        What::Origin(joint) => Some(format!("origin({})", joint_name(*joint))),
        What::Zero(_) => None,
    };
    let zero = |c: &&Candidate| match c.what {
        What::Zero(joint) => Some(joint_name(joint)),
        _ => None,
    };
    let names = |all: Vec<String>| (!all.is_empty()).then(|| Fact::names(all));
    let equivalent = rivals.iter().copied().filter_map(|c| code(&c));
    let joints = rivals.iter().copied().filter_map(|c| zero(&c));
    let mut finding = finding
        .with("recordings", Fact::names([recording]))
        .with("before", Fact::ratio(before.value))
        .with("after", Fact::ratio(after.value))
        .with("rms", Fact::meters(rms))
        .with_some("equivalent", names(equivalent.collect()))
        .with_some("joints", names(joints.collect()));
    finding.subject.recordings = std::iter::once(recording.to_owned()).collect();
    let limit = inputs.robot.profile.solve.limits.held_out_rms;
    if limit.is_some_and(|limit| rms < limit) {
        finding.with_severity(Severity::Warning)
    } else {
        finding
    }
}

/// Length of a translation and its σ along it, m.
fn size(motion: &HeldOutMotion, v: Vector3<f64>) -> (f64, f64) {
    let covariance: Matrix3<f64> = motion.covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let along = v.try_normalize(0.0).unwrap_or_else(Vector3::x);
    let variance = along.dot(&(covariance * along));
    (v.norm(), variance.max(0.0).sqrt())
}

/// Held-out rms error of these bodies in a recording, m.
fn rms(
    inputs: &Inputs,
    held_out: &HeldOut,
    recording: &str,
    bodies: &BTreeSet<String>,
) -> Option<f64> {
    let poses = held_out.poses.iter().filter(|p| !p.screened);
    let own = |label: &str| {
        let rest = label.strip_prefix(recording);
        rest.is_some_and(|rest| rest.starts_with(':'))
    };
    let poses = poses.filter(|p| own(&p.pose));
    let of = |subject: &String| body_of(inputs, subject).map(|(name, _)| name);
    let poses = poses.filter(|p| of(&p.subject).is_some_and(|name| bodies.contains(name)));
    let squares: Vec<f64> = poses
        .filter_map(|p| Some(p.calibrated_m?.powi(2)))
        .collect();
    let count = squares.len() as f64;
    (count > 0.0).then(|| (squares.iter().sum::<f64>() / count).sqrt())
}

/// Where links are in the rows of a recording.
struct Places {
    tracker_from_link: BTreeMap<usize, Vec<Isometry3<f64>>>,
}

impl Places {
    fn of(inputs: &Inputs, fit: &MlFit, loaded: &Loaded) -> Self {
        let under = conditions(loaded, &inputs.robot, inputs.robot.profile.solve.load);
        let robot = &fit.calibration;
        let rows = loaded.q.iter().enumerate();
        let of_row = rows.filter_map(|(row, q)| {
            let root_from_link = robot.root_from_link_under(q.as_ref()?, &under[row]);
            let links = root_from_link.iter();
            Some((row, links.map(|x| robot.tracker_from_root * x).collect()))
        });
        Self {
            tracker_from_link: of_row.collect(),
        }
    }

    fn at(&self, link: LinkId, row: usize) -> Isometry3<f64> {
        let known = self.tracker_from_link.get(&row);
        known.map_or_else(Isometry3::identity, |links| links[link.index()])
    }
}

/// Everything that may have moved, each motion once: what moves all bodies as one on the root is a motion of the tracker.
fn candidates(inputs: &Inputs, fit: &MlFit) -> Vec<Candidate> {
    let model = &inputs.robot.model;
    let frames = frames(inputs, fit);
    let bodies = || frames.keys();
    let all: BTreeSet<String> = bodies().cloned().collect();
    let seen = |names: &BTreeSet<String>| {
        let of = names.iter().map(|name| frames[name].0);
        Displaced::Seen(of.collect())
    };
    let root = model.root();
    let mut known: BTreeSet<(usize, BTreeSet<String>)> = BTreeSet::new();
    let mut out = Vec::new();
    let mut add = |what: What, names: BTreeSet<String>, on: (LinkId, Isometry3<f64>)| {
        let place = (carrier(model, on.0).index(), names.clone());
        if !names.is_empty() && known.insert(place) {
            out.push(Candidate {
                what,
                displaced: seen(&names),
                bodies: names,
                on,
            });
        }
    };
    let at = |place: Point3<f64>| Isometry3::from(Translation3::from(place.coords));
    add(What::Tracker, all, (root, Isometry3::identity()));
    for name in bodies() {
        let (frame, body) = frames[name];
        let alone = frames.values().filter(|other| other.0 == frame).count() == 1;
        if alone {
            let middle = middle(fit, name);
            add(
                What::Body(name.clone()),
                std::iter::once(name.clone()).collect(),
                (body.link, at(middle)),
            );
        }
    }
    let joints: Vec<JointId> = model.independent_joints().collect();
    for &joint in &joints {
        let of = model.joint(joint);
        add(
            What::Origin(joint),
            beyond(model, joint, &frames),
            (of.parent, of.parent_link_from_joint),
        );
    }
    for joint in joints {
        let edge = fit.formulation.joints[joint.index()];
        let names = beyond(model, joint, &frames);
        if let Some(edge) = edge.filter(|_| !names.is_empty()) {
            out.push(Candidate {
                what: What::Zero(joint),
                displaced: Displaced::Zero(edge),
                bodies: names,
                on: (root, Isometry3::identity()),
            });
        }
    }
    out
}

/// Frame of every body that was measured.
fn frames<'a>(inputs: &'a Inputs, fit: &MlFit) -> BTreeMap<String, (FrameId, &'a Body)> {
    let formulation = &fit.formulation;
    let bodies = inputs.robot.profile.bodies.iter();
    let frame = |(name, body): (&'a String, &'a Body)| {
        let own = formulation.bodies.get(name).copied();
        let of_points = || formulation.links[body.link.index()];
        let seen = own.or_else(|| {
            let points = formulation.points.get(name);
            points.filter(|p| !p.is_empty()).and_then(|_| of_points())
        });
        Some((name.clone(), (seen?, body)))
    };
    bodies.filter_map(frame).collect()
}

/// Bodies on links that follow a joint.
fn beyond(
    model: &RobotModel,
    joint: JointId,
    frames: &BTreeMap<String, (FrameId, &Body)>,
) -> BTreeSet<String> {
    let follows = |link: LinkId| {
        let chain = model.chain(model.root(), link);
        chain.iter().any(|step| step.joint == joint)
    };
    let bodies = frames.iter().filter(|(_, (_, body))| follows(body.link));
    bodies.map(|(name, _)| name.clone()).collect()
}

/// The link on which a link is fixed, or itself: everything between moves as one.
fn carrier(model: &RobotModel, link: LinkId) -> LinkId {
    let chain = model.chain(model.root(), link);
    let moving = |joint: JointId| model.joint(joint).kind.axis().is_some();
    let last = chain.iter().rev().find(|step| moving(step.joint));
    last.map_or(model.root(), |step| model.joint(step.joint).child)
}

/// Middle of a body's markers on its link, or its origin, m.
fn middle(fit: &MlFit, name: &str) -> Point3<f64> {
    let robot = &fit.calibration;
    let points = robot.points.get(name).filter(|p| !p.is_empty());
    if let Some(points) = points {
        let sum: Vector3<f64> = points.values().map(|p| p.coords).sum();
        return Point3::from(sum / points.len() as f64);
    }
    let mount = robot.mounts.get(name);
    mount.map_or_else(Point3::origin, |m| Point3::from(m.translation.vector))
}
