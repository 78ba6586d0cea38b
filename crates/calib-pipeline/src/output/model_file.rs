//! The calibrated robot as a file for programs that predict.

use std::collections::BTreeMap;

use calib_core::EffectKind;
use calib_core::effect::{Drives, Source};
use calib_geometry::se3;
use calib_model::STOOD_STILL;
use calib_model::file::{
    Input, ModelBody, ModelEffect, ModelJoint, ModelLink, ModelMimic, ModelMotion, ModelNumber,
    ModelPlugin, ModelPoint, ModelPose, ModelUncertainty, ModelValidity, RobotModelFile,
};
use calib_plugin::Origin;
use calib_profile::Usage;
use calib_report::Scene;
use calib_report::scene::SceneVerdict;
use calib_urdf::{Joint, JointId, JointKind, RobotModel};
use nalgebra::{DMatrix, DVector, Isometry3, Point3, Vector3};
use rayon::prelude::*;

use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::{Calibration, motion_axis};
use crate::formulate::ml::calibration_at;
use crate::formulate::solved::Solved;
use crate::prepare::conditions::STILL;
use crate::prepare::inputs::Inputs;

/// Name of the file beside a patched URDF: `r.calibrated.urdf` gives `r.calibrated.model.json`.
#[must_use]
pub fn model_name(urdf: &str) -> String {
    format!("{}.model.json", urdf.trim_end_matches(".urdf"))
}

/// The robot that a run found.
#[must_use]
pub fn model_file(inputs: &Inputs, solved: &Solved, scene: &Scene) -> RobotModelFile {
    let robot = &solved.robot;
    let profile = &inputs.robot.profile;
    let model = &robot.model;
    let name = |link: calib_urdf::LinkId| model.link(link).name.clone();
    let points = profile.points.iter().map(|(point, tip)| {
        let at = robot.contact_points.get(point).copied().unwrap_or(tip.at);
        let xyz_m = at.coords.into();
        let link = name(tip.link);
        (point.clone(), ModelPoint { link, xyz_m })
    });
    RobotModelFile {
        robot: profile.robot.clone(),
        root: name(model.root()),
        gravity_m_s2: robot.masses.gravity().into(),
        masses_assumed: robot.masses.assumed.is_some(),
        links: links(robot),
        joints: outward(model)
            .into_iter()
            .map(|j| joint(inputs, robot, j))
            .collect(),
        approach_threshold: STILL,
        reference_temperature_c: grows(robot)
            .then_some(inputs.robot.profile.load.reference_temperature_c),
        tracker: profile.tracker.frame.clone(),
        tracker_from_root: pose(&robot.tracker_from_root),
        bodies: bodies(inputs, robot),
        points: points.collect(),
        uncertainty: solved.fit.as_ref().map(|fit| uncertainty(inputs, fit)),
        validity: scene.verdict.as_ref().map(validity),
        written_by: format!("calib {}", env!("CARGO_PKG_VERSION")),
        inputs: inputs
            .digests
            .iter()
            .map(|d| Input {
                path: d.path.clone(),
                sha256: d.sha256.clone(),
            })
            .collect(),
        ..RobotModelFile::default()
    }
}

/// What a model was shown to be good for, as the scene has it.
fn validity(of: &SceneVerdict) -> ModelValidity {
    let verdict = serde_json::to_value(of.verdict).ok();
    let verdict = verdict.as_ref().and_then(serde_json::Value::as_str);
    ModelValidity {
        verdict: verdict.unwrap_or_default().to_owned(),
        position_error_m: of.position_error_m,
        interval_m: of.interval_m,
        scope: of.scope.clone(),
        not_for: of.not_for.clone(),
    }
}

fn pose(outer_from_inner: &Isometry3<f64>) -> ModelPose {
    let q = outer_from_inner.rotation.coords;
    ModelPose {
        xyz_m: outer_from_inner.translation.vector.into(),
        quat_xyzw: [q.x, q.y, q.z, q.w],
    }
}

/// Masses and first moments: those that are given, and what was found beyond.
fn links(robot: &Calibration) -> Vec<ModelLink> {
    let loaded = robot.masses.loaded();
    let link = |id: calib_urdf::LinkId| {
        let own = loaded.link(id).inertial;
        let given = own.map_or_else(Vector3::zeros, |i| i.center_of_mass.coords * i.mass);
        ModelLink {
            name: loaded.link(id).name.clone(),
            mass_kg: own.map_or(0.0, |i| i.mass),
            first_moment_kg_m: (given + robot.masses.beyond()[id.index()]).into(),
        }
    };
    loaded.link_ids().map(link).collect()
}

fn joint(inputs: &Inputs, robot: &Calibration, id: JointId) -> ModelJoint {
    let model = &robot.model;
    let j = model.joint(id);
    ModelJoint {
        name: j.name.clone(),
        parent: model.link(j.parent).name.clone(),
        child: model.link(j.child).name.clone(),
        motion: motion(j),
        parent_from_joint: pose(&j.parent_link_from_joint),
        load_origin: pose(&robot.masses.loaded().joint(id).parent_link_from_joint),
        axis: j.kind.axis().map(|axis| axis.into_inner().into()),
        limits: j.limits.range().map(|(low, high)| [low, high]),
        mimic: mimic(model, j),
        fitted_range: fitted_range(inputs, id),
        effects: effects(inputs, robot, id),
    }
}

/// The joints, each after the one that carries it.
pub(super) fn outward(model: &RobotModel) -> Vec<JointId> {
    let mut joints: Vec<JointId> = model.joint_ids().collect();
    joints.sort_by_key(|j| (model.chain_to_root(model.joint(*j).child).len(), j.index()));
    joints
}

/// How a joint moves.
pub(super) fn motion(joint: &Joint) -> ModelMotion {
    match joint.kind {
        JointKind::Fixed => ModelMotion::Fixed,
        JointKind::Prismatic { .. } => ModelMotion::Prismatic,
        _ => ModelMotion::Revolute,
    }
}

/// The joint that it follows.
pub(super) fn mimic(model: &RobotModel, joint: &Joint) -> Option<ModelMimic> {
    joint.mimic.as_ref().map(|_| ModelMimic {
        joint: model.joint(joint.law.source).name.clone(),
        multiplier: joint.law.multiplier,
        offset: joint.law.offset,
    })
}

/// Whether some length follows the temperature.
fn grows(robot: &Calibration) -> bool {
    let mut joints = robot.effects.iter();
    joints.any(|e| {
        e.coefficients
            .keys()
            .any(|kind| kind.drives() == Drives::Along)
    })
}

fn effects(inputs: &Inputs, robot: &Calibration, id: JointId) -> Vec<ModelEffect> {
    let Some(axis) = motion_axis(&robot.model, id) else {
        return Vec::new();
    };
    let slides = !robot.model.joint(id).kind.turns();
    let drive = robot.masses.drives()[id.index()];
    let entry = |kind: EffectKind, value: f64, other: Option<usize>| {
        let term = kind.term();
        ModelEffect {
            kind: term.name.to_owned(),
            formula: term.formula.to_owned(),
            value,
            unit: term.quantity.unit(slides).symbol().to_owned(),
            about: match term.drives {
                Drives::Across(k) => Some(axis.across()[k].into()),
                _ => None,
            },
            along: (term.drives == Drives::Along).then(|| robot.masses.reach()[id.index()].into()),
            other: other.map(|o| robot.model.joints()[o].name.clone()),
            gear_ratio: (term.source == Source::Motor).then_some(drive.gear_ratio),
            friction: (term.source == Source::Friction).then_some(drive.friction),
            plugin: plugin(inputs, id, kind),
        }
    };
    let of = &robot.effects[id.index()];
    // One that a physical limit holds at 0 was estimated too, and its uncertainty is in the file.
    let own = of.coefficients.iter();
    let own = own.map(|(kind, c)| entry(*kind, *c, None));
    let coupled = of.coupling.iter();
    let coupled = coupled.map(|(other, c)| entry(EffectKind::Coupling, *c, Some(*other)));
    own.chain(coupled).collect()
}

/// The plugin that computes an effect of a joint.
fn plugin(inputs: &Inputs, id: JointId, kind: EffectKind) -> Option<ModelPlugin> {
    let name = matches!(kind, EffectKind::Outside(_)).then(|| kind.term().name)?;
    let profile = &inputs.robot.profile;
    let parameters = profile.solve.joints.get(&id)?.effects.get(name)?;
    let parameters = parameters.iter().filter_map(|(name, value)| {
        let value = serde_json::to_value(value).ok()?;
        Some((name.clone(), value))
    });
    let entry = inputs.estimators.tables.effect.get(name).ok()?;
    let Origin::Plugin {
        plugin,
        version,
        sha256,
        ..
    } = entry.origin()
    else {
        return None;
    };
    Some(ModelPlugin {
        name: plugin.clone(),
        version: version.clone(),
        sha256: sha256.clone(),
        parameters: parameters.collect(),
    })
}

/// Smallest and largest reading of the fitted rows; of a joint that stood still its one position, if something that was seen depends on it.
pub(super) fn fitted_range(inputs: &Inputs, id: JointId) -> Option<[f64; 2]> {
    let fitted = inputs.recordings.values();
    let fitted = fitted.filter(|r| r.spec.usage != Usage::Validation);
    let readings = fitted.flat_map(|r| r.q.iter().flatten());
    let model = &inputs.robot.model;
    model.joint(id).kind.axis()?;
    let (low, high) = readings
        .map(|q| model.position(q, id))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| {
            (l.min(q), h.max(q))
        });
    if high - low > STOOD_STILL {
        return Some([low, high]);
    }
    let middle = (low + high) / 2.0;
    let profile = &inputs.robot.profile;
    let bodies = profile.bodies.values().map(|b| b.link);
    let mut links = bodies.chain(profile.points.values().map(|p| p.link));
    let carries = links.any(|link| {
        let mut chain = model.chain(model.root(), link).into_iter();
        chain.any(|step| step.joint == id)
    });
    (middle.is_finite() && carries).then_some([middle, middle])
}

fn bodies(inputs: &Inputs, robot: &Calibration) -> BTreeMap<String, ModelBody> {
    let body = |(name, body): (&String, &calib_profile::Body)| {
        let markers = robot.points.get(name).into_iter().flatten();
        let markers_m = markers.map(|(marker, at)| (marker.clone(), at.coords.into()));
        let entry = ModelBody {
            link: robot.model.link(body.link).name.clone(),
            link_from_body: robot.mounts.get(name).map(pose),
            markers_m: markers_m.collect(),
        };
        (name.clone(), entry)
    };
    inputs.robot.profile.bodies.iter().map(body).collect()
}

/// Covariance of all numbers that the fit changes.
///
/// ```text
/// C_numbers = G C Gᵀ = R Rᵀ,   R = G V diag(√λ),   C = V diag(λ) Vᵀ,   G = ∂numbers/∂parameters
/// ```
fn uncertainty(inputs: &Inputs, fit: &MlFit) -> ModelUncertainty {
    /// Of a parameter's scale: large against rounding, and what is left out is of its size.
    const STEP: f64 = 1e-6;
    let solution = &fit.solution;
    let base = calibration_at(&fit.formulation, &solution.model, &solution.values, inputs);
    let named = names(&base);
    let scale = &solution.information.scale;
    let column_of = |p: usize| -> Option<(usize, DVector<f64>)> {
        let column = solution.column_of(p)?;
        let step = STEP * scale[column];
        let mut values = solution.values.clone();
        values.0[p] += step;
        let moved = calibration_at(&fit.formulation, &solution.model, &values, inputs);
        Some((column, DVector::from_vec(changes(&base, &moved)) / step))
    };
    let columns = (0..solution.parameters.len()).into_par_iter();
    let columns: Vec<(usize, DVector<f64>)> = columns.filter_map(column_of).collect();
    let mut g = DMatrix::zeros(named.len(), scale.len());
    for (column, own) in columns {
        g.set_column(column, &own);
    }
    let root = g * solution.half_covariance();
    let rows = named.into_par_iter().enumerate();
    let known = rows.filter(|(r, _)| root.row(*r).iter().any(|x| *x != 0.0));
    let (numbers, root) = known
        .map(|(r, number)| (number, root.row(r).iter().map(|x| rounded(*x)).collect()))
        .unzip();
    ModelUncertainty { numbers, root }
}

/// Nine digits: more of a standard deviation says nothing.
fn rounded(x: f64) -> f64 {
    if x == 0.0 {
        return 0.0;
    }
    format!("{x:.8e}").parse().unwrap_or(x) + 0.0
}

/// Names of the six numbers of a pose, in the order of its change [ω; v].
const OF_POSE: [&str; 6] = ["rx", "ry", "rz", "x", "y", "z"];

/// What [`changes`] lists.
fn names(robot: &Calibration) -> Vec<ModelNumber> {
    let model = &robot.model;
    let mut out = Vec::new();
    let mut push = |of: &str, name: &str, number: &str| {
        out.push(ModelNumber {
            of: of.to_owned(),
            name: name.to_owned(),
            number: number.to_owned(),
        });
    };
    OF_POSE.iter().for_each(|n| push("tracker", "", n));
    for id in model.joint_ids() {
        let name = &model.joint(id).name;
        OF_POSE.iter().for_each(|n| push("joint", name, n));
        let effects = &robot.effects[id.index()];
        for kind in effects.coefficients.keys() {
            push("joint", name, kind.term().name);
        }
        for other in effects.coupling.keys() {
            let other = &model.joints()[*other].name;
            push("joint", name, &format!("coupling:{other}"));
        }
    }
    for body in robot.mounts.keys() {
        OF_POSE.iter().for_each(|n| push("body", body, n));
    }
    for (body, markers) in &robot.points {
        for marker in markers.keys() {
            let name = format!("{body}/{marker}");
            OF_POSE[3..].iter().for_each(|n| push("marker", &name, n));
        }
    }
    for point in robot.contact_points.keys() {
        OF_POSE[3..].iter().for_each(|n| push("point", point, n));
    }
    for link in model.link_ids() {
        let name = &model.link(link).name;
        OF_POSE[3..].iter().for_each(|n| push("link", name, n));
    }
    out
}

/// From one robot to another that differs little: every number of the file.
fn changes(base: &Calibration, moved: &Calibration) -> Vec<f64> {
    let mut out = Vec::new();
    let pose = |out: &mut Vec<f64>, base: &Isometry3<f64>, moved: &Isometry3<f64>| {
        let twist = se3::log(&(base.inverse() * moved));
        out.extend(twist.angular().iter().chain(twist.linear().iter()));
    };
    let point = |out: &mut Vec<f64>, base: &Point3<f64>, moved: &Point3<f64>| {
        out.extend((moved - base).iter());
    };
    pose(&mut out, &base.tracker_from_root, &moved.tracker_from_root);
    for id in base.model.joint_ids() {
        let origin = |robot: &Calibration| robot.model.joint(id).parent_link_from_joint;
        pose(&mut out, &origin(base), &origin(moved));
        let (own, other) = (&base.effects[id.index()], &moved.effects[id.index()]);
        let coefficients = own.coefficients.iter();
        out.extend(coefficients.map(|(kind, c)| other.of(*kind) - c));
        let coupled = own.coupling.iter();
        out.extend(coupled.map(|(j, c)| other.coupling.get(j).copied().unwrap_or(*c) - c));
    }
    for (body, mount) in &base.mounts {
        pose(&mut out, mount, moved.mounts.get(body).unwrap_or(mount));
    }
    for (body, markers) in &base.points {
        for (marker, at) in markers {
            let other = moved.points.get(body).and_then(|m| m.get(marker));
            point(&mut out, at, other.unwrap_or(at));
        }
    }
    for (name, at) in &base.contact_points {
        point(&mut out, at, moved.contact_points.get(name).unwrap_or(at));
    }
    let moments = base.masses.beyond().iter().zip(moved.masses.beyond());
    for (own, other) in moments {
        out.extend((other - own).iter());
    }
    out
}
