//! Structural mistakes of two tables of poses by name, and an explanation that they give.

use serde::Serialize;

use crate::residuals::Residuals;

/// One of the two tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Side {
    /// The robot's poses.
    Robot,
    /// The measured poses.
    Measured,
    /// Both.
    Both,
}

/// A correction of the tables.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Correction {
    /// Quaternions were stored as w, x, y, z and read as x, y, z, w.
    ScalarFirst(Side),
    /// Quaternions were stored as x, y, z, w and read as w, x, y, z.
    ScalarLast(Side),
    /// Rotations are inverted, positions are not.
    InvertedRotations(Side),
    /// Poses are inverted.
    InvertedPoses(Side),
    /// Positions are in millimeters and were read as meters.
    Millimeters(Side),
    /// Positions are a thousand times too small.
    Thousandth(Side),
    /// The measured pose of a row belongs to the robot's pose so many rows before.
    Rows(i8),
    /// The measured lengths must be multiplied by this to be those of the robot.
    Scaled(f64),
    /// From this pose on, counted from 0, the body was elsewhere on the flange.
    BodyMoved(usize),
    /// From this pose on, counted from 0, the tracker (or board) or the robot's base was elsewhere.
    TrackerMoved(usize),
}

/// The corrections that explain the residuals.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Explanation {
    /// Equally good explanations; each is one correction, or two at once.
    pub candidates: Vec<Vec<Correction>>,
    /// As given.
    pub before: Residuals,
    /// After the first candidate was applied.
    pub after: Residuals,
}

impl std::fmt::Display for Side {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Robot => "robot",
            Self::Measured => "measured",
            Self::Both => "robot and measured",
        })
    }
}

impl std::fmt::Display for Correction {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::ScalarFirst(side) => {
                write!(f, "the {side} quaternions are stored as w, x, y, z")
            }
            Self::ScalarLast(side) => write!(f, "the {side} quaternions are stored as x, y, z, w"),
            Self::InvertedRotations(side) => {
                write!(
                    f,
                    "the {side} rotations are inverted, the positions are not"
                )
            }
            Self::InvertedPoses(side) => write!(f, "the {side} poses are inverted"),
            Self::Millimeters(side) => write!(f, "the {side} positions are in millimeters"),
            Self::Thousandth(side) => {
                write!(f, "the {side} positions are a thousand times too small")
            }
            Self::Rows(by) => {
                let word = if *by > 0 { "late" } else { "early" };
                write!(f, "the measured poses are {} row {word}", by.abs())
            }
            Self::Scaled(factor) => write!(
                f,
                "the measured lengths are {:.4} times those of the robot",
                1.0 / factor
            ),
            Self::BodyMoved(pose) => write!(
                f,
                "what is measured on the flange was moved before pose {} of the table",
                pose + 1
            ),
            Self::TrackerMoved(pose) => write!(
                f,
                "the tracker, the board or the robot's base was moved before pose {} of the table",
                pose + 1
            ),
        }
    }
}

impl std::fmt::Display for Explanation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (k, corrections) in self.candidates.iter().enumerate() {
            let words: Vec<String> = corrections.iter().map(ToString::to_string).collect();
            let before = if k == 0 { "" } else { ", or " };
            write!(f, "{before}{}", words.join(" and "))?;
        }
        let shown = |r: &Residuals| {
            let (mm, deg) = (r.rms_translation * 1e3, r.rms_rotation.to_degrees());
            format!("{mm:.3} mm and {deg:.3}°")
        };
        write!(
            f,
            " (residuals {}, corrected {})",
            shown(&self.before),
            shown(&self.after)
        )
    }
}
