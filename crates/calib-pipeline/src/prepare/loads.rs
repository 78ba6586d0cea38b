//! What gravity does to the joints: torque about, force along and torques across the axis of each, by all that it carries.
//!
//! ```text
//! τ_j = z_j · Σ_{links k carried by j} (c_k − o_j) × m_k g,   c_k in the root's frame             (1)
//! ∂τ_j/∂h_k = z_j · (R_k × g)                            h_k: first moment, kg m, in link k's frame
//! ```
//!
//! τ is what gravity exerts: a joint that gives way turns along it.

use calib_core::effect::Drives;
use calib_core::{Axis, EffectKind};
use calib_profile::{Prior, RobotLoad};
use calib_urdf::{JointId, LinkId, RobotModel};
use nalgebra::{Isometry3, Matrix3, Unit, UnitQuaternion, Vector3};

/// What loads the joints of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Masses {
    /// Nominal geometry, with all that gravity acts on.
    loaded: RobotModel,
    /// The same without payloads, whose masses are known.
    unladen: RobotModel,
    /// Gravity in the root's frame, m/s².
    gravity: Vector3<f64>,
    /// First moments that were found beyond these, by link, in its frame, kg m.
    beyond: Vec<Vector3<f64>>,
    /// Joints, each before the one that carries it.
    leaves_first: Vec<JointId>,
    /// By joint index.
    drives: Vec<Drive>,
    /// From the joint before that moves, m, in the joint's axes, by joint index: the lengths that grow with temperature.
    reach: Vec<Vector3<f64>>,
    /// Mass that was assumed because the URDF has none, kg.
    pub assumed: Option<f64>,
}

/// A first moment as a parameter: of this link, along this axis of its frame.
pub type FirstMoment = (LinkId, usize);

/// What is stated of a joint's drive.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Drive {
    /// Turns of the motor per turn of the joint; 0 where it is not stated.
    pub gear_ratio: f64,
    /// Load that friction holds, N m or N.
    pub friction: f64,
}

/// What the load exerts on the joints at one posture, and what their drives are.
#[derive(Debug, Clone, PartialEq)]
pub struct Loads {
    /// By joint index.
    pub drives: Vec<Drive>,
    /// About each joint's axis, N m; along that of a prismatic one, N; by joint index.
    pub about_axis: Vec<f64>,
    /// About the two axes across, N m.
    pub across: Vec<[f64; 2]>,
}

impl Masses {
    /// Of a robot, as a profile states its loads.
    #[must_use]
    pub fn of(model: &RobotModel, load: &RobotLoad) -> Self {
        let unladen = load.unladen(model);
        let mut leaves_first: Vec<JointId> = model.joint_ids().collect();
        leaves_first.sort_by_key(|j| {
            let depth = model.chain_to_root(model.joint(*j).child).len();
            (std::cmp::Reverse(depth), j.index())
        });
        Self {
            gravity: load.gravity(),
            drives: model
                .joint_ids()
                .map(|joint| Drive {
                    gear_ratio: load.gear_ratio.get(&joint).copied().unwrap_or(0.0),
                    friction: load.friction.get(&joint).copied().unwrap_or(0.0),
                })
                .collect(),
            reach: model.joint_ids().map(|j| model.reach(j)).collect(),
            beyond: vec![Vector3::zeros(); model.links().len()],
            leaves_first,
            assumed: (!model.has_masses()).then(|| unladen.total_mass()),
            loaded: load.loaded(model),
            unladen,
        }
    }

    /// Takes first moments as they were found beyond the ones that are given, kg m.
    pub fn add(&mut self, (link, axis): FirstMoment, value: f64) {
        self.beyond[link.index()][axis] += value;
    }

    /// First moments that were found beyond the given ones, by link index, in the link's frame, kg m.
    #[must_use]
    pub fn beyond(&self) -> &[Vector3<f64>] {
        &self.beyond
    }

    /// Gravity in the root's frame, m/s².
    #[must_use]
    pub fn gravity(&self) -> Vector3<f64> {
        self.gravity
    }

    /// Drives by joint index.
    #[must_use]
    pub fn drives(&self) -> &[Drive] {
        &self.drives
    }

    /// Lengths that lead to the joints, from the joint before that moves, m, in their axes, by joint index; nominal.
    #[must_use]
    pub fn reach(&self) -> &[Vector3<f64>] {
        &self.reach
    }

    /// The nominal robot with all masses that are given or assumed.
    #[must_use]
    pub fn loaded(&self) -> &RobotModel {
        &self.loaded
    }

    /// Minus the torques that the joints were measured to hold about their axes, N m by joint index, where there are; gravity
    /// otherwise, and across the axes.
    #[must_use]
    pub fn under(&self, q: &[f64], held: Option<&[f64]>) -> Loads {
        let mut loads = self.at(q);
        if let Some(held) = held {
            loads.about_axis = held.iter().map(|torque| -torque).collect();
        }
        loads
    }

    /// Gravity alone.
    #[must_use]
    pub fn at(&self, q: &[f64]) -> Loads {
        let model = &self.loaded;
        let n = model.joints().len();
        let poses = model.forward_kinematics(q);
        let (mass, moment) = self.carried(&poses);
        let mut loads = Loads {
            drives: self.drives.clone(),
            about_axis: vec![0.0; n],
            across: vec![[0.0; 2]; n],
        };
        for joint in model.joint_ids() {
            let Some(frame) = Frame::of(model, joint, &poses) else {
                continue;
            };
            let child = model.joint(joint).child.index();
            let about_origin = moment[child] - mass[child] * frame.origin;
            let torque = about_origin.cross(&self.gravity);
            let force = self.gravity * mass[child];
            let turns = model.joint(joint).kind.turns();
            loads.about_axis[joint.index()] = frame.axis.dot(if turns { &torque } else { &force });
            if turns {
                loads.across[joint.index()] = frame.across.map(|e| e.dot(&torque));
            }
        }
        loads
    }

    /// Mass (kg) and first moment about the root's origin (kg m, root's frame) of every link with all that it carries.
    fn carried(&self, poses: &[Isometry3<f64>]) -> (Vec<f64>, Vec<Vector3<f64>>) {
        let model = &self.loaded;
        let mut mass = vec![0.0; poses.len()];
        let mut moment = vec![Vector3::zeros(); poses.len()];
        for link in model.link_ids() {
            let k = link.index();
            if let Some(inertial) = model.link(link).inertial {
                mass[k] = inertial.mass;
                moment[k] = (poses[k] * inertial.center_of_mass).coords * inertial.mass;
            }
            moment[k] += poses[k].rotation * self.beyond[k];
        }
        for joint in &self.leaves_first {
            let joint = model.joint(*joint);
            let (parent, child) = (joint.parent.index(), joint.child.index());
            mass[parent] += mass[child];
            let below = moment[child];
            moment[parent] += below;
        }
        (mass, moment)
    }

    /// How the regressor of a term at a joint follows first moments, N m per kg m.
    #[must_use]
    pub fn shares(
        &self,
        q: &[f64],
        joint: JointId,
        kind: EffectKind,
        moments: &[FirstMoment],
    ) -> Vec<f64> {
        let model = &self.loaded;
        let poses = model.forward_kinematics(q);
        let turning = model.joint(joint).kind.turns();
        let Some(frame) = Frame::of(model, joint, &poses).filter(|_| turning) else {
            return vec![0.0; moments.len()];
        };
        let along = match kind.drives() {
            Drives::Across(k) => frame.across[k],
            _ => frame.axis,
        };
        let share = |(link, axis): &FirstMoment| {
            if model.carries(joint, *link) {
                let lever = poses[link.index()].rotation * Matrix3::identity().column(*axis);
                along.dot(&lever.cross(&self.gravity))
            } else {
                0.0
            }
        };
        moments.iter().map(share).collect()
    }

    /// Prior σ of a moved link's first moment along its axes, kg m: of its own mass, of what is fixed to it, and of the
    /// masses that hang on it further out, each as if it were at its joint's origin.
    #[must_use]
    pub fn moment_sigma(&self, link: LinkId, prior: &Prior) -> Vector3<f64> {
        let robot = &self.unladen;
        let mut variance = Vector3::zeros();
        let mut rigid = vec![(link, Isometry3::identity())];
        while let Some((link, place)) = rigid.pop() {
            let of = robot.link(link);
            if let Some(inertial) = of.inertial {
                let center = place * inertial.center_of_mass;
                let spread = center.coords.map(|c| (prior.mass * c).powi(2));
                let spread = spread.add_scalar(prior.mass_center.powi(2));
                variance += spread * inertial.mass.powi(2);
            }
            for id in &of.child_joints {
                let joint = robot.joint(*id);
                let place = place * joint.parent_link_from_joint;
                if joint.kind.axis().is_none() {
                    rigid.push((joint.child, place));
                    continue;
                }
                let further = robot.link_ids().filter(|l| robot.carries(*id, *l));
                let masses = further.filter_map(|l| robot.link(l).inertial);
                let squares: f64 = masses.map(|i| (prior.mass * i.mass).powi(2)).sum();
                variance += place.translation.vector.map(|r| r * r) * squares;
            }
        }
        variance.map(f64::sqrt)
    }
}

/// A joint's axes in the root's frame.
struct Frame {
    origin: Vector3<f64>,
    axis: Vector3<f64>,
    /// These turn with the joint.
    across: [Vector3<f64>; 2],
}

impl Frame {
    /// `None` for a fixed joint.
    fn of(model: &RobotModel, joint: JointId, poses: &[Isometry3<f64>]) -> Option<Self> {
        let j = model.joint(joint);
        let axis: Unit<Vector3<f64>> = j.kind.axis()?;
        let root_from_joint = poses[j.parent.index()] * j.parent_link_from_joint;
        let root_from_child: UnitQuaternion<f64> = poses[j.child.index()].rotation;
        Some(Self {
            origin: root_from_joint.translation.vector,
            axis: root_from_joint.rotation * axis.into_inner(),
            across: Axis::Revolute(axis).across().map(|e| root_from_child * e),
        })
    }
}
