//! Robots of the study: five families of arms, drawn at random, as a nominal URDF and as they truly are.
//!
//! ```text
//! root_from_tip(q) = Π_j  O_j · E_j · M_j(q_j),    O_j nominal origin, E_j its error, M_j motion about or along z
//! ```

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::noise::Noise;

/// Errors of the nominal robot, standard deviations: zero offset (°), each coordinate of an origin (mm), tilt of an axis (°).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NominalErrors {
    pub offset_deg: f64,
    pub origin_mm: f64,
    pub tilt_deg: f64,
}

/// As a good manufacturer's drawing is.
const SMALL: NominalErrors = NominalErrors {
    offset_deg: 0.3,
    origin_mm: 1.0,
    tilt_deg: 0.2,
};
/// As after a repair without alignment.
const BIG: NominalErrors = NominalErrors {
    offset_deg: 1.0,
    origin_mm: 5.0,
    tilt_deg: 0.5,
};
/// As of a robot that was built from another drawing.
const HUGE: NominalErrors = NominalErrors {
    offset_deg: 3.0,
    origin_mm: 20.0,
    tilt_deg: 2.0,
};

/// How far the nominal robot is off.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Errors {
    /// Zero offsets by 0.3°, origins by 1 mm, axes by 0.2°.
    Small,
    /// By 1°, 5 mm, 0.5°.
    Big,
    /// By 3°, 20 mm, 2°.
    Huge,
}

impl Errors {
    /// The standard deviations.
    pub(super) fn sizes(self) -> NominalErrors {
        match self {
            Self::Small => SMALL,
            Self::Big => BIG,
            Self::Huge => HUGE,
        }
    }

    /// Its word in the name of a cell, from which draws follow.
    pub(super) fn id(self) -> &'static str {
        match self {
            Self::Small => "false",
            Self::Big => "true",
            Self::Huge => "huge",
        }
    }
}

/// One joint; it moves about or along its own z.
#[derive(Debug, Clone)]
pub(crate) struct Joint {
    pub prismatic: bool,
    /// `parent_from_joint` of the URDF.
    pub nominal: Isometry3<f64>,
    /// `parent_from_joint` of the real robot.
    pub actual: Isometry3<f64>,
}

/// A serial arm. Link 0 is the root, link k hangs on joint k − 1.
#[derive(Debug, Clone)]
pub(crate) struct Robot {
    pub joints: Vec<Joint>,
}

/// What the joints of the real robot do beside what is read: true position = reading + Σ.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Transmission {
    /// Joint, share of its own reading that is added.
    pub gain: Option<(usize, f64)>,
    /// Joint, other joint, share of the other's reading that is added.
    pub coupling: Option<(usize, usize, f64)>,
    /// Joint, constant, rad or m.
    pub offset: Option<(usize, f64)>,
    /// Joint, amplitude (rad): joint + amplitude · sin of its reading.
    pub eccentricity: Option<(usize, f64)>,
}

impl Transmission {
    fn position(&self, j: usize, q: &[f64]) -> f64 {
        let mut at = q[j];
        if let Some((of, share)) = self.gain.filter(|g| g.0 == j) {
            at += share * q[of];
        }
        if let Some((_, other, share)) = self.coupling.filter(|c| c.0 == j) {
            at += share * q[other];
        }
        if let Some((_, by)) = self.offset.filter(|o| o.0 == j) {
            at += by;
        }
        if let Some((_, amplitude)) = self.eccentricity.filter(|e| e.0 == j) {
            at += amplitude * q[j].sin();
        }
        at
    }
}

impl Robot {
    /// Robot number `number` of the study: the families take turns.
    pub fn draw(number: u64, errors: NominalErrors, noise: &mut Noise) -> Self {
        let nominal = match number % 5 {
            0 | 1 => random_arm(noise),
            2 => wrist_arm(noise),
            3 => collaborative_arm(noise),
            _ => scara(noise),
        };
        let joints = nominal.into_iter().map(|(prismatic, nominal)| {
            let tilt = errors.tilt_deg.to_radians();
            let turn = noise.vector(1.0).component_mul(&Vector3::new(
                tilt,
                tilt,
                errors.offset_deg.to_radians(),
            ));
            let step = Isometry3::from_parts(
                Translation3::from(noise.vector(errors.origin_mm * 1e-3)),
                UnitQuaternion::from_scaled_axis(turn),
            );
            Joint {
                prismatic,
                nominal,
                actual: nominal * step,
            }
        });
        Self {
            joints: joints.collect(),
        }
    }

    /// Range of a joint, rad or m.
    pub fn range(&self, joint: usize) -> (f64, f64) {
        if self.joints[joint].prismatic {
            (-0.2, 0.2)
        } else {
            (-1.9, 1.9)
        }
    }

    /// Poses `root_from_link` of all links of the real robot at readings.
    pub fn links(&self, q: &[f64], transmission: &Transmission) -> Vec<Isometry3<f64>> {
        let mut poses = vec![Isometry3::identity()];
        let mut pose = Isometry3::identity();
        for (j, joint) in self.joints.iter().enumerate() {
            pose *= joint.actual * motion(joint.prismatic, transmission.position(j, q));
            poses.push(pose);
        }
        poses
    }

    /// Moments of gravity about the joints' axes with 1.5 kg in the middle of every link and z up, N m.
    pub fn gravity(&self, q: &[f64]) -> Vec<f64> {
        let links = self.links(q, &Transmission::default());
        let centers: Vec<Vector3<f64>> = links
            .windows(2)
            .map(|w| 0.5 * (w[0].translation.vector + w[1].translation.vector))
            .chain(links.last().map(|l| l.translation.vector))
            .collect();
        let weight = Vector3::new(0.0, 0.0, -9.81 * 1.5);
        (0..self.joints.len())
            .map(|j| {
                let (at, axis) = (
                    &links[j + 1].translation.vector,
                    links[j + 1] * Vector3::z(),
                );
                let moment = |c: &Vector3<f64>| axis.dot(&(c - at).cross(&weight));
                centers[j + 1..].iter().map(moment).sum()
            })
            .collect()
    }

    /// The nominal robot as a URDF.
    pub fn urdf(&self) -> String {
        let mut text = String::from("<robot name=\"arm\">\n  <link name=\"l0\"/>\n");
        for (j, joint) in self.joints.iter().enumerate() {
            let t = joint.nominal.translation.vector;
            let (r, p, y) = joint.nominal.rotation.euler_angles();
            let kind = if joint.prismatic {
                "prismatic"
            } else {
                "revolute"
            };
            // Writing into a string cannot fail.
            let _ = write!(
                text,
                "  <link name=\"l{k}\"/>\n  <joint name=\"j{k}\" type=\"{kind}\">\n    <parent link=\"l{j}\"/>\n    <child link=\"l{k}\"/>\n    \
                 <origin xyz=\"{} {} {}\" rpy=\"{r} {p} {y}\"/>\n    <axis xyz=\"0 0 1\"/>\n    \
                 <limit lower=\"-6.3\" upper=\"6.3\" effort=\"50\" velocity=\"2\"/>\n  </joint>\n",
                t.x,
                t.y,
                t.z,
                k = j + 1,
            );
        }
        text + "</robot>\n"
    }
}

fn motion(prismatic: bool, q: f64) -> Isometry3<f64> {
    if prismatic {
        Isometry3::translation(0.0, 0.0, q)
    } else {
        Isometry3::rotation(Vector3::z() * q)
    }
}

fn at(x: f64, y: f64, z: f64, roll: f64, pitch: f64, yaw: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

/// Four to seven joints, half of the arms with one prismatic joint, half with axes at right angles.
fn random_arm(noise: &mut Noise) -> Vec<(bool, Isometry3<f64>)> {
    let n = 4 + noise.below(4);
    let sliding = (noise.uniform() < 0.5).then(|| noise.below(n - 1));
    let square = noise.uniform() < 0.5;
    (0..n)
        .map(|j| {
            let turn = if square {
                let axis = if noise.uniform() < 0.5 {
                    Vector3::x()
                } else {
                    Vector3::y()
                };
                let side = if noise.uniform() < 0.5 { 1.0 } else { -1.0 };
                UnitQuaternion::from_scaled_axis(axis * side * FRAC_PI_2)
            } else {
                noise.turn(2.0)
            };
            let mut reach = |from, to| noise.between(from, to);
            let arm = Vector3::new(reach(-0.35, 0.35), reach(-0.35, 0.35), reach(0.05, 0.4));
            // The last two axes meet, as in most arms.
            let arm = if j + 1 == n { Vector3::zeros() } else { arm };
            (sliding == Some(j), Isometry3::from_parts(arm.into(), turn))
        })
        .collect()
}

/// Six axes with a spherical wrist, as industrial arms have.
fn wrist_arm(noise: &mut Noise) -> Vec<(bool, Isometry3<f64>)> {
    let mut s = || noise.between(0.8, 1.25);
    let h = FRAC_PI_2;
    [
        at(0.0, 0.0, 0.3 * s(), 0.0, 0.0, 0.0),
        at(0.07 * s(), 0.0, 0.1 * s(), -h, 0.0, 0.0),
        at(0.0, -0.36 * s(), 0.0, 0.0, 0.0, 0.0),
        at(0.38 * s(), -0.06 * s(), 0.0, 0.0, h, 0.0),
        at(0.0, 0.0, 0.0, 0.0, -h, 0.0),
        at(0.0, 0.0, 0.0, 0.0, h, 0.0),
    ]
    .map(|o| (false, o))
    .to_vec()
}

/// Six axes, the second to fourth parallel, as in collaborative arms.
fn collaborative_arm(noise: &mut Noise) -> Vec<(bool, Isometry3<f64>)> {
    let mut s = || noise.between(0.8, 1.25);
    let h = FRAC_PI_2;
    [
        at(0.0, 0.0, 0.09 * s(), 0.0, 0.0, 0.0),
        at(0.0, 0.0, 0.0, h, 0.0, 0.0),
        at(-0.42 * s(), 0.0, 0.0, 0.0, 0.0, 0.0),
        at(-0.39 * s(), 0.0, 0.11 * s(), 0.0, 0.0, 0.0),
        at(0.0, -0.09 * s(), 0.0, h, 0.0, 0.0),
        at(0.0, 0.08 * s(), 0.0, -h, PI, PI),
    ]
    .map(|o| (false, o))
    .to_vec()
}

/// Two parallel revolute joints, a lift and a rotation about it.
fn scara(noise: &mut Noise) -> Vec<(bool, Isometry3<f64>)> {
    let mut s = || noise.between(0.8, 1.25);
    vec![
        (false, at(0.0, 0.0, 0.4 * s(), 0.0, 0.0, 0.0)),
        (false, at(0.33 * s(), 0.0, 0.05, 0.0, 0.0, 0.0)),
        (true, at(0.27 * s(), 0.0, -0.05, PI, 0.0, 0.0)),
        (false, at(0.0, 0.0, 0.1, 0.0, 0.0, 0.0)),
    ]
}
