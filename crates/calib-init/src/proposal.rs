//! A profile before it is text.

use calib_recording::ColumnMap;
use calib_urdf::{JointId, LinkId};
use serde::Serialize;

use crate::fact::{About, Fact};
use crate::session::{Stream, Use};
use crate::skeleton::Skeleton;

/// A tracking body on its link.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Its name.
    pub name: String,
    /// Its markers; empty: a tracked pose.
    pub markers: Vec<String>,
    /// The link that carries it.
    pub link: LinkId,
}

/// A file with its column map.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Relative to the profile.
    pub path: String,
    /// How to read it, where the readers' own rules do not.
    pub columns: Option<ColumnMap>,
}

/// A recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Its name.
    pub name: String,
    /// The tracker's file, or the only one.
    pub table: Table,
    /// The robot's own log.
    pub log: Option<Table>,
    /// `None`: every row is a pose.
    pub stream: Option<Stream>,
    /// Largest offset between the clocks that is looked for, s, where the usual one is too small.
    pub max_offset: Option<f64>,
    /// What it is for.
    pub usage: Use,
    /// Joints without a column, and where they are taken to stand, rad or m: at 0, or as near to it as their limits allow.
    pub hold: Vec<(JointId, f64)>,
}

/// Noise that the recordings show: standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Noise {
    /// Of a marker coordinate, m.
    pub marker: Option<f64>,
    /// Of a body: of a coordinate, m, and about an axis, rad.
    pub body: Option<(f64, f64)>,
}

impl Noise {
    /// What was found of it.
    #[must_use]
    pub fn of(facts: &[Fact]) -> Self {
        let mut noise = Self::default();
        for fact in facts {
            match fact.about {
                About::MarkerSigma { sigma, .. } => noise.marker = Some(sigma),
                About::BodySigma {
                    position,
                    orientation,
                } => noise.body = Some((position, orientation)),
                _ => {}
            }
        }
        noise
    }
}

/// Everything that the profile says.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// Name of the robot.
    pub robot: String,
    /// The URDF, relative to the profile.
    pub urdf: String,
    /// The schema beside the profile, where there is one.
    pub schema: Option<String>,
    /// Noise.
    pub noise: Noise,
    /// Bodies.
    pub bodies: Vec<Body>,
    /// Recordings.
    pub recordings: Vec<Recording>,
    /// Where nothing was recorded: what is to be.
    pub skeleton: Option<Skeleton>,
    /// What was found, and how.
    pub facts: Vec<Fact>,
}

impl Proposal {
    /// The facts that a person must look at.
    pub fn to_check(&self) -> impl Iterator<Item = &Fact> {
        self.facts.iter().filter(|fact| fact.check)
    }
}
