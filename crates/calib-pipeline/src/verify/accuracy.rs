//! How exact the result is: the tool's uncertainty over the workspace, and what an error on a new pose is made of.

use std::collections::BTreeMap;

use calib_core::effect::Source;
use calib_core::{Configuration, EffectKind, NoiseKind, Target};
use calib_geometry::so3;
use calib_profile::{Body, BodyKind, Usage};
use calib_report::{AccuracyLimit, ErrorSource, HeldOut, PoseError, Workspace, WorkspacePoint};
use calib_urdf::LinkId;
use nalgebra::Matrix6;

use crate::formulate::along_sight::orientation;
use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::joint_state;
use crate::prepare::conditions::Conditions;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;
use crate::verify::tracker_noise::TrackerNoise;

/// Indicated joint positions of a sample as a prediction's configuration, loads included.
#[must_use]
pub fn configuration(inputs: &Inputs, fit: &MlFit, q: &[f64]) -> Configuration {
    let model = &inputs.robot.model;
    let mut at = Configuration::zero();
    // Every joint in the middle of its backlash.
    let unknown = Conditions::default();
    let masses = &inputs.robot.masses;
    let loads = fit.formulation.loaded.then(|| masses.at(q));
    let free: Vec<_> = fit.formulation.masses.iter().map(|m| m.0).collect();
    for joint in model.joint_ids() {
        let Some(edge) = fit.formulation.joints[joint.index()] else {
            continue;
        };
        at = match &loads {
            Some(loads) => at.at(edge, &joint_state(model, joint, q, loads, &unknown)),
            None => at.with(edge, model.position(q, joint)),
        };
        if free.is_empty() {
            continue;
        }
        for kind in EffectKind::all().filter(|k| k.term().source == Source::Load) {
            let shares = masses.shares(q, joint, kind, &free);
            at = at.with_shares(edge, kind, shares);
        }
    }
    at
}

/// The link that the longest chain of joints carries a body on.
#[must_use]
pub fn tool_link(inputs: &Inputs) -> Option<LinkId> {
    let model = &inputs.robot.model;
    inputs
        .robot
        .profile
        .bodies
        .values()
        .map(|b| b.link)
        .max_by_key(|l| {
            model
                .chain(model.root(), *l)
                .iter()
                .filter(|s| model.joint(s.joint).kind.axis().is_some())
                .count()
        })
}

/// Postures at which the workspace is sampled at most.
const WORKSPACE_POSES: usize = 60;

pub(crate) fn workspace(inputs: &Inputs, fit: &MlFit) -> Option<Workspace> {
    let model = &inputs.robot.model;
    let tool = tool_link(inputs)?;
    let root = fit.formulation.links[model.root().index()]?;
    let mut bodies = inputs.robot.profile.bodies.iter();
    let body = bodies.find(|(name, body)| {
        let seen = &fit.formulation;
        body.link == tool && (seen.bodies.contains_key(*name) || seen.points.contains_key(*name))
    });
    // What was seen, not the link: a zero offset against a mount is a convention that a link frame would show as error.
    let name = body.map_or(&model.link(tool).name, |(name, _)| name);
    let target = *targets(fit, name, tool).first()?;
    let rows: Vec<&Vec<f64>> = inputs
        .recordings
        .values()
        .filter(|r| r.spec.usage != Usage::Sweep)
        .flat_map(|r| r.q.iter().flatten())
        .collect();
    let step = rows.len().div_ceil(WORKSPACE_POSES).max(1);
    let mut points = Vec::new();
    for q in rows.iter().step_by(step) {
        let at = configuration(inputs, fit, q);
        let place = fit.solution.linear_point(root, target, &at).ok()?;
        // Seen from the tracker, as everything that was verified: where the robot's base begins is another convention.
        let tracker = fit.formulation.tracker;
        let seen = fit.solution.known_point(tracker, target, &at).ok()?;
        points.push(WorkspacePoint {
            position_m: place.position.coords.into(),
            sigma_m: seen.covariance?.trace().max(0.0).sqrt(),
        });
    }
    Workspace::of(name, &model.link(model.root()).name, points)
        .map(|w| w.relative_to(&inputs.robot.profile.tracker.frame))
}

/// What a held-out error is made of: rms over the bodies and postures that were held out, in meters, beside the noise of the tracker.
pub(crate) fn accuracy_limits(
    inputs: &Inputs,
    held_out: Option<&HeldOut>,
    fit: &MlFit,
    tracker: &TrackerNoise<'_>,
) -> Vec<AccuracyLimit> {
    let Some((held_out, measured)) = held_out.and_then(|h| Some((h, h.calibrated?))) else {
        return Vec::new();
    };
    let of_errors = OfErrors::of(inputs, held_out, fit);
    let parameters = of_errors.parameters;
    let tracker = tracker.over(inputs, held_out).unwrap_or(0.0);
    let joints = f64::hypot(
        fit.joint_sigma().unwrap_or(0.0) * of_errors.lever,
        fit.slide_sigma().unwrap_or(0.0) * of_errors.slides,
    );
    let explained = parameters.powi(2) + tracker.powi(2) + joints.powi(2);
    let rest = (measured.rms_m.powi(2) - explained).max(0.0).sqrt();
    let total = explained + rest.powi(2);
    let limit = |(kind, sigma): (ErrorSource, f64)| {
        let share = if total > 0.0 {
            sigma.powi(2) / total
        } else {
            0.0
        };
        AccuracyLimit::new(kind, sigma, share)
    };
    let mut limits: Vec<AccuracyLimit> = [
        (ErrorSource::TrackerNoise, tracker),
        (ErrorSource::JointNoise, joints),
        (ErrorSource::Parameters, parameters),
        (ErrorSource::NotModeled, rest),
    ]
    .map(limit)
    .into();
    limits.sort_by(|a, b| b.share.unwrap_or(0.0).total_cmp(&a.share.unwrap_or(0.0)));
    limits
}

/// Held-out errors that are looked at, at most: more change nothing but the time.
const ERRORS: usize = 120;

/// What the joints and the parameters do to the bodies and in the postures that were held out.
#[derive(Debug, Clone, Copy, Default)]
struct OfErrors {
    /// Root sum of squares over the joints of how far the body moves per radian, rms over the errors, m.
    lever: f64,
    /// The same of joints that slide: per meter, 1 each.
    slides: f64,
    /// σ of the body's predicted position, rms over the errors, m.
    parameters: f64,
}

impl OfErrors {
    fn of(inputs: &Inputs, held_out: &HeldOut, fit: &MlFit) -> Self {
        let errors: Vec<&PoseError> = held_out.poses.iter().filter(|p| !p.screened).collect();
        let step = errors.len().div_ceil(ERRORS).max(1);
        let rows = rows_by_label(inputs);
        let (mut levers, mut slides, mut variances, mut n) = (0.0, 0.0, 0.0, 0.0);
        // Markers of one body and posture are alike.
        let mut known: BTreeMap<(&String, &String), (f64, f64, f64)> = BTreeMap::new();
        for error in errors.into_iter().step_by(step) {
            let of_body = body_of(inputs, &error.subject);
            let (Some(q), Some((name, body))) = (rows.get(&error.pose), of_body) else {
                continue;
            };
            let key = (&error.pose, name);
            let (lever, slide, variance) = *known.entry(key).or_insert_with(|| {
                let variance = variance_of(inputs, fit, (name, body.link), q);
                let squared = |turning| squared_lever(inputs, body.link, q, turning);
                (squared(true), squared(false), variance)
            });
            levers += lever;
            slides += slide;
            variances += variance;
            n += 1.0;
        }
        let rms = |sum: f64| (sum / f64::max(n, 1.0)).sqrt();
        Self {
            lever: rms(levers),
            slides: rms(slides),
            parameters: rms(variances),
        }
    }
}

/// Joint positions by the labels of held-out poses.
fn rows_by_label(inputs: &Inputs) -> BTreeMap<String, &Vec<f64>> {
    let recordings = inputs.recordings.values();
    let of_recording = recordings.flat_map(|r| {
        let rows = r.poses.rows.iter().zip(&r.q);
        rows.filter_map(|(row, q)| Some((format!("{}:{row}", r.name), q.as_ref()?)))
    });
    of_recording.collect()
}

/// The body that a held-out error is of: by its own name, or by a marker's.
pub(crate) fn body_of<'a>(inputs: &'a Inputs, subject: &str) -> Option<(&'a String, &'a Body)> {
    let mut bodies = inputs.robot.profile.bodies.iter();
    bodies.find(|(name, body)| {
        *name == subject
            || matches!(&body.kind, BodyKind::Markers { names, .. } if names.iter().any(|name| name == subject))
    })
}

/// Variance of a body's position as the tracker sees it, by the parameters alone, m²: of its origin or, where it has no orientation, the mean
/// over its markers.
fn variance_of(inputs: &Inputs, fit: &MlFit, (name, link): (&String, LinkId), q: &[f64]) -> f64 {
    let at = configuration(inputs, fit, q);
    let targets = targets(fit, name, link);
    let variance = |target: &Target| {
        let tracker = fit.formulation.tracker;
        let seen = fit.solution.known_point(tracker, *target, &at);
        let covariance = seen.ok().and_then(|seen| seen.covariance);
        covariance.map_or(0.0, |c| c.trace().max(0.0))
    };
    let sum: f64 = targets.iter().map(variance).sum();
    sum / targets.len().max(1) as f64
}

/// What is seen of a body: its origin, its markers where it has no orientation, or else the link that carries it.
fn targets(fit: &MlFit, name: &str, link: LinkId) -> Vec<Target> {
    let formulation = &fit.formulation;
    if let Some(body) = formulation.bodies.get(name) {
        return vec![Target::Frame(*body)];
    }
    if let Some(points) = formulation.points.get(name).filter(|p| !p.is_empty()) {
        return points.values().copied().map(Target::Point).collect();
    }
    let link = formulation.links[link.index()];
    link.map(Target::Frame).into_iter().collect()
}

/// Sum of squares over the joints that turn, or that slide, of how far a link moves per radian or meter.
fn squared_lever(inputs: &Inputs, link: LinkId, q: &[f64], turning: bool) -> f64 {
    let model = &inputs.robot.model;
    let columns = model.jacobian(q, link);
    let of_kind = columns
        .iter()
        .filter(|(id, _)| model.joint(*id).kind.turns() == turning);
    of_kind
        .map(|(_, c)| c.fixed_rows::<3>(3).norm_squared())
        .sum()
}

/// The body that the longest chain of joints carries.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ToolBody<'a> {
    name: &'a String,
    kind: &'a BodyKind,
}

pub(crate) fn tool_bodies(inputs: &Inputs) -> Vec<ToolBody<'_>> {
    let tool = tool_link(inputs);
    let bodies = inputs.robot.profile.bodies.iter();
    bodies
        .filter(|(_, body)| Some(body.link) == tool)
        .map(|(name, body)| {
            let kind = &body.kind;
            ToolBody { name, kind }
        })
        .collect()
}

impl ToolBody<'_> {
    /// What its errors are listed under: its markers, or its own name.
    pub(crate) fn subjects(&self) -> Vec<&String> {
        match self.kind {
            BodyKind::Markers { names, .. } => names.iter().chain([self.name]).collect(),
            BodyKind::Pose => vec![self.name],
        }
    }

    /// rms angle that the noise of one measurement of its orientation makes, rad, where a level of noise is as `level` says; `None` where
    /// none is measured.
    pub(crate) fn orientation_noise(
        &self,
        tracks: &BTreeMap<String, BodyTrack>,
        fit: &MlFit,
        level: &dyn Fn(NoiseKind, f64) -> f64,
    ) -> Option<f64> {
        let noise = TrackerNoise::of(fit);
        let track = tracks.get(self.name)?;
        if *self.kind == BodyKind::Pose || track.is_computed {
            let mut noise = fit.solution.noise.iter();
            let found = noise.find(|n| n.kind == NoiseKind::Orientation)?;
            let found = orientation(fit, self.name).unwrap_or(found.sigma.powi(2));
            let variance = level(NoiseKind::Orientation, found);
            return Some((3.0 * variance).sqrt());
        }
        // Fit of a pose to n markers: information Σ J_iᵀJ_i/σ_i² with J_i = [−[p_i]ₓ, 1], and the part of the rotation.
        let template = track.template.as_ref()?;
        let seen = template.names.iter().zip(&template.points);
        let information: Option<Matrix6<f64>> = seen
            .map(|(name, p)| {
                let mut j = nalgebra::Matrix3x6::zeros();
                j.fixed_view_mut::<3, 3>(0, 0)
                    .copy_from(&-so3::skew(&p.coords));
                j.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
                Some(j.transpose() * j / level(NoiseKind::Position, noise.variance(name)?))
            })
            .sum();
        let covariance = nalgebra::Cholesky::new(information?)?.inverse();
        Some(covariance.fixed_view::<3, 3>(0, 0).trace().max(0.0).sqrt())
    }
}
