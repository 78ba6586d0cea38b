//! Edges of constant, measured and random poses.

use nalgebra::{Isometry3, Matrix6, Vector6};

use crate::graph::chart::Chart;
use crate::graph::edge::{Edge, EdgeKind, Role, UnknownPose};
use crate::graph::error::Error;
use crate::graph::ids::{EdgeId, FrameId, GroupId, ParameterId};
use crate::graph::parameter::{Parameter, ParameterKind};
use crate::graph::problem::Problem;
use crate::graph::unit::Unit;

impl Problem {
    pub(super) fn edge_of(
        &mut self,
        name: &str,
        parent: FrameId,
        child: FrameId,
        kind: EdgeKind,
    ) -> EdgeId {
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
                    (ParameterKind::Translation, Unit::Meter)
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
        let Some(u) = self.unknown_mut(edge, "set_role") else {
            return;
        };
        u.role = role;
        u.joint = joint.map(ToOwned::to_owned);
        for p in u.parameters.into_iter().flatten() {
            self.parameters[p.index()].joint = joint.map(ToOwned::to_owned);
        }
    }

    /// Prior σ of an unknown pose about its nominal: rotations (rad) and translations (m).
    pub fn set_prior(&mut self, edge: EdgeId, rotation: Option<f64>, translation: Option<f64>) {
        if self.unknown_mut(edge, "set_prior").is_none() {
            return;
        }
        for (i, p) in self.edge_parameters(edge) {
            self.parameters[p.index()].prior_sigma = if i < 3 { rotation } else { translation };
        }
    }

    /// Where the solver starts an unknown pose; only the chart's free coordinates are taken over.
    pub fn set_start(&mut self, edge: EdgeId, start: &Isometry3<f64>) {
        let Some(u) = self.unknown_mut(edge, "set_start") else {
            return;
        };
        let c = u.chart.coordinates(&(u.nominal.inverse() * start));
        for (i, p) in self.edge_parameters(edge) {
            self.parameters[p.index()].start = c[i];
        }
    }

    /// The unknown pose of an edge; where it is none, a fault that [`Model::new`](crate::Model::new) reports.
    fn unknown_mut(&mut self, edge: EdgeId, call: &'static str) -> Option<&mut UnknownPose> {
        if !matches!(
            self.edges.get(edge.index()).map(|e| &e.kind),
            Some(EdgeKind::Unknown(_))
        ) {
            self.wrong_edge(edge, call, "an unknown pose");
        }
        match self.edges.get_mut(edge.index()).map(|e| &mut e.kind) {
            Some(EdgeKind::Unknown(u)) => Some(u),
            _ => None,
        }
    }

    /// Keeps a call on the wrong kind of edge for [`Model::new`](crate::Model::new) to report.
    pub(super) fn wrong_edge(&mut self, edge: EdgeId, call: &'static str, expected: &'static str) {
        let edge = self.edge_name(edge).to_owned();
        self.faults.push(Error::WrongEdge {
            call,
            edge,
            expected,
        });
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
}
