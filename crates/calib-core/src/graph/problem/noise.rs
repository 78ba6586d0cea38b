//! Statements of what is random from pose to pose, for one and the same measurements.

use std::collections::BTreeSet;

use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use crate::graph::axis::Axis;
use crate::graph::edge::{Edge, EdgeKind};
use crate::graph::ids::{EdgeId, FrameId, GroupId};
use crate::graph::measurement::MeasurementKind;
use crate::graph::problem::{NoiseKind, Problem};

/// What is random from pose to pose, beside the noise of each measurement. In order of growth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum NoiseModel {
    /// Nothing: every measurement has its own noise. The weights are those of plain least squares.
    White,
    /// The readings of the joints that turn, with one σ.
    Joint,
    /// With one more σ for those that slide.
    JointAndSlide,
    /// The pose of each marker body, turns and shifts.
    BodyPose,
    /// The joints' readings, each joint with a σ of its own, those that slide too.
    JointEach,
}

impl NoiseModel {
    /// All of them, in order of growth.
    pub const ALL: [Self; 5] = [
        Self::White,
        Self::Joint,
        Self::JointAndSlide,
        Self::BodyPose,
        Self::JointEach,
    ];
}

/// Markers from which the noise of a body's pose is distinguishable from their own.
const MARKERS_OF_A_POSE: usize = 3;
/// Radius of a body, m: σ at its markers over this is a rotation, rad.
const RADIUS: f64 = 0.1;

impl Problem {
    /// The same problem with this noise from pose to pose, started from the levels that are stated; `None` where it says
    /// nothing new: no joint or only one has noise, or no body has three markers. Frames, edges, parameters and groups
    /// keep their places; new ones follow them. A group that nothing refers to anymore keeps its place too, and is not
    /// estimated.
    #[must_use]
    pub fn with_noise_model(&self, model: NoiseModel) -> Option<Self> {
        let noisy: Vec<(usize, GroupId)> = self
            .edges
            .iter()
            .enumerate()
            .filter_map(|(e, edge)| match &edge.kind {
                EdgeKind::Joint(joint) => Some((e, joint.noise?)),
                _ => None,
            })
            .collect();
        let mut out = self.clone();
        match model {
            NoiseModel::White => out.without_joint_noise(&noisy),
            NoiseModel::Joint if noisy.is_empty() => return None,
            NoiseModel::Joint => {}
            NoiseModel::JointAndSlide => {
                let sliding = self.joints_of_own_noise();
                let (_, kind, sigma) = *sliding.first()?;
                let common = out.noise_group("slide", kind, sigma, true);
                for (edge, ..) in sliding {
                    out.joint_noise(EdgeId::of(edge), common);
                }
            }
            NoiseModel::BodyPose => {
                out.without_joint_noise(&noisy);
                let bodies = out.marker_bodies();
                if bodies.is_empty() {
                    return None;
                }
                for body in bodies {
                    out.with_random_body(&body);
                }
            }
            NoiseModel::JointEach => {
                let sliding = self.joints_of_own_noise();
                if noisy.len() < 2 && sliding.is_empty() {
                    return None;
                }
                out.without_joint_noise(&noisy);
                for (edge, kind, sigma) in sliding {
                    let name = format!("joint {}", self.edges[edge].name);
                    let own = out.noise_group(&name, kind, sigma, true);
                    out.joint_noise(EdgeId::of(edge), own);
                }
                for &(edge, group) in &noisy {
                    let name = format!("joint {}", self.edges[edge].name);
                    let stated = self.groups[group.index()].clone();
                    let own = out.noise_group(&name, stated.kind, stated.sigma, stated.estimate);
                    out.joint_noise(EdgeId::of(edge), own);
                }
            }
        }
        Some(out)
    }

    /// Joints that have noise of their own only, with its kind and the σ to begin with.
    fn joints_of_own_noise(&self) -> Vec<(usize, NoiseKind, f64)> {
        let of = |(e, edge): (usize, &Edge)| {
            let EdgeKind::Joint(joint) = &edge.kind else {
                return None;
            };
            let kind = match joint.axis {
                Axis::Revolute(_) => NoiseKind::Joint,
                Axis::Prismatic(_) => NoiseKind::Slide,
            };
            let sigma = joint.own_noise.filter(|_| joint.noise.is_none())?;
            Some((e, kind, sigma))
        };
        self.edges.iter().enumerate().filter_map(of).collect()
    }

    fn without_joint_noise(&mut self, noisy: &[(usize, GroupId)]) {
        for &(edge, group) in noisy {
            if let EdgeKind::Joint(joint) = &mut self.edges[edge].kind {
                joint.noise = None;
            }
            self.groups[group.index()].estimate = false;
        }
    }

    /// Bodies of three markers and more that hang on an unknown pose.
    fn marker_bodies(&self) -> Vec<MarkerBody> {
        let of = |measurement: &crate::graph::measurement::Measurement| {
            let MeasurementKind::Markers(markers) = &measurement.kind else {
                return None;
            };
            let seen = markers.observations.iter().map(|o| o.point);
            let points: BTreeSet<_> = seen.collect();
            let mount = self.edges.iter().position(|edge| {
                edge.child == measurement.to && matches!(edge.kind, EdgeKind::Unknown(_))
            })?;
            let whole = points.len() >= MARKERS_OF_A_POSE && measurement.path.is_none();
            whole.then(|| MarkerBody {
                name: measurement.name.clone(),
                frame: measurement.to,
                mount,
                markers: markers.noise,
            })
        };
        let mut bodies: Vec<MarkerBody> = Vec::new();
        for body in self.measurements.iter().filter_map(of) {
            if bodies.iter().all(|b| b.frame != body.frame) {
                bodies.push(body);
            }
        }
        bodies
    }

    /// Puts a random turn and a random shift between a body and its mount.
    fn with_random_body(&mut self, body: &MarkerBody) {
        let MarkerBody {
            name,
            frame,
            mount,
            markers,
        } = body;
        let sigma = self.groups[markers.index()].sigma;
        let turned = self.frame(&format!("{name}.turned"));
        let shifted = self.frame(&format!("{name}.shifted"));
        self.edges[*mount].child = turned;
        let unit = |i: usize| Vector6::from_fn(|r, _| if r == i { 1.0 } else { 0.0 });
        let turn = format!("{name} pose, orientation");
        let group = self.noise_group(&turn, NoiseKind::Orientation, sigma / RADIUS, true);
        self.random(&turn, turned, shifted, [0, 1, 2].map(unit).to_vec(), group);
        let shift = format!("{name} pose, position");
        let group = self.noise_group(&shift, NoiseKind::Position, sigma, true);
        self.random(&shift, shifted, *frame, [3, 4, 5].map(unit).to_vec(), group);
    }
}

/// A body that is seen by its markers.
struct MarkerBody {
    name: String,
    frame: FrameId,
    /// Edge that it hangs on.
    mount: usize,
    /// Noise of its markers.
    markers: GroupId,
}
