//! Product of exponentials: screws of the joints in the root, and where the tool stands at positions 0.
//!
//! ```text
//! root_from_tool = exp([S_1] q_1) … exp([S_n] q_n) M,   S = [ω; v]: v = −ω × p of a turning joint, ω = 0 of a sliding one   (1)
//! ```
//!
//! After Lynch and Park, Modern Robotics (2017), chapter 4.1.

use calib_model::Pose;
use calib_model::axis::Axis;
use calib_model::file::RobotModelFile;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::geometric::{axis_of, isometry};

/// One joint.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Screw {
    pub joint: String,
    pub omega: Vector3<f64>,
    pub v: Vector3<f64>,
    pub reads: String,
    pub multiplier: f64,
    pub offset: f64,
}

/// Screws of the joints of a chain, and M of equation (1).
pub(crate) fn screws(file: &RobotModelFile, chain: &[usize]) -> (Vec<Screw>, Isometry3<f64>) {
    let mut at = Isometry3::identity();
    let mut screws = Vec::new();
    for &i in chain {
        let joint = &file.joints[i];
        at *= isometry(&joint.parent_from_joint);
        let Some(axis) = axis_of(joint) else { continue };
        let direction = at.rotation * axis.direction().into_inner();
        let (omega, v) = match axis {
            Axis::Revolute(_) => (direction, -direction.cross(&at.translation.vector)),
            Axis::Prismatic(_) => (Vector3::zeros(), direction),
        };
        let mimic = joint.mimic.as_ref();
        screws.push(Screw {
            joint: joint.name.clone(),
            omega,
            v,
            reads: mimic.map_or_else(|| joint.name.clone(), |m| m.joint.clone()),
            multiplier: mimic.map_or(1.0, |m| m.multiplier),
            offset: mimic.map_or(0.0, |m| m.offset),
        });
    }
    (screws, at)
}

/// Equation (1) at readings by name.
pub(crate) fn forward(
    (screws, end): &(Vec<Screw>, Isometry3<f64>),
    q: &dyn Fn(&str) -> f64,
) -> Pose {
    let motion = |s: &Screw| {
        let q = s.multiplier * q(&s.reads) + s.offset;
        if s.omega == Vector3::zeros() {
            return Isometry3::from_parts(Translation3::from(s.v * q), UnitQuaternion::identity());
        }
        // The point of the axis next to the root: p = ω × v.
        let p = s.omega.cross(&s.v);
        let turn = UnitQuaternion::from_scaled_axis(s.omega * q);
        Isometry3::from_parts(Translation3::from(p - turn * p), turn)
    };
    let at = screws
        .iter()
        .fold(Isometry3::identity(), |at, s| at * motion(s));
    Pose::of(&(at * end))
}
