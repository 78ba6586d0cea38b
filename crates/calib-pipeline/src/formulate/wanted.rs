//! The transforms that a run is asked for: those of the profile, what was touched, and, where nothing of the robot itself is
//! estimated, the mounts and the tracker.

use calib_core::{EdgeKind, FrameId, ParameterId, Role};
use calib_profile::ContactBase;

use crate::formulate::formulation::MlFit;
use crate::formulate::found::Found;
use crate::prepare::inputs::Inputs;

/// Each with its two frames of the fit.
pub(super) fn transforms(inputs: &Inputs, fit: &MlFit) -> Vec<(Found, FrameId, FrameId)> {
    let mut all = of_profile(inputs, fit);
    if robot_is_given(fit) {
        all.extend(mounts_and_tracker(inputs, fit));
    }
    all.extend(places(inputs, fit));
    all
}

fn of_profile(inputs: &Inputs, fit: &MlFit) -> Vec<(Found, FrameId, FrameId)> {
    let profile = &inputs.robot.profile;
    let model = &inputs.robot.model;
    let formulation = &fit.formulation;
    let mut out = Vec::new();
    for (name, origin) in &profile.origins {
        if let (Some(body), Some(link)) = (
            formulation.bodies.get(&origin.body),
            formulation.links[origin.link.index()],
        ) {
            let frames = Found {
                origin: Some(name.clone()),
                ..Found::between(format!("{}_from_{name}", origin.body), &origin.body, name)
            };
            out.push((frames, *body, link));
        }
    }
    for (name, t) in &profile.transforms {
        if let (Some(parent), Some(child)) = (
            formulation.links[t.parent.index()],
            formulation.links[t.child.index()],
        ) {
            let [outer, inner] = [t.parent, t.child].map(|link| &model.link(link).name);
            out.push((Found::between(name.clone(), outer, inner), parent, child));
        }
    }
    out
}

/// Whether the robot is taken as its URDF has it, as in a hand-eye calibration.
fn robot_is_given(fit: &MlFit) -> bool {
    let problem = &fit.formulation.problem;
    let estimated = |parameter: &ParameterId| !problem.parameters()[parameter.index()].fixed;
    let is_given = |edge: &calib_core::Edge| match &edge.kind {
        EdgeKind::Unknown(origin) if origin.role == Role::JointOrigin => {
            !origin.parameters.iter().flatten().any(estimated)
        }
        EdgeKind::Joint(joint) => !joint.effects.iter().any(|e| estimated(&e.parameter)),
        _ => true,
    };
    problem.edges().iter().all(is_given)
}

fn mounts_and_tracker(inputs: &Inputs, fit: &MlFit) -> Vec<(Found, FrameId, FrameId)> {
    let profile = &inputs.robot.profile;
    let model = &inputs.robot.model;
    let formulation = &fit.formulation;
    let mut out = Vec::new();
    for (name, frame) in &formulation.bodies {
        let link = profile.bodies[name].link;
        if let Some(parent) = formulation.links[link.index()] {
            let link = &model.link(link).name;
            let frames = Found::between(format!("{link}_from_{name}"), link, name);
            out.push((frames, parent, *frame));
        }
    }
    if let Some(root) = formulation.links[model.root().index()] {
        let (tracker, base) = (&profile.tracker.frame, &model.link(model.root()).name);
        let frames = Found::between(format!("{tracker}_from_{base}"), tracker, base);
        out.push((frames, formulation.tracker, root));
    }
    out
}

/// Where the touched things are that were estimated.
fn places(inputs: &Inputs, fit: &MlFit) -> Vec<(Found, FrameId, FrameId)> {
    let profile = &inputs.robot.profile;
    let formulation = &fit.formulation;
    let mut out = Vec::new();
    for (name, contact) in &profile.contacts {
        let estimated = contact.place_sigma.is_some() || contact.place_sigma_rad.is_some();
        let Some(edge) = formulation.contacts.get(name).filter(|_| estimated) else {
            continue;
        };
        let (base, parent) = match contact.on {
            ContactBase::Tracker => (&profile.tracker.frame, Some(formulation.tracker)),
            ContactBase::Link(link) => (
                &inputs.robot.model.link(link).name,
                formulation.links[link.index()],
            ),
        };
        if let Some(parent) = parent {
            let frames = Found::between(format!("{base}_from_{name}"), base, name);
            let place = formulation.problem.edges()[edge.index()].child;
            out.push((frames, parent, place));
        }
    }
    out
}
