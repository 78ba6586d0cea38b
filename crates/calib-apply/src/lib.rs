#![doc = include_str!("../README.md")]
//! # What is compared
//!
//! ```text
//! result:  robot.calibrated.urdf + its change record  ─►  before, after: parent_link_from_joint of every joint
//! target:  URDF | xacro (+ the YAML that it loads) | kinematics YAML  ─►  the same joints' origins as they stand there
//! before = there (to 1e-6 m, 1e-6 rad)  ─►  after is written, number by number; every other byte stays
//! ```

mod apply;
mod change;
mod diff;
mod error;
mod files;
mod kind;
mod render;
mod restore;
mod result;
mod revert;
mod target;

pub use apply::{Applied, ApplyRequest, apply};
pub use change::{Destination, FileChange};
pub use diff::{diff_json, diff_table, diff_unified};
pub use error::{ApplyError, OriginDifference};
pub use kind::Kind;
pub use render::{json, text};
pub use restore::{not_reverted, original, revert, revert_in_place};
pub use result::{Calibrated, find as find_result};
pub use revert::{read_record, record_path};
pub use target::Target;
