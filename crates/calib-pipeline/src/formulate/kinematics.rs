//! A robot as it is believed to be: corrected geometry, joint effects, where it stands and what is bolted to it.

use std::collections::BTreeMap;

use calib_geometry::so3;
use calib_urdf::{JointId, JointKind, LinkId, RobotModel};
use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::prepare::conditions::Conditions;
use crate::prepare::loads::{gravity_moments, has_masses};

/// What the reading of one joint leaves out.
///
/// ```text
/// φ = q + offset + gain·q + c·(cos q − 1) + s·sin q + compliance·τ + backlash·a + Σ_k coupling_k·q_k   (1)
/// joint_from_child = exp(axis φ) · Exp(lateral₁ τ₁ e₁ + lateral₂ τ₂ e₂)                            (2)
/// ```
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JointEffects {
    /// Zero offset, rad or m.
    pub offset: f64,
    /// Gain error, 1.
    pub gain: f64,
    /// Eccentricity, cosine part, rad.
    pub eccentricity_cos: f64,
    /// Eccentricity, sine part, rad.
    pub eccentricity_sin: f64,
    /// Turn per holding torque about the axis, rad per N m.
    pub compliance: f64,
    /// Turn per holding torque about the two axes across, rad per N m.
    pub lateral: [f64; 2],
    /// Half of the play, rad or m; a of equation (1) is the direction of approach, ±1.
    pub backlash: f64,
    /// Share of other joints' readings.
    pub coupling: BTreeMap<JointIndex, f64>,
}

/// Index of a joint in its model, serialisable.
pub type JointIndex = usize;

impl JointEffects {
    /// Whether a URDF can hold them: only a zero offset can be put into an origin.
    #[must_use]
    pub fn fits_into_urdf(&self) -> bool {
        let rest = Self {
            offset: 0.0,
            ..self.clone()
        };
        rest == Self::default()
    }
}

/// A robot, its effects, its place and its bodies.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// Geometry: origins without zero offsets.
    pub model: RobotModel,
    /// The robot as described: loads are computed from it, as in the fit.
    pub described: RobotModel,
    /// Effects by joint index.
    pub effects: Vec<JointEffects>,
    /// `tracker_from_root`.
    pub tracker_from_root: Isometry3<f64>,
    /// `link_from_body` of bodies that have a frame.
    pub mounts: BTreeMap<String, Isometry3<f64>>,
    /// Markers on their link, m, by body then marker, where they are known.
    pub points: BTreeMap<String, BTreeMap<String, Point3<f64>>>,
    /// Touching points in their links' frames, m, by name.
    pub contact_points: BTreeMap<String, Point3<f64>>,
    /// Frames of touched things (z along normal or direction) in what they are fixed to, by contact.
    pub places: BTreeMap<String, Isometry3<f64>>,
}

impl Calibration {
    /// A robot that is exactly as described.
    #[must_use]
    pub fn nominal(model: &RobotModel, tracker_from_root: Isometry3<f64>) -> Self {
        Self {
            model: model.clone(),
            described: model.clone(),
            effects: vec![JointEffects::default(); model.joints().len()],
            tracker_from_root,
            mounts: BTreeMap::new(),
            points: BTreeMap::new(),
            contact_points: BTreeMap::new(),
            places: BTreeMap::new(),
        }
    }

    /// `root_from_link` of all links at indicated joint positions (by joint index, rad or m), nothing else being
    /// known: in the middle of all play, loaded by gravity.
    #[must_use]
    pub fn root_from_link(&self, q: &[f64]) -> Vec<Isometry3<f64>> {
        self.root_from_link_under(q, &Conditions::default())
    }

    /// The same under known circumstances.
    #[must_use]
    pub fn root_from_link_under(&self, q: &[f64], under: &Conditions) -> Vec<Isometry3<f64>> {
        let loads = Loads::under(&self.described, q, under);
        let mut poses = vec![Isometry3::identity(); self.model.links().len()];
        // Links in an order in which every parent comes before its children.
        let mut order: Vec<LinkId> = vec![self.model.root()];
        let mut next = 0;
        while next < order.len() {
            let link = order[next];
            next += 1;
            for &joint in &self.model.link(link).child_joints {
                let j = self.model.joint(joint);
                poses[j.child.index()] = poses[link.index()]
                    * j.parent_link_from_joint
                    * self.motion(joint, q, &loads, under);
                order.push(j.child);
            }
        }
        poses
    }

    /// Eq. (2) of [`JointEffects`] for one joint.
    fn motion(
        &self,
        joint: JointId,
        q: &[f64],
        loads: &Loads,
        under: &Conditions,
    ) -> Isometry3<f64> {
        let j = self.model.joint(joint);
        let Some(axis) = j.kind.axis() else {
            return Isometry3::identity();
        };
        let e = &self.effects[joint.index()];
        let reading = self.model.position(q, joint);
        let coupled: f64 = e.coupling.iter().map(|(k, c)| c * q[*k]).sum();
        let phi = reading
            + e.offset
            + e.gain * reading
            + e.eccentricity_cos * (reading.cos() - 1.0)
            + e.eccentricity_sin * reading.sin()
            + e.compliance * loads.about_axis[joint.index()]
            + e.backlash * under.approach_of(joint.index())
            + coupled;
        if matches!(j.kind, JointKind::Prismatic { .. }) {
            return Isometry3::from_parts(
                Translation3::from(axis.into_inner() * phi),
                UnitQuaternion::identity(),
            );
        }
        let mut turn = UnitQuaternion::from_axis_angle(&axis, phi);
        if e.lateral != [0.0, 0.0] {
            let [e1, e2] = across(&axis);
            let across = loads.across[joint.index()];
            turn *= so3::exp(&(e1 * (e.lateral[0] * across[0]) + e2 * (e.lateral[1] * across[1])));
        }
        Isometry3::from_parts(Translation3::identity(), turn)
    }

    /// The geometry with zero offsets put into the origins: what a URDF can hold.
    #[must_use]
    pub fn urdf_model(&self) -> RobotModel {
        let mut model = self.model.clone();
        for joint in self.model.joint_ids() {
            let offset = self.effects[joint.index()].offset;
            let j = self.model.joint(joint);
            let Some(axis) = j.kind.axis().filter(|_| offset != 0.0) else {
                continue;
            };
            let moved = if j.kind.turns() {
                Isometry3::from_parts(
                    Translation3::identity(),
                    UnitQuaternion::from_axis_angle(&axis, offset),
                )
            } else {
                Isometry3::from_parts(
                    Translation3::from(axis.into_inner() * offset),
                    UnitQuaternion::identity(),
                )
            };
            model = model.with_origin(joint, j.parent_link_from_joint * moved);
        }
        model
    }
}

/// Holding torques at one posture.
#[derive(Debug, Clone, PartialEq)]
pub struct Loads {
    /// About each joint's axis, N m, by joint index.
    pub about_axis: Vec<f64>,
    /// About the two axes across, N m.
    pub across: Vec<[f64; 2]>,
}

impl Loads {
    /// The measured torques about the axes where there are, gravity otherwise and across the axes.
    #[must_use]
    pub fn under(model: &RobotModel, q: &[f64], under: &Conditions) -> Self {
        let mut loads = Self::at(model, q);
        if let Some(torque) = &under.torque {
            loads.about_axis.clone_from(torque);
        }
        loads
    }

    /// From the masses of the description; zero where there are none.
    #[must_use]
    pub fn at(model: &RobotModel, q: &[f64]) -> Self {
        let n = model.joints().len();
        if !has_masses(model) {
            return Self {
                about_axis: vec![0.0; n],
                across: vec![[0.0; 2]; n],
            };
        }
        let moments = gravity_moments(model, &model.forward_kinematics(q));
        let mut loads = Self {
            about_axis: vec![0.0; n],
            across: vec![[0.0; 2]; n],
        };
        for joint in model.joint_ids() {
            let Some(axis) = model.joint(joint).kind.axis() else {
                continue;
            };
            // The joint holds against gravity; the lateral axes turn with the joint (eq. 2).
            let holds = -moments[joint.index()];
            loads.about_axis[joint.index()] = holds.dot(&axis);
            if model.joint(joint).kind.turns() {
                let [e1, e2] = across(&axis);
                let turn = UnitQuaternion::from_axis_angle(&axis, model.position(q, joint));
                let in_child = turn.inverse() * holds;
                loads.across[joint.index()] = [in_child.dot(&e1), in_child.dot(&e2)];
            }
        }
        loads
    }
}

fn across(axis: &Unit<Vector3<f64>>) -> [Vector3<f64>; 2] {
    calib_core::Axis::Revolute(*axis).across()
}
