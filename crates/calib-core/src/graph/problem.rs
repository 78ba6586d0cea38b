//! The problem as the caller states it: frames, edges, points, noise groups, measurements.

use nalgebra::{Isometry3, Matrix6, Point3, Unit as UnitVec, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use crate::graph::chart::Chart;
use crate::graph::edge::{
    Axis, Candidate, Edge, EdgeKind, EffectKind, Joint, JointEffect, Role, UnknownPose,
};
use crate::graph::error::Error;
use crate::graph::ids::{EdgeId, FrameId, GroupId, ParameterId, PointId};
use crate::graph::measurement::{
    MarkerObservation, Measurement, MeasurementKind, PoseNoise, PoseObservation,
};
use crate::graph::parameter::{Parameter, ParameterKind, Unit};

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
    /// A joint's reading, rad or m.
    Joint,
    /// A factor on given covariances.
    Scale,
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
    pub(crate) measurements: Vec<Measurement>,
    /// Time of each sample, s (optional; the goodness-of-fit test looks for drift along it).
    pub times: Option<Vec<f64>>,
    /// Samples that are predicted but not fitted to.
    pub held_out: std::collections::BTreeSet<usize>,
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

    fn edge_of(&mut self, name: &str, parent: FrameId, child: FrameId, kind: EdgeKind) -> EdgeId {
        self.edges.push(Edge {
            name: name.to_owned(),
            parent,
            child,
            kind,
        });
        EdgeId::of(self.edges.len() - 1)
    }

    /// A constant `parent_from_child`.
    pub fn known(
        &mut self,
        name: &str,
        parent: FrameId,
        child: FrameId,
        pose: Isometry3<f64>,
    ) -> EdgeId {
        self.edge_of(name, parent, child, EdgeKind::Known(pose))
    }

    /// A pose that is measured for every sample.
    pub fn measured(
        &mut self,
        name: &str,
        parent: FrameId,
        child: FrameId,
        poses: Vec<Option<Isometry3<f64>>>,
        covariance: Option<Matrix6<f64>>,
    ) -> EdgeId {
        self.edge_of(
            name,
            parent,
            child,
            EdgeKind::Measured { poses, covariance },
        )
    }

    /// An unknown constant pose near `nominal`; its free coordinates become parameters
    /// `<name>.rx` … `<name>.z` without prior.
    pub fn unknown(
        &mut self,
        name: &str,
        parent: FrameId,
        child: FrameId,
        nominal: Isometry3<f64>,
        chart: Chart,
    ) -> EdgeId {
        let labels = chart.labels();
        let mut parameters = [None; 6];
        for i in 0..6 {
            if chart.free()[i] {
                let (kind, unit) = if i < 3 {
                    (ParameterKind::Rotation, Unit::Radian)
                } else {
                    (ParameterKind::Translation, Unit::Metre)
                };
                parameters[i] = Some(self.parameter(Parameter {
                    name: format!("{name}.{}", labels[i]),
                    joint: None,
                    kind,
                    unit,
                    nominal: 0.0,
                    start: 0.0,
                    prior_sigma: None,
                    bounds: None,
                    fixed: false,
                }));
            }
        }
        self.edge_of(
            name,
            parent,
            child,
            EdgeKind::Unknown(UnknownPose {
                nominal,
                chart,
                role: Role::Other,
                joint: None,
                parameters,
            }),
        )
    }

    /// Says what an unknown pose is in the robot, and whose joint origin it is.
    pub fn set_role(&mut self, edge: EdgeId, role: Role, joint: Option<&str>) {
        let mut own = Vec::new();
        if let Some(Edge {
            kind: EdgeKind::Unknown(u),
            ..
        }) = self.edges.get_mut(edge.index())
        {
            u.role = role;
            u.joint = joint.map(ToOwned::to_owned);
            own.extend(u.parameters.iter().flatten().copied());
        }
        for p in own {
            self.parameters[p.index()].joint = joint.map(ToOwned::to_owned);
        }
    }

    /// Prior σ of an unknown pose about its nominal: rotations (rad) and translations (m).
    pub fn set_prior(&mut self, edge: EdgeId, rotation: Option<f64>, translation: Option<f64>) {
        for (i, p) in self.edge_parameters(edge) {
            self.parameters[p.index()].prior_sigma = if i < 3 { rotation } else { translation };
        }
    }

    /// Where the solver starts an unknown pose; only the chart's free coordinates are taken over.
    pub fn set_start(&mut self, edge: EdgeId, start: &Isometry3<f64>) {
        let Some(EdgeKind::Unknown(u)) = self.edges.get(edge.index()).map(|e| &e.kind) else {
            return;
        };
        let c = u.chart.coordinates(&(u.nominal.inverse() * start));
        for (i, p) in self.edge_parameters(edge) {
            self.parameters[p.index()].start = c[i];
        }
    }

    /// (chart coordinate, parameter) of an unknown pose's free directions.
    #[must_use]
    pub fn edge_parameters(&self, edge: EdgeId) -> Vec<(usize, ParameterId)> {
        match self.edges.get(edge.index()).map(|e| &e.kind) {
            Some(EdgeKind::Unknown(u)) => u
                .parameters
                .iter()
                .enumerate()
                .filter_map(|(i, p)| p.map(|p| (i, p)))
                .collect(),
            _ => Vec::new(),
        }
    }

    /// A joint with its reading per sample (rad or m).
    pub fn joint(
        &mut self,
        name: &str,
        parent: FrameId,
        child: FrameId,
        axis: Axis,
        q: Vec<f64>,
    ) -> EdgeId {
        self.edge_of(
            name,
            parent,
            child,
            EdgeKind::Joint(Joint {
                axis,
                q,
                effects: Vec::new(),
                candidates: Vec::new(),
                noise: None,
            }),
        )
    }

    fn joint_mut(&mut self, edge: EdgeId) -> Option<&mut Joint> {
        match self.edges.get_mut(edge.index()).map(|e| &mut e.kind) {
            Some(EdgeKind::Joint(j)) => Some(j),
            _ => None,
        }
    }

    /// Regressor of an effect that follows from the reading alone.
    fn own_values(&self, edge: EdgeId, kind: EffectKind) -> Option<Vec<f64>> {
        let EdgeKind::Joint(joint) = &self.edges.get(edge.index())?.kind else {
            return None;
        };
        match kind {
            EffectKind::Gain => Some(joint.q.clone()),
            EffectKind::EccentricityCos => Some(joint.q.iter().map(|q| q.cos() - 1.0).collect()),
            EffectKind::EccentricitySin => Some(joint.q.iter().map(|q| q.sin()).collect()),
            _ => None,
        }
    }

    /// Frees an effect of a joint whose regressor follows from the reading: [`EffectKind::ZeroOffset`],
    /// `Gain`, `EccentricityCos`, `EccentricitySin`. The parameter is called `<joint>.<effect>`.
    pub fn free_effect(
        &mut self,
        edge: EdgeId,
        kind: EffectKind,
        prior_sigma: Option<f64>,
    ) -> ParameterId {
        let values = self.own_values(edge, kind);
        self.push_effect(edge, kind, values, prior_sigma)
    }

    /// Frees an effect with its regressor per sample (torque, velocity, direction of approach,
    /// another joint's reading).
    pub fn free_effect_with(
        &mut self,
        edge: EdgeId,
        kind: EffectKind,
        values: Vec<f64>,
        prior_sigma: Option<f64>,
    ) -> ParameterId {
        self.push_effect(edge, kind, Some(values), prior_sigma)
    }

    fn push_effect(
        &mut self,
        edge: EdgeId,
        kind: EffectKind,
        values: Option<Vec<f64>>,
        prior_sigma: Option<f64>,
    ) -> ParameterId {
        let (name, prismatic) = match self.edges.get(edge.index()) {
            Some(e) => (
                e.name.clone(),
                matches!(&e.kind, EdgeKind::Joint(j) if matches!(j.axis, Axis::Prismatic(_))),
            ),
            None => (String::new(), false),
        };
        let angle = if prismatic { Unit::Metre } else { Unit::Radian };
        let (parameter_kind, unit) = match kind {
            EffectKind::ZeroOffset => (ParameterKind::ZeroOffset, angle),
            EffectKind::Gain => (ParameterKind::Gain, Unit::One),
            EffectKind::EccentricityCos => (ParameterKind::EccentricityCos, angle),
            EffectKind::EccentricitySin => (ParameterKind::EccentricitySin, angle),
            EffectKind::TorqueCompliance => (
                ParameterKind::TorqueCompliance,
                if prismatic {
                    Unit::MetrePerNewton
                } else {
                    Unit::RadianPerNewtonMetre
                },
            ),
            EffectKind::Lateral1 | EffectKind::Lateral2 => {
                (ParameterKind::LateralCompliance, Unit::RadianPerNewtonMetre)
            }
            EffectKind::Backlash => (ParameterKind::Backlash, angle),
            EffectKind::ClockOffset => (ParameterKind::ClockOffset, Unit::Second),
            EffectKind::Coupling => (ParameterKind::Coupling, Unit::One),
            EffectKind::Other => (ParameterKind::Other, Unit::One),
        };
        let repeats = match self.edges.get(edge.index()).map(|e| &e.kind) {
            Some(EdgeKind::Joint(j)) => j.effects.iter().filter(|f| f.kind == kind).count(),
            _ => 0,
        };
        let suffix = if repeats == 0 {
            String::new()
        } else {
            format!("_{}", repeats + 1)
        };
        let parameter = self.parameter(Parameter {
            name: format!("{name}.{}{suffix}", kind.label()),
            joint: Some(name),
            kind: parameter_kind,
            unit,
            nominal: 0.0,
            start: 0.0,
            prior_sigma,
            bounds: None,
            fixed: false,
        });
        self.share_effect(edge, kind, values, parameter);
        parameter
    }

    /// Adds an effect whose coefficient is an existing parameter (one clock offset for all joints,
    /// one compliance for both arms). `values: None` means 1 for every sample.
    pub fn share_effect(
        &mut self,
        edge: EdgeId,
        kind: EffectKind,
        values: Option<Vec<f64>>,
        parameter: ParameterId,
    ) {
        if let Some(joint) = self.joint_mut(edge) {
            joint.effects.push(JointEffect {
                kind,
                values,
                parameter,
            });
        }
    }

    /// Declares an effect that is not modelled, for the goodness-of-fit test.
    pub fn candidate(&mut self, edge: EdgeId, kind: EffectKind, values: Vec<f64>) {
        let name = self.edge_name(edge).to_owned();
        if let Some(joint) = self.joint_mut(edge) {
            joint.candidates.push(Candidate {
                kind,
                name: format!("{name}.{}", kind.label()),
                values,
            });
        }
    }

    /// Gives a joint's reading its own noise, drawn anew for every sample and marginalised.
    pub fn joint_noise(&mut self, edge: EdgeId, group: GroupId) {
        if let Some(joint) = self.joint_mut(edge) {
            joint.noise = Some(group);
        }
    }

    /// A wobble `exp(G u_s)` between two frames; `directions` are the columns of G.
    pub fn random(
        &mut self,
        name: &str,
        parent: FrameId,
        child: FrameId,
        directions: Vec<Vector6<f64>>,
        group: GroupId,
    ) -> EdgeId {
        self.edge_of(name, parent, child, EdgeKind::Random { directions, group })
    }

    /// Adds a scalar parameter (usually done by the other methods).
    pub fn parameter(&mut self, parameter: Parameter) -> ParameterId {
        self.parameters.push(parameter);
        ParameterId::of(self.parameters.len() - 1)
    }

    /// A point of known coordinates in `frame`.
    pub fn known_point(&mut self, name: &str, frame: FrameId, position: Point3<f64>) -> PointId {
        self.points.push(Point {
            name: name.to_owned(),
            frame,
            position,
            parameters: None,
        });
        PointId::of(self.points.len() - 1)
    }

    /// A point of unknown coordinates near `position`: parameters `<name>.x`, `.y`, `.z`.
    pub fn unknown_point(
        &mut self,
        name: &str,
        frame: FrameId,
        position: Point3<f64>,
        prior_sigma: Option<f64>,
    ) -> PointId {
        let coordinate = |axis: &str, value: f64| Parameter {
            name: format!("{name}.{axis}"),
            joint: None,
            kind: ParameterKind::Point,
            unit: Unit::Metre,
            nominal: value,
            start: value,
            prior_sigma,
            bounds: None,
            fixed: false,
        };
        let x = self.parameter(coordinate("x", position.x));
        let y = self.parameter(coordinate("y", position.y));
        let z = self.parameter(coordinate("z", position.z));
        self.points.push(Point {
            name: name.to_owned(),
            frame,
            position,
            parameters: Some([x, y, z]),
        });
        PointId::of(self.points.len() - 1)
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

    /// Adds a measurement.
    pub fn add_measurement(&mut self, measurement: Measurement) {
        self.measurements.push(measurement);
    }

    /// Markers of frame `to` seen from frame `from`, along the shortest path.
    pub fn markers(
        &mut self,
        name: &str,
        from: FrameId,
        to: FrameId,
        noise: GroupId,
        observations: Vec<MarkerObservation>,
    ) {
        self.add_measurement(Measurement {
            name: name.to_owned(),
            from,
            to,
            path: None,
            kind: MeasurementKind::Markers {
                noise,
                observations,
            },
        });
    }

    /// Poses of frame `to` seen from frame `from`, along the shortest path.
    pub fn poses(
        &mut self,
        name: &str,
        from: FrameId,
        to: FrameId,
        noise: PoseNoise,
        observations: Vec<PoseObservation>,
    ) {
        self.add_measurement(Measurement {
            name: name.to_owned(),
            from,
            to,
            path: None,
            kind: MeasurementKind::Poses {
                noise,
                observations,
            },
        });
    }

    /// Two paths between the same frames that must agree at `samples`: out along `there`, home
    /// against `back` (both given from the common start to the common end).
    pub fn add_loop(
        &mut self,
        name: &str,
        end: FrameId,
        there: &[(EdgeId, bool)],
        back: &[(EdgeId, bool)],
        noise: PoseNoise,
        samples: Vec<usize>,
    ) {
        // closed path from the end: back⁻¹ · there
        let mut path: Vec<(EdgeId, bool)> = back.iter().rev().map(|&(e, inv)| (e, !inv)).collect();
        path.extend_from_slice(there);
        self.add_measurement(Measurement {
            name: name.to_owned(),
            from: end,
            to: end,
            path: Some(path),
            kind: MeasurementKind::Loop { noise, samples },
        });
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
        &mut self.measurements
    }

    /// The edges from one frame to another by the shortest way (fewest edges, first created wins).
    ///
    /// # Errors
    /// [`Error::NoPath`] when the frames are not connected.
    pub fn path(&self, from: FrameId, to: FrameId) -> Result<Vec<(EdgeId, bool)>, Error> {
        let mut reached: Vec<Option<(EdgeId, bool, usize)>> = vec![None; self.frames.len()];
        let mut queue = std::collections::VecDeque::from([from.index()]);
        while let Some(here) = queue.pop_front() {
            if here == to.index() {
                break;
            }
            for (i, edge) in self.edges.iter().enumerate() {
                let (p, c) = (edge.parent.index(), edge.child.index());
                let (next, inverse) = if p == here {
                    (c, false)
                } else if c == here {
                    (p, true)
                } else {
                    continue;
                };
                if next != from.index() && reached[next].is_none() {
                    reached[next] = Some((EdgeId::of(i), inverse, here));
                    queue.push_back(next);
                }
            }
        }
        let mut path = Vec::new();
        let mut here = to.index();
        while here != from.index() {
            let Some((edge, inverse, before)) = reached.get(here).copied().flatten() else {
                return Err(Error::NoPath {
                    from: self.frame_name(from).to_owned(),
                    to: self.frame_name(to).to_owned(),
                });
            };
            path.push((edge, inverse));
            here = before;
        }
        path.reverse();
        Ok(path)
    }

    /// Unit vector helper for axes given as three numbers; `None` for a zero or non-finite vector.
    #[must_use]
    pub fn unit(x: f64, y: f64, z: f64) -> Option<UnitVec<Vector3<f64>>> {
        UnitVec::try_new(Vector3::new(x, y, z), 1e-9).filter(|u| u.iter().all(|c| c.is_finite()))
    }
}
