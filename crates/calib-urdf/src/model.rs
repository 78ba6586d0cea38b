//! The robot as a plain arena: links, joints, typed indices.

use crate::error::ReadProblem;
use calib_finding::nearest_word;
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use thiserror::Error;

/// A link of one [`RobotModel`], in the order of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct LinkId(pub(crate) u32);

/// A joint of one [`RobotModel`], in the order of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct JointId(pub(crate) u32);

impl LinkId {
    /// The position in [`RobotModel::links`] and in the result of the forward kinematics.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl JointId {
    /// The position in [`RobotModel::joints`] and in a vector of joint positions.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// How a joint moves. An axis exists only where it means something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum JointKind {
    /// Does not move.
    Fixed,
    /// Turns between limits, rad.
    Revolute {
        /// In the joint's frame.
        axis: Unit<Vector3<f64>>,
    },
    /// Turns without limits, rad.
    Continuous {
        /// In the joint's frame.
        axis: Unit<Vector3<f64>>,
    },
    /// Slides, m.
    Prismatic {
        /// In the joint's frame.
        axis: Unit<Vector3<f64>>,
    },
}

impl JointKind {
    /// The axis in the joint's frame; `None` for a fixed joint.
    #[must_use]
    pub fn axis(&self) -> Option<Unit<Vector3<f64>>> {
        match *self {
            Self::Fixed => None,
            Self::Revolute { axis } | Self::Continuous { axis } | Self::Prismatic { axis } => {
                Some(axis)
            }
        }
    }

    /// Does it turn (rad) rather than slide or stand still?
    #[must_use]
    pub fn turns(&self) -> bool {
        matches!(self, Self::Revolute { .. } | Self::Continuous { .. })
    }

    /// The word that a URDF writes in `type`.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Fixed => "fixed",
            Self::Revolute { .. } => "revolute",
            Self::Continuous { .. } => "continuous",
            Self::Prismatic { .. } => "prismatic",
        }
    }
}

/// `<limit>` of a joint; each number as far as the file gives it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct JointLimits {
    /// Smallest position, rad or m.
    pub lower: Option<f64>,
    /// Largest position, rad or m.
    pub upper: Option<f64>,
    /// Largest torque or force, N·m or N.
    pub effort: Option<f64>,
    /// Largest speed, rad/s or m/s.
    pub velocity: Option<f64>,
}

impl JointLimits {
    /// Both position limits (rad or m), when the joint has any.
    ///
    /// A URDF that gives one means 0 by the other. A continuous joint has none.
    #[must_use]
    pub fn range(&self) -> Option<(f64, f64)> {
        match (self.lower, self.upper) {
            (None, None) => None,
            (lower, upper) => Some((lower.unwrap_or(0.0), upper.unwrap_or(0.0))),
        }
    }
}

/// `<mimic>` as written: `q = multiplier · q_source + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mimic {
    /// The joint that is mimicked; it may mimic another one.
    pub joint: JointId,
    /// 1 where the file gives none.
    pub multiplier: f64,
    /// rad or m; 0 where the file gives none.
    pub offset: f64,
}

/// What a joint's position comes to after all mimics are followed: `q = multiplier · q_source + offset`.
///
/// A joint that mimics nothing follows itself, with 1 and 0.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct MimicLaw {
    /// The joint that moves on its own.
    pub source: JointId,
    /// Product of the multipliers along the way.
    pub multiplier: f64,
    /// rad or m.
    pub offset: f64,
}

/// What gravity acts on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertial {
    /// kg.
    pub mass: f64,
    /// Center of mass in the link's frame, m.
    pub center_of_mass: Point3<f64>,
}

/// A rigid body of the robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Unique among links.
    pub name: String,
    /// The joint that hangs it on its parent; `None` for the root.
    pub parent_joint: Option<JointId>,
    /// The joints that hang on it, in the order of the file.
    pub child_joints: Vec<JointId>,
    /// `None` where the file gives no mass.
    pub inertial: Option<Inertial>,
}

/// A joint with its frame. The child link's frame is the joint's frame after the motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Unique among joints.
    pub name: String,
    /// The link it is mounted on.
    pub parent: LinkId,
    /// The link it carries.
    pub child: LinkId,
    /// `<origin>`; the identity where the file gives none.
    pub parent_link_from_joint: Isometry3<f64>,
    /// How it moves.
    pub kind: JointKind,
    /// As far as given.
    pub limits: JointLimits,
    /// As written.
    pub mimic: Option<Mimic>,
    /// With chains of mimics followed.
    pub law: MimicLaw,
}

/// A name that the model does not have.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("the robot `{robot}` has no {kind} `{name}`{}", hint(.nearest.as_deref()))]
pub struct UnknownName {
    /// The robot's name.
    pub robot: String,
    /// `joint` or `link`.
    pub kind: &'static str,
    /// What was asked for.
    pub name: String,
    /// What was probably meant.
    pub nearest: Option<String>,
}

impl UnknownName {
    pub(crate) fn among<'a>(
        robot: &str,
        kind: &'static str,
        name: &str,
        known: impl IntoIterator<Item = &'a str>,
    ) -> Self {
        Self {
            robot: robot.to_owned(),
            kind,
            name: name.to_owned(),
            nearest: nearest_word(name, known).map(str::to_owned),
        }
    }
}

fn hint(nearest: Option<&str>) -> String {
    nearest.map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}

/// A tree of links and joints, checked: one root, no circles, finite numbers, unit axes.
///
/// ```
/// use calib_urdf::RobotModel;
/// let text = r#"<robot name="arm">
///   <link name="base"/> <link name="tip"/>
///   <joint name="elbow" type="continuous">
///     <parent link="base"/> <child link="tip"/>
///     <origin xyz="0 0 0.5"/> <axis xyz="0 0 1"/>
///   </joint>
/// </robot>"#;
/// let model = RobotModel::from_urdf_text(text, "arm.urdf")?;
/// let mut q = model.zero_positions();
/// q[model.joint_id("elbow")?.index()] = 0.25;
/// let root_from_link = model.forward_kinematics(&q);
/// let tip = root_from_link[model.link_id("tip")?.index()];
/// assert_eq!(tip.translation.z, 0.5);
/// assert!((tip.rotation.angle() - 0.25).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// The two kinds of ids do not index each other:
///
/// ```compile_fail
/// # use calib_urdf::{JointId, LinkId, RobotModel};
/// fn wrong(model: &RobotModel, joint: JointId) -> &calib_urdf::Link { model.link(joint) }
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct RobotModel {
    pub(crate) name: String,
    pub(crate) links: Vec<Link>,
    pub(crate) joints: Vec<Joint>,
    pub(crate) root: LinkId,
    /// Every joint after the joint that carries its parent link.
    pub(crate) from_root: Vec<JointId>,
    pub(crate) link_ids: BTreeMap<String, LinkId>,
    pub(crate) joint_ids: BTreeMap<String, JointId>,
    pub(crate) warnings: Vec<ReadProblem>,
}

impl RobotModel {
    /// The robot's name; empty where the file gives none.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// All links; [`LinkId::index`] is the position.
    #[must_use]
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// All joints; [`JointId::index`] is the position.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// The ids of all links, in the order of the file.
    pub fn link_ids(&self) -> impl Iterator<Item = LinkId> + use<> {
        (0..self.links.len() as u32).map(LinkId)
    }

    /// The ids of all joints, in the order of the file.
    pub fn joint_ids(&self) -> impl Iterator<Item = JointId> + use<> {
        (0..self.joints.len() as u32).map(JointId)
    }

    /// The joints that move on their own: neither fixed nor mimicking. In the order of the file.
    pub fn independent_joints(&self) -> impl Iterator<Item = JointId> + '_ {
        self.joint_ids().filter(|id| {
            let joint = self.joint(*id);
            joint.kind != JointKind::Fixed && joint.mimic.is_none()
        })
    }

    /// What is wrong in the file and no reason to refuse the robot: a mimic of a fixed joint (the joint stands still),
    /// limits in the wrong order (the joint then has none).
    #[must_use]
    pub fn warnings(&self) -> &[ReadProblem] {
        &self.warnings
    }

    /// The only link without a parent.
    #[must_use]
    pub fn root(&self) -> LinkId {
        self.root
    }

    /// The link of an id of this model.
    #[must_use]
    pub fn link(&self, id: LinkId) -> &Link {
        &self.links[id.index()]
    }

    /// The joint of an id of this model.
    #[must_use]
    pub fn joint(&self, id: JointId) -> &Joint {
        &self.joints[id.index()]
    }

    /// The same robot with another origin of one joint.
    #[must_use]
    pub fn with_origin(mut self, joint: JointId, parent_link_from_joint: Isometry3<f64>) -> Self {
        self.joints[joint.index()].parent_link_from_joint = parent_link_from_joint;
        self
    }

    /// The same robot with a joint that moves differently (another axis, or fixed).
    #[must_use]
    pub fn with_kind(mut self, joint: JointId, kind: JointKind) -> Self {
        self.joints[joint.index()].kind = kind;
        self
    }

    /// # Errors
    /// [`UnknownName`], with the nearest name that exists.
    pub fn link_id(&self, name: &str) -> Result<LinkId, UnknownName> {
        self.link_ids.get(name).copied().ok_or_else(|| {
            UnknownName::among(
                &self.name,
                "link",
                name,
                self.link_ids.keys().map(String::as_str),
            )
        })
    }

    /// # Errors
    /// [`UnknownName`], with the nearest name that exists.
    pub fn joint_id(&self, name: &str) -> Result<JointId, UnknownName> {
        self.joint_ids.get(name).copied().ok_or_else(|| {
            UnknownName::among(
                &self.name,
                "joint",
                name,
                self.joint_ids.keys().map(String::as_str),
            )
        })
    }
}
