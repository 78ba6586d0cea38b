//! Recording designs: which readings a recording holds, and how the held-out poses were chosen.

use serde::{Deserialize, Serialize};

use super::robot::Robot;
use crate::noise::Noise;

/// How the poses to be fitted were chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Design {
    /// Forty random poses.
    Random,
    /// Ten random poses.
    Few,
    /// One joint at a time from one posture, seven poses each.
    Sweeps,
    /// Twenty random poses in one recording, sweeps in another.
    Both,
    /// A slow motion of all joints, 150 samples.
    Stream,
    /// Six random poses.
    Six,
}

/// How the held-out poses were chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Validation {
    /// Twelve random poses of all joints.
    Combined,
    /// The same design once more, from other postures.
    Alike,
    /// None.
    Absent,
}

/// The body that the tracker sees on the last link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Body {
    /// One marker.
    One,
    /// Two markers.
    Two,
    /// Three markers.
    Three,
    /// Four markers.
    Four,
    /// Position and orientation.
    Pose,
}

impl Design {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Random,
        Self::Few,
        Self::Sweeps,
        Self::Both,
        Self::Stream,
        Self::Six,
    ];

    /// Readings by recording, fitted ones first; the name says what it holds.
    pub(crate) fn readings(
        self,
        robot: &Robot,
        noise: &mut Noise,
    ) -> Vec<(&'static str, Vec<Vec<f64>>)> {
        match self {
            Self::Random => vec![("poses", random(robot, 40, noise))],
            Self::Few => vec![("poses", random(robot, 10, noise))],
            Self::Six => vec![("poses", random(robot, 6, noise))],
            Self::Sweeps => vec![("sweeps", sweeps(robot, noise))],
            Self::Both => vec![
                ("poses", random(robot, 20, noise)),
                ("sweeps", sweeps(robot, noise)),
            ],
            Self::Stream => vec![("motion", stream(robot, noise))],
        }
    }
}

impl Validation {
    /// The held-out readings.
    pub(crate) fn readings(
        self,
        design: Design,
        robot: &Robot,
        noise: &mut Noise,
    ) -> Option<Vec<Vec<f64>>> {
        match (self, design) {
            (Self::Absent, _) => None,
            (Self::Alike, Design::Sweeps) => Some(sweeps(robot, noise)),
            (Self::Alike, Design::Stream) => Some(stream(robot, noise)),
            _ => Some(random(robot, 12, noise)),
        }
    }
}

impl Body {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::One, Self::Two, Self::Three, Self::Four, Self::Pose];

    /// Markers that are recorded.
    pub(crate) fn markers(self) -> usize {
        match self {
            Self::One => 1,
            Self::Two => 2,
            Self::Three => 3,
            Self::Four => 4,
            Self::Pose => 0,
        }
    }
}

/// Readings within the joint ranges, joints independent.
pub(crate) fn random(robot: &Robot, count: usize, noise: &mut Noise) -> Vec<Vec<f64>> {
    let pose = |noise: &mut Noise| {
        let joints = 0..robot.joints.len();
        joints
            .map(|j| {
                let (low, high) = robot.range(j);
                noise.between(low, high)
            })
            .collect()
    };
    (0..count).map(|_| pose(noise)).collect()
}

fn sweeps(robot: &Robot, noise: &mut Noise) -> Vec<Vec<f64>> {
    let home: Vec<f64> = random(robot, 1, noise)[0].iter().map(|q| 0.5 * q).collect();
    let mut rows = Vec::new();
    for j in 0..robot.joints.len() {
        let (low, high) = robot.range(j);
        for k in 0..7 {
            let mut row = home.clone();
            row[j] = low + (high - low) * (f64::from(k) + 0.5 * noise.uniform()) / 7.0;
            rows.push(row);
        }
    }
    rows
}

fn stream(robot: &Robot, noise: &mut Noise) -> Vec<Vec<f64>> {
    let of_joint = |noise: &mut Noise| {
        (
            noise.between(0.4, 1.3),
            noise.between(0.0, std::f64::consts::TAU),
        )
    };
    let waves: Vec<(f64, f64)> = robot.joints.iter().map(|_| of_joint(noise)).collect();
    let at = |i: i32| {
        let t = f64::from(i) * 0.1;
        let wave = |(j, (rate, phase)): (usize, &(f64, f64))| {
            robot.range(j).1 * 0.9 * (rate * t + phase).sin()
        };
        waves.iter().enumerate().map(wave).collect()
    };
    (0..150).map(at).collect()
}
