//! The nominal kinematics as the engine needs them: a tree of links, joint laws, and forward kinematics in bare matrices.

use calib_urdf::{JointKind, RobotModel};
use nalgebra::{Isometry3, Matrix3, Unit, Vector3};

use super::ids::{JointIndex, LinkIndex};

/// How a joint moves its child link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// It does not.
    Fixed,
    /// Rotation about an axis of the joint frame; positions in rad.
    Revolute(Unit<Vector3<f64>>),
    /// Translation along an axis of the joint frame; positions in m.
    Prismatic(Unit<Vector3<f64>>),
}

/// A joint of the chain.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainJoint {
    /// The link that carries the joint.
    pub parent: LinkIndex,
    /// The link that the joint moves.
    pub child: LinkIndex,
    /// Nominal origin of the joint.
    pub parent_from_joint: Isometry3<f64>,
    /// How the child moves.
    pub motion: Motion,
    /// The joint's position as a sum of readings, `q = offset + Σ factor · reading`: `[(itself, 1)]` for an ordinary
    /// joint, `[(source, multiplier)]` for one that mimics, one more term for a declared coupling.
    pub law: Vec<(JointIndex, f64)>,
    /// rad or m.
    pub offset: f64,
}

/// The nominal robot: a tree of links. Joint and link indices are those of the [`RobotModel`] it was made from.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    pub(crate) links: usize,
    pub(crate) joints: Vec<ChainJoint>,
    /// Joints sorted so that a parent comes before its children.
    order: Vec<usize>,
    /// The place of each joint in the alphabetical order of names; in its own order where there are none.
    pub(crate) alphabet: Vec<usize>,
}

/// The joints of a chain do not form a tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ChainError {
    /// A joint names a link or a joint that does not exist.
    #[error("joint {joint} refers to a link or joint that the chain does not have")]
    UnknownIndex {
        /// Index of the joint.
        joint: usize,
    },
    /// A link has two parents, or the joints form a loop.
    #[error("joint {joint} closes a loop: each link needs exactly one path from the root")]
    NotATree {
        /// Index of a joint that is not reached from the root.
        joint: usize,
    },
}

impl Chain {
    /// A chain of `links` links from its joints; link 0 need not be the root.
    ///
    /// # Errors
    /// [`ChainError`] when an index does not exist or the joints form no tree.
    pub fn new(links: usize, joints: Vec<ChainJoint>) -> Result<Self, ChainError> {
        let mut has_parent = vec![false; links];
        for (j, joint) in joints.iter().enumerate() {
            let known = joint.parent.0 < links
                && joint.child.0 < links
                && joint.law.iter().all(|(source, _)| source.0 < joints.len());
            if !known {
                return Err(ChainError::UnknownIndex { joint: j });
            }
            if std::mem::replace(&mut has_parent[joint.child.0], true) {
                return Err(ChainError::NotATree { joint: j });
            }
        }
        let mut reached: Vec<bool> = has_parent.iter().map(|p| !p).collect();
        let mut order = Vec::with_capacity(joints.len());
        let mut waiting: Vec<usize> = (0..joints.len()).collect();
        while !waiting.is_empty() {
            let before = waiting.len();
            waiting.retain(|&j| {
                let ready = reached[joints[j].parent.0];
                if ready {
                    reached[joints[j].child.0] = true;
                    order.push(j);
                }
                !ready
            });
            if waiting.len() == before {
                return Err(ChainError::NotATree { joint: waiting[0] });
            }
        }
        Ok(Self {
            links,
            alphabet: (0..joints.len()).collect(),
            joints,
            order,
        })
    }

    /// The chain of a robot model, with the same joint and link indices; mimics become laws.
    ///
    /// # Errors
    /// [`ChainError`] for a model whose joints form no tree (a [`RobotModel`] that was read is one).
    pub fn from_model(model: &RobotModel) -> Result<Self, ChainError> {
        let joints = model.joints().iter().map(|joint| ChainJoint {
            parent: LinkIndex(joint.parent.index()),
            child: LinkIndex(joint.child.index()),
            parent_from_joint: joint.parent_link_from_joint,
            motion: match joint.kind {
                JointKind::Fixed => Motion::Fixed,
                JointKind::Revolute { axis } | JointKind::Continuous { axis } => {
                    Motion::Revolute(axis)
                }
                JointKind::Prismatic { axis } => Motion::Prismatic(axis),
            },
            law: vec![(JointIndex(joint.law.source.index()), joint.law.multiplier)],
            offset: joint.law.offset,
        });
        let mut chain = Self::new(model.links().len(), joints.collect())?;
        let mut sorted: Vec<usize> = (0..chain.joints.len()).collect();
        sorted.sort_by_key(|j| &model.joints()[*j].name);
        for (place, joint) in sorted.into_iter().enumerate() {
            chain.alphabet[joint] = place;
        }
        Ok(chain)
    }

    /// The same chain with a declared coupling: `q_joint += factor · reading_source`.
    ///
    /// Indices that do not exist change nothing.
    #[must_use]
    pub fn with_coupling(mut self, joint: JointIndex, source: JointIndex, factor: f64) -> Self {
        if source.0 < self.joints.len()
            && let Some(joint) = self.joints.get_mut(joint.0)
        {
            joint.law.push((source, factor));
        }
        self
    }

    /// The same chain with a declared gain: every term of the joint's law is multiplied.
    ///
    /// An index that does not exist changes nothing.
    #[must_use]
    pub fn with_gain(mut self, joint: JointIndex, gain: f64) -> Self {
        if let Some(joint) = self.joints.get_mut(joint.0) {
            joint.law.iter_mut().for_each(|term| term.1 *= gain);
        }
        self
    }

    /// The same chain with another axis of a joint that moves.
    ///
    /// An index that does not exist changes nothing.
    #[must_use]
    pub fn with_axis(mut self, joint: JointIndex, to: Unit<Vector3<f64>>) -> Self {
        if let Some(Motion::Revolute(axis) | Motion::Prismatic(axis)) =
            self.joints.get_mut(joint.0).map(|joint| &mut joint.motion)
        {
            *axis = to;
        }
        self
    }

    /// All joints.
    #[must_use]
    pub fn joints(&self) -> &[ChainJoint] {
        &self.joints
    }

    /// Number of links.
    #[must_use]
    pub fn links(&self) -> usize {
        self.links
    }

    /// The joints from the root to a link, root first; fixed ones included.
    #[must_use]
    pub fn path(&self, link: LinkIndex) -> Vec<JointIndex> {
        let mut path = Vec::new();
        let mut at = link;
        while let Some(j) = self.joints.iter().position(|joint| joint.child == at) {
            path.push(JointIndex(j));
            at = self.joints[j].parent;
        }
        path.reverse();
        path
    }

    /// A joint and all that it carries, in the order of the chain.
    pub(crate) fn carried(&self, joint: JointIndex) -> Vec<JointIndex> {
        let joints = (0..self.joints.len()).map(JointIndex);
        let is_carried = |j: &JointIndex| self.path(self.joints[j.0].child).contains(&joint);
        joints.filter(is_carried).collect()
    }

    /// The readings that move a link.
    pub(crate) fn readings_of(&self, link: LinkIndex) -> Vec<JointIndex> {
        let mut readings: Vec<JointIndex> = self
            .path(link)
            .iter()
            .map(|j| &self.joints[j.0])
            .filter(|joint| joint.motion != Motion::Fixed)
            .flat_map(|joint| {
                joint
                    .law
                    .iter()
                    .filter(|term| term.1 != 0.0)
                    .map(|term| term.0)
            })
            .collect();
        readings.sort_unstable();
        readings.dedup();
        readings
    }

    /// The link at the root side of all fixed joints above a link: links with the same one move together.
    pub(crate) fn rigid_group(&self, link: LinkIndex) -> LinkIndex {
        let mut at = link;
        while let Some(joint) = self.joints.iter().find(|joint| joint.child == at) {
            if joint.motion != Motion::Fixed {
                break;
            }
            at = joint.parent;
        }
        at
    }

    /// Whether the joint turns (or slides) something itself; `None` for a fixed one. The joint is one of the chain.
    pub fn turns(&self, joint: usize) -> Option<bool> {
        match self.joints[joint].motion {
            Motion::Fixed => None,
            Motion::Revolute(_) => Some(true),
            Motion::Prismatic(_) => Some(false),
        }
    }

    /// The position of a joint (rad or m).
    pub(crate) fn position(&self, joint: usize, readings: &[f64]) -> f64 {
        let joint = &self.joints[joint];
        // q = offset + Σ factor · reading
        joint
            .law
            .iter()
            .fold(joint.offset, |sum, (source, factor)| {
                sum + factor * readings[source.0]
            })
    }
}

/// Rotation and translation `a_from_b` in bare matrices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pose {
    /// Orthogonal.
    pub r: Matrix3<f64>,
    /// m.
    pub t: Vector3<f64>,
}

impl Pose {
    pub(crate) const IDENTITY: Pose = Pose {
        r: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        t: Vector3::new(0.0, 0.0, 0.0),
    };
}

#[derive(Debug, Clone)]
struct Step {
    joint: usize,
    parent: usize,
    child: usize,
    origin: Pose,
    motion: Motion,
}

/// Forward kinematics of the links that carry bodies: only the joints above them are walked.
#[derive(Debug, Clone)]
pub(crate) struct Walk {
    steps: Vec<Step>,
    /// `root_from_link`, at the link's index; links that are not walked keep the identity.
    pub root_from_link: Vec<Pose>,
    /// `root_from_joint` before the motion, at the joint's index.
    pub root_from_joint: Vec<Pose>,
}

impl Walk {
    pub(crate) fn new(chain: &Chain, links: &[LinkIndex]) -> Self {
        let mut wanted = vec![false; chain.joints.len()];
        for link in links {
            for joint in chain.path(*link) {
                wanted[joint.0] = true;
            }
        }
        let steps = chain.order.iter().filter(|&&j| wanted[j]).map(|&j| {
            let joint = &chain.joints[j];
            Step {
                joint: j,
                parent: joint.parent.0,
                child: joint.child.0,
                origin: Pose {
                    r: joint
                        .parent_from_joint
                        .rotation
                        .to_rotation_matrix()
                        .into_inner(),
                    t: joint.parent_from_joint.translation.vector,
                },
                motion: joint.motion,
            }
        });
        Self {
            steps: steps.collect(),
            root_from_link: vec![Pose::IDENTITY; chain.links],
            root_from_joint: vec![Pose::IDENTITY; chain.joints.len()],
        }
    }

    /// Fills `root_from_link` and `root_from_joint` for one row of readings.
    pub(crate) fn go(&mut self, chain: &Chain, readings: &[f64]) {
        for step in &self.steps {
            let parent = self.root_from_link[step.parent];
            // root_from_joint = root_from_parent · parent_from_joint
            let joint = Pose {
                r: parent.r * step.origin.r,
                t: parent.r * step.origin.t + parent.t,
            };
            self.root_from_joint[step.joint] = joint;
            self.root_from_link[step.child] = match step.motion {
                Motion::Fixed => joint,
                Motion::Revolute(axis) => Pose {
                    r: joint.r * rotation(&axis, chain.position(step.joint, readings)),
                    t: joint.t,
                },
                Motion::Prismatic(axis) => Pose {
                    r: joint.r,
                    t: joint.t + joint.r * axis.into_inner() * chain.position(step.joint, readings),
                },
            };
        }
    }
}

/// The axis of a joint in the root frame, at one row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    direction: Vector3<f64>,
    /// A point of it, m.
    origin: Vector3<f64>,
}

impl Axis {
    /// Of a joint whose frame stands here.
    pub(super) fn of(root_from_joint: &Pose, motion: &Motion) -> Self {
        Self {
            direction: match motion {
                Motion::Fixed => Vector3::zeros(),
                Motion::Revolute(axis) | Motion::Prismatic(axis) => {
                    root_from_joint.r * axis.into_inner()
                }
            },
            origin: root_from_joint.t,
        }
    }

    /// A pose behind the joint, with the joint `by` (rad or m) further.
    pub(super) fn moved(&self, turns: bool, by: f64, pose: &Pose) -> Pose {
        if turns {
            let r = rotation(&self.direction, by);
            Pose {
                r: r * pose.r,
                t: self.origin + r * (pose.t - self.origin),
            }
        } else {
            Pose {
                r: pose.r,
                t: pose.t + self.direction * by,
            }
        }
    }
}

/// Rodrigues: `R = cos q · I + sin q · [a]ₓ + (1 − cos q) · a aᵀ`.
fn rotation(axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    let (s, c) = angle.sin_cos();
    let (x, y, z) = (axis.x, axis.y, axis.z);
    let k = 1.0 - c;
    Matrix3::new(
        c + k * x * x,
        k * x * y - s * z,
        k * x * z + s * y,
        k * x * y + s * z,
        c + k * y * y,
        k * y * z - s * x,
        k * x * z - s * y,
        k * y * z + s * x,
        c + k * z * z,
    )
}
