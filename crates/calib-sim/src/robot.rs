//! The true robot: the nominal URDF with drawn errors.

use std::collections::BTreeMap;

use calib_core::{Axis, EffectKind, JointMotion, JointState};
use calib_geometry::{Twist, se3};
use calib_profile::{Error3, Profile, Simulation};
use calib_urdf::{JointId, RobotModel};
use nalgebra::{Isometry3, Unit, Vector3};
use rand::{Rng, RngExt};
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;

use crate::{normal3, stream};

/// The robot as it really is.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueRobot {
    /// Kinematics with true origins; joint positions are true angles.
    pub model: RobotModel,
    /// `tracker_from_root`.
    pub tracker_from_root: Isometry3<f64>,
    /// Zero offsets by joint, rad.
    pub offsets: BTreeMap<JointId, f64>,
    /// Compliance by joint, rad per N m.
    pub compliance: BTreeMap<JointId, f64>,
    /// `link_from_body` by body.
    pub mounts: BTreeMap<String, Isometry3<f64>>,
    /// The nominal robot with everything that gravity acts on.
    loaded: RobotModel,
    /// Gravity in the frame of the root, m/s².
    gravity: Vector3<f64>,
}

impl TrueRobot {
    /// Draws the errors of eq. (1) and of mounts and offsets.
    #[must_use]
    pub fn draw(profile: &Profile, plan: &Simulation, nominal: &RobotModel, seed: u64) -> Self {
        let mut rng = stream(seed, 0);
        let mut model = nominal.clone();
        let mut offsets = BTreeMap::new();
        for id in nominal.independent_joints() {
            let joint = nominal.joint(id);
            let Some(axis) = joint.kind.axis() else {
                continue;
            };
            let xi = across(&mut rng, &axis, &plan.errors.axis);
            model = model.with_origin(id, joint.parent_link_from_joint * se3::exp(&xi));
            let offset = rng.sample::<f64, _>(StandardNormal) * plan.errors.joint_offset;
            if joint.kind.turns() {
                offsets.insert(id, offset);
            }
        }
        for (id, change) in &plan.errors.fixed {
            model = model.with_origin(*id, nominal.joint(*id).parent_link_from_joint * change);
        }
        let mut mounts = BTreeMap::new();
        for (name, mount) in &plan.mounts {
            let xi = Twist::new(
                normal3(&mut rng, plan.errors.mount.angle),
                normal3(&mut rng, plan.errors.mount.position),
            );
            let known = profile.bodies.get(name).is_some_and(|b| b.mount.is_some());
            let error = if known {
                Isometry3::identity()
            } else {
                se3::exp(&xi)
            };
            mounts.insert(name.clone(), mount.link_from_body * error);
        }
        Self {
            model,
            tracker_from_root: plan.tracker_from_root,
            offsets,
            compliance: plan.errors.compliance.clone(),
            mounts,
            loaded: profile.load.loaded(nominal),
            gravity: profile.load.gravity(),
        }
    }

    /// True `root_from_link` at indicated joint positions, eq. (2).
    #[must_use]
    pub fn forward_kinematics(
        &self,
        q_indicated: &[f64],
        joint_sigma: f64,
        rng: &mut ChaCha12Rng,
    ) -> Vec<Isometry3<f64>> {
        let held = self.loaded.gravity_torques(q_indicated, &self.gravity);
        let mut q = q_indicated.to_vec();
        for (id, offset) in &self.offsets {
            let noise = rng.sample::<f64, _>(StandardNormal) * joint_sigma;
            let state = JointState {
                q: q[id.index()],
                // The load is what the joint holds against.
                torque: -held[id.index()],
                ..JointState::default()
            };
            let compliance = self.compliance.get(id).copied().unwrap_or(0.0);
            let effects = [
                (EffectKind::ZeroOffset, *offset),
                (EffectKind::TorqueCompliance, compliance),
            ];
            let amounts = effects.map(|(kind, c)| (kind, c * kind.term().regressor.at(&state)));
            // Only joints that rotate have offsets (see `draw`).
            if let Some(axis) = self.model.joint(*id).kind.axis() {
                let still = (Axis::Revolute(axis), Vector3::zeros());
                let motion = JointMotion::new(still, state.q, amounts);
                q[id.index()] = motion.phi() + noise;
            }
        }
        self.model.forward_kinematics(&q)
    }

    /// True `root_from_link` at indicated zero: offsets, but neither load nor noise.
    #[must_use]
    pub fn at_zero(&self) -> Vec<Isometry3<f64>> {
        let mut q = self.model.zero_positions();
        for (id, offset) in &self.offsets {
            q[id.index()] += offset;
        }
        self.model.forward_kinematics(&q)
    }
}

/// A twist across `axis`: no part along or about it.
fn across(rng: &mut impl Rng, axis: &Unit<Vector3<f64>>, sigma: &Error3) -> Twist {
    let project = |v: Vector3<f64>| v - axis.into_inner() * v.dot(axis);
    let angular = project(normal3(rng, sigma.angle));
    let linear = project(normal3(rng, sigma.position));
    Twist::new(angular, linear)
}
