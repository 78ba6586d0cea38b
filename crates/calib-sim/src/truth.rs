//! The truth behind simulated recordings, in the names and conventions of the report.

use std::collections::BTreeMap;

use calib_checks::rigid_body::Template;
use calib_profile::{BodyKind, Profile};
use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3};
use serde::{Deserialize, Serialize};

use crate::{SimError, TrueRobot};

/// A transform as position and quaternion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TruthTransform {
    /// Position, m.
    pub translation_m: [f64; 3],
    /// Unit quaternion, scalar last.
    pub rotation_xyzw: [f64; 4],
}

impl From<Isometry3<f64>> for TruthTransform {
    fn from(t: Isometry3<f64>) -> Self {
        // The sign of a quaternion is free: scalar part not negative.
        let q = if t.rotation.w < 0.0 {
            -t.rotation.coords
        } else {
            t.rotation.coords
        };
        Self {
            translation_m: t.translation.vector.into(),
            rotation_xyzw: q.into(),
        }
    }
}

impl TruthTransform {
    /// As an isometry.
    #[must_use]
    pub fn isometry(&self) -> Isometry3<f64> {
        let [x, y, z, w] = self.rotation_xyzw;
        let rotation =
            nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z));
        Isometry3::from_parts(nalgebra::Vector3::from(self.translation_m).into(), rotation)
    }
}

/// What was drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// Seed.
    pub seed: u64,
    /// `body_from_joint` of every origin, and the profile's transforms, by the report's names.
    pub transforms: BTreeMap<String, TruthTransform>,
    /// True `parent_from_joint` by joint.
    pub joint_origins: BTreeMap<String, TruthTransform>,
    /// Zero offsets by joint, rad.
    pub joint_offsets_rad: BTreeMap<String, f64>,
    /// Compliance by joint, rad per N m.
    pub compliance_rad_per_nm: BTreeMap<String, f64>,
    /// True `link_from_body` by body, in the body frame that the profile defines.
    pub mounts: BTreeMap<String, TruthTransform>,
    /// `tracker_from_root`.
    pub tracker_from_root: TruthTransform,
}

impl Truth {
    pub(crate) fn of(
        profile: &Profile,
        model: &RobotModel,
        robot: &TrueRobot,
        seed: u64,
    ) -> Result<Self, SimError> {
        let mut mounts = BTreeMap::new();
        for (name, mount) in &robot.mounts {
            let plan_from_body = body_frame(profile, name)?;
            mounts.insert(name.clone(), mount * plan_from_body);
        }
        let mut transforms: BTreeMap<String, TruthTransform> = BTreeMap::new();
        for (name, origin) in &profile.origins {
            let body = &profile.bodies[&origin.body];
            // body_from_joint = (link_from_body)⁻¹ · link_from_origin; only fixed joints lie between
            let zero = robot.at_zero();
            let link_from_origin = zero[body.link.index()].inverse() * zero[origin.link.index()];
            let body_from_joint = mounts[&origin.body].inverse() * link_from_origin;
            transforms.insert(
                format!("{}_from_{name}", origin.body),
                body_from_joint.into(),
            );
        }
        for (name, t) in &profile.transforms {
            let zero = robot.at_zero();
            let parent_from_child = zero[t.parent.index()].inverse() * zero[t.child.index()];
            transforms.insert(name.clone(), parent_from_child.into());
        }
        let joint_name = |id: &calib_urdf::JointId| model.joint(*id).name.clone();
        Ok(Self {
            seed,
            transforms,
            joint_origins: robot
                .model
                .joints()
                .iter()
                .map(|j| (j.name.clone(), j.parent_link_from_joint.into()))
                .collect(),
            joint_offsets_rad: robot
                .offsets
                .iter()
                .map(|(id, o)| (joint_name(id), *o))
                .collect(),
            compliance_rad_per_nm: robot
                .compliance
                .iter()
                .map(|(id, c)| (joint_name(id), *c))
                .collect(),
            mounts: mounts
                .into_iter()
                .map(|(name, m)| (name, m.into()))
                .collect(),
            tracker_from_root: robot.tracker_from_root.into(),
        })
    }
}

/// From the body frame of the plan to the one that the profile defines (its template, or the first three markers).
fn body_frame(profile: &Profile, name: &str) -> Result<Isometry3<f64>, SimError> {
    let (Some(plan), Some(body)) = (&profile.simulate, profile.bodies.get(name)) else {
        return Ok(Isometry3::identity());
    };
    let BodyKind::Markers { names, template } = &body.kind else {
        return Ok(Isometry3::identity());
    };
    if names.len() < 3 {
        return Ok(Isometry3::identity());
    }
    let in_plan: Vec<Point3<f64>> = names.iter().map(|m| plan.mounts[name].markers[m]).collect();
    let in_body = match template {
        Some(points) => points.clone(),
        None => {
            let tracks: Vec<[Option<Point3<f64>>; 1]> =
                in_plan.iter().map(|p| [Some(*p)]).collect();
            let tracks: Vec<&[Option<Point3<f64>>]> =
                tracks.iter().map(<[_; 1]>::as_slice).collect();
            let learned = Template::learn(names, &tracks);
            learned
                .map_err(|source| SimError::Body {
                    body: name.to_owned(),
                    source,
                })?
                .points
        }
    };
    let registered = calib_geometry::registration::rigid_registration(&in_body, &in_plan, None);
    Ok(registered.map_or_else(|_| Isometry3::identity(), |r| r.b_from_a))
}
