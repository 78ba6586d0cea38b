//! What columns seem to be, while it is found.

use std::collections::BTreeMap;

use calib_recording::{BodyColumns, ColumnMap};
use calib_urdf::JointId;

use crate::fact::About;

/// Largest angle in radians that is no angle in degrees: one turn, and a tenth.
pub const TURN: f64 = 2.2 * std::f64::consts::PI;

/// A column map with what it was made from.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Guess {
    /// The map.
    pub map: ColumnMap,
    /// What was found, and how.
    pub facts: Vec<About>,
    /// Joint and its column.
    pub joints: Vec<(JointId, String)>,
    /// Joints and columns are paired by their order alone.
    pub by_order: bool,
    /// Bodies whose orientation may be read in several ways: the other ways, by body, the most usual first.
    pub other_turns: BTreeMap<String, Vec<BodyColumns>>,
}
