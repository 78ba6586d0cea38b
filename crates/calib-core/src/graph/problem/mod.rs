//! The problem as the caller states it: frames, edges, points, noise groups, measurements.

use std::sync::Arc;

use nalgebra::{Point3, Unit as UnitVec, Vector3};
use serde::{Deserialize, Serialize};

use crate::graph::edge::Edge;
use crate::graph::error::Error;
use crate::graph::ids::{EdgeId, FrameId, GroupId, ParameterId};
use crate::graph::measurement::Measurement;
use crate::graph::parameter::Parameter;

mod edges;
mod joints;
mod measurements;
mod noise;
mod own_noise;
mod paths;
mod starts;

pub use noise::NoiseModel;
pub use own_noise::OwnNoise;
pub use starts::{OpenStart, StartChange};

/// A point that is fixed in a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Name, for instance `hand_2`.
    pub name: String,
    /// The frame it is fixed in.
    pub frame: FrameId,
    /// Nominal coordinates, m.
    pub position: Point3<f64>,
    /// Its three coordinates where they are unknown.
    pub parameters: Option<[ParameterId; 3]>,
}

/// What kind of noise a group is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseKind {
    /// Marker or body position, m.
    Position,
    /// Body orientation or direction, rad.
    Orientation,
    /// Reading of a joint that turns, rad.
    Joint,
    /// Reading of a joint that slides, m.
    Slide,
    /// A factor on given covariances.
    Scale,
}

impl NoiseKind {
    /// Of the reading of a joint.
    #[must_use]
    pub fn is_of_joints(self) -> bool {
        matches!(self, Self::Joint | Self::Slide)
    }
}

/// A noise level that several measurements share.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseGroup {
    /// Name, for instance `markers`.
    pub name: String,
    /// What it is.
    pub kind: NoiseKind,
    /// σ, stated or first guess.
    pub sigma: f64,
    /// Estimate it from the residuals (REML) instead of taking it as stated.
    pub estimate: bool,
}

/// A whole estimation problem. Build it with the methods below; nothing is checked until it is
/// compiled by [`Model::new`](crate::Model::new) or solved.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Problem {
    pub(crate) samples: usize,
    pub(crate) frames: Vec<String>,
    pub(crate) edges: Vec<Edge>,
    pub(crate) points: Vec<Point>,
    pub(crate) parameters: Vec<Parameter>,
    pub(crate) groups: Vec<NoiseGroup>,
    /// Shared by the copies of a problem until one of them changes its own.
    pub(crate) measurements: Arc<Vec<Measurement>>,
    /// Calls of the builder that could not be carried out.
    pub(crate) faults: Vec<Error>,
    /// Samples before a joint's first motion.
    pub(crate) starts: Vec<OpenStart>,
    /// Time of each sample, s (optional; the goodness-of-fit test looks for drift along it).
    pub times: Option<Vec<f64>>,
    /// Samples that are predicted but not fitted to.
    pub held_out: std::collections::BTreeSet<usize>,
    /// First sample of every recording but the first (optional): where only some samples are looked at, they are of every recording.
    pub borders: Vec<usize>,
}

impl Problem {
    /// An empty problem over `samples` samples (static poses or instants).
    #[must_use]
    pub fn new(samples: usize) -> Self {
        Self {
            samples,
            ..Self::default()
        }
    }

    /// Number of samples.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Adds a frame.
    pub fn frame(&mut self, name: &str) -> FrameId {
        self.frames.push(name.to_owned());
        FrameId::of(self.frames.len() - 1)
    }

    /// The frame of that name.
    #[must_use]
    pub fn find_frame(&self, name: &str) -> Option<FrameId> {
        self.frames.iter().position(|f| f == name).map(FrameId::of)
    }

    /// Name of a frame.
    #[must_use]
    pub fn frame_name(&self, frame: FrameId) -> &str {
        self.frames.get(frame.index()).map_or("?", String::as_str)
    }

    /// Adds a scalar parameter (usually done by the other methods).
    pub fn parameter(&mut self, parameter: Parameter) -> ParameterId {
        self.parameters.push(parameter);
        ParameterId::of(self.parameters.len() - 1)
    }

    /// A noise level: σ in m, rad or 1; `estimate` lets the residuals decide it.
    pub fn noise_group(
        &mut self,
        name: &str,
        kind: NoiseKind,
        sigma: f64,
        estimate: bool,
    ) -> GroupId {
        self.groups.push(NoiseGroup {
            name: name.to_owned(),
            kind,
            sigma,
            estimate,
        });
        GroupId::of(self.groups.len() - 1)
    }

    /// All scalars, in the order of creation.
    #[must_use]
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// One scalar, to set its prior, bounds, start or to hold it.
    pub fn parameter_mut(&mut self, id: ParameterId) -> &mut Parameter {
        &mut self.parameters[id.index()]
    }

    /// The parameter of that name.
    #[must_use]
    pub fn find_parameter(&self, name: &str) -> Option<ParameterId> {
        self.parameters
            .iter()
            .position(|p| p.name == name)
            .map(ParameterId::of)
    }

    /// All edges, in the order of creation.
    #[must_use]
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// The edge of that name.
    #[must_use]
    pub fn find_edge(&self, name: &str) -> Option<EdgeId> {
        self.edges
            .iter()
            .position(|e| e.name == name)
            .map(EdgeId::of)
    }

    /// Name of an edge.
    #[must_use]
    pub fn edge_name(&self, edge: EdgeId) -> &str {
        self.edges
            .get(edge.index())
            .map_or("?", |e| e.name.as_str())
    }

    /// All points.
    #[must_use]
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// All noise groups.
    #[must_use]
    pub fn groups(&self) -> &[NoiseGroup] {
        &self.groups
    }

    /// One noise group, to change its σ.
    pub fn group_mut(&mut self, id: GroupId) -> &mut NoiseGroup {
        &mut self.groups[id.index()]
    }

    /// All measurements.
    #[must_use]
    pub fn measurements(&self) -> &[Measurement] {
        &self.measurements
    }

    /// One measurement, to edit its observations.
    pub fn measurements_mut(&mut self) -> &mut [Measurement] {
        Arc::make_mut(&mut self.measurements).as_mut_slice()
    }

    /// Holds the measurements of another problem in place of its own, where they are the same: once for both.
    pub fn share_measurements(&mut self, with: &Self) {
        if self.measurements == with.measurements {
            self.measurements = Arc::clone(&with.measurements);
        }
    }

    /// Unit vector helper for axes given as three numbers; `None` for a zero or non-finite vector.
    #[must_use]
    pub fn unit(x: f64, y: f64, z: f64) -> Option<UnitVec<Vector3<f64>>> {
        UnitVec::try_new(Vector3::new(x, y, z), 1e-9).filter(|u| u.iter().all(|c| c.is_finite()))
    }
}
