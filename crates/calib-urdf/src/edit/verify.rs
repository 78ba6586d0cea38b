//! Does a patched text say what it should? Two readers are asked.
//!
//! The model that the edits ask for and the one that comes out of the text have to put every link in the same place,
//! at zero and at positions that bend every joint, to [`POSITION_TOLERANCE`]. urdf-rs reads the same text as the second,
//! independent reader (also the one of urdf-viz), with the matrices of [`matrix_from_rpy`] instead of quaternions.

use crate::edit::change::UrdfEdit;
use crate::edit::decimal::same_number;
use crate::edit::error::{EditError, Rounded};
use crate::kinematics::rpy::{angle_between, matrix_from_rpy};
use crate::model::{Joint, JointId, JointKind, JointLimits, Link, LinkId, MimicLaw, RobotModel};
use crate::read::source::OwnAttributes as _;
use crate::read::source::{has_quaternions, parse};
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

/// m. A thousandth of a nanometer: decimals and rounding may cost this much, and nothing else.
pub const POSITION_TOLERANCE: f64 = 1e-12;
/// rad. The same at a distance of one meter as [`POSITION_TOLERANCE`].
pub const ROTATION_TOLERANCE: f64 = 1e-12;

/// How well a text reproduces the model that it should hold.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Verification {
    /// The largest distance of a link's origin from where it should be, m, over all links and tried positions.
    pub translation: f64,
    /// The largest angle between a link's axes and where they should be, rad.
    pub rotation: f64,
    /// The same through urdf-rs, or why it could not be asked.
    pub second_reader: SecondReader,
}

/// What urdf-rs says to the text.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SecondReader {
    /// It reads it, and no link is further away than this.
    Agrees {
        /// m.
        translation: f64,
        /// rad.
        rotation: f64,
    },
    /// It does not read a part of XML or URDF that this file uses (entities, quaternions near pitch ±π/2, visuals).
    CannotRead(String),
}

/// Reads a patched URDF again and compares its forward kinematics with the model that it should hold.
///
/// # Errors
/// [`EditError::Read`] when it is not a URDF, [`EditError::StructureChanged`] when links or joints differ, and
/// [`EditError::NotReproduced`] when a link stands elsewhere.
pub fn verify(
    patched_text: &str,
    expected: &RobotModel,
    name_for_errors: &str,
) -> Result<Verification, EditError> {
    let found = RobotModel::from_urdf_text(patched_text, name_for_errors)?;
    same_structure(&found, expected, name_for_errors)?;
    let mut worst = (0.0_f64, 0.0_f64);
    for q in trial_positions(expected) {
        let wanted = expected.forward_kinematics(&q);
        compare(
            &found.forward_kinematics(&q),
            &wanted,
            expected,
            name_for_errors,
            "own reader",
            &mut worst,
        )?;
    }
    let second_reader = match second_reading(patched_text, name_for_errors, expected) {
        Err(reason) => SecondReader::CannotRead(reason),
        Ok(second) => {
            let mut worst = (0.0, 0.0);
            for q in trial_positions(expected) {
                let wanted = expected.forward_kinematics(&q);
                compare(
                    &second.forward_kinematics(&q),
                    &wanted,
                    expected,
                    name_for_errors,
                    "urdf-rs",
                    &mut worst,
                )?;
            }
            SecondReader::Agrees {
                translation: worst.0,
                rotation: worst.1,
            }
        }
    };
    Ok(Verification {
        translation: worst.0,
        rotation: worst.1,
        second_reader,
    })
}

fn compare(
    found: &[Isometry3<f64>],
    wanted: &[Isometry3<f64>],
    model: &RobotModel,
    file: &str,
    reader: &'static str,
    worst: &mut (f64, f64),
) -> Result<(), EditError> {
    // Rounding grows with the distance from the root: a mobile base's map may be kilometers away.
    let size = wanted
        .iter()
        .map(|pose| pose.translation.vector.norm())
        .fold(1.0, f64::max);
    for ((link, found), wanted) in model.links().iter().zip(found).zip(wanted) {
        let translation = (found.translation.vector - wanted.translation.vector).norm();
        let rotation = angle_between(&found.rotation, &wanted.rotation);
        *worst = (worst.0.max(translation), worst.1.max(rotation));
        // Not `>`: NaN must not pass.
        if !(translation <= POSITION_TOLERANCE * size && rotation <= ROTATION_TOLERANCE) {
            return Err(EditError::NotReproduced {
                file: file.to_owned(),
                link: link.name.clone(),
                translation_m: Rounded(translation),
                rotation_rad: Rounded(rotation),
                reader,
            });
        }
    }
    Ok(())
}

fn same_structure(found: &RobotModel, expected: &RobotModel, file: &str) -> Result<(), EditError> {
    let changed = |what: String| {
        Err(EditError::StructureChanged {
            file: file.to_owned(),
            what,
        })
    };
    if found.links().len() != expected.links().len()
        || found.joints().len() != expected.joints().len()
    {
        return changed(format!(
            "the robot has {} links and {} joints instead of {} and {}",
            found.links().len(),
            found.joints().len(),
            expected.links().len(),
            expected.joints().len()
        ));
    }
    for (a, b) in found.links().iter().zip(expected.links()) {
        if a.name != b.name || a.inertial != b.inertial {
            return changed(format!(
                "link `{}` stands where link `{}` should",
                a.name, b.name
            ));
        }
    }
    for (a, b) in found.joints().iter().zip(expected.joints()) {
        if (&a.name, a.parent, a.child, a.mimic) != (&b.name, b.parent, b.child, b.mimic)
            || !same_limits(&a.limits, &b.limits)
        {
            return changed(format!(
                "joint `{}` differs from joint `{}`",
                a.name, b.name
            ));
        }
        let axis = |joint: &Joint| joint.kind.axis().map_or(Vector3::zeros(), Unit::into_inner);
        if a.kind.name() != b.kind.name() || (axis(a) - axis(b)).norm() > ROTATION_TOLERANCE {
            return changed(format!("joint `{}` moves differently", a.name));
        }
    }
    Ok(())
}

fn same_limits(a: &JointLimits, b: &JointLimits) -> bool {
    let pairs = [
        (a.lower, b.lower),
        (a.upper, b.upper),
        (a.effort, b.effort),
        (a.velocity, b.velocity),
    ];
    pairs.iter().all(|pair| match pair {
        (Some(a), Some(b)) => same_number(*a, *b),
        (None, None) => true,
        _ => false,
    })
}

/// Zero, and two positions in which no joint is at zero or at the same angle as its neighbor.
fn trial_positions(model: &RobotModel) -> Vec<Vec<f64>> {
    let bent = |sign: f64| {
        (0..model.joints().len())
            .map(|i| sign * (0.3 + 0.7 * (i as f64 * 0.618).fract()))
            .collect()
    };
    vec![model.zero_positions(), bent(1.0), bent(-1.0)]
}

/// The model as urdf-rs reads it: origins, axes and mimics of its own, the tree of ours.
fn second_reading(text: &str, name: &str, ours: &RobotModel) -> Result<RobotModel, String> {
    let document = parse(text, name).map_err(|error| error.to_string())?;
    if has_quaternions(&document) && document.descendants().any(|node| node.has_own("quat_xyzw")) {
        return Err("it rounds `quat_xyzw` near pitch ±π/2".to_owned());
    }
    let prefixed =
        |node: roxmltree::Node<'_, '_>| node.attributes().any(|a| a.namespace().is_some());
    if document.descendants().any(prefixed) {
        return Err("it takes attributes of other namespaces for the URDF's".to_owned());
    }
    let robot = urdf_rs::read_from_string(text.trim_start_matches('\u{feff}'))
        .map_err(|error| error.to_string())?;
    let mut model = ours.clone();
    if robot.joints.len() != model.joints.len() {
        return Err(format!("it finds {} joints", robot.joints.len()));
    }
    for (id, theirs) in robot.joints.iter().enumerate() {
        let axis = Unit::new_normalize(Vector3::from(theirs.axis.xyz.0));
        let kind = match theirs.joint_type {
            urdf_rs::JointType::Fixed => JointKind::Fixed,
            urdf_rs::JointType::Revolute => JointKind::Revolute { axis },
            urdf_rs::JointType::Continuous => JointKind::Continuous { axis },
            urdf_rs::JointType::Prismatic => JointKind::Prismatic { axis },
            _ => return Err(format!("it finds another type for joint `{}`", theirs.name)),
        };
        let rotation = matrix_from_rpy(&Vector3::from(theirs.origin.rpy.0));
        let joint = &mut model.joints[id];
        if joint.name != theirs.name
            || ours.link(joint.parent).name != theirs.parent.link
            || ours.link(joint.child).name != theirs.child.link
        {
            return Err(format!(
                "it finds joint `{}` in place of `{}`",
                theirs.name, joint.name
            ));
        }
        joint.kind = kind;
        joint.parent_link_from_joint = Isometry3::from_parts(
            Translation3::from(Vector3::from(theirs.origin.xyz.0)),
            UnitQuaternion::from_rotation_matrix(&rotation),
        );
    }
    Ok(model)
}

impl RobotModel {
    /// The model that a URDF has after these edits: what [`verify`] compares a patched text with.
    ///
    /// # Errors
    /// [`EditError::UnknownName`], [`EditError::NameTaken`]. `name_for_errors` stands in the messages.
    pub fn with_edits(
        mut self,
        name_for_errors: &str,
        edits: &[UrdfEdit],
    ) -> Result<Self, EditError> {
        let unknown = |source| EditError::UnknownName {
            file: name_for_errors.to_owned(),
            source,
        };
        for edit in edits {
            match edit {
                UrdfEdit::SetOrigin {
                    joint,
                    parent_link_from_joint,
                } => {
                    let id = self.joint_id(joint).map_err(unknown)?;
                    self = self.with_origin(id, *parent_link_from_joint);
                }
                UrdfEdit::SetAxis { joint, axis } => {
                    let id = self.joint_id(joint).map_err(unknown)?;
                    let kind = match self.joint(id).kind {
                        JointKind::Fixed => JointKind::Fixed,
                        JointKind::Revolute { .. } => JointKind::Revolute { axis: *axis },
                        JointKind::Continuous { .. } => JointKind::Continuous { axis: *axis },
                        JointKind::Prismatic { .. } => JointKind::Prismatic { axis: *axis },
                    };
                    self = self.with_kind(id, kind);
                }
                UrdfEdit::SetLimits {
                    joint,
                    lower,
                    upper,
                } => {
                    let id = self.joint_id(joint).map_err(unknown)?;
                    let joint = &mut self.joints[id.index()];
                    if !matches!(joint.kind, JointKind::Continuous { .. } | JointKind::Fixed) {
                        joint.limits.lower = Some(*lower);
                        joint.limits.upper = Some(*upper);
                    }
                }
                UrdfEdit::AddFixedFrame {
                    name,
                    parent_link,
                    joint_name,
                    parent_from_frame,
                    ..
                } => {
                    let parent = self.link_id(parent_link).map_err(unknown)?;
                    self.add_fixed_frame(name, parent, joint_name, parent_from_frame);
                }
                UrdfEdit::AddProvenance { .. } => {}
            }
        }
        Ok(self)
    }

    /// Adds the frame, or moves the one of that name (whose place in the tree [`crate::patch()`] has checked).
    fn add_fixed_frame(
        &mut self,
        name: &str,
        parent: LinkId,
        joint_name: &str,
        parent_from_frame: &Isometry3<f64>,
    ) {
        if let Some(id) = self.joint_ids.get(joint_name) {
            self.joints[id.index()].parent_link_from_joint = *parent_from_frame;
            return;
        }
        let (child, id) = (
            LinkId(self.links.len() as u32),
            JointId(self.joints.len() as u32),
        );
        self.links.push(Link {
            name: name.to_owned(),
            parent_joint: Some(id),
            child_joints: Vec::new(),
            inertial: None,
        });
        self.links[parent.index()].child_joints.push(id);
        self.joints.push(Joint {
            name: joint_name.to_owned(),
            parent,
            child,
            parent_link_from_joint: *parent_from_frame,
            kind: JointKind::Fixed,
            limits: JointLimits::default(),
            mimic: None,
            law: MimicLaw {
                source: id,
                multiplier: 1.0,
                offset: 0.0,
            },
        });
        self.from_root.push(id);
        self.link_ids.insert(name.to_owned(), child);
        self.joint_ids.insert(joint_name.to_owned(), id);
    }
}
