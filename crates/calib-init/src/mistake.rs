//! A mistake of a recording, as data.

use serde::Serialize;

/// A mistake in the recordings that explains them.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "mistake")]
pub enum Mistake {
    /// A joint counts the other way.
    Sign {
        /// Its name.
        joint: String,
    },
    /// The columns of two joints are exchanged.
    Exchange {
        /// Name of one.
        first: String,
        /// Name of the other.
        second: String,
    },
    /// Several columns are in another order than their names.
    Order {
        /// Each joint with the name of the one in whose column its values are.
        columns: Vec<(String, String)>,
    },
    /// The unit of a joint's column, or of all columns of its kind.
    Unit {
        /// The joint; all where absent.
        joint: Option<String>,
        /// The unit that the values really have.
        unit: &'static str,
    },
    /// The unit of the tracker's lengths.
    TrackerUnit {
        /// The unit that the values really have.
        unit: &'static str,
    },
    /// A zero that is off.
    Offset {
        /// The joint.
        joint: String,
        /// What must be added, rad or m.
        value: f64,
        /// Whether it turns.
        turns: bool,
    },
    /// Joint values and tracker rows are paired off by some rows.
    Rows {
        /// How many.
        rows: i8,
    },
    /// The tracker's frame is left-handed.
    Mirrored,
    /// The tracker moved before some recordings.
    TrackerMoved,
    /// A joint moves a multiple of what its column says.
    Gain {
        /// The joint.
        joint: String,
        /// What the column must be multiplied by.
        factor: f64,
    },
    /// The body moved on its link before some recordings.
    Remounted {
        /// The body.
        body: String,
    },
    /// The quaternions are in another order than their columns' names say.
    Quaternions {
        /// The scalar is the first of the four; else the last.
        first: bool,
    },
    /// The poses are those of the tracker in the body.
    Inverted,
    /// Another convention of poses was misread.
    Poses,
    /// A joint moved, and no column holds its readings.
    MissingColumn {
        /// The joint.
        joint: String,
    },
    /// A joint without a column stood elsewhere than at 0.
    StoodAt {
        /// The joint.
        joint: String,
        /// Where it stood, rad or m.
        value: f64,
        /// Whether it turns.
        turns: bool,
    },
    /// A body is on another link.
    Link {
        /// The body.
        body: String,
        /// The link.
        link: String,
    },
    /// Two bodies are exchanged.
    Bodies {
        /// One.
        first: String,
        /// The other.
        second: String,
    },
    /// Any other: `calib check` names it.
    Other,
}
