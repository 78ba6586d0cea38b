//! A robot as it is believed to be: corrected geometry, joint effects, where it stands and what is bolted to it.

use std::collections::BTreeMap;

use calib_core::{Axis, EffectKind, JointMotion, JointState};
use calib_profile::RobotLoad;
use calib_urdf::{JointId, JointKind, RobotModel};
use nalgebra::{Isometry3, Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::prepare::conditions::Conditions;
use crate::prepare::loads::{Loads, Masses};

/// What the reading of one joint leaves out: equation (1) of [`calib_core::effect`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JointEffects {
    /// Coefficients by term, SI; terms that are not named are 0.
    pub coefficients: BTreeMap<EffectKind, f64>,
    /// Coefficients of couplings, by the other joint.
    pub coupling: BTreeMap<JointIndex, f64>,
}

/// Index of a joint in its model, serializable.
pub type JointIndex = usize;

impl JointEffects {
    /// Coefficient of a term.
    #[must_use]
    pub fn of(&self, kind: EffectKind) -> f64 {
        self.coefficients.get(&kind).copied().unwrap_or(0.0)
    }

    /// Whether a URDF can hold them: only geometric ones (the zero offset) can be put into an origin.
    #[must_use]
    pub fn fits_into_urdf(&self) -> bool {
        let geometric = |kind: &EffectKind| kind.effect().geometric;
        let rest = self
            .coefficients
            .iter()
            .filter(|(kind, _)| !geometric(kind));
        self.coupling.is_empty() && rest.into_iter().all(|(_, c)| *c == 0.0)
    }
}

/// A robot, its effects, its place and its bodies.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// Geometry: origins without zero offsets.
    pub model: RobotModel,
    /// What loads the joints, as in the fit.
    pub masses: Masses,
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
    /// Spots in the frames of touched things, m, by contact and spot.
    pub spots: BTreeMap<String, BTreeMap<String, Point3<f64>>>,
}

impl Calibration {
    /// A robot that is exactly as in the nominal URDF, and yields by the stiffness that is stated.
    #[must_use]
    pub fn nominal(
        model: &RobotModel,
        load: &RobotLoad,
        tracker_from_root: Isometry3<f64>,
    ) -> Self {
        let mut effects = vec![JointEffects::default(); model.joints().len()];
        for (joint, stiffness) in &load.stiffness {
            let own = &mut effects[joint.index()].coefficients;
            own.insert(EffectKind::TorqueCompliance, 1.0 / stiffness);
        }
        Self {
            model: model.clone(),
            masses: Masses::of(model, load),
            effects,
            tracker_from_root,
            mounts: BTreeMap::new(),
            points: BTreeMap::new(),
            contact_points: BTreeMap::new(),
            places: BTreeMap::new(),
            spots: BTreeMap::new(),
        }
    }

    /// `root_from_link` of all links at indicated joint positions (by joint index, rad or m), nothing else being
    /// known: every joint in the middle of its backlash, loaded by gravity.
    #[must_use]
    pub fn root_from_link(&self, q: &[f64]) -> Vec<Isometry3<f64>> {
        self.root_from_link_under(q, &Conditions::default())
    }

    /// The same under known circumstances.
    #[must_use]
    pub fn root_from_link_under(&self, q: &[f64], under: &Conditions) -> Vec<Isometry3<f64>> {
        let loads = self.masses.under(q, under.torque.as_deref());
        self.model
            .forward_kinematics_with(|joint| self.motion(joint, q, &loads, under))
    }

    /// `joint_from_child` of one joint with its effects.
    fn motion(
        &self,
        joint: JointId,
        q: &[f64],
        loads: &Loads,
        under: &Conditions,
    ) -> Isometry3<f64> {
        let Some(axis) = motion_axis(&self.model, joint) else {
            return Isometry3::identity();
        };
        let effects = &self.effects[joint.index()];
        let state = joint_state(&self.model, joint, q, loads, under);
        let own = effects.coefficients.iter();
        let own = own.map(|(kind, c)| (*kind, c * kind.term().regressor.at(&state)));
        let coupled = effects.coupling.iter().map(|(other, c)| {
            let other = q.get(*other).copied().unwrap_or(0.0);
            let regressor = EffectKind::Coupling.term().regressor;
            (
                EffectKind::Coupling,
                c * regressor.at(&JointState { other, ..state }),
            )
        });
        let reach = self.masses.reach()[joint.index()];
        JointMotion::new((axis, reach), state.q, own.chain(coupled)).joint_from_child()
    }

    /// The geometry with zero offsets put into the origins: what a URDF can hold.
    #[must_use]
    pub fn urdf_model(&self) -> RobotModel {
        let mut model = self.model.clone();
        for joint in self.model.joint_ids() {
            let offset = self.effects[joint.index()].of(EffectKind::ZeroOffset);
            let j = self.model.joint(joint);
            let Some(axis) = motion_axis(&model, joint).filter(|_| offset != 0.0) else {
                continue;
            };
            let amount = [(EffectKind::ZeroOffset, offset)];
            let still = (axis, Vector3::zeros());
            let moved = JointMotion::new(still, 0.0, amount).joint_from_child();
            model = model.with_origin(joint, j.parent_link_from_joint * moved);
        }
        model
    }

    /// The robot as its URDF alone has it, without the effects that a URDF cannot hold; `None` where it has none.
    #[must_use]
    pub fn urdf_alone(&self) -> Option<Self> {
        let beyond = self.effects.iter().any(|j| !j.fits_into_urdf());
        beyond.then(|| Self {
            model: self.urdf_model(),
            effects: vec![JointEffects::default(); self.effects.len()],
            ..self.clone()
        })
    }
}

/// Axis of a joint's motion; `None` for a fixed joint.
#[must_use]
pub fn motion_axis(model: &RobotModel, joint: JointId) -> Option<Axis> {
    let kind = &model.joint(joint).kind;
    let axis = kind.axis()?;
    Some(match kind {
        JointKind::Prismatic { .. } => Axis::Prismatic(axis),
        _ => Axis::Revolute(axis),
    })
}

/// What the regressors of a joint's effects depend on.
#[must_use]
pub fn joint_state(
    model: &RobotModel,
    joint: JointId,
    q: &[f64],
    loads: &Loads,
    under: &Conditions,
) -> JointState {
    let index = joint.index();
    let drive = loads.drives[index];
    let position = model.position(q, joint);
    JointState {
        q: position,
        motor: drive.gear_ratio * position,
        friction: drive.friction,
        torque: loads.about_axis[index],
        across: loads.across[index],
        approach: under.approach_of(index),
        warmth: under.warmth_of(index),
        ..JointState::default()
    }
}
