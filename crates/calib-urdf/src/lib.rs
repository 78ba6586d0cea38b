//! Robot model and forward kinematics from a URDF; edits of the URDF's text.
//!
//! A URDF is a tree of links. Joint `j` connects `child` to `parent`; at position `q_j` (rad or m)
//!
//! ```text
//! parent_from_child(q_j) = parent_from_joint · motion(q_j)                                    (1)
//! parent_from_joint      = Trans(x, y, z) · Rz(yaw) · Ry(pitch) · Rx(roll)                    (2)
//! motion(q)              = Rot(axis, q) | Trans(q · axis) | 1     revolute | prismatic | fixed
//! q_j                    = multiplier · q_source + offset         where joint j mimics another
//! root_from_link         = ∏ parent_from_child(q_j) along the path from the root to the link  (3)
//! ```
//!
//! (2) is the URDF's `<origin xyz rpy>`: fixed-axis X-Y-Z angles. `parent_from_joint` is what a
//! calibration corrects, so the way back, from a rotation to three decimals in a text, has to be
//! exact as well: see [`rpy`].
//!
//! [`patch()`] replaces attribute values by their byte range and leaves every other byte of the file (comments, quotes,
//! order, line endings) as it is. [`revert()`] restores the original bytes.
//!
//! This crate does **not** open files (`package://` stays a text; [`mesh`] reads bytes), expand xacro, or support closed kinematic loops.
//!
//! ```
//! use calib_urdf::nalgebra::Isometry3;
//! use calib_urdf::{RobotModel, UrdfEdit, patch, revert};
//!
//! let text = r#"<robot name="arm"><link name="base"/><link name="hand"/>
//!   <joint name="wrist" type="revolute"><parent link="base"/><child link="hand"/>
//!     <origin xyz="0 0 0.30" rpy="0 0 0"/><axis xyz="0 0 1"/><limit effort="1" velocity="1"/></joint></robot>"#;
//! let model = RobotModel::from_urdf_text(text, "arm.urdf")?;
//! let root_from_hand = model.root_from_link(&[1.0], model.link_id("hand")?);
//! assert!((root_from_hand.translation.z - 0.30).abs() < 1e-15);
//!
//! let edit = UrdfEdit::SetOrigin {
//!     joint: "wrist".to_owned(),
//!     parent_link_from_joint: Isometry3::translation(0.0, 0.0, 0.302),
//! };
//! let patched = patch(text, "arm.urdf", &[edit])?;
//! assert_eq!(patched.text, text.replace("0.30\"", "0.302\""));
//! assert_eq!(revert(&patched.text, &patched.record(text))?, text);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod doubt;
pub mod edit;
pub mod error;
pub mod kinematics;
mod masses;
pub mod model;
pub mod range;
pub mod read;
pub mod xacro;
pub mod yaml;

pub use edit::change::{Change, UrdfEdit};
pub use edit::decimal;
pub use edit::diff::{Changed, JointDiff, ModelDiff, diff, diff_models, diff_origins, unified};
pub use edit::error::{EditError, SharedValue};
pub use edit::patch::{Patched, PatchedFiles, patch, patch_with};
pub use edit::revert::{ChangeRecord, Replacement, RevertError, replay, revert, sha256_hex};
pub use edit::verify::{SecondReader, Verification, verify};
pub use error::{Place, Problem, ReadError, ReadProblem};
pub use kinematics::axes::{AxisPair, AxisRelation};
pub use kinematics::rpy;
pub use model::{
    Inertial, Joint, JointId, JointKind, JointLimits, Link, LinkId, Mimic, MimicLaw, RobotModel,
    UnknownName,
};
pub use nalgebra;
pub use read::{mesh, source, visual};
pub use xacro::companions::{Companion, Companions, Reads, Reference, references};
pub use xacro::origins::{is_xacro, xacro_may_name, xacro_origins};
pub use yaml::origins::{YamlOrigin, patch_yaml, ur_key, yaml_origins};
