//! What `calib record` cannot do with its arguments.

use calib_capture::BadAddress;
use calib_urdf::UnknownName;

/// An argument of `calib record` that does not fit the profile, the robot or the tracker.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// `--source` is not an address.
    #[error("{0}\n  help: Correct `--source`.")]
    Source(#[from] BadAddress),
    /// `--joints` is not a source of joint values; the text says why.
    #[error("--joints: {0}\n  help: Correct `--joints`.")]
    Joints(String),
    /// The recording has no joint ranges, and the robot sends no joint values.
    #[error(
        "recording `{recording}` has no joint ranges, so there are no poses to guide to and no joint values\n  help: let the robot send its joints (--joints udp:PORT), or give the recording `joints` in the profile"
    )]
    NoJoints {
        /// The recording.
        recording: String,
    },
    /// `--recording` names none of the profile.
    #[error("the profile has no recording `{wanted}`\n  help: it has {}", known.join(", "))]
    UnknownRecording {
        /// What was asked for.
        wanted: String,
        /// The recordings of the profile.
        known: Vec<String>,
    },
    /// The profile has no recordings.
    #[error("the profile has no recordings\n  help: add one")]
    NoRecordings,
    /// The profile has several recordings.
    #[error("the profile has {} recordings\n  help: choose one with --recording: {}", known.len(), known.join(", "))]
    WhichRecording {
        /// The recordings of the profile.
        known: Vec<String>,
    },
    /// The recording is no place for the postures of a plan.
    #[error(
        "recording `{recording}` is a sweep or a motion, and a plan has single postures\n  help: choose a recording with `use: static` for its postures, one with `use: validation` for its held-out ones"
    )]
    PlanInSweep {
        /// The recording.
        recording: String,
    },
    /// The profile says that a joint stands still which the plan moves.
    #[error(
        "the plan moves joint `{joint}`, recording `{recording}` holds it\n  help: take `{joint}` out of `hold` of the recording, or plan with `plan: {{hold: …}}`"
    )]
    PlanMovesHeld {
        /// The recording.
        recording: String,
        /// The joint.
        joint: String,
    },
    /// The robot does not send joints that the plan moves.
    #[error(
        "{plan} moves {}, the robot sends {}\n  help: let it send all joints of the plan, or leave out `--joints` and move to the stated positions", missing.join(", "), sent.join(", ")
    )]
    PlanJointsNotSent {
        /// The plan.
        plan: String,
        /// Joints that are not sent.
        missing: Vec<String>,
        /// Joints that are.
        sent: Vec<String>,
    },
    /// The robot was to send its joints and sends none of them.
    #[error(
        "the robot was to send its joint values, and what arrives is: {heard}\n  help: let it send the joints of the profile as `NAME_deg=VALUE` or `NAME_mm=VALUE`: {}", known.join(", ")
    )]
    JointsNotSent {
        /// What arrives instead.
        heard: String,
        /// Joints that move a recorded body.
        known: Vec<String>,
    },
    /// No body that the plan moves is recorded.
    #[error(
        "{plan}: none of the recorded bodies is moved by its joints\n  help: map one that they move: `--map`"
    )]
    PlanMovesNothing {
        /// The plan.
        plan: String,
    },
    /// `--poses` gives no poses, or too many.
    #[error(
        "--poses {poses} makes {count} poses\n  help: give from 1 to some dozens for each joint"
    )]
    Poses {
        /// Values of each joint.
        poses: usize,
        /// Poses of the grid.
        count: usize,
    },
    /// A duration is not a positive number.
    #[error("{option} {value}\n  help: give seconds above 0")]
    Duration {
        /// The option.
        option: &'static str,
        /// Its value, s.
        value: f64,
    },
    /// `--at` names a swept joint.
    #[error("--at holds `{joint}`, which this recording sweeps\n  help: leave it out")]
    HoldsSwept {
        /// The joint.
        joint: String,
    },
    /// `--at` cannot be read; the text says why.
    #[error("--at: {0}\n  help: write a joint with its unit: --at waist_deg=20")]
    At(String),
    /// `--at` names a joint that the robot does not have.
    #[error("--at: {0}\n  help: write a joint with its unit: --at waist_deg=20")]
    UnknownJoint(#[from] UnknownName),
    /// `--at` gives an angle for a prismatic joint, or a length for a revolute one.
    #[error(
        "--at `{given}`: `{joint}` is {kind}\n  help: write a joint with its unit: --at waist_deg=20"
    )]
    JointUnit {
        /// The argument.
        given: String,
        /// The joint.
        joint: String,
        /// Its type in the URDF.
        kind: &'static str,
    },
    /// `--map` is not a pair of names.
    #[error("--map `{0}`\n  help: write the profile's name and the tracker's: --map gripM=body_0")]
    Map(String),
    /// A name stands in two pairs of `--map`, on the same side.
    #[error("--map: `{0}` is mapped twice\n  help: map each name to one other name")]
    MapTwice(String),
    /// The tracker's names do not fit the profile's; the text says how.
    #[error("{0}")]
    Names(String),
}
