//! The calibrated robot as a patched URDF, the effects that a URDF cannot hold, and the scene.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use calib_core::EFFECTS;
use calib_core::effect::{Drives, Source};
use calib_geometry::so3;
use calib_report::scene::{Provenance, SceneBody, SceneFrame, SceneMarker, SceneRobot};
use calib_report::{Change, Input, Scene, Status, Unit};
use calib_urdf::rpy::rpy_from_rotation;
use calib_urdf::{ChangeRecord, RobotModel, UrdfEdit, patch};
use nalgebra::{Isometry3, Matrix6};

use crate::error::PipelineError;
use crate::formulate::found::Found;
use crate::formulate::kinematics::Calibration;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;
use crate::verify::known::Known;

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

/// Patches the URDF to the calibrated geometry; verifies by re-reading that its forward kinematics is the
/// solution's to 1e-12 m.
///
/// # Errors
/// [`PipelineError::Patch`].
pub fn patch_urdf(
    inputs: &Inputs,
    robot: &Calibration,
    known: &BTreeMap<String, Known>,
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
                parent_link_from_joint: new,
            });
        }
    }
    for body in &inputs.robot.profile.outputs.add_bodies {
        if let Some(mount) = robot.mounts.get(body) {
            let link = inputs.robot.profile.bodies[body].link;
            edits.push(UrdfEdit::AddFixedFrame {
                name: body.clone(),
                parent_link: nominal.link(link).name.clone(),
                joint_name: format!("{body}_mount"),
                parent_from_frame: *mount,
                comment: Some(format!("tracking body {body}")),
            });
        }
    }
    let file = &inputs.robot.profile.urdf;
    let fail = |e: calib_urdf::EditError| PipelineError::Patch {
        file: file.clone(),
        text: e.to_string(),
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
    known: &BTreeMap<String, Known>,
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
                let mut push = |what: &str, unit: Unit, old: f64, new: f64| {
                    if (new - old).abs() > UNCHANGED {
                        let known = known.get(&format!("{joint}.{what}"));
                        changes.push(Change {
                            joint: joint.clone(),
                            what: what.to_owned(),
                            unit,
                            old: Some(old),
                            new,
                            delta: Some(new - old),
                            sigma: known.map(|k| k.sigma),
                            data_share: known.and_then(|k| k.data_share),
                        });
                    }
                };
                for (k, what) in ["x", "y", "z"].into_iter().enumerate() {
                    push(
                        what,
                        Unit::Meter,
                        old.translation.vector[k],
                        new.translation.vector[k],
                    );
                }
                // Roll, pitch and yaw jump near pitch ±90°: the turn itself is what changed.
                let turn = so3::log(&(old.rotation.inverse() * new.rotation));
                for (k, what) in ["turn about x", "turn about y", "turn about z"]
                    .into_iter()
                    .enumerate()
                {
                    push(what, Unit::Radian, 0.0, turn[k]);
                }
            }
            UrdfEdit::AddFixedFrame {
                name,
                parent_from_frame,
                joint_name,
                ..
            } => {
                let new = numbers(parent_from_frame);
                for (k, what) in ["x", "y", "z", "roll", "pitch", "yaw"].iter().enumerate() {
                    changes.push(Change {
                        joint: joint_name.clone(),
                        what: format!("added {name} {what}"),
                        unit: if k < 3 { Unit::Meter } else { Unit::Radian },
                        old: None,
                        new: new[k],
                        delta: None,
                        sigma: known.get(&format!("{name}.{what}")).map(|k| k.sigma),
                        data_share: None,
                    });
                }
            }
            _ => {}
        }
    }
    changes
}

fn numbers(pose: &Isometry3<f64>) -> [f64; 6] {
    let t = pose.translation.vector;
    let rpy = rpy_from_rotation(&pose.rotation);
    [t.x, t.y, t.z, rpy[0], rpy[1], rpy[2]]
}

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
         # torque: what the joint holds against gravity about its axis, N m; torque_across: about the two axes across.\n\
         # approach: +1 where the joint came from below, -1 from above; backlash is half of the clearance.\n\
         calib_effects: 1\njoints:\n",
        sum(Drives::About),
        sum(Drives::Across(0)),
        sum(Drives::Across(1)),
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
            }
        }
        if !e.coupling.is_empty() {
            text.push_str("    coupling:\n");
            for (other, share) in &e.coupling {
                let _ = writeln!(text, "      {}: {share}", model.joints()[*other].name);
            }
        }
    }
    Some(text)
}

/// The calibrated world: tracker, robot root, bodies, origins and links at the zero position.
#[must_use]
pub fn scene(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    robot: &Calibration,
    root_covariance: Option<&Matrix6<f64>>,
    found: &[Found],
) -> Scene {
    let profile = &inputs.robot.profile;
    let model = robot.urdf_model();
    let root = model.link(model.root()).name.clone();
    let mut frames = vec![
        SceneFrame::root(profile.tracker.frame.clone(), Status::Measured),
        SceneFrame::new(
            root.clone(),
            profile.tracker.frame.clone(),
            &robot.tracker_from_root,
            root_covariance,
            Status::Calibrated,
        ),
    ];
    for joint in model.joints() {
        // At zero the child link stands where the joint's origin is.
        let status = if joint.parent_link_from_joint
            == inputs.robot.model.joints()[joint_index(&model, &joint.name)].parent_link_from_joint
        {
            Status::Assumed
        } else {
            Status::Calibrated
        };
        let frame = SceneFrame::new(
            model.link(joint.child).name.clone(),
            model.link(joint.parent).name.clone(),
            &joint.parent_link_from_joint,
            None,
            status,
        );
        frames.push(frame.in_urdf());
    }
    for (name, mount) in &robot.mounts {
        let body = &profile.bodies[name];
        let status = if body.mount.is_some() {
            Status::Assumed
        } else {
            Status::Calibrated
        };
        frames.push(SceneFrame::new(
            body_frame(&model, name),
            model.link(body.link).name.clone(),
            mount,
            None,
            status,
        ));
    }
    for f in found
        .iter()
        .filter(|f| profile.origins.contains_key(&f.child) && robot.mounts.contains_key(&f.parent))
    {
        frames.push(SceneFrame::new(
            format!("{}_origin", f.child),
            body_frame(&model, &f.parent),
            &f.pose,
            f.covariance.as_ref(),
            f.status,
        ));
    }
    let bodies = robot
        .mounts
        .keys()
        .map(|name| SceneBody {
            name: body_frame(&model, name),
            link: model.link(profile.bodies[name].link).name.clone(),
            markers: tracks[name].template.as_ref().map_or_else(Vec::new, |t| {
                t.names
                    .iter()
                    .zip(&t.points)
                    .map(|(n, p)| SceneMarker {
                        name: n.clone(),
                        xyz_m: p.coords.into(),
                    })
                    .collect()
            }),
        })
        .collect();
    Scene {
        name: inputs.robot.file.clone(),
        robot: SceneRobot {
            name: profile.robot.clone(),
            urdf: profile.outputs.urdf.clone(),
            base: root,
            joints: Vec::new(),
        },
        frames,
        bodies,
        objects: Vec::new(),
        provenance: Provenance {
            tool: "calib".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            profile: inputs.robot.file.clone(),
            inputs: inputs
                .digests
                .iter()
                .map(|d| Input {
                    path: d.path.clone(),
                    sha256: d.sha256.clone(),
                })
                .collect(),
        },
        ..Scene::default()
    }
}

/// Name of a body's frame in the scene: its own, unless a link has it.
fn body_frame(model: &RobotModel, body: &str) -> String {
    if model.link_id(body).is_ok() {
        format!("{body}_body")
    } else {
        body.to_owned()
    }
}

fn joint_index(model: &RobotModel, name: &str) -> usize {
    model.joint_id(name).map_or(0, calib_urdf::JointId::index)
}
