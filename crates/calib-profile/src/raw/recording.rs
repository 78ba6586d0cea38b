//! Recordings: what each is for, and how its rows become poses.

use super::RawValue;
use schemars::JsonSchema;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;

/// What a recording is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawUse {
    /// One or two joints turned over their range of motion.
    Sweep,
    /// Any static poses, used to fit.
    Static,
    /// Held out: never used to fit, only to verify.
    Validation,
}

/// Place of an entry among those of its map, from 0. It is no part of what the entry says: entries are equal whatever their places.
#[derive(Debug, Clone, Copy, Default)]
pub struct Place(pub usize);

impl PartialEq for Place {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// The recordings by name, each with its place in the text: that is taken for the order in which they were made.
pub(super) fn in_their_order<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<BTreeMap<String, RawRecording>, D::Error> {
    struct Entries;

    impl<'de> Visitor<'de> for Entries {
        type Value = BTreeMap<String, RawRecording>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("a map")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut out = BTreeMap::new();
            while let Some((name, mut recording)) = map.next_entry::<String, RawRecording>()? {
                recording.place = Place(out.len());
                out.insert(name, recording);
            }
            Ok(out)
        }
    }

    from.deserialize_map(Entries)
}

/// One recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawRecording {
    /// File, relative to the profile.
    pub file: String,
    /// What it is for.
    #[serde(rename = "use")]
    pub usage: RawUse,
    /// Joints moved and the range asked of each: `<joint>_deg|_rad|_mm|_m: [from, to]`.
    #[serde(default)]
    pub joints: BTreeMap<String, [f64; 2]>,
    /// Joints that the file does not list and that stood still: `<joint>_deg|_rad|_mm|_m: value`.
    #[serde(default)]
    pub hold: BTreeMap<String, f64>,
    /// Text column whose values group the poses in the report (e.g. the torso position).
    #[serde(default)]
    pub group: Option<String>,
    /// Reader to use, built-in or of a plugin; found from the content when absent (see `calib plugins`).
    #[serde(default)]
    pub reader: Option<String>,
    /// Parameters of the reader, by name.
    #[serde(default)]
    pub reader_parameters: BTreeMap<String, RawValue>,
    /// How to read columns that do not name their unit.
    #[serde(default)]
    pub columns: Option<calib_recording::ColumnMap>,
    /// The robot's own log of its joints, where it is another file than the tracker's.
    #[serde(default)]
    pub robot_log: Option<RawRobotLog>,
    /// How rows with a time become poses, and how the clocks of tracker and robot go together. Without it every row is
    /// a pose, and tracker and joints must share their rows.
    #[serde(default)]
    pub timing: Option<RawTiming>,
    /// Where it stands among the recordings.
    #[serde(skip)]
    pub place: Place,
}

/// The robot's own log of its joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawRobotLog {
    /// File, relative to the profile.
    pub file: String,
    /// Reader to use; found from the content when absent.
    #[serde(default)]
    pub reader: Option<String>,
    /// How to read columns that do not name their unit.
    #[serde(default)]
    pub columns: Option<calib_recording::ColumnMap>,
    /// For recordings without `timing`: how rows of the log belong to rows of the tracker's file.
    #[serde(default)]
    pub rows: Option<RawRows>,
}

/// Which row of the robot's log belongs to a row of the tracker's file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawRows {
    /// The row of the same number: both files have one row for every posture.
    Same,
}

/// Where poses come from in a recording with time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawTimedPoses {
    /// Every hold gives one static pose: medians (of orientations the chordal mean), weighted by their scatter.
    #[default]
    Settle,
    /// Rows of the motion itself, at `rate_hz`; the fit estimates what is left of the clocks' offset.
    Continuous,
}

/// What is known of the clocks of tracker and robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawClocks {
    /// Two clocks: offset and drift are found. One clock: in rows of a motion, how late joint values are.
    #[default]
    Estimate,
    /// One clock (synchronized machines): the times are used unchanged.
    Shared,
}

/// Time in a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawTiming {
    /// Where the poses come from: `settle` (default) or `continuous`.
    pub poses: RawTimedPoses,
    /// What is known of the clocks: `estimate` (default) or `shared`.
    pub clock: RawClocks,
    /// Shortest hold, s.
    pub hold_s: f64,
    /// Rows taken from a motion, per s.
    pub rate_hz: f64,
    /// Largest offset between the clocks that is looked for, s.
    pub max_offset_s: f64,
    /// By how much the values of a joint are later than those of the others, ms, where its log was filtered or sent separately: `{elbow: 30}`; below 0
    /// where they are ahead.
    pub late_ms: BTreeMap<String, f64>,
}

impl Default for RawTiming {
    fn default() -> Self {
        Self {
            poses: RawTimedPoses::Settle,
            clock: RawClocks::Estimate,
            hold_s: 0.5,
            rate_hz: 10.0,
            max_offset_s: 10.0,
            late_ms: BTreeMap::new(),
        }
    }
}
