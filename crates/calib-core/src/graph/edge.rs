//! The edges of the frame graph: what lies between two frames, and which of it is unknown.

use nalgebra::{Isometry3, Matrix6, Unit, Vector3};
use serde::{Deserialize, Serialize};

use crate::graph::chart::Chart;
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
                q: Vec::new(),
                effects: j
                    .effects
                    .iter()
                    .map(|f| JointEffect {
                        kind: f.kind,
                        values: f.values.as_ref().map(|_| Vec::new()),
                        parameter: f.parameter,
                    })
                    .collect(),
                candidates: Vec::new(),
                noise: j.noise,
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
    /// `exp(G u_s)`, `u_s ~ N(0, σ² I)`, drawn anew for every sample and marginalised.
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
    /// Centre of the prior and origin of the chart.
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

/// What a joint's motion is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Axis {
    /// Rotation about this direction through the joint frame's origin (q in rad).
    Revolute(Unit<Vector3<f64>>),
    /// Shift along this direction (q in m).
    Prismatic(Unit<Vector3<f64>>),
}

impl Axis {
    /// The direction, in the joint frame.
    #[must_use]
    pub fn direction(&self) -> Unit<Vector3<f64>> {
        match self {
            Self::Revolute(a) | Self::Prismatic(a) => *a,
        }
    }

    /// Two unit vectors that complete the axis to a right-handed basis (a, e₁, e₂): the axes of
    /// lateral give. For a coordinate axis they are coordinate axes (z: x and y).
    #[must_use]
    pub fn across(&self) -> [Vector3<f64>; 2] {
        let a = self.direction().into_inner();
        // The coordinate axis after the dominant one, orthogonalised.
        let k = a.iamax();
        let mut seed = Vector3::zeros();
        seed[(k + 1) % 3] = 1.0;
        let e1 = (seed - a * a.dot(&seed)).normalize();
        [e1, a.cross(&e1)]
    }
}

/// Joint: `exp(S φ_s) · Exp(θ_s)` with `φ_s = q_s + Σ_j F_j(s) c_j` and lateral rotations
/// `θ_s = Σ_j e_j F_j(s) c_j` across the axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Axis in the joint frame.
    pub axis: Axis,
    /// Reading per sample, rad or m.
    pub q: Vec<f64>,
    /// Effects whose coefficients are parameters.
    pub effects: Vec<JointEffect>,
    /// Effects that are not in the model; the goodness-of-fit test asks whether they should be.
    pub candidates: Vec<Candidate>,
    /// Noise of the reading itself, drawn anew for every sample.
    pub noise: Option<GroupId>,
}

/// Effect of a joint: linear in its coefficient.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EffectKind {
    /// F = 1.
    ZeroOffset,
    /// F = q.
    Gain,
    /// F = cos q − 1.
    EccentricityCos,
    /// F = sin q.
    EccentricitySin,
    /// F = torque about (force along) the axis, N·m (N).
    TorqueCompliance,
    /// Rotation about the first axis across, F = torque about it, N·m.
    Lateral1,
    /// Rotation about the second axis across, F = torque about it, N·m.
    Lateral2,
    /// F = ±1 by the direction of approach (or tanh τ/ε).
    Backlash,
    /// F = joint velocity, rad/s (m/s); the coefficient is a time.
    ClockOffset,
    /// F = another joint's reading.
    Coupling,
    /// F = whatever the caller supplies.
    Other,
}

impl EffectKind {
    /// The rotation axis across the joint axis that it drives, if it is a lateral effect.
    pub(crate) fn lateral(self) -> Option<usize> {
        match self {
            Self::Lateral1 => Some(0),
            Self::Lateral2 => Some(1),
            _ => None,
        }
    }

    /// Ending of the parameter's name.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::ZeroOffset => "offset",
            Self::Gain => "gain",
            Self::EccentricityCos => "eccentricity_cos",
            Self::EccentricitySin => "eccentricity_sin",
            Self::TorqueCompliance => "compliance",
            Self::Lateral1 => "lateral_1",
            Self::Lateral2 => "lateral_2",
            Self::Backlash => "backlash",
            Self::ClockOffset => "clock_offset",
            Self::Coupling => "coupling",
            Self::Other => "effect",
        }
    }

    /// The physics, in words, for the goodness-of-fit finding.
    #[must_use]
    pub fn physics(self) -> &'static str {
        match self {
            Self::ZeroOffset => "zero offset of the encoder",
            Self::Gain => "encoder gain",
            Self::EccentricityCos | Self::EccentricitySin => "gear eccentricity",
            Self::TorqueCompliance => "compliance under gravity",
            Self::Lateral1 | Self::Lateral2 => "lateral compliance",
            Self::Backlash => "backlash (hysteresis)",
            Self::ClockOffset => "clock offset between tracker and encoders",
            Self::Coupling => "coupling with another joint",
            Self::Other => "an effect that the caller named",
        }
    }
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
}

impl JointEffect {
    pub(crate) fn value(&self, sample: usize) -> f64 {
        self.values.as_ref().map_or(1.0, |v| v[sample])
    }
}

/// An effect outside the model.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Which.
    pub kind: EffectKind,
    /// What a person calls it, for instance `elbow.compliance`.
    pub name: String,
    /// Regressor per sample.
    pub values: Vec<f64>,
}
