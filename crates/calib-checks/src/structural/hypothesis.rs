//! The hypotheses: what may be wrong with the data or with the claims about them, and how each is corrected.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use serde::Serialize;

use super::ids::{BodyIndex, JointIndex, LinkIndex, RecordingIndex};
use super::order::ColumnOrder;
use super::rotation::{axes_rotation, cube};
use super::units::{Length, UnitMistake};

/// An error of a joint's zero by a multiple of 90°.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub enum QuarterTurns {
    /// The reading is 90° too small: add 90°.
    Plus90,
    /// The reading is 90° too large: subtract 90°.
    Minus90,
    /// The reading is off by 180°.
    Half,
}

impl QuarterTurns {
    /// What must be added to the reading, rad.
    #[must_use]
    pub fn angle(self) -> f64 {
        match self {
            Self::Plus90 => FRAC_PI_2,
            Self::Minus90 => -FRAC_PI_2,
            Self::Half => PI,
        }
    }
}

/// A coordinate axis, forwards or backwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub enum Direction {
    /// 1 0 0
    X,
    /// −1 0 0
    MinusX,
    /// 0 1 0
    Y,
    /// 0 −1 0
    MinusY,
    /// 0 0 1
    Z,
    /// 0 0 −1
    MinusZ,
}

impl Direction {
    /// Each.
    pub const ALL: [Self; 6] = [
        Self::X,
        Self::MinusX,
        Self::Y,
        Self::MinusY,
        Self::Z,
        Self::MinusZ,
    ];

    /// As a unit vector.
    #[must_use]
    pub fn vector(self) -> Unit<Vector3<f64>> {
        match self {
            Self::X => Vector3::x_axis(),
            Self::MinusX => -Vector3::x_axis(),
            Self::Y => Vector3::y_axis(),
            Self::MinusY => -Vector3::y_axis(),
            Self::Z => Vector3::z_axis(),
            Self::MinusZ => -Vector3::z_axis(),
        }
    }
}

/// A convention of a pose that was misread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub enum PoseMistake {
    /// `w x y z` in the file, read as `x y z w`.
    ScalarFirstReadAsLast,
    /// `x y z w` in the file, read as `w x y z`.
    ScalarLastReadAsFirst,
    /// The file holds `body_from_tracker`.
    Inverse,
    /// The rotation alone is transposed, the position is right.
    Transposed,
}

/// One thing that may be wrong. Applying a hypothesis *corrects* the data under the assumption that it is true.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub enum Hypothesis {
    /// The joint's readings count in the other direction.
    Sign {
        /// Joint.
        joint: JointIndex,
    },
    /// The columns of two joints are exchanged.
    Exchange {
        /// The smaller index.
        first: JointIndex,
        /// The larger index.
        second: JointIndex,
    },
    /// Several columns are in another order than their names.
    Order {
        /// Which.
        order: ColumnOrder,
    },
    /// The column's unit was misread.
    Unit {
        /// Joint.
        joint: JointIndex,
        /// Which unit for which.
        mistake: UnitMistake,
    },
    /// The unit of all joint columns of its kind was misread: of all angles, or of all lengths.
    Units {
        /// Which unit for which.
        mistake: UnitMistake,
    },
    /// The joint also moves with another joint's reading: `reading_joint += factor · reading_source`.
    Coupling {
        /// Joint that moves too.
        joint: JointIndex,
        /// Joint that moves it.
        source: JointIndex,
        /// rad or m per rad or m.
        factor: f64,
    },
    /// The joint moves more or less than its readings: `reading *= factor`.
    Gain {
        /// Joint.
        joint: JointIndex,
        /// 1 for none.
        factor: f64,
    },
    /// The joint moves along (about) another coordinate axis of its frame than the model has it.
    Axis {
        /// Joint.
        joint: JointIndex,
        /// Its true axis.
        along: Direction,
    },
    /// The zero of the joint is off by a multiple of 90°.
    Offset {
        /// Joint.
        joint: JointIndex,
        /// What is to be added.
        turns: QuarterTurns,
    },
    /// The zero of a joint that moves is off by any angle or length: `reading += offset`.
    Zero {
        /// Joint.
        joint: JointIndex,
        /// What is to be added, rad or m.
        offset: f64,
    },
    /// Readings and tracker data are paired one row off: row i needs the readings of row i − `rows`.
    RowShift {
        /// ±1 or ±2.
        rows: i8,
    },
    /// The readings of a recording were taken `seconds` before the tracker's data of their row.
    Lag {
        /// Recording.
        recording: RecordingIndex,
        /// s; negative where the readings are ahead.
        seconds: f64,
    },
    /// The readings of a joint were taken `seconds` before those of the others and the tracker's data of their row.
    Latency {
        /// Joint.
        joint: JointIndex,
        /// s; negative where the readings are ahead.
        seconds: f64,
    },
    /// The readings of a joint and of all that it carries were taken `seconds` before those of the others and the tracker's data of their row.
    LatencyBeyond {
        /// The first of them.
        joint: JointIndex,
        /// s; negative where the readings are ahead.
        seconds: f64,
    },
    /// The joint moved although its column is empty.
    MissingColumn {
        /// Joint.
        joint: JointIndex,
    },
    /// The joint stood elsewhere than at 0 although its column is empty.
    StoodAt {
        /// Joint.
        joint: JointIndex,
        /// Where it stood, rad or m.
        value: f64,
    },
    /// The body is mounted on another link.
    WrongLink {
        /// Body.
        body: BodyIndex,
        /// Where it is mounted; any link rigidly connected with it does as well.
        link: LinkIndex,
    },
    /// Two bodies are exchanged.
    ExchangedBodies {
        /// The smaller index.
        first: BodyIndex,
        /// The larger index.
        second: BodyIndex,
    },
    /// Tracker coordinates have another unit of length.
    TrackerUnit {
        /// What the values are.
        unit: Length,
        /// What they were read as.
        read_as: Length,
    },
    /// The tracker frame is left-handed.
    Mirrored,
    /// The tracker axes of a recording are permuted against the other recordings.
    TrackerAxes {
        /// Number of the cube rotation, 1 to 23, see [`axes_rotation`].
        rotation: u8,
    },
    /// The tracker was moved between this recording and the others.
    TrackerMoved,
    /// The body was remounted between this recording and the others.
    Remounted {
        /// Body.
        body: BodyIndex,
    },
    /// Poses were misread.
    Poses {
        /// One body; `None` for all bodies with poses.
        body: Option<BodyIndex>,
        /// What was misread.
        mistake: PoseMistake,
    },
}

/// Where a hypothesis applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub enum Scope {
    /// In all rows.
    All,
    /// In one recording.
    Recording(RecordingIndex),
    /// In all recordings but one.
    AllExcept(RecordingIndex),
}

impl Scope {
    /// Does the scope contain this recording?
    #[must_use]
    pub fn contains(self, recording: RecordingIndex) -> bool {
        match self {
            Self::All => true,
            Self::Recording(r) => r == recording,
            Self::AllExcept(r) => r != recording,
        }
    }
}

/// A hypothesis and where it applies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Scoped {
    /// What is wrong.
    pub hypothesis: Hypothesis,
    /// Where.
    pub scope: Scope,
}

/// `reading_joint ← factor · reading_joint + coupling · reading_source + offset`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Affine {
    pub joint: usize,
    pub factor: f64,
    pub source: usize,
    pub coupling: f64,
    pub offset: f64,
}

impl Hypothesis {
    /// The correction of one joint's readings row by row, if it is one.
    pub(crate) fn affine(&self) -> Option<Affine> {
        let (joint, factor, source, coupling, offset) = match *self {
            Self::Sign { joint } => (joint, -1.0, joint, 0.0, 0.0),
            Self::Unit { joint, mistake } => (joint, mistake.factor(), joint, 0.0, 0.0),
            Self::Gain { joint, factor } => (joint, factor, joint, 0.0, 0.0),
            Self::Coupling {
                joint,
                source,
                factor,
            } => (joint, 1.0, source, factor, 0.0),
            Self::Offset { joint, turns } => (joint, 1.0, joint, 0.0, turns.angle()),
            Self::Zero { joint, offset } => (joint, 1.0, joint, 0.0, offset),
            _ => return None,
        };
        Some(Affine {
            joint: joint.0,
            factor,
            source: source.0,
            coupling,
            offset,
        })
    }

    /// A frame or a mount of a recording's own.
    pub(crate) fn is_frame(&self) -> bool {
        matches!(self, Self::TrackerMoved | Self::Remounted { .. })
    }

    /// A mistake of one joint by any amount.
    #[must_use]
    pub fn is_sized(&self) -> bool {
        let part = |factor: f64| factor.abs() != 1.0;
        matches!(self, Self::Zero { .. } | Self::Gain { .. })
            || matches!(self, Self::Coupling { factor, .. } if part(*factor))
    }

    /// ln of the factor by which measured coordinates are multiplied.
    #[must_use]
    pub fn log_scale(&self) -> f64 {
        match self {
            Self::TrackerUnit { unit, read_as } => (unit.meters() / read_as.meters()).ln(),
            _ => 0.0,
        }
    }

    /// The corrected position of a tracked point, for hypotheses that change points one by one.
    pub(crate) fn point(&self, p: &Vector3<f64>) -> Option<Vector3<f64>> {
        match *self {
            Self::TrackerUnit { unit, read_as } => Some(p * (unit.meters() / read_as.meters())),
            Self::Mirrored => Some(Vector3::new(p.x, -p.y, p.z)),
            Self::TrackerAxes { rotation } => Some(axes_rotation(rotation) * p),
            _ => None,
        }
    }

    /// The corrected pose of body `b`; `None` where the hypothesis does not change poses.
    pub(crate) fn pose(&self, b: BodyIndex, pose: &Isometry3<f64>) -> Option<Isometry3<f64>> {
        match *self {
            Self::TrackerUnit { .. } | Self::TrackerAxes { .. } | Self::Mirrored => {
                let position = self.point(&pose.translation.vector)?;
                let q = pose.rotation.quaternion();
                let rotation = match *self {
                    // S R S with S = diag(1, −1, 1): the rotation vector is an axial vector
                    Self::Mirrored => {
                        UnitQuaternion::new_normalize(Quaternion::new(q.w, -q.i, q.j, -q.k))
                    }
                    Self::TrackerAxes { rotation } => {
                        let axes =
                            nalgebra::Rotation3::from_matrix_unchecked(axes_rotation(rotation));
                        UnitQuaternion::from_rotation_matrix(&axes) * pose.rotation
                    }
                    _ => pose.rotation,
                };
                Some(Isometry3::from_parts(
                    Translation3::from(position),
                    rotation,
                ))
            }
            Self::Poses { body, mistake } if body.is_none_or(|only| only == b) => {
                Some(mistake.corrected(pose))
            }
            _ => None,
        }
    }

    /// The hypothesis that undoes the correction of the measured points or poses.
    pub(crate) fn undone(&self) -> Hypothesis {
        match *self {
            Self::TrackerUnit { unit, read_as } => Self::TrackerUnit {
                unit: read_as,
                read_as: unit,
            },
            Self::Poses { body, mistake } => Self::Poses {
                body,
                mistake: mistake.undone(),
            },
            Self::TrackerAxes { rotation } => {
                let back = axes_rotation(rotation).transpose();
                let number = cube().position(|r| (r - back).amax() < 0.5).unwrap_or(0);
                Self::TrackerAxes {
                    rotation: number as u8,
                }
            }
            other => other,
        }
    }
}

impl PoseMistake {
    fn corrected(self, pose: &Isometry3<f64>) -> Isometry3<f64> {
        let q = pose.rotation.quaternion();
        let with = |w, i, j, k| {
            let rotation = UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k));
            Isometry3::from_parts(pose.translation, rotation)
        };
        match self {
            // read x y z w, meant w x y z
            Self::ScalarFirstReadAsLast => with(q.i, q.j, q.k, q.w),
            Self::ScalarLastReadAsFirst => with(q.k, q.w, q.i, q.j),
            Self::Inverse => pose.inverse(),
            Self::Transposed => Isometry3::from_parts(pose.translation, pose.rotation.inverse()),
        }
    }

    fn undone(self) -> Self {
        match self {
            Self::ScalarFirstReadAsLast => Self::ScalarLastReadAsFirst,
            Self::ScalarLastReadAsFirst => Self::ScalarFirstReadAsLast,
            other => other,
        }
    }
}
