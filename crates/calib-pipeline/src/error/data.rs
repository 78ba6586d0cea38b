//! What the recordings lack that the profile asks of them.

use calib_checks::rigid_body::NotABody;
use calib_finding::{Finding, Severity};
use calib_plugin::PluginError;
use calib_recording::NotOneTable;
use calib_urdf::{JointKind, UnknownName};

use super::seen::{SeenInstead, did_you_mean};

/// What the recordings lack that the profile asks of them.
#[derive(Debug, thiserror::Error)]
pub enum DataProblem {
    /// The data checks found errors.
    #[error("the data checks found {}\n{}", errors(.0).count().to_string() + if errors(.0).count() == 1 { " error" } else { " errors" }, listed(.0))]
    Checks(Vec<Finding>),
    /// A table without a row.
    #[error("has no poses")]
    NoPoses,
    /// Streams of several clocks in a recording without `timing`.
    #[error("{0}")]
    NotOneTable(NotOneTable),
    /// A column that is not a joint of the robot.
    #[error("column `{column}` is not a joint: {unknown}")]
    ColumnNotAJoint {
        /// The column.
        column: String,
        /// The nearest joint.
        unknown: UnknownName,
    },
    /// A stream that is not a joint of the robot.
    #[error("stream `{stream}` is not a joint: {unknown}")]
    StreamNotAJoint {
        /// The stream.
        stream: String,
        /// The nearest joint.
        unknown: UnknownName,
    },
    /// An angle for a joint that slides, or a length for one that turns.
    #[error(
        "joint `{joint}` is {}, its column is not {}",
        kind.name(),
        if kind.turns() { "an angle" } else { "a length" }
    )]
    JointUnit {
        /// The joint.
        joint: String,
        /// What the robot has.
        kind: JointKind,
    },
    /// A joint that is recorded and held.
    #[error("joint `{joint}` is in the file and held by the profile")]
    HeldAndRecorded {
        /// The joint.
        joint: String,
    },
    /// A joint in `late_ms` that is not recorded.
    #[error("`late_ms` names joint `{joint}`, which the recording does not have")]
    LateJointNotRecorded {
        /// The joint.
        joint: String,
    },
    /// A column without a value.
    #[error("joint `{joint}` has a column, and no value in any row")]
    NoJointValues {
        /// The joint.
        joint: String,
    },
    /// A robot's log without joints.
    #[error("the robot's log has no joints")]
    NoJointsInLog,
    /// The robot's log has not one row for every row of the tracker.
    #[error("{0}")]
    RowsDiffer(RowsDiffer),
    /// A timed recording without a tracker.
    #[error("no stream of a marker or body")]
    NothingTracked,
    /// A stream that names a time line that is not there.
    #[error("a stream has no time line")]
    NoTimeline,
    /// `timing` for a tracker without time.
    #[error("`timing` is given, the tracker's rows have no time")]
    NoTrackerTime,
    /// `timing` for joints without time.
    #[error("the joints' rows have no time")]
    NoJointTime,
    /// A contact's coordinates are not in its recording.
    #[error(
        "contact `{contact}` takes coordinates from `{columns}`, which the table does not have"
    )]
    NoCoordinates {
        /// The contact.
        contact: String,
        /// Stem of the columns.
        columns: String,
        /// What the table has that is called almost like it.
        meant: Option<String>,
    },
    /// The names of a contact's spots are not in its recording.
    #[error(
        "contact `{contact}` takes the spots' names from column `{column}`, which the table does not have"
    )]
    NoSpotNames {
        /// The contact.
        contact: String,
        /// The column.
        column: String,
        /// What the table has that is called almost like it.
        meant: Option<String>,
    },
    /// A row touches a spot that the profile does not know.
    #[error("row {row}: contact `{contact}` has no spot `{spot}`")]
    UnknownSpot {
        /// The contact.
        contact: String,
        /// What the row says.
        spot: String,
        /// The row, as findings number them.
        row: u64,
        /// The spot that is called almost like it.
        meant: Option<String>,
    },
    /// The tracker's streams make no table.
    #[error("{0}")]
    NotATrack(NotATrack),
    /// The clocks cannot be brought together.
    #[error("recording `{recording}`: {}", why.text())]
    Clocks {
        /// The recording.
        recording: String,
        /// What was found.
        why: Box<Finding>,
    },
    /// A stream with no body of the profile.
    #[error("recording `{recording}`: {}", why.text())]
    NoBody {
        /// The recording.
        recording: String,
        /// What was found.
        why: Box<Finding>,
    },
    /// No hold.
    #[error("recording `{recording}`: nothing stands still for {hold} s")]
    NothingStandsStill {
        /// The recording.
        recording: String,
        /// Time that a hold must last, s.
        hold: f64,
    },
    /// A body that no fitted recording shows.
    #[error("no recording that is fitted shows body `{body}`{}", seen.words())]
    BodyNotSeen {
        /// The body.
        body: String,
        /// What the recordings have instead.
        seen: Box<SeenInstead>,
    },
    /// A reader of a plugin does not understand the file.
    #[error("{0}")]
    Unread(Box<PluginError>),
    /// Markers that make no body.
    #[error("body `{body}`: {why}")]
    NotABody {
        /// The body.
        body: String,
        /// Why.
        why: NotABody,
    },
}

/// Why rows of the robot's log are not those of the tracker's file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RowsDiffer {
    /// One of the files has no streams.
    #[error("no markers, no bodies or no joints to pair by their rows")]
    Nothing,
    /// Another number of rows.
    #[error(
        "the tracker's file has {tracker} rows, the robot's log {robot}: rows cannot be paired"
    )]
    Count {
        /// Rows of the tracker.
        tracker: usize,
        /// Rows of the robot.
        robot: usize,
    },
    /// A column of both files names the rows otherwise.
    #[error(
        "row {row}: `{label}` is `{tracker}` in the tracker's file and `{robot}` in the robot's log"
    )]
    Label {
        /// The column.
        label: String,
        /// The row of the tracker's file, as findings number them.
        row: u64,
        /// What it says.
        tracker: String,
        /// What the log says.
        robot: String,
    },
}

/// Why the tracker's streams make no table.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotATrack {
    /// A stream without time.
    #[error("`{stream}` has no time")]
    NoTime {
        /// The stream.
        stream: String,
    },
    /// Two streams of one name.
    #[error("`{stream}` is the name of two streams")]
    NameTwice {
        /// The stream.
        stream: String,
    },
}

impl DataProblem {
    /// What to do.
    #[must_use]
    pub fn remedy(&self) -> String {
        let text = match self {
            Self::Checks(_) => "correct the data, or continue at your own risk with --force",
            Self::NoPoses => "record at least one row",
            Self::NotOneTable(_) => {
                "add `timing: {}` to the recording in the profile: holds become poses, and the clocks are brought together"
            }
            Self::ColumnNotAJoint { .. } => "rename the column, or map it under `columns`",
            Self::StreamNotAJoint { .. } => "rename it, or map it under `columns`",
            Self::JointUnit { .. } => "correct the unit in the column name",
            Self::HeldAndRecorded { .. } => "remove it from `hold`",
            Self::LateJointNotRecorded { .. } => "remove it from `timing: {late_ms}`",
            Self::NoJointValues { .. } => {
                "export its values; where it stood still, remove the column and say where: `hold` in the recording"
            }
            Self::NoJointsInLog => {
                "name the columns as the robot's joints with their unit (`elbow_rad`), or map them under `columns`"
            }
            Self::RowsDiffer(_) => {
                "both files need one row for every posture, in the same order; for two clocks use `timing: {}` instead of `rows: same`"
            }
            Self::NothingTracked => "name the tracker's file under `file`",
            Self::NoTimeline => "correct the reader",
            Self::NoTrackerTime => "add a column `t_s`, or remove `timing`: static poses need none",
            Self::NoJointTime => "add a column `t_s` to the robot's log",
            Self::NotATrack(_) => "give every stream a name of its own",
            Self::Clocks { why, .. } | Self::NoBody { why, .. } => return why.remedy(),
            Self::NothingStandsStill { .. } => {
                "hold each posture for a second, or take rows of the motion: `timing: {poses: continuous}`"
            }
            Self::BodyNotSeen { body, seen } => return seen.remedy(body),
            Self::NoCoordinates { columns, meant, .. } => {
                let near = did_you_mean(meant.as_ref());
                return format!(
                    "{near}name the columns `{columns}.x_mm`, `{columns}.y_mm`, `{columns}.z_mm`"
                );
            }
            Self::NoSpotNames { meant, .. } => {
                let near = did_you_mean(meant.as_ref());
                return format!("{near}add the column: the name of the touched spot in every row");
            }
            Self::UnknownSpot { spot, meant, .. } => {
                let near = did_you_mean(meant.as_ref());
                return format!("{near}correct the name, or state where `{spot}` is under `at_mm`");
            }
            Self::Unread(_) => "correct the file, or name another `reader` for the recording",
            Self::NotABody { .. } => {
                "mount at least three markers that span a plane, and check their names"
            }
        };
        text.to_owned()
    }
}

fn errors(findings: &[Finding]) -> impl Iterator<Item = &Finding> {
    findings.iter().filter(|f| f.severity == Severity::Error)
}

/// Errors with their rows and remedies, one below the other.
fn listed(findings: &[Finding]) -> String {
    /// Rows that a line names; `calib check` lists more.
    const ROWS: usize = 5;
    let one = |f: &Finding| {
        let rows: Vec<String> = f.rows.iter().take(ROWS).map(u64::to_string).collect();
        let at = if rows.is_empty() {
            String::new()
        } else {
            format!(" (rows {})", rows.join(", "))
        };
        format!(
            "{} [{}]{at}: {}\n  help: {}",
            f.subject,
            f.id,
            f.text(),
            f.remedy()
        )
    };
    errors(findings).map(one).collect::<Vec<_>>().join("\n")
}
