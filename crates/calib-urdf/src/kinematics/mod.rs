//! Forward kinematics, chains, Jacobians and gravity torques: pure functions of (model, joint positions).
//!
//! Joint positions are a slice with one entry for each joint of the model, at [`JointId::index`], rad
//! or m. Entries of fixed and of mimicking joints are not looked at; entries that are missing at the end count as 0.

pub mod axes;
pub mod rpy;

use crate::model::{JointId, JointKind, LinkId, RobotModel, UnknownName};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3, Vector6};
use std::collections::BTreeMap;

/// Which way a chain passes a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Passing {
    /// From the parent link to the child link.
    Forward,
    /// From the child link to the parent link.
    Backward,
}

impl Passing {
    /// +1 forward, −1 backward: the sign with which the joint's motion enters.
    #[must_use]
    pub fn sign(self) -> f64 {
        match self {
            Self::Forward => 1.0,
            Self::Backward => -1.0,
        }
    }
}

/// One joint on the way from a link to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChainStep {
    /// The joint that is passed.
    pub joint: JointId,
    /// Which way.
    pub passing: Passing,
}

impl RobotModel {
    /// All joints at 0.
    #[must_use]
    pub fn zero_positions(&self) -> Vec<f64> {
        vec![0.0; self.joints.len()]
    }

    /// A vector of joint positions (rad or m) from names; joints that are not named stand at 0.
    ///
    /// # Errors
    /// [`UnknownName`], with the nearest joint.
    pub fn positions(&self, by_name: &BTreeMap<String, f64>) -> Result<Vec<f64>, UnknownName> {
        let mut q = self.zero_positions();
        for (name, position) in by_name {
            q[self.joint_id(name)?.index()] = *position;
        }
        Ok(q)
    }

    /// Where a joint stands (rad or m) with its mimics followed; 0 for a fixed joint.
    #[must_use]
    pub fn position(&self, q: &[f64], joint: JointId) -> f64 {
        let law = self.joint(joint).law;
        let source = q.get(law.source.index()).copied().unwrap_or(0.0);
        // q = multiplier · q_source + offset
        law.multiplier * source + law.offset
    }

    /// `joint_from_child(q)`, the motion of one joint alone.
    #[must_use]
    pub fn motion(&self, q: &[f64], joint: JointId) -> Isometry3<f64> {
        match self.joint(joint).kind {
            JointKind::Fixed => Isometry3::identity(),
            JointKind::Revolute { axis } | JointKind::Continuous { axis } => Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&axis, self.position(q, joint)),
            ),
            JointKind::Prismatic { axis } => Isometry3::from_parts(
                Translation3::from(axis.into_inner() * self.position(q, joint)),
                UnitQuaternion::identity(),
            ),
        }
    }

    /// `parent_from_child(q) = parent_link_from_joint · joint_from_child(q)`.
    #[must_use]
    pub fn parent_from_child(&self, q: &[f64], joint: JointId) -> Isometry3<f64> {
        self.joint(joint).parent_link_from_joint * self.motion(q, joint)
    }

    /// `root_from_link` of every link, at [`LinkId::index`].
    #[must_use]
    pub fn forward_kinematics(&self, q: &[f64]) -> Vec<Isometry3<f64>> {
        let mut root_from_link = Vec::new();
        self.forward_kinematics_into(q, &mut root_from_link);
        root_from_link
    }

    /// [`RobotModel::forward_kinematics`] into a vector that is used again.
    pub fn forward_kinematics_into(&self, q: &[f64], root_from_link: &mut Vec<Isometry3<f64>>) {
        root_from_link.clear();
        root_from_link.resize(self.links.len(), Isometry3::identity());
        for &id in &self.from_root {
            let joint = self.joint(id);
            // root_from_child = root_from_parent · parent_from_child
            root_from_link[joint.child.index()] =
                root_from_link[joint.parent.index()] * self.parent_from_child(q, id);
        }
    }

    /// `root_from_link` of every link, the motion `joint_from_child` of each joint being given by the caller.
    #[must_use]
    pub fn forward_kinematics_with(
        &self,
        mut motion: impl FnMut(JointId) -> Isometry3<f64>,
    ) -> Vec<Isometry3<f64>> {
        let mut root_from_link = vec![Isometry3::identity(); self.links.len()];
        for &id in &self.from_root {
            let joint = self.joint(id);
            // root_from_child = root_from_parent · parent_from_joint · joint_from_child
            root_from_link[joint.child.index()] =
                root_from_link[joint.parent.index()] * joint.parent_link_from_joint * motion(id);
        }
        root_from_link
    }

    /// `root_from_link` of one link: only its own chain is computed.
    #[must_use]
    pub fn root_from_link(&self, q: &[f64], link: LinkId) -> Isometry3<f64> {
        self.up(link).fold(Isometry3::identity(), |below, joint| {
            self.parent_from_child(q, joint) * below
        })
    }

    /// `from_link_from_to_link`: the pose of `to` in the frame of `from`.
    #[must_use]
    pub fn link_from_link(&self, q: &[f64], from: LinkId, to: LinkId) -> Isometry3<f64> {
        let mut from_from_here = Isometry3::identity();
        for step in self.chain(from, to) {
            let parent_from_child = self.parent_from_child(q, step.joint);
            from_from_here *= match step.passing {
                Passing::Forward => parent_from_child,
                Passing::Backward => parent_from_child.inverse(),
            };
        }
        from_from_here
    }

    fn up(&self, link: LinkId) -> impl Iterator<Item = JointId> + '_ {
        std::iter::successors(self.link(link).parent_joint, |joint| {
            self.link(self.joint(*joint).parent).parent_joint
        })
    }

    /// The joints from a link up to the root, nearest joint first; fixed ones included.
    #[must_use]
    pub fn chain_to_root(&self, link: LinkId) -> Vec<JointId> {
        self.up(link).collect()
    }

    /// The length that leads to a joint: from the joint before it that moves, or from the root, to its origin, m, in its axes.
    #[must_use]
    pub fn reach(&self, joint: JointId) -> Vector3<f64> {
        let mut before_from_joint = self.joint(joint).parent_link_from_joint;
        for fixed in self.up(self.joint(joint).parent) {
            let fixed = self.joint(fixed);
            if fixed.kind.axis().is_some() {
                break;
            }
            before_from_joint = fixed.parent_link_from_joint * before_from_joint;
        }
        let rotation = before_from_joint.rotation;
        rotation.inverse() * before_from_joint.translation.vector
    }

    /// The joints from one link to another through the last link that both hang on; fixed ones included.
    #[must_use]
    pub fn chain(&self, from: LinkId, to: LinkId) -> Vec<ChainStep> {
        let mut up = self.chain_to_root(from);
        let mut down = self.chain_to_root(to);
        while let (Some(a), Some(b)) = (up.last(), down.last()) {
            if a != b {
                break;
            }
            up.pop();
            down.pop();
        }
        let up = up.into_iter().map(|joint| ChainStep {
            joint,
            passing: Passing::Backward,
        });
        let down = down.into_iter().rev().map(|joint| ChainStep {
            joint,
            passing: Passing::Forward,
        });
        up.chain(down).collect()
    }

    /// Does the link move when this joint does (mimics aside)?
    #[must_use]
    pub fn carries(&self, joint: JointId, link: LinkId) -> bool {
        self.up(link).any(|above| above == joint)
    }

    /// Columns of the geometric Jacobian of a link, twists `[ω; v]` in the **link's** frame:
    ///
    /// ```text
    /// root_from_link(q + dq) = root_from_link(q) · exp(Σ J_j dq_j)          to first order
    /// ```
    ///
    /// One column for each independent joint that moves the link, root first; a mimicking joint adds to its source's column.
    #[must_use]
    pub fn jacobian(&self, q: &[f64], link: LinkId) -> Vec<(JointId, Vector6<f64>)> {
        let mut columns: Vec<(JointId, Vector6<f64>)> = Vec::new();
        let mut child_from_link = Isometry3::identity();
        for id in self.up(link) {
            let joint = self.joint(id);
            let link_from_child = child_from_link.inverse();
            let column = match joint.kind {
                JointKind::Fixed => None,
                // ω = R·a,  v = p × ω: the joint's frame stands at p in the link, and its axis is not moved by itself
                JointKind::Revolute { axis } | JointKind::Continuous { axis } => {
                    let omega = link_from_child * axis.into_inner();
                    Some(stacked(
                        &omega,
                        &link_from_child.translation.vector.cross(&omega),
                    ))
                }
                JointKind::Prismatic { axis } => Some(stacked(
                    &Vector3::zeros(),
                    &(link_from_child * axis.into_inner()),
                )),
            };
            if let Some(column) = column {
                let law = joint.law;
                match columns.iter_mut().find(|(source, _)| *source == law.source) {
                    Some((_, sum)) => *sum += law.multiplier * column,
                    None => columns.push((law.source, law.multiplier * column)),
                }
            }
            child_from_link = self.parent_from_child(q, id) * child_from_link;
        }
        columns.reverse();
        columns
    }

    /// What each joint has to hold against gravity (N·m for turning joints, N for sliding ones), at [`JointId::index`].
    ///
    /// `gravity_in_root` is the acceleration of free fall in the root link's frame, (0, 0, −9.81) m/s² for an upright base.
    ///
    /// ```text
    /// τ_j = −Σ_{links i carried by j}  a_j · ((c_i − p_j) × m_i g)          turning
    /// τ_j = −Σ_{links i carried by j}  a_j · m_i g                          sliding
    /// ```
    ///
    /// It is ∂U/∂q_j of the potential energy U = −Σ m_i g·c_i, each joint taken alone (mimics not summed up). Links without `<inertial>` weigh nothing.
    #[must_use]
    pub fn gravity_torques(&self, q: &[f64], gravity_in_root: &Vector3<f64>) -> Vec<f64> {
        let root_from_link = self.forward_kinematics(q);
        // Mass and first moment Σ m·c (in the root frame) of everything that a link carries, itself included.
        let mut mass = vec![0.0; self.links.len()];
        let mut moment = vec![Vector3::zeros(); self.links.len()];
        for (i, link) in self.links.iter().enumerate() {
            if let Some(inertial) = link.inertial {
                mass[i] = inertial.mass;
                moment[i] = inertial.mass * (root_from_link[i] * inertial.center_of_mass).coords;
            }
        }
        let mut torque = vec![0.0; self.joints.len()];
        for &id in self.from_root.iter().rev() {
            let joint = self.joint(id);
            let child = joint.child.index();
            let root_from_joint = &root_from_link[child];
            torque[id.index()] = match joint.kind {
                JointKind::Fixed => 0.0,
                JointKind::Revolute { axis } | JointKind::Continuous { axis } => {
                    let axis = root_from_joint.rotation * axis.into_inner();
                    let arm_times_mass =
                        moment[child] - mass[child] * root_from_joint.translation.vector;
                    -axis.dot(&arm_times_mass.cross(gravity_in_root))
                }
                JointKind::Prismatic { axis } => -(root_from_joint.rotation * axis.into_inner())
                    .dot(&(mass[child] * gravity_in_root)),
            };
            let parent = joint.parent.index();
            mass[parent] += mass[child];
            let below = moment[child];
            moment[parent] += below;
        }
        torque
    }

    /// Mass (kg) and center of mass (m, root frame) of the whole robot; `None` where no link has a mass.
    #[must_use]
    pub fn center_of_mass(&self, q: &[f64]) -> Option<(f64, Point3<f64>)> {
        let root_from_link = self.forward_kinematics(q);
        let mut mass = 0.0;
        let mut moment = Vector3::zeros();
        for (link, root_from_link) in self.links.iter().zip(&root_from_link) {
            if let Some(inertial) = link.inertial {
                mass += inertial.mass;
                moment += inertial.mass * (root_from_link * inertial.center_of_mass).coords;
            }
        }
        (mass > 0.0).then(|| (mass, Point3::from(moment / mass)))
    }
}

fn stacked(omega: &Vector3<f64>, v: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(omega.x, omega.y, omega.z, v.x, v.y, v.z)
}
