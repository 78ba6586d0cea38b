//! What a model of a robot can have: effects, axes and origins of its joints, as parts to choose from.

use std::collections::{BTreeMap, BTreeSet};

use calib_core::effect::{Effect, Source, coupling};
use calib_core::{EFFECTS, EdgeKind, Joint, ParameterId, Part};
use calib_profile::{Free, JointFree, OriginFreeSet, Solve};
use calib_urdf::{JointId, JointKind, RobotModel};

use crate::formulate::formulation::Formulation;
use crate::formulate::ml::{moves, used_joints};
use crate::prepare::inputs::Inputs;

/// What a part frees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// The axis line of a joint.
    Axis,
    /// The whole origin of a fixed joint.
    Origin,
    /// An effect.
    Effect(&'static Effect),
    /// A share of another joint's motion.
    Coupling(JointId),
    /// The first moments of all links.
    Masses,
}

/// A part and what it is in the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RobotPart {
    /// What it frees.
    pub what: What,
    /// The joint; `None`: all joints that can have it.
    pub joint: Option<JointId>,
}

/// Everything that a model of this robot could have.
#[derive(Debug)]
pub struct Parts {
    /// What each is.
    pub named: Vec<RobotPart>,
    /// The same as the core takes it.
    pub parts: Vec<Part>,
    /// Those that the profile frees.
    pub first: BTreeSet<usize>,
}

/// Place of axes: they follow the offsets.
const AXES: u8 = 2;
/// Place of couplings: after all effects of one joint alone.
const COUPLINGS: u8 = 100;
/// Place of fixed joints: their origins are seldom wrong where the axes are right.
const FIXED: u8 = 101;
/// Place of the masses: what they load comes first.
const MASSES: u8 = 102;
/// Groups come after all that they consist of.
const GROUPS: u8 = 200;

/// Joints that the fitted recordings move, and fixed joints between them, parents first. Those whose `free` is an empty list in the profile
/// are held on purpose.
pub(crate) fn open_joints(inputs: &Inputs, formulation: &Formulation) -> Vec<JointId> {
    let model = &inputs.robot.model;
    let exceptions = &inputs.robot.profile.solve.joints;
    let held = |joint: &JointId| {
        let list = exceptions.get(joint).and_then(|e| e.free.as_ref());
        list.is_some_and(BTreeSet::is_empty)
    };
    let open = |joint: &JointId| match edge(formulation, *joint) {
        Some(edge) => model.joint(*joint).mimic.is_none() && moves(&formulation.problem, &edge.q),
        None => model.joint(*joint).kind == JointKind::Fixed,
    };
    let used = used_joints(inputs, model).into_iter();
    used.filter(|j| open(j) && !held(j)).collect()
}

fn edge(formulation: &Formulation, joint: JointId) -> Option<&Joint> {
    let edge = formulation.joints[joint.index()]?;
    match &formulation.problem.edges()[edge.index()].kind {
        EdgeKind::Joint(joint) => Some(joint),
        _ => None,
    }
}

/// The profile's choice with everything free that these joints can have.
pub(crate) fn everything(inputs: &Inputs, open: &[JointId]) -> Solve {
    let model = &inputs.robot.model;
    let mut solve = inputs.robot.profile.solve.clone();
    if !plugins_by_load(&solve) {
        solve.free.insert(Free::Masses);
    }
    for &joint in open {
        let slides = matches!(model.joint(joint).kind, JointKind::Prismatic { .. });
        let moved = model.joint(joint).kind != JointKind::Fixed;
        let now = solve.free_set(joint, moved, slides).origin;
        let mut free = BTreeSet::new();
        free.insert(match (moved, now) {
            (false, _) | (_, OriginFreeSet::Full) => JointFree::Origin,
            _ => JointFree::Axis,
        });
        if moved {
            // What has no place in a ladder is taken where the profile frees it.
            let stated = solve.free_set(joint, moved, slides).effects;
            let stated = |e: &Effect| stated.iter().any(|f| f.effect == e);
            let effects = EFFECTS.iter().filter(|e| e.profile.is_some());
            let effects = effects.filter(|e| e.ladder.is_some() || stated(e));
            free.extend(effects.map(|e| JointFree::Effect(e)));
        }
        let exception = solve.joints.entry(joint).or_default();
        exception.free = Some(free);
        for other in couplings(inputs, open, joint) {
            if !exception.coupled_to.contains(&other) {
                exception.coupled_to.push(other);
            }
        }
    }
    solve
}

/// Joints whose motion this one could follow: on a chain to something that is measured.
fn couplings(inputs: &Inputs, open: &[JointId], joint: JointId) -> Vec<JointId> {
    let model = &inputs.robot.model;
    let fixed = |j: JointId| model.joint(j).kind == JointKind::Fixed;
    if fixed(joint) {
        return Vec::new();
    }
    let profile = &inputs.robot.profile;
    let links = profile.bodies.values().map(|b| b.link);
    let links: Vec<_> = links
        .chain(profile.points.values().map(|p| p.link))
        .collect();
    let together = |other: &JointId| {
        let mut chains = links.iter().map(|l| model.chain(model.root(), *l));
        chains.any(|chain| {
            [joint, *other]
                .iter()
                .all(|j| chain.iter().any(|s| s.joint == *j))
        })
    };
    let others = open.iter().copied();
    let moving = others.filter(|o| *o != joint && !fixed(*o));
    moving.filter(together).collect()
}

impl Parts {
    /// The parts of a problem that was stated with [`everything`] free.
    pub(crate) fn of(inputs: &Inputs, open: &[JointId], formulation: &Formulation) -> Self {
        let mut parts = Self {
            named: Vec::new(),
            parts: Vec::new(),
            first: BTreeSet::new(),
        };
        for &joint in open {
            parts.of_joint(inputs, open, joint, formulation);
        }
        parts.masses(inputs, formulation);
        parts.groups();
        parts
    }

    fn add(&mut self, what: What, joint: JointId, parameters: Vec<ParameterId>, free: bool) {
        if parameters.is_empty() {
            return;
        }
        if free {
            self.first.insert(self.parts.len());
        }
        let place = match what {
            What::Axis => AXES,
            What::Origin => FIXED,
            What::Effect(effect) => effect.ladder.map_or(COUPLINGS, |(place, _)| place),
            What::Coupling(_) => COUPLINGS,
            What::Masses => MASSES,
        };
        self.parts.push(Part { parameters, place });
        self.named.push(RobotPart {
            what,
            joint: Some(joint),
        });
    }

    fn of_joint(
        &mut self,
        inputs: &Inputs,
        open: &[JointId],
        joint: JointId,
        formulation: &Formulation,
    ) {
        let kind = &inputs.robot.model.joint(joint).kind;
        let moved = *kind != JointKind::Fixed;
        let slides = matches!(kind, JointKind::Prismatic { .. });
        let solve = &inputs.robot.profile.solve;
        let now = solve.free_set(joint, moved, slides);
        if let Some(origin) = formulation.origins[joint.index()]
            && let EdgeKind::Unknown(pose) = &formulation.problem.edges()[origin.index()].kind
        {
            let free = now.origin != OriginFreeSet::Held;
            let what = match (moved, now.origin) {
                (false, _) | (_, OriginFreeSet::Full) => What::Origin,
                _ => What::Axis,
            };
            let parameters = pose.parameters.iter().flatten().copied();
            self.add(what, joint, parameters.collect(), free);
        }
        let Some(edge) = edge(formulation, joint) else {
            return;
        };
        let mut coefficients: BTreeMap<&'static Effect, Vec<ParameterId>> = BTreeMap::new();
        for effect in &edge.effects {
            let of = coefficients.entry(effect.kind.effect()).or_default();
            of.push(effect.parameter);
        }
        for (effect, parameters) in coefficients {
            if *effect == coupling::EFFECT {
                // As in the list of the stated problem: those of the profile first.
                let stated = now.coupled_to.len();
                let mut others = now.coupled_to.clone();
                let added = couplings(inputs, open, joint).into_iter();
                others.extend(added.filter(|o| !now.coupled_to.contains(o)));
                for (i, (other, parameter)) in others.into_iter().zip(parameters).enumerate() {
                    self.add(What::Coupling(other), joint, vec![parameter], i < stated);
                }
            } else if effect.profile.is_some() {
                let free = now.effects.iter().any(|f| f.effect == effect);
                self.add(What::Effect(effect), joint, parameters, free);
            }
        }
    }

    /// First moments beyond the given ones: they show by what yields to them, and only together.
    fn masses(&mut self, inputs: &Inputs, formulation: &Formulation) {
        let parameters: Vec<ParameterId> = formulation.masses.iter().map(|m| m.1).collect();
        if parameters.is_empty() {
            return;
        }
        if inputs.robot.profile.solve.free.contains(&Free::Masses) {
            self.first.insert(self.parts.len());
        }
        self.parts.push(Part {
            parameters,
            place: MASSES,
        });
        self.named.push(RobotPart {
            what: What::Masses,
            joint: None,
        });
    }

    /// Each effect of all joints, and all axes.
    fn groups(&mut self) {
        let mut kinds: Vec<What> = Vec::new();
        for part in &self.named {
            let alone = matches!(part.what, What::Coupling(_) | What::Origin | What::Masses);
            if !alone && !kinds.contains(&part.what) {
                kinds.push(part.what);
            }
        }
        for what in kinds {
            let own = |i: &usize| self.named[*i].what == what;
            let members: Vec<usize> = (0..self.named.len()).filter(own).collect();
            if members.len() < 2 {
                continue;
            }
            let parameters = members.iter().flat_map(|m| &self.parts[*m].parameters);
            let parameters = parameters.copied().collect();
            let place = GROUPS + self.parts[members[0]].place;
            self.parts.push(Part { parameters, place });
            self.named.push(RobotPart { what, joint: None });
        }
    }
}

/// The profile's choice with these parts free, each at its joint.
pub(crate) fn with_parts(inputs: &Inputs, added: &[RobotPart]) -> Solve {
    let model = &inputs.robot.model;
    let mut solve = inputs.robot.profile.solve.clone();
    for part in added {
        let Some(joint) = part.joint else { continue };
        let list = own_list(&solve, model, joint);
        let exception = solve.joints.entry(joint).or_default();
        match part.what {
            What::Coupling(other) => exception.coupled_to.push(other),
            what => {
                let mut list = list;
                list.insert(match what {
                    What::Axis => JointFree::Axis,
                    What::Effect(effect) => JointFree::Effect(effect),
                    What::Origin | What::Coupling(_) | What::Masses => JointFree::Origin,
                });
                exception.free = Some(list);
            }
        }
    }
    let with_masses = added.iter().any(|part| part.what == What::Masses);
    if with_masses && yields(&solve) && !plugins_by_load(&solve) {
        solve.free.insert(Free::Masses);
    }
    solve
}

/// Whether a plugin computes an effect of the load: how it follows masses is not known, so that they cannot be free.
fn plugins_by_load(solve: &Solve) -> bool {
    let outside = solve.joints.values().flat_map(|e| &e.outside);
    let mut terms = outside.flat_map(|free| free.effect.terms);
    terms.any(|term| term.source == Source::Load)
}

/// Whether something yields to a load: a profile may free masses only there.
fn yields(solve: &Solve) -> bool {
    let by_load = |e: &&Effect| e.terms.iter().any(|t| t.source == Source::Load);
    let all = solve.free.iter().filter_map(|free| match free {
        Free::Effect(effect) => Some(*effect),
        _ => None,
    });
    let lists = solve.joints.values().filter_map(|e| e.free.as_ref());
    let own = lists.flatten().filter_map(|free| match free {
        JointFree::Effect(effect) => Some(*effect),
        _ => None,
    });
    all.chain(own).any(|e| by_load(&e))
}

/// What is free of one joint, as a list of its own.
fn own_list(solve: &Solve, model: &RobotModel, joint: JointId) -> BTreeSet<JointFree> {
    if let Some(list) = solve.joints.get(&joint).and_then(|e| e.free.clone()) {
        return list;
    }
    if model.joint(joint).kind == JointKind::Fixed {
        return BTreeSet::new();
    }
    let all = solve.free.iter().filter_map(|free| match free {
        Free::JointAxes => Some(JointFree::Axis),
        Free::JointOrigins => Some(JointFree::Origin),
        Free::Effect(effect) => Some(JointFree::Effect(effect)),
        _ => None,
    });
    all.collect()
}

/// `free` and `joints` of `solve:` as a profile writes them.
pub(crate) fn yaml(solve: &Solve, model: &RobotModel) -> String {
    let word = |value: serde_json::Value| value.as_str().unwrap_or_default().to_owned();
    let free = solve
        .free
        .iter()
        .filter_map(|f| serde_json::to_value(f).ok());
    let free: Vec<String> = free.map(word).collect();
    let mut text = format!("solve:\n  free: [{}]\n", free.join(", "));
    if !solve.joints.is_empty() {
        text += "  joints:\n";
    }
    for (joint, exception) in &solve.joints {
        let mut keys = Vec::new();
        if let Some(list) = &exception.free {
            let list = list.iter().filter_map(|f| serde_json::to_value(f).ok());
            let list: Vec<String> = list.map(word).collect();
            keys.push(format!("free: [{}]", list.join(", ")));
        }
        let scale = |value: Option<f64>, unit: f64| value.map(|v| rounded(v / unit));
        const MM: f64 = 1e-3;
        const DEG: f64 = std::f64::consts::PI / 180.0;
        for (key, value) in [
            ("sigma_mm", scale(exception.sigma_m, MM)),
            ("sigma_deg", scale(exception.sigma_rad, DEG)),
            ("within_mm", scale(exception.within_m, MM)),
            ("within_deg", scale(exception.within_rad, DEG)),
        ] {
            keys.extend(value.map(|v| format!("{key}: {v}")));
        }
        if !exception.coupled_to.is_empty() {
            let others = exception.coupled_to.iter();
            let others: Vec<String> = others.map(|o| quoted(&model.joint(*o).name)).collect();
            keys.push(format!("coupled_to: [{}]", others.join(", ")));
        }
        if !exception.effects.is_empty() {
            // JSON is YAML.
            let effects = serde_json::to_string(&exception.effects).unwrap_or_default();
            keys.push(format!("effects: {effects}"));
        }
        let name = quoted(&model.joint(*joint).name);
        text += &format!("    {name}: {{{}}}\n", keys.join(", "));
    }
    text
}

/// Without the rounding of a change of units.
fn rounded(value: f64) -> f64 {
    format!("{value:.12e}").parse().unwrap_or(value)
}

/// A name as YAML takes it.
fn quoted(name: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let word = name.chars().all(plain) && name.starts_with(|c: char| c.is_ascii_alphabetic());
    // Words that YAML reads as something else.
    const TAKEN: [&str; 8] = ["y", "n", "yes", "no", "on", "off", "true", "false"];
    match word && !TAKEN.contains(&name.to_lowercase().as_str()) && name != "null" {
        true => name.to_owned(),
        false => serde_json::Value::from(name).to_string(),
    }
}
