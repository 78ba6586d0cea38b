//! Robot model and forward kinematics from a URDF; edits of the URDF's text.
//!
//! A URDF is a tree of links. Joint `j` hangs `child` on `parent`; at position `q_j` (rad or m)
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
//! The file is text that we were lent: [`patch()`] exchanges attribute values by their byte range, and every other
//! byte (comments, quotes, order, line endings) stays. [`revert()`] gives the original bytes back.
//!
//! What this crate does **not** do: it opens no mesh (`package://` stays a text), expands no xacro,
//! and knows no closed kinematic loops.

pub mod axes;
pub mod companions;
pub mod decimal;
pub mod diff;
pub mod edit;
pub mod error;
mod expression;
mod insert;
pub mod kinematics;
pub mod model;
pub mod nearest;
mod numbers;
pub mod patch;
pub mod read;
pub mod revert;
pub mod rpy;
pub mod source;
pub mod verify;
pub mod visual;
mod xacro;
mod xacro_origins;
mod xacro_value;
mod yaml;
mod yaml_origins;

pub use axes::{AxisPair, AxisRelation};
pub use companions::{Companion, Companions, Reads, Reference, references};
pub use diff::{Changed, JointDiff, ModelDiff, diff, diff_models, diff_origins, unified};
pub use edit::{Change, EditError, UrdfEdit};
pub use patch::{Patched, PatchedFiles, patch, patch_with};
pub use revert::{ChangeRecord, Replacement, RevertError, revert, sha256_hex};
pub use verify::{SecondReader, Verification, verify};
pub use xacro_origins::{is_xacro, xacro_origins};
pub use yaml_origins::{YamlOrigin, patch_yaml, ur_key, yaml_origins};

pub use error::{Place, Problem, ReadError, ReadProblem};
pub use model::{
    Inertial, Joint, JointId, JointKind, JointLimits, Link, LinkId, Mimic, MimicLaw, RobotModel,
    UnknownName,
};
