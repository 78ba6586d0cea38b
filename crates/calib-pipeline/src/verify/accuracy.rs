//! How exact the result is: the tool's uncertainty over the workspace, and what an error on a new pose is made of.

use std::collections::BTreeMap;

use calib_core::effect::Source;
use calib_core::{Configuration, EffectKind, GroupId, NoiseKind};
use calib_geometry::so3;
use calib_profile::{BodyKind, Usage};
use calib_report::{AccuracyLimit, ErrorSource, HeldOut, Workspace, WorkspacePoint};
use calib_urdf::LinkId;
use nalgebra::Matrix6;

use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::joint_state;
use crate::prepare::conditions::Conditions;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;

/// Indicated joint positions of a sample as a prediction's configuration, loads included.
pub(crate) fn configuration(inputs: &Inputs, fit: &MlFit, q: &[f64]) -> Configuration {
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
fn tool_link(inputs: &Inputs) -> Option<LinkId> {
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
    let link = fit.formulation.links[tool.index()]?;
    let body = fit
        .formulation
        .bodies
        .iter()
        .find(|(name, _)| inputs.robot.profile.bodies[*name].link == tool);
    // The body, not the link: a zero offset against a mount is a convention that a link frame would show as error.
    let (name, target) = body.map_or((&model.link(tool).name, link), |(n, frame)| (n, *frame));
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
        let place = fit.solution.relative_pose(root, target, &at).ok()?;
        // Seen from the tracker, as everything that was verified: where the robot's base begins is another convention.
        let seen = fit
            .solution
            .relative_pose(fit.formulation.tracker, target, &at)
            .ok()?;
        points.push(WorkspacePoint {
            position_m: place.pose.translation.vector.into(),
            sigma_m: seen
                .covariance?
                .fixed_view::<3, 3>(3, 3)
                .trace()
                .max(0.0)
                .sqrt(),
        });
    }
    Workspace::of(name, &model.link(model.root()).name, points)
        .map(|w| w.relative_to(&inputs.robot.profile.tracker.frame))
}

/// The noise level of a group that was found.
fn noise_level(fit: &MlFit, group: Option<GroupId>) -> Option<f64> {
    let level = fit.solution.noise.iter().find(|n| Some(n.id) == group)?;
    Some(level.sigma)
}

/// What a tool error on a new pose is made of: rms over the held-out poses, in meters.
pub(crate) fn accuracy_limits(
    inputs: &Inputs,
    held_out: Option<&HeldOut>,
    fit: &MlFit,
    workspace: Option<&Workspace>,
) -> Vec<AccuracyLimit> {
    let Some(measured) = held_out.and_then(|h| h.calibrated) else {
        return Vec::new();
    };
    let parameters = workspace.map_or(0.0, |w| w.rms_sigma_m);
    let tracker = tracker_sigma(fit).unwrap_or(0.0);
    let joints = fit.joint_sigma().unwrap_or(0.0) * joint_lever(inputs);
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

    /// rms angle that the noise of one measurement of its orientation makes, rad; `None` where none is measured.
    pub(crate) fn orientation_noise(
        &self,
        tracks: &BTreeMap<String, BodyTrack>,
        fit: Option<&MlFit>,
    ) -> Option<f64> {
        let fit = fit?;
        let groups = fit.formulation.noise;
        let track = tracks.get(self.name)?;
        if *self.kind == BodyKind::Pose || track.is_computed() {
            let mut noise = fit.solution.noise.iter();
            let level = noise.find(|n| n.kind == NoiseKind::Orientation)?;
            return Some(level.sigma * 3.0_f64.sqrt());
        }
        // Fit of a pose to n markers: information JᵀJ/σ² with J_i = [−[p_i]ₓ, 1], and the part of the rotation.
        let points = &track.template.as_ref()?.points;
        let information: Matrix6<f64> = points
            .iter()
            .map(|p| {
                let mut j = nalgebra::Matrix3x6::zeros();
                j.fixed_view_mut::<3, 3>(0, 0)
                    .copy_from(&-so3::skew(&p.coords));
                j.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
                j.transpose() * j
            })
            .sum();
        let covariance = nalgebra::Cholesky::new(information)?.inverse();
        let rotation = covariance.fixed_view::<3, 3>(0, 0).trace().max(0.0).sqrt();
        Some(noise_level(fit, groups.marker)? * rotation)
    }
}

/// Noise of one measured position, rms of its length (m), as the held-out errors count it: by marker, else by body.
pub(crate) fn tracker_sigma(fit: &MlFit) -> Option<f64> {
    let groups = fit.formulation.noise;
    let sigma =
        noise_level(fit, groups.marker).or_else(|| noise_level(fit, groups.body_position))?;
    Some(sigma * 3.0_f64.sqrt())
}

/// Root sum of squares over the joints of how far the tool moves per radian, rms over held-out poses, m.
fn joint_lever(inputs: &Inputs) -> f64 {
    let model = &inputs.robot.model;
    let Some(tool) = tool_link(inputs) else {
        return 0.0;
    };
    let rows: Vec<&Vec<f64>> = inputs
        .recordings
        .values()
        .filter(|r| r.spec.usage == Usage::Validation)
        .flat_map(|r| r.q.iter().flatten())
        .collect();
    let squares: f64 = rows
        .iter()
        .map(|q| {
            let columns = model.jacobian(q, tool);
            columns
                .iter()
                .filter(|(id, _)| model.joint(*id).kind.turns())
                .map(|(_, c)| c.fixed_rows::<3>(3).norm_squared())
                .sum::<f64>()
        })
        .sum();
    (squares / rows.len().max(1) as f64).sqrt()
}
