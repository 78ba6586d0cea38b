//! What `calib check` looked at: what was recorded, which checks passed, and which could not be made.

use calib_finding::{Finding, Id, Severity, catalog};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{JointCoverage, Lost, RecordingUse};

/// The data of a profile as its checks see them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DataChecks {
    /// The robot's name.
    pub robot: String,
    /// The recordings, by name.
    pub recordings: Vec<CheckedRecording>,
    /// The joint ranges of the fitted recordings.
    pub coverage: Vec<JointCoverage>,
    /// Scatter of the markers about their rigid bodies.
    pub noise: Vec<BodyNoise>,
    /// Every check and how it ended.
    pub checks: Vec<Checked>,
    /// What the checks found, worst first.
    pub findings: Vec<Finding>,
}

/// One recording.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CheckedRecording {
    /// Its name in the profile.
    pub name: String,
    /// What it is used for.
    pub used_for: RecordingUse,
    /// Rows.
    pub rows: usize,
    /// Columns of joints.
    pub joints: usize,
    /// Bodies that were recorded as poses.
    pub bodies: usize,
    /// Markers.
    pub markers: usize,
    /// Rows per second, median; null where rows have no time.
    pub rate_hz: Option<f64>,
    /// Samples that the tracker lost, by marker or body.
    pub lost: Vec<Lost>,
    /// How clocks were aligned; empty where there was one.
    pub alignment: String,
}

/// Scatter of a body's markers about the rigid body.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BodyNoise {
    /// The body.
    pub body: String,
    /// Standard deviation of one marker coordinate, m; null where fewer than three markers leave it open.
    pub sigma_m: Option<f64>,
    /// What the profile states it to be, m.
    #[serde(default)]
    pub stated_m: Option<f64>,
}

/// A check and how it ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Checked {
    /// The check.
    pub check: DataCheck,
    /// How it ended.
    pub outcome: CheckOutcome,
}

/// What is checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum DataCheck {
    /// Units of angles and lengths.
    Units,
    /// Joint readings lie inside of their limits.
    JointLimits,
    /// The joints of a sweep move.
    JointMotion,
    /// Markers are measured: neither zero, nor frozen, nor written twice.
    Markers,
    /// Markers of a body keep their distances and their names.
    RigidBodies,
    /// Rows are poses at rest, in order, each once.
    Rows,
    /// Validation poses differ from the fitted ones.
    Validation,
    /// Bodies move as the nominal robot moves them: signs, order and zeros of the joints, mounts.
    Structure,
    /// The clocks of joints and tracker.
    Clocks,
}

/// How a check ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum CheckOutcome {
    /// Nothing was found.
    Passed,
    /// See the findings.
    Found,
    /// Not checked: the URDF states no limits.
    NoJointLimits,
    /// Not checked: no body has three markers or more.
    NoRigidBody,
    /// Not checked: no recording is for validation.
    NoValidation,
    /// Not checked: errors of the data come first.
    AfterErrors,
    /// Not needed: every row holds the joints and the tracker's data of one pose.
    OneTable,
}

impl DataCheck {
    /// Every check, in the order of the text.
    pub const ALL: [Self; 9] = [
        Self::Units,
        Self::JointLimits,
        Self::JointMotion,
        Self::Markers,
        Self::RigidBodies,
        Self::Rows,
        Self::Validation,
        Self::Structure,
        Self::Clocks,
    ];

    /// The findings that it makes.
    #[must_use]
    pub fn ids(self) -> &'static [Id] {
        match self {
            Self::Units => &[
                catalog::UNIT_MISMATCH,
                catalog::UNIT_MISSING,
                catalog::QUATERNION_ORDER,
                catalog::POSE_CONVENTION,
                catalog::UP_AXIS,
            ],
            Self::JointLimits => &[catalog::JOINT_OUTSIDE_LIMITS],
            Self::JointMotion => &[
                catalog::COVERAGE,
                catalog::JOINT_NEVER_MOVED,
                catalog::TOO_FEW_POSES,
                catalog::JOINT_DUPLICATE,
            ],
            Self::Markers => &[
                catalog::ALL_ZERO_TRIPLET,
                catalog::PLACEHOLDER_TRIPLET,
                catalog::DUPLICATE_COLUMN,
                catalog::FROZEN,
                catalog::VIRTUAL_POINTS,
                catalog::MANY_LOST,
                catalog::MISSING_MARKER,
                catalog::MISSING_BODY,
            ],
            Self::RigidBodies => &[
                catalog::NOT_RIGID,
                catalog::BODY_NOT_RIGID,
                catalog::BODY_REDEFINED,
                catalog::BODY_CONDENSED,
                catalog::POSE_OF_MARKERS,
                catalog::MARKER_SWAP,
                catalog::MARKER_SWAP_REPAIRED,
                catalog::MARKER_OUTLIER,
                catalog::MIRRORED,
                catalog::NOT_UNIT_ROTATION,
                catalog::BODY_FLIP,
            ],
            Self::Rows => &[
                catalog::JUMP,
                catalog::TIME_GAP,
                catalog::UNSETTLED_ROWS,
                catalog::ROWS_REPEATED,
                catalog::FRAMES_MERGED,
                catalog::ROWS_OUT_OF_ORDER,
                catalog::ROW_OUTLIER,
                catalog::ROW_CUT_OFF,
                catalog::JOINT_VALUES_MISSING,
                catalog::JOINT_READINGS_HELD,
            ],
            Self::Validation => &[catalog::HELD_OUT_IN_TRAINING],
            Self::Structure => &[
                catalog::JOINT_SIGN,
                catalog::JOINT_AXIS,
                catalog::JOINT_ORDER,
                catalog::JOINT_OFFSET,
                catalog::JOINT_COUPLING,
                catalog::JOINT_GAIN,
                catalog::JOINT_COLUMN_MISSING,
                catalog::WRONG_MOUNT,
                catalog::CHANGED_WHILE_RECORDING,
                catalog::TRACKER_MOVED,
                catalog::TRACKER_SCALE,
                catalog::BODY_REMOUNTED,
                catalog::MODEL_DISAGREES,
                catalog::NOT_CHECKED,
                catalog::INVISIBLE_MISTAKES,
            ],
            Self::Clocks => &[catalog::CLOCK_LAG],
        }
    }

    /// How it ended: `unless` is why it could not be made, where it could not.
    #[must_use]
    pub fn ended(self, findings: &[Finding], unless: Option<CheckOutcome>) -> Checked {
        // Frames of one posture are no fault, but rows that repeat each other.
        let counts = |f: &Finding| f.severity > Severity::Info || f.id == catalog::FRAMES_MERGED;
        let own = |f: &Finding| counts(f) && self.ids().contains(&f.id);
        let outcome = if findings.iter().any(own) {
            CheckOutcome::Found
        } else {
            unless.unwrap_or(CheckOutcome::Passed)
        };
        Checked {
            check: self,
            outcome,
        }
    }
}
