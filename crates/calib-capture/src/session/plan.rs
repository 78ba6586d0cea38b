//! What is recorded, and how.

use crate::{Frame, Guide, JointColumn, JointSource};
use std::fmt::Write as _;

/// Body or marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WatchedKind {
    /// Position and rotation.
    Body,
    /// Position only.
    Marker,
}

/// A body or marker that gets columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Watched {
    /// Its name in the profile, and in the file.
    pub name: String,
    /// The tracker's name for it.
    pub from: String,
    /// What is written for it.
    pub kind: WatchedKind,
}

impl Watched {
    /// Whether the tracker saw it.
    pub(super) fn is_in(&self, frame: &Frame) -> bool {
        match self.kind {
            WatchedKind::Body => frame.bodies.contains_key(&self.from),
            WatchedKind::Marker => frame.point(&self.from).is_some(),
        }
    }
}

/// A body that the swept joints move: a pose in which it is hidden says nothing of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Moved {
    /// Its name in the profile.
    pub name: String,
    /// What of [`Plan::watched`] belongs to it: itself, or its markers.
    pub parts: Vec<usize>,
}

/// Markers that give the place of a rigid body.
const RIGID: usize = 3;

impl Moved {
    /// Whether enough of it was seen: itself, or three of its markers (all, where it has fewer).
    pub(super) fn is_in(&self, plan: &Plan, frame: &Frame) -> bool {
        let parts = self.parts.iter().filter_map(|&part| plan.watched.get(part));
        let seen = parts.filter(|watched| watched.is_in(frame)).count();
        seen >= self.parts.len().min(RIGID)
    }
}

/// What is recorded, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Joint columns.
    pub columns: Vec<JointColumn>,
    /// The source of their values.
    pub joints: JointSource,
    /// The requested poses.
    pub guide: Guide,
    /// Bodies and markers.
    pub watched: Vec<Watched>,
    /// Bodies without which a requested pose does not count.
    pub moved: Vec<Moved>,
    /// A motion is recorded: every frame is a row, and nothing is held.
    pub continuous: bool,
    /// How long a pose is recorded, s.
    pub hold: f64,
    /// Distance from the target within which a measured joint is at the pose, rad or m.
    pub near: (f64, f64),
    /// Rows also while the robot moves.
    pub all: bool,
    /// Give up when the tracker sends nothing for this long, s.
    pub patience: f64,
    /// Time limit, s.
    pub longest: Option<f64>,
}

impl Plan {
    /// The file's header line.
    pub fn header(&self) -> String {
        let mut header = String::from("frame,t_s,host_s,hold");
        for column in &self.columns {
            let _ = write!(header, ",{}", column.header());
        }
        for watched in &self.watched {
            let parts: &[&str] = match watched.kind {
                WatchedKind::Body => &["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"],
                WatchedKind::Marker => &["x_m", "y_m", "z_m"],
            };
            for part in parts {
                let _ = write!(header, ",{}.{part}", watched.name);
            }
        }
        header
    }
}
