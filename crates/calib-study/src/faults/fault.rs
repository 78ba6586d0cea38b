//! The faults of the study: one entry each.

use serde::{Deserialize, Serialize};

use super::design::{Body, Design, Validation};

/// What is wrong with a robot, its recordings or its profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// Nothing.
    None,
    /// The sign of a joint.
    Sign,
    /// Two joints' columns are exchanged.
    Exchange,
    /// A joint's column is in degrees under a name that says rad, or the other way round.
    JointUnit,
    /// A joint moves by the whole angle of another one as well (parallelogram, motor in the base).
    Coupling,
    /// A zero offset of 90° or 180°.
    QuarterTurn,
    /// The joints of a row belong to the row before or after it.
    RowShift,
    /// The column of a moving joint is missing.
    MissingColumn,
    /// The profile names the link before as the one that carries the body.
    WrongLink,
    /// All recordings are in mm under a name that says m, or the other way round.
    TrackerUnit,
    /// One recording is.
    TrackerUnitInOne,
    /// The tracker's frame is left-handed.
    Mirrored,
    /// Quaternions are written w first, read w last.
    QuaternionOrder,
    /// Poses are `body_from_tracker`.
    InversePoses,
    /// The sign of a joint is wrong in one recording.
    SignInOne,
    /// Two joints' columns are exchanged in one recording.
    ExchangeInOne,
    /// The tracker was moved before the last recording.
    TrackerMoved,
    /// The body was mounted again before the last recording.
    Remounted,
    /// Two discrete faults at once.
    Pair,
    /// A joint moves 1 % more than it reads.
    Gain,
    /// A joint moves by 2 % of another one as well.
    Crosstalk,
    /// An encoder or gear is 0.5° eccentric.
    Eccentricity,
    /// Gravity bends the joints by 0.02° per N m.
    Compliance,
    /// The body slips by 2 mm in the middle of the first recording.
    Slip,
    /// The tracker is bumped by 2 mm in the middle of the first recording.
    Bump,
    /// The tracker drifts by 2 mm over the recordings.
    Drift,
    /// A joint's zero steps by 0.3° in the middle of the first recording.
    OffsetStep,
    /// Every pose is written ten times, with new tracker noise.
    RepeatedFrames,
    /// Every row is written three times.
    CopiedRows,
    /// The tracker's noise has a memory: AR(1) with ρ = 0.9.
    Memory,
    /// Half a percent to five percent of the samples are off by 10–100 mm, held-out ones included.
    Outliers,
    /// The held-out rows repeat fitted ones.
    HeldOutCopies,
    /// The body slips in the middle of the first recording by 0.6 mm, twice the tracker's noise, and in recordings of 100 rows by
    /// 0.3 mm.
    SmallSlip,
}

/// How a fault is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// Good data: everything but an accepted, true result is a false alarm.
    Clean,
    /// A mistake of a person or a file: one of finitely many.
    Discrete,
    /// Two of them.
    Pair,
    /// An effect with a size.
    Continuous,
    /// Something changed while it was being recorded.
    Change,
    /// Rows that are not independent.
    Dependence,
}

impl Fault {
    /// All of them.
    pub const ALL: [Self; 33] = [
        Self::None,
        Self::Outliers,
        Self::Sign,
        Self::Exchange,
        Self::JointUnit,
        Self::Coupling,
        Self::QuarterTurn,
        Self::RowShift,
        Self::MissingColumn,
        Self::WrongLink,
        Self::TrackerUnit,
        Self::TrackerUnitInOne,
        Self::Mirrored,
        Self::QuaternionOrder,
        Self::InversePoses,
        Self::SignInOne,
        Self::ExchangeInOne,
        Self::TrackerMoved,
        Self::Remounted,
        Self::Pair,
        Self::Gain,
        Self::Crosstalk,
        Self::Eccentricity,
        Self::Compliance,
        Self::Slip,
        Self::Bump,
        Self::Drift,
        Self::OffsetStep,
        Self::RepeatedFrames,
        Self::CopiedRows,
        Self::Memory,
        Self::HeldOutCopies,
        Self::SmallSlip,
    ];

    /// How it is counted.
    #[must_use]
    pub fn class(self) -> Class {
        match self {
            Self::None | Self::Outliers => Class::Clean,
            Self::Pair => Class::Pair,
            Self::Gain | Self::Crosstalk | Self::Eccentricity | Self::Compliance => {
                Class::Continuous
            }
            Self::Slip | Self::SmallSlip | Self::Bump | Self::Drift | Self::OffsetStep => {
                Class::Change
            }
            Self::RepeatedFrames | Self::CopiedRows | Self::Memory | Self::HeldOutCopies => {
                Class::Dependence
            }
            _ => Class::Discrete,
        }
    }

    /// Whether a recording of this kind can have it.
    #[must_use]
    pub fn applies(self, design: Design, body: Body, validation: Validation) -> bool {
        let two_recordings = design == Design::Both || validation != Validation::Absent;
        match self {
            Self::QuaternionOrder | Self::InversePoses => body == Body::Pose,
            Self::TrackerUnitInOne | Self::SignInOne | Self::ExchangeInOne => two_recordings,
            Self::TrackerMoved | Self::Remounted => two_recordings,
            Self::HeldOutCopies => validation != Validation::Absent,
            // Every second row of a slow motion is the one before it, almost.
            Self::RepeatedFrames => design != Design::Stream,
            _ => true,
        }
    }
}
