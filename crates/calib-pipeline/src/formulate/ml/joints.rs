//! Joints: their origins, their motion and its effects.

use calib_core::effect::{Drives, Effect, Source};
use calib_core::{
    Axis, Chart, EFFECTS, EdgeId, EffectKind, GroupId, JointState, NoiseKind, Problem, Role,
};
use calib_profile::{ContactBase, JointFreeSet, OriginFreeSet, Profile};
use calib_urdf::{JointId, JointKind, LinkId, RobotModel};

use crate::formulate::formulation::{Formulation, FreeSet};
use crate::formulate::kinematics::joint_state;
use crate::prepare::conditions::Conditions;
use crate::prepare::inputs::Inputs;
use crate::prepare::loads::Loads;

/// Joint noise that estimation starts from, rad (0.01°).
pub const JOINT_SIGMA: f64 = 1.7e-4;
/// The same of a joint that slides, m.
const SLIDE_SIGMA: f64 = 1e-4;
/// A revolute joint that moves less than this in the fitted recordings did not move, rad.
const MOVED: f64 = 1e-3;

/// A shorter length before a joint does not grow by what any tracker sees, m: a millimeter of aluminium by 0.02 µm per kelvin.
const SHORTEST: f64 = 1e-3;

/// The term whose coefficient is one over a stiffness.
const COMPLIANCE: EffectKind = EffectKind::TorqueCompliance;

/// One sample: indicated positions, and what else is known of it.
pub(super) struct Row<'a> {
    pub q: &'a [f64],
    pub under: &'a Conditions,
    pub loads: Loads,
}

/// Name of a link's frame in the problem. Bodies, links and the tracker may share names; frames may not.
pub(super) fn link_frame(model: &RobotModel, link: LinkId) -> String {
    format!("link {}", model.link(link).name)
}

/// Joints between the root and any link that something is attached to or reported at, parents first.
pub(crate) fn used_joints(inputs: &Inputs, model: &RobotModel) -> Vec<JointId> {
    let profile = &inputs.robot.profile;
    let mut links: Vec<_> = profile.bodies.values().map(|b| b.link).collect();
    links.extend(profile.origins.values().map(|o| o.link));
    links.extend(
        profile
            .transforms
            .values()
            .flat_map(|t| [t.parent, t.child]),
    );
    links.extend(profile.points.values().map(|p| p.link));
    links.extend(profile.contacts.values().filter_map(|c| match c.on {
        ContactBase::Link(link) => Some(link),
        ContactBase::Tracker => None,
    }));
    let mut joints: Vec<JointId> = Vec::new();
    for link in links {
        for step in model.chain(model.root(), link) {
            if !joints.contains(&step.joint) {
                joints.push(step.joint);
            }
        }
    }
    joints.sort_by_key(|j| {
        (
            model.chain(model.root(), model.joint(*j).child).len(),
            j.index(),
        )
    });
    joints
}

pub(super) fn joint_noise_group(problem: &mut Problem, profile: &Profile) -> Option<GroupId> {
    let noise = profile.solve.noise;
    match noise.joint {
        Some(0.0) => None,
        Some(sigma) => Some(problem.noise_group("joint", NoiseKind::Joint, sigma, !noise.known)),
        None => Some(problem.noise_group("joint", NoiseKind::Joint, JOINT_SIGMA, true)),
    }
}

/// Whether the fitted samples move a joint with these readings.
pub(crate) fn moves(problem: &Problem, readings: &[f64]) -> bool {
    let samples = readings.iter().enumerate();
    let fitted = samples.filter(|(i, _)| !problem.held_out.contains(i));
    let (low, high) = fitted.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (_, q)| {
        (l.min(*q), h.max(*q))
    });
    high - low > MOVED
}

pub(super) fn add_joint(
    formulation: &mut Formulation,
    inputs: &Inputs,
    joint: JointId,
    rows: &[Row<'_>],
    noise: Option<GroupId>,
    free_set: FreeSet,
) {
    let profile = &inputs.robot.profile;
    let model = &inputs.robot.model;
    let j = model.joint(joint);
    let Some(parent) = formulation.links[j.parent.index()] else {
        return;
    };
    let readings: Vec<f64> = rows.iter().map(|r| model.position(r.q, joint)).collect();
    let moved = moves(&formulation.problem, &readings);
    let slides = matches!(j.kind, JointKind::Prismatic { .. });
    let free = match free_set {
        FreeSet::Profile => profile.solve.free_set(joint, moved, slides),
        FreeSet::RegistrationOnly => profile.solve.free_set(joint, false, slides).held(),
    };
    let problem = &mut formulation.problem;
    let chart = match (free.origin, j.kind.axis()) {
        (OriginFreeSet::Held, _) | (OriginFreeSet::Axis, None) => Chart::none(),
        (OriginFreeSet::Axis, Some(axis)) => Chart::axis_line(&axis),
        (OriginFreeSet::Full, _) => Chart::full(),
    };
    let fixed = j.kind == JointKind::Fixed;
    let child = problem.frame(&link_frame(model, j.child));
    let origin_child = if fixed {
        child
    } else {
        problem.frame(&format!("joint {} origin", j.name))
    };
    let name = format!("{}.origin", j.name);
    let origin = problem.unknown(&name, parent, origin_child, j.parent_link_from_joint, chart);
    problem.set_role(origin, Role::JointOrigin, Some(&j.name));
    if free.origin != OriginFreeSet::Held {
        problem.set_prior(origin, Some(free.angle_sigma), Some(free.position_sigma));
    }
    for (coordinate, parameter) in problem.edge_parameters(origin) {
        let within = if coordinate < 3 {
            free.angle_within
        } else {
            free.position_within
        };
        problem.parameter_mut(parameter).bounds = within.map(|w| (-w, w));
    }
    formulation.origins[joint.index()] = Some(origin);
    formulation.links[j.child.index()] = Some(child);
    let Some(axis) = j.kind.axis() else { return };
    let motion = if slides {
        Axis::Prismatic(axis)
    } else {
        Axis::Revolute(axis)
    };
    let edge = problem.joint(&j.name, origin_child, child, motion, readings);
    formulation.joints[joint.index()] = Some(edge);
    problem.joint_reach(edge, inputs.robot.masses.reach()[joint.index()]);
    formulation.loaded |= add_effects(problem, profile, model, joint, edge, &free, rows);
    match noise {
        // Meters have no common level with angles, and a profile states that of angles.
        _ if slides && moved && profile.solve.noise.joint != Some(0.0) => {
            problem.joint_own_noise(edge, SLIDE_SIGMA);
        }
        Some(group) if moved && !slides => problem.joint_noise(edge, group),
        _ => {}
    }
}

/// What physics and the profile allow a coefficient.
fn limits(effect: &Effect, within: Option<f64>) -> Option<(f64, f64)> {
    match (effect.nonnegative, within) {
        (true, within) => Some((0.0, within.unwrap_or(f64::INFINITY))),
        (false, within) => within.map(|w| (-w, w)),
    }
}

/// Frees the effects of a joint and offers the others to the test for missing physics; returns whether a prediction
/// needs its load or another joint's reading.
fn add_effects(
    problem: &mut Problem,
    profile: &Profile,
    model: &RobotModel,
    joint: JointId,
    edge: EdgeId,
    free: &JointFreeSet,
    rows: &[Row<'_>],
) -> bool {
    let states: Vec<JointState> = rows
        .iter()
        .map(|r| joint_state(model, joint, r.q, &r.loads, r.under))
        .collect();
    // Where two joints cross, nothing lies between them that could grow.
    let leads = model.reach(joint).norm() > SHORTEST;
    let possible = |e: &Effect| leads || e.terms.iter().all(|t| t.drives != Drives::Along);
    let stiffness = profile.load.stiffness.get(&joint);
    let given = stiffness.map(|stiffness| 1.0 / stiffness);
    let mut loaded = false;
    let listed = EFFECTS.iter().filter(|e| e.profile.is_some());
    for effect in listed.filter(|e| possible(e)) {
        let wanted = free.effects.iter().find(|f| f.effect == *effect);
        if let Some(wanted) = wanted.filter(|_| (effect.estimable)(&states)) {
            for term in effect.terms {
                let p = problem.free_effect_at(edge, term.kind, &states, wanted.sigma);
                let parameter = problem.parameter_mut(p);
                parameter.bounds = limits(effect, wanted.within);
                if let Some(compliance) = given.filter(|_| term.kind == COMPLIANCE) {
                    parameter.nominal = compliance;
                    parameter.start = compliance;
                }
                loaded |= matches!(term.source, Source::Load | Source::Friction | Source::Motor);
            }
        } else if let Some(compliance) = given.filter(|_| *effect == COMPLIANCE.effect()) {
            let p = problem.free_effect_at(edge, COMPLIANCE, &states, None);
            let parameter = problem.parameter_mut(p);
            parameter.nominal = compliance;
            parameter.start = compliance;
            parameter.fixed = true;
            loaded = true;
        } else if wanted.is_none() && effect.testable.is_some_and(|test| test(&states)) {
            // Terms of the reading alone are tested in any case.
            let terms = effect.terms.iter().filter(|t| t.source != Source::Reading);
            for term in terms {
                if let Some(values) = term.kind.regressors(&states) {
                    problem.candidate(edge, term.kind, values);
                }
            }
        }
    }
    for outside in free.effects.iter().filter(|f| !EFFECTS.contains(&f.effect)) {
        for term in outside.effect.terms {
            problem.free_effect_at(edge, term.kind, &states, outside.sigma);
            loaded |= term.source != Source::Reading;
        }
    }
    let coupling = EffectKind::Coupling;
    let slides = !model.joint(joint).kind.turns();
    for other in &free.coupled_to {
        loaded = true;
        let coupled: Vec<JointState> = rows
            .iter()
            .zip(&states)
            .map(|(r, state)| JointState {
                other: model.position(r.q, *other),
                ..*state
            })
            .collect();
        let sigma = profile.solve.prior.of(coupling.effect(), slides);
        problem.free_effect_at(edge, coupling, &coupled, sigma);
    }
    loaded
}
