//! How the clocks of a recording go together, and the table of poses that follows.

use std::collections::BTreeMap;

use calib_checks::sync::ClockMap;
use calib_finding::Finding;
use calib_recording::Poses;
use nalgebra::Matrix3;

use crate::prepare::excluded::Excluded;

/// An offset below this, s, is none: at 0.5 rad/s and 1 m it is a tenth of a millimeter.
pub(crate) const SAME_TIME: f64 = 2e-4;

/// What is known of two clocks.
#[derive(Debug, Clone, PartialEq)]
pub enum ClockState {
    /// They are one: the streams name the same clock.
    One,
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
            Self::One | Self::Declared => t,
        }
    }
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
}

impl Alignment {
    /// One line for people: where the poses come from, and how the clocks go together.
    #[must_use]
    pub fn text(&self) -> String {
        let poses = match self.holds {
            Some(holds) => format!("{holds} holds in {} samples", self.samples),
            None => format!("motion of {} samples", self.samples),
        };
        let clocks = match &self.clocks {
            ClockState::One => "one clock".to_owned(),
            ClockState::Declared => "clocks stated to be the same".to_owned(),
            ClockState::Found { body, map } => format!(
                "the tracker clock is offset by {:+.4} s ± {:.2} ms from the robot clock and runs {:+.0} ± {:.0} ppm fast (motion of `{body}`: correlation {:.3}, second peak {:.2})",
                map.offset,
                map.offset_sigma * 1e3,
                map.drift * 1e6,
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
    /// How the clocks go together.
    pub alignment: Alignment,
    /// What was noticed on the way.
    pub findings: Vec<Finding>,
    /// Holds that had not settled.
    pub excluded: Vec<Excluded>,
}
