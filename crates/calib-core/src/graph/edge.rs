//! The edges of the frame graph: what lies between two frames, and which of it is unknown.

use nalgebra::{Isometry3, Matrix6, Vector3};
use serde::{Deserialize, Serialize};

use crate::graph::axis::Axis;
use crate::graph::chart::Chart;
use crate::graph::effect::{Drives, EffectKind};
use crate::graph::ids::{FrameId, GroupId, ParameterId};

/// `parent_from_child(s)` for every sample s.
#[derive(Debug, Clone, PartialEq)]
pub struct Edge {
    /// Name; parameters are called `<name>.<coordinate>`.
    pub name: String,
    /// Frame on the left.
    pub parent: FrameId,
    /// Frame on the right.
    pub child: FrameId,
    /// What it is.
    pub kind: EdgeKind,
}

impl Edge {
    /// A copy whose per-sample arrays are empty (effects keep whether they have one).
    pub(crate) fn clone_shallow(&self) -> Self {
        let kind = match &self.kind {
            EdgeKind::Joint(j) => EdgeKind::Joint(Joint {
                axis: j.axis,
                reach: j.reach,
                q: Vec::new(),
                effects: j.effects.iter().map(JointEffect::clone_shallow).collect(),
                candidates: Vec::new(),
                noise: j.noise,
                own_noise: j.own_noise,
            }),
            EdgeKind::Measured { covariance, .. } => EdgeKind::Measured {
                poses: Vec::new(),
                covariance: *covariance,
            },
            other => other.clone(),
        };
        Self {
            name: self.name.clone(),
            parent: self.parent,
            child: self.child,
            kind,
        }
    }
}

/// Every edge of the frame graph is one of these.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum EdgeKind {
    /// A constant that is not questioned.
    Known(Isometry3<f64>),
    /// Measured for every sample (`None`: lost, the sample does not serve paths through it). A
    /// covariance `[ω; v]` in the child frame becomes a random effect of the sample.
    Measured {
        /// One pose per sample.
        poses: Vec<Option<Isometry3<f64>>>,
        /// Covariance of `pose·exp(noise)`.
        covariance: Option<Matrix6<f64>>,
    },
    /// A moving joint with everything that is wrong with it.
    Joint(Joint),
    /// A constant that is estimated.
    Unknown(UnknownPose),
    /// `exp(G u_s)`, `u_s ~ N(0, σ² I)`, drawn again for every sample and marginalized.
    Random {
        /// Columns of G, twists `[ω; v]`.
        directions: Vec<nalgebra::Vector6<f64>>,
        /// The group whose σ it has.
        group: GroupId,
    },
}

/// Where an unknown pose stands in the robot; only the words about it depend on this.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Role {
    /// Between the tracker (or another world frame) and the robot.
    World,
    /// The origin of a joint in its parent link.
    JointOrigin,
    /// A tracking body or tool on its link.
    Mount,
    /// Anything else.
    Other,
}

/// An unknown constant pose.
#[derive(Debug, Clone, PartialEq)]
pub struct UnknownPose {
    /// Center of the prior and origin of the chart.
    pub nominal: Isometry3<f64>,
    /// Which directions are free.
    pub chart: Chart,
    /// What it is in the robot.
    pub role: Role,
    /// The joint whose origin it is.
    pub joint: Option<String>,
    /// Parameter per chart coordinate; `None` where the chart is not free.
    pub parameters: [Option<ParameterId>; 6],
}

/// Joint: `Trans(δ_s) · exp(S φ_s) · Exp(θ_s)` with `φ_s = q_s + Σ_j F_j(s) c_j`, lateral rotations
/// `θ_s = Σ_j e_j F_j(s) c_j` across the axis and the growth `δ_s = p Σ_j F_j(s) c_j` of what leads to the joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Axis in the joint frame.
    pub axis: Axis,
    /// p, from the joint before it that moves, m, in the joint frame; 0 where nothing grows.
    pub reach: Vector3<f64>,
    /// Reading per sample, rad or m.
    pub q: Vec<f64>,
    /// Effects whose coefficients are parameters.
    pub effects: Vec<JointEffect>,
    /// Effects that are not in the model; the goodness-of-fit test asks whether they should be.
    pub candidates: Vec<Candidate>,
    /// Noise of the reading itself, drawn again for every sample.
    pub noise: Option<GroupId>,
    /// σ, rad or m, that its noise begins with where it has none here and a [`NoiseModel`](crate::NoiseModel) gives it some.
    pub own_noise: Option<f64>,
}

/// An effect in the model.
#[derive(Debug, Clone, PartialEq)]
pub struct JointEffect {
    /// Which.
    pub kind: EffectKind,
    /// Regressor per sample; `None` means 1 everywhere.
    pub values: Option<Vec<f64>>,
    /// Its coefficient; several effects may share one (one clock offset for all joints).
    pub parameter: ParameterId,
    /// What the regressor follows beside: `F_s = values_s + Σ_i shares_i(s) x_i`.
    pub shares: Vec<Share>,
    /// [`EffectKind::drives`], looked up once.
    pub(crate) drives: Drives,
}

impl JointEffect {
    pub(crate) fn new(kind: EffectKind, values: Option<Vec<f64>>, parameter: ParameterId) -> Self {
        Self {
            kind,
            values,
            parameter,
            shares: Vec::new(),
            drives: kind.drives(),
        }
    }

    /// A copy whose per-sample arrays are empty.
    fn clone_shallow(&self) -> Self {
        let shares = self.shares.iter().map(|share| Share {
            parameter: share.parameter,
            values: Vec::new(),
        });
        Self {
            shares: shares.collect(),
            ..Self::new(
                self.kind,
                self.values.as_ref().map(|_| Vec::new()),
                self.parameter,
            )
        }
    }

    /// F_s at these values of all parameters.
    #[inline]
    pub(crate) fn value(&self, sample: usize, at: &[f64]) -> f64 {
        let known = self.values.as_ref().map_or(1.0, |v| v[sample]);
        let shares = self.shares.iter();
        shares.fold(known, |sum, share| {
            sum + share.values[sample] * at[share.parameter.index()]
        })
    }
}

/// How a regressor follows a parameter that joints share (a mass that loads all joints below it), linearly.
#[derive(Debug, Clone, PartialEq)]
pub struct Share {
    /// The parameter.
    pub parameter: ParameterId,
    /// ∂F/∂x per sample.
    pub values: Vec<f64>,
}

/// An effect outside the model.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Candidate {
    /// Which.
    pub kind: EffectKind,
    /// What a person calls it, for instance `elbow.compliance`.
    pub name: String,
    /// Regressor per sample.
    pub values: Vec<f64>,
}
