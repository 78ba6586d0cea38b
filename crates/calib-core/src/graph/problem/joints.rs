//! Joints and their effects.

use calib_geometry::plausible::{Unlikely, unlikely_meters, unlikely_radians};
use nalgebra::Vector3;

use crate::graph::axis::Axis;
use crate::graph::edge::{Candidate, EdgeKind, Joint, JointEffect, Share};
use crate::graph::effect::{EffectKind, JointState, Source};
use crate::graph::error::Error;
use crate::graph::ids::{EdgeId, FrameId, GroupId, ParameterId};
use crate::graph::parameter::{Parameter, ParameterKind};
use crate::graph::problem::Problem;

impl Problem {
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
                reach: Vector3::zeros(),
                q,
                effects: Vec::new(),
                candidates: Vec::new(),
                noise: None,
                own_noise: None,
            }),
        )
    }

    /// States the reach of a joint, m in its frame: what grows with its temperature.
    pub fn joint_reach(&mut self, edge: EdgeId, reach: Vector3<f64>) {
        if let Some(joint) = self.joint_mut(edge, "joint_reach") {
            joint.reach = reach;
        }
    }

    /// The joint of an edge; where it is none, a fault that [`Model::new`](crate::Model::new) reports.
    fn joint_mut(&mut self, edge: EdgeId, call: &'static str) -> Option<&mut Joint> {
        if !matches!(
            self.edges.get(edge.index()).map(|e| &e.kind),
            Some(EdgeKind::Joint(_))
        ) {
            self.wrong_edge(edge, call, "a joint");
        }
        match self.edges.get_mut(edge.index()).map(|e| &mut e.kind) {
            Some(EdgeKind::Joint(j)) => Some(j),
            _ => None,
        }
    }

    /// Joints whose readings are hardly rad (m): degrees, most of all. It is for a person to judge, so nothing is refused.
    ///
    /// ```
    /// use calib_core::{Axis, Problem};
    /// use nalgebra::Vector3;
    ///
    /// let mut problem = Problem::new(3);
    /// let (base, link) = (problem.frame("base"), problem.frame("link"));
    /// problem.joint("elbow", base, link, Axis::Revolute(Vector3::z_axis()), vec![-90.0, 0.0, 45.0]);
    /// assert_eq!(problem.unlikely_units().len(), 1);
    /// ```
    #[must_use]
    pub fn unlikely_units(&self) -> Vec<(EdgeId, Unlikely)> {
        let edges = self.edges.iter().enumerate();
        edges
            .filter_map(|(e, edge)| {
                let EdgeKind::Joint(joint) = &edge.kind else {
                    return None;
                };
                let why = match joint.axis {
                    Axis::Revolute(_) => unlikely_radians(&joint.q),
                    Axis::Prismatic(_) => unlikely_meters(&joint.q),
                };
                Some((EdgeId::of(e), why?))
            })
            .collect()
    }

    /// Frees a term whose regressor follows from the reading (zero offset, gain, eccentricity). The parameter is
    /// called `<joint>.<term>`. A term that needs more ([`Problem::free_effect_with`]) or an edge that is not a joint is
    /// reported by [`Model::new`](crate::Model::new).
    pub fn free_effect(
        &mut self,
        edge: EdgeId,
        kind: EffectKind,
        prior_sigma: Option<f64>,
    ) -> ParameterId {
        let values = match self.joint_mut(edge, "free_effect") {
            Some(joint) if kind.term().source != Source::Constant => {
                joint.q.iter().map(|q| kind.of_reading(*q)).collect()
            }
            _ => None,
        };
        if values.is_none() && kind.term().source != Source::Constant {
            let what = format!("{}.{}", self.edge_name(edge), kind.label());
            self.faults.push(Error::NoRegressor { what });
        }
        self.push_effect(edge, kind, values, prior_sigma)
    }

    /// Frees a term with its regressor per sample (torque, velocity, direction of approach, another joint's
    /// reading): see [`EffectKind::regressors`].
    pub fn free_effect_with(
        &mut self,
        edge: EdgeId,
        kind: EffectKind,
        values: Vec<f64>,
        prior_sigma: Option<f64>,
    ) -> ParameterId {
        self.push_effect(edge, kind, Some(values), prior_sigma)
    }

    /// Frees a term at the states of the samples.
    pub fn free_effect_at(
        &mut self,
        edge: EdgeId,
        kind: EffectKind,
        states: &[JointState],
        prior_sigma: Option<f64>,
    ) -> ParameterId {
        self.push_effect(edge, kind, kind.regressors(states), prior_sigma)
    }

    fn push_effect(
        &mut self,
        edge: EdgeId,
        kind: EffectKind,
        values: Option<Vec<f64>>,
        prior_sigma: Option<f64>,
    ) -> ParameterId {
        let name = self.edge_name(edge).to_owned();
        let (prismatic, repeats) = match self.joint_mut(edge, "free_effect") {
            Some(j) => (
                matches!(j.axis, Axis::Prismatic(_)),
                j.effects.iter().filter(|f| f.kind == kind).count(),
            ),
            None => (false, 0),
        };
        let suffix = if repeats == 0 {
            String::new()
        } else {
            format!("_{}", repeats + 1)
        };
        let parameter = self.parameter(Parameter {
            name: format!("{name}.{}{suffix}", kind.label()),
            joint: Some(name),
            kind: ParameterKind::Effect(kind),
            unit: kind.term().quantity.unit(prismatic),
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
        if let Some(joint) = self.joint_mut(edge, "share_effect") {
            joint
                .effects
                .push(JointEffect::new(kind, values, parameter));
        }
    }

    /// Lets the regressor of a term that is free follow parameters besides: `F_s + Σ_i shares_i(s) x_i`. The effect is then
    /// bilinear in its coefficient and these, as a compliance is under masses that are not known.
    pub fn follow(&mut self, edge: EdgeId, kind: EffectKind, shares: Vec<Share>) {
        let found = self.joint_mut(edge, "follow").map(|joint| {
            let effect = joint.effects.iter_mut().rev().find(|f| f.kind == kind);
            effect.map(|f| f.shares.extend(shares)).is_some()
        });
        if found == Some(false) {
            let what = format!("{}.{}", self.edge_name(edge), kind.label());
            self.faults.push(Error::NoRegressor { what });
        }
    }

    /// Declares an effect that is not modeled, for the goodness-of-fit test.
    pub fn candidate(&mut self, edge: EdgeId, kind: EffectKind, values: Vec<f64>) {
        let name = match kind {
            // All joints share a clock.
            EffectKind::ClockOffset => kind.label().to_owned(),
            _ => format!("{}.{}", self.edge_name(edge), kind.label()),
        };
        self.shared_candidate(edge, kind, name, values);
    }

    /// The same of an effect whose coefficient joints have in common: candidates of a clock's offset with one `name` are tested as one.
    pub fn shared_candidate(
        &mut self,
        edge: EdgeId,
        kind: EffectKind,
        name: String,
        values: Vec<f64>,
    ) {
        if let Some(joint) = self.joint_mut(edge, "candidate") {
            joint.candidates.push(Candidate { kind, name, values });
        }
    }

    /// Gives a joint's reading its own noise, drawn again for every sample and marginalized.
    pub fn joint_noise(&mut self, edge: EdgeId, group: GroupId) {
        if let Some(joint) = self.joint_mut(edge, "joint_noise") {
            joint.noise = Some(group);
        }
    }

    /// Lets a joint have noise, begun with this σ (rad or m), where the poses speak for it: it has no common level with that of the others.
    pub fn joint_own_noise(&mut self, edge: EdgeId, sigma: f64) {
        if let Some(joint) = self.joint_mut(edge, "joint_own_noise") {
            joint.own_noise = Some(sigma);
        }
    }
}
