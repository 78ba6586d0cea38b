//! The calibrated robot as a patched URDF, and the effects that a URDF cannot hold.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use calib_core::effect::{Drives, Source};
use calib_core::{EFFECTS, EffectKind};
use calib_geometry::so3;
use calib_report::{Change, Unit};
use calib_urdf::{ChangeRecord, JointId, RobotModel, UrdfEdit, patch};
use nalgebra::Vector3;

use crate::error::PipelineError;
use crate::formulate::kinematics::{Calibration, JointEffects, motion_axis};
use crate::output::points::added_frames;
use crate::output::written::{numbers, written};
use crate::prepare::inputs::Inputs;
use crate::verify::known::{Known, Number};

/// The patched URDF.
#[derive(Debug, Clone)]
pub struct PatchedUrdf {
    /// Its text.
    pub text: String,
    /// What differs, number by number.
    pub changes: Vec<Change>,
    /// How to get the original back.
    pub record: ChangeRecord,
    /// Unified diff.
    pub diff: String,
}

/// Origins that moved by less than this (m, rad) keep their text: below any tracker and above rounding.
const UNCHANGED: f64 = 1e-12;

/// Patches the URDF to the calibrated geometry, in numbers of nine decimals (`written`); verifies by re-reading that the forward kinematics of the text is
/// that of the numbers that were meant to 1e-12 m.
///
/// # Errors
/// [`PipelineError::Patch`].
pub fn patch_urdf(
    inputs: &Inputs,
    robot: &Calibration,
    known: &BTreeMap<Number, Known>,
) -> Result<PatchedUrdf, PipelineError> {
    let nominal = &inputs.robot.model;
    let target = robot.urdf_model();
    let mut edits = Vec::new();
    for joint in nominal.joint_ids() {
        let old = nominal.joint(joint).parent_link_from_joint;
        let new = target.joint(joint).parent_link_from_joint;
        let change = old.inverse() * new;
        if change.translation.vector.norm() > UNCHANGED || change.rotation.angle() > UNCHANGED {
            edits.push(UrdfEdit::SetOrigin {
                joint: nominal.joint(joint).name.clone(),
                parent_link_from_joint: written(Some(&old), &new),
            });
        }
    }
    edits.extend(added_frames(inputs, robot));
    let file = &inputs.robot.profile.urdf;
    let fail = |cause: calib_urdf::EditError| PipelineError::Patch {
        file: file.clone(),
        cause: Box::new(cause),
    };
    let original = &inputs.robot.urdf_text;
    let patched = patch(original, file, &edits).map_err(fail)?;
    let record = patched.record(original);
    let out = &inputs.robot.profile.outputs.urdf;
    let diff = calib_urdf::unified(original, file, &patched.text, out);
    let changes = number_changes(nominal, &target, &edits, known);
    Ok(PatchedUrdf {
        text: patched.text,
        changes,
        record,
        diff,
    })
}

/// Origin changes number by number, with the uncertainty of each number where one parameter carries it.
fn number_changes(
    nominal: &RobotModel,
    target: &RobotModel,
    edits: &[UrdfEdit],
    known: &BTreeMap<Number, Known>,
) -> Vec<Change> {
    let mut changes = Vec::new();
    for edit in edits {
        match edit {
            UrdfEdit::SetOrigin { joint, .. } => {
                let Ok(id) = nominal.joint_id(joint) else {
                    continue;
                };
                let old = nominal.joint(id).parent_link_from_joint;
                let new = target.joint(id).parent_link_from_joint;
                let mut push = |k: usize, unit: Unit, old: f64, new: f64| {
                    if (new - old).abs() > UNCHANGED {
                        let known = known.get(&Number::Origin(id, k));
                        changes.push(Change {
                            joint: joint.clone(),
                            what: ORIGIN_NUMBERS[k].to_owned(),
                            unit,
                            old: Some(old),
                            new,
                            delta: Some(new - old),
                            sigma: known.map(|k| k.sigma),
                            data_share: known.and_then(|k| k.data_share),
                        });
                    }
                };
                for k in 0..3 {
                    push(
                        k,
                        Unit::Meter,
                        old.translation.vector[k],
                        new.translation.vector[k],
                    );
                }
                // Roll, pitch and yaw jump near pitch ±90°: the rotation itself is what changed.
                let rotation = so3::log(&(old.rotation.inverse() * new.rotation));
                for k in 0..3 {
                    push(3 + k, Unit::Radian, 0.0, rotation[k]);
                }
            }
            UrdfEdit::AddFixedFrame {
                name,
                parent_from_frame,
                joint_name,
                ..
            } => {
                let new = numbers(parent_from_frame);
                // A point has no orientation.
                let turned = parent_from_frame.rotation.angle() > 0.0;
                let numbers = if turned { 6 } else { 3 };
                for (k, what) in MOUNT_NUMBERS.iter().enumerate().take(numbers) {
                    changes.push(Change {
                        joint: joint_name.clone(),
                        what: format!("added {name} {what}"),
                        unit: if k < 3 { Unit::Meter } else { Unit::Radian },
                        old: None,
                        new: new[k],
                        delta: None,
                        sigma: known.get(&Number::Mount(name.clone(), k)).map(|k| k.sigma),
                        data_share: None,
                    });
                }
            }
            _ => {}
        }
    }
    changes
}

/// The numbers of [`Number::Origin`] in words.
const ORIGIN_NUMBERS: [&str; 6] = [
    "x",
    "y",
    "z",
    "rotation about x",
    "rotation about y",
    "rotation about z",
];

/// The numbers of [`Number::Mount`] in words.
const MOUNT_NUMBERS: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];

/// Name of the file beside a patched URDF that holds what a URDF cannot: `r.calibrated.urdf` gives `r.calibrated.calibration.yaml`.
#[must_use]
pub fn calibration_name(urdf: &str) -> String {
    format!("{}.calibration.yaml", urdf.trim_end_matches(".urdf"))
}

/// The effects that a URDF cannot hold, as YAML; `None` when there are none.
#[must_use]
pub fn calibration_yaml(inputs: &Inputs, robot: &Calibration) -> Option<String> {
    let model = &inputs.robot.model;
    let beyond: Vec<_> = model
        .joint_ids()
        .filter(|j| !robot.effects[j.index()].fits_into_urdf())
        .collect();
    if beyond.is_empty() {
        return None;
    }
    let terms = || {
        let effects = EFFECTS.iter().filter(|e| !e.geometric);
        effects.flat_map(|e| e.terms)
    };
    let sum = |about: Drives| -> String {
        let of = terms().filter(|t| {
            let kept = !matches!(t.source, Source::Velocity | Source::Caller);
            kept && t.drives == about
        });
        of.map(|t| t.formula).collect::<Vec<_>>().join(" + ")
    };
    let mut text = format!(
        "# Joint effects that a URDF cannot hold. Zero offsets are in the URDF's origins already.\n\
         # phi = q + {}\n\
         # rotation about the first axis across: {}; about the second: {}\n\
         {}\
         # torque: what the load exerts about the axis, N m (minus what the joint holds); torque_across: about the two axes\n\
         # across, which turn with the joint. A compliance above 0 gives way.\n\
         # approach: +1 where the joint came from below, -1 from above; backlash is half of the clearance.\n\
         # n: gear_ratio of the joint; friction: what it holds, N m.\n\
         # Version 1 had torque and approach of the other sign.\n{}\
         calib_effects: 2\n{}joints:\n",
        sum(Drives::About),
        sum(Drives::Across(0)),
        sum(Drives::Across(1)),
        growth_comment(inputs, robot, &sum(Drives::Along)),
        plugins_comment(robot),
        loads_yaml(inputs, robot),
    );
    for joint in beyond {
        let e = &robot.effects[joint.index()];
        let prismatic = !model.joint(joint).kind.turns();
        let _ = writeln!(text, "  {}:", model.joint(joint).name);
        for term in terms() {
            /// Below this an effect moves no tool by a nanometer (rad, rad per N m, 1).
            const NOTHING: f64 = 1e-15;
            let value = e.of(term.kind);
            if value.abs() > NOTHING {
                let unit = term.quantity.unit(prismatic).key_ending();
                let _ = writeln!(text, "    {}{unit}: {value:e}", term.name);
                if let (Drives::Across(k), Some(axis)) = (term.drives, motion_axis(model, joint)) {
                    let v = axis.across()[k];
                    let [x, y, z] = [v.x, v.y, v.z];
                    let _ = writeln!(text, "    {}_axis: [{x}, {y}, {z}]", term.name);
                }
                if term.drives == Drives::Along {
                    let reach = robot.masses.reach()[joint.index()];
                    let [x, y, z] = [reach.x, reach.y, reach.z];
                    let _ = writeln!(text, "    {}_of_m: [{x}, {y}, {z}]", term.name);
                }
            }
        }
        text.push_str(&plugins_yaml(e));
        text.push_str(&drive_yaml(robot, joint, e));
        if !e.coupling.is_empty() {
            text.push_str("    coupling:\n");
            for (other, share) in &e.coupling {
                let _ = writeln!(text, "      {}: {share}", model.joints()[*other].name);
            }
        }
    }
    Some(text)
}

/// What grows, and from which temperature on.
fn growth_comment(inputs: &Inputs, robot: &Calibration, sum: &str) -> String {
    let grows = |e: &JointEffects| e.of(EffectKind::ThermalExpansion) != 0.0;
    if !robot.effects.iter().any(grows) {
        return String::new();
    }
    let reference = inputs.robot.profile.load.reference_temperature_c;
    format!(
        "# The length before the joint (`_of_m`, from the joint before that moves, in the joint's axes) grows by {sum}, T0 = {reference} degC.\n"
    )
}

/// Coefficients of the effects that plugins compute.
fn plugins_yaml(effects: &JointEffects) -> String {
    let mut text = String::new();
    for (kind, value) in &effects.coefficients {
        if matches!(kind, EffectKind::Outside(_)) {
            let start = if text.is_empty() {
                "    plugin_effects:\n"
            } else {
                ""
            };
            let _ = writeln!(text, "{start}      {}: {value:e}", kind.term().name);
        }
    }
    text
}

/// What the coefficients of plugins belong to.
fn plugins_comment(robot: &Calibration) -> &'static str {
    let of_joint = |e: &JointEffects| {
        let mut kinds = e.coefficients.keys();
        kinds.any(|kind| matches!(kind, EffectKind::Outside(_)))
    };
    match robot.effects.iter().any(of_joint) {
        true => {
            "# plugin_effects: phi has each of them times the regressor of the plugin that the profile names as well; SI.\n"
        }
        false => "",
    }
}

/// What the formulas of a joint's effects need of its drive.
fn drive_yaml(robot: &Calibration, joint: JointId, effects: &JointEffects) -> String {
    let drive = robot.masses.drives()[joint.index()];
    let needs = |source: Source| {
        let mut own = effects.coefficients.iter();
        own.any(|(kind, c)| *c != 0.0 && kind.term().source == source)
    };
    let mut text = String::new();
    if needs(Source::Motor) {
        let _ = writeln!(text, "    gear_ratio: {}", drive.gear_ratio);
    }
    if needs(Source::Friction) {
        let _ = writeln!(text, "    friction: {}", drive.friction);
    }
    text
}

/// What loads the joints: gravity and the masses that the compliances belong to; empty where no joint yields to them.
fn loads_yaml(inputs: &Inputs, robot: &Calibration) -> String {
    let by_load = |kind: &EffectKind| {
        let source = kind.term().source;
        source == Source::Load || source == Source::Friction
    };
    let yields = |e: &JointEffects| {
        let mut found = e.coefficients.iter();
        found.any(|(kind, c)| by_load(kind) && *c != 0.0)
    };
    if !robot.effects.iter().any(yields) {
        return String::new();
    }
    let masses = &robot.masses;
    let g = masses.gravity();
    let mut text = format!(
        "# Loads follow from gravity (in the frame of the root, m/s2) and these masses at the joint readings. first_moment: mass\n\
         # times center in the link's frame, kg m. {}\n\
         gravity: [{}, {}, {}]\nloads:\n",
        match masses.assumed {
            Some(_) => "The masses are assumed: their scale and the compliances' belong together.",
            None => "The masses are those of the nominal URDF and of the payloads.",
        },
        g.x,
        g.y,
        g.z
    );
    let model = masses.loaded();
    for link in inputs.robot.model.link_ids() {
        let own = model.link(link).inertial;
        let moment = own.map_or_else(Vector3::zeros, |i| i.center_of_mass.coords * i.mass);
        let moment = moment + masses.beyond()[link.index()];
        let mass = own.map_or(0.0, |i| i.mass);
        if mass == 0.0 && moment == Vector3::zeros() {
            continue;
        }
        let name = &model.link(link).name;
        let [x, y, z] = [moment.x, moment.y, moment.z];
        let _ = writeln!(
            text,
            "  {name}: {{mass_kg: {mass}, first_moment_kg_m: [{x:e}, {y:e}, {z:e}]}}"
        );
    }
    text
}
