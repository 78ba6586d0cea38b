//! How the clocks of a recording go together, and the table of poses that follows.

use std::collections::BTreeMap;
use std::sync::Arc;

use calib_checks::sync::ClockMap;
use calib_finding::Finding;
use calib_recording::Poses;
use calib_report::{Unit, number};
use nalgebra::Matrix3;

use crate::prepare::excluded::Excluded;
use crate::prepare::row_noise::RowNoise;
use crate::prepare::streams::Scalars;

/// An offset below this, s, is none: at 0.5 rad/s and 1 m it is a tenth of a millimeter.
pub(crate) const SAME_TIME: f64 = 2e-4;

/// What is known of two clocks.
#[derive(Debug, Clone, PartialEq)]
pub enum ClockState {
    /// They are one: the streams name the same clock.
    One,
    /// They are one, and by how much the joint values are late is found from the motion.
    OneWithLag {
        /// The offset, s, from which the fit starts: tracker minus robot, 0 where it is small.
        start: f64,
    },
    /// The profile declares them to be one.
    Declared,
    /// Found from the motion of a body.
    Found {
        /// The body.
        body: String,
        /// Equation (1) of [`mod@crate::prepare::align`], tracker from robot.
        map: ClockMap,
    },
}

impl ClockState {
    /// The robot's time of a tracker's time, s.
    #[must_use]
    pub fn at_robot(&self, t: f64) -> f64 {
        match self {
            Self::Found { map, .. } => map.to_b(t),
            Self::OneWithLag { start } => t - start,
            Self::One | Self::Declared => t,
        }
    }
}

/// What of the clocks of rows of a motion is estimated with everything else.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClockUnknowns {
    /// Nothing: the rows are held, or the profile declares one clock.
    None,
    /// The offset.
    Offset,
    /// Offset and drift.
    OffsetAndDrift,
}

/// What a robot that is calibrated says of the clocks, beyond [`ClockState`].
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// Added to the robot's time of each row, s.
    pub by_row: Vec<f64>,
    /// The same in the middle of the recording, and from there to its end, from all rows, s.
    pub shift: [f64; 2],
    /// Their standard deviations, where they come from the recording's own rows and a robot that was held fixed, s.
    pub sigma: Option<[f64; 2]>,
}

/// How the clocks of one recording go together.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// The tracker's clock, in the reader's words.
    pub tracker_clock: String,
    /// The robot's clock.
    pub robot_clock: String,
    /// What is known of them.
    pub clocks: ClockState,
    /// Holds that became poses; `None` for rows of a motion.
    pub holds: Option<usize>,
    /// Rows of the tracker's stream.
    pub samples: usize,
    /// The joints over the robot's own time, where rows of a motion may have to be taken again at better times.
    pub joints: Arc<BTreeMap<String, Scalars>>,
    /// What the calibrated robot says of the clocks; `None` before.
    pub refined: Option<Refined>,
}

impl Alignment {
    /// What of the clocks is estimated with everything else.
    #[must_use]
    pub fn unknowns(&self) -> ClockUnknowns {
        match self.clocks {
            _ if self.holds.is_some() => ClockUnknowns::None,
            ClockState::One | ClockState::Declared => ClockUnknowns::None,
            ClockState::OneWithLag { .. } => ClockUnknowns::Offset,
            ClockState::Found { .. } => ClockUnknowns::OffsetAndDrift,
        }
    }

    /// One line for people: where the poses come from, and how the clocks go together.
    #[must_use]
    pub fn text(&self) -> String {
        let poses = match self.holds {
            Some(holds) => format!("{holds} holds in {} samples", self.samples),
            None => format!("motion of {} samples", self.samples),
        };
        let clocks = match &self.clocks {
            ClockState::One => "one clock".to_owned(),
            ClockState::OneWithLag { .. } => {
                "one clock; the fit estimates by how much the joint values are late".to_owned()
            }
            ClockState::Declared => "clocks stated to be the same".to_owned(),
            ClockState::Found { body, map } => format!(
                "the tracker clock is offset by {} from the robot clock and runs {} ± {:.0} ppm fast (motion of `{body}`: correlation {:.3}, second peak {:.2})",
                number::with_sigma(map.offset, Some(map.offset_sigma), Unit::Second),
                number::fixed(map.drift * 1e6, 0),
                map.drift_sigma * 1e6,
                map.correlation,
                map.second
            ),
        };
        format!("{poses}; {clocks}")
    }
}

/// A recording with time as a table.
#[derive(Debug, Clone)]
pub struct Aligned {
    /// The table.
    pub poses: Poses,
    /// Speed of each recorded joint per row, rad/s or m/s; empty for holds.
    pub velocities: BTreeMap<String, Vec<Option<f64>>>,
    /// Shape of each marker's covariance per row, in units of the usual variance; only for holds.
    pub shapes: BTreeMap<String, Vec<Option<Matrix3<f64>>>>,
    /// Usual variances of single rows about the mean of their hold; only for holds.
    pub row_noise: RowNoise,
    /// How the clocks go together.
    pub alignment: Alignment,
    /// What was noticed on the way.
    pub findings: Vec<Finding>,
    /// Holds that had not settled.
    pub excluded: Vec<Excluded>,
}
