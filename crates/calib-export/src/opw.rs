//! Parameters of an arm with an ortho-parallel basis and a spherical wrist, as ROS-Industrial's packages have them.
//!
//! ```text
//! root_from_tool = B Rz(p_1) T(a1, b, c1) Ry(p_2) T(0, 0, c2) Ry(p_3) T(a2, 0, c3) Rz(p_4) Ry(p_5) Rz(p_6) T(0, 0, c4) F      (1)
//! p_i = s_i q_i − o_i,   s_i = ±1
//! Σ |log(tool(q)⁻¹ tool_model(q))|² + small ridge → min over 7 lengths, 6 offsets, 4 numbers of B, 4 of F                   (2)
//! ```
//!
//! The chain is that of Brandstötter, Angerer and Hofbaur, "An analytical solution of the inverse kinematics problem of industrial serial
//! manipulators with an ortho-parallel basis and a spherical wrist", Austrian Robotics Workshop 2014. A rotation about z and a translation
//! along it would be the same in B = `root_from_base` as in o_1 and c1, and in F = `flange_from_tool` as in o_6 and c4: the fit moves
//! neither of B and F so.

use calib_model::Pose;
use calib_model::file::{ModelMotion, RobotModelFile};
use nalgebra::{
    Cholesky, Isometry3, Matrix3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3, Vector6,
};

use crate::best::{RIDGE, STEPS, twist, weighed};
use crate::dh::{Line, lines};

/// Numbers of equation (2).
const NUMBERS: usize = 21;

/// Readings of the six joints, rad.
pub(crate) type Readings = [f64; 6];

/// Equation (1).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Opw {
    /// Names of the joints, base first.
    pub joints: Vec<String>,
    /// a1, a2, b, c1, c2, c3, c4, m.
    pub lengths: Lengths,
    /// o, rad.
    pub offsets: [f64; 6],
    /// s.
    pub signs: [f64; 6],
    /// B.
    pub root_from_base: Isometry3<f64>,
    /// F.
    pub flange_from_tool: Isometry3<f64>,
}

/// m.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Lengths {
    pub a1: f64,
    pub a2: f64,
    pub b: f64,
    pub c1: f64,
    pub c2: f64,
    pub c3: f64,
    pub c4: f64,
}

/// A frame of the chain, and the twist in it that a number causes.
type Moved = (Isometry3<f64>, Vector6<f64>);

/// Unit twists [ω; v].
const RX: usize = 0;
const RY: usize = 1;
const RZ: usize = 2;
const X: usize = 3;
const Y: usize = 4;
const Z: usize = 5;

fn turn(axis: usize, angle: f64) -> Isometry3<f64> {
    Isometry3::rotation(Vector3::ith(axis, angle))
}

fn moved(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::translation(x, y, z)
}

impl Opw {
    /// root_from_tool at readings.
    pub(crate) fn forward(&self, q: &Readings) -> Isometry3<f64> {
        self.walk(q, &mut |_, _, _| {})
    }

    /// The chain from the root to the tool; `mark` sees each number's frame, axis and sign, in the order of [`Opw::add`].
    fn walk(
        &self,
        q: &Readings,
        mark: &mut dyn FnMut(&Isometry3<f64>, usize, f64),
    ) -> Isometry3<f64> {
        let l = &self.lengths;
        let p = |i: usize| self.signs[i] * q[i] - self.offsets[i];
        let mut at = self.root_from_base;
        [RX, RY, X, Y].iter().for_each(|k| mark(&at, *k, 1.0));
        // An offset is subtracted.
        mark(&at, RZ, -1.0);
        at *= turn(RZ, p(0));
        [X, Y, Z].iter().for_each(|k| mark(&at, *k, 1.0));
        at *= moved(l.a1, l.b, l.c1);
        mark(&at, RY, -1.0);
        at *= turn(RY, p(1));
        mark(&at, Z, 1.0);
        at *= moved(0.0, 0.0, l.c2);
        mark(&at, RY, -1.0);
        at *= turn(RY, p(2));
        [X, Z].iter().for_each(|k| mark(&at, *k, 1.0));
        at *= moved(l.a2, 0.0, l.c3);
        for (i, axis) in [(3, RZ), (4, RY), (5, RZ)] {
            mark(&at, axis, -1.0);
            at *= turn(axis, p(i));
        }
        mark(&at, Z, 1.0);
        at *= moved(0.0, 0.0, l.c4);
        [RX, RY, X, Y].iter().for_each(|k| mark(&at, *k, 1.0));
        at * self.flange_from_tool
    }

    /// Adds to the numbers of equation (2).
    fn add(&mut self, d: &SVector<f64, NUMBERS>) {
        let small = |k: usize| {
            let (turn, by) = (Vector3::new(d[k], d[k + 1], 0.0), [d[k + 2], d[k + 3]]);
            Isometry3::new(Vector3::new(by[0], by[1], 0.0), turn)
        };
        self.root_from_base *= small(0);
        let ([o1, o2, o3, o4, o5, o6], l) = (&mut self.offsets, &mut self.lengths);
        let numbers: [&mut f64; 13] = [
            o1, &mut l.a1, &mut l.b, &mut l.c1, o2, &mut l.c2, o3, &mut l.a2, &mut l.c3, o4, o5,
            o6, &mut l.c4,
        ];
        for (number, d) in numbers.into_iter().zip(d.iter().skip(4)) {
            *number += d;
        }
        self.flange_from_tool = small(17) * self.flange_from_tool;
    }

    /// Equation (2) from these numbers, by Gauss–Newton steps.
    pub(crate) fn refitted(&self, readings: &[Readings], wanted: &[Pose]) -> Self {
        let mut out = self.clone();
        for _ in 0..STEPS {
            let ridge = readings.len() as f64 * RIDGE * RIDGE;
            let mut normal = SMatrix::<f64, NUMBERS, NUMBERS>::identity() * ridge;
            let mut right = SVector::<f64, NUMBERS>::zeros();
            for (q, wanted) in readings.iter().zip(wanted) {
                let mut marked: Vec<Moved> = Vec::with_capacity(NUMBERS);
                let tool = out.walk(q, &mut |at, axis, sign| {
                    marked.push((*at, Vector6::ith(axis, sign)));
                });
                let residual = weighed(&twist(&Pose::of(&tool).inverse().then(wanted)));
                let mut rows = SMatrix::<f64, 6, NUMBERS>::zeros();
                for (k, (at, by)) in marked.iter().enumerate() {
                    let at_from_tool = Pose::of(&(at.inverse() * tool));
                    rows.set_column(k, &weighed(&at_from_tool.pull_back(by)));
                }
                normal += rows.tr_mul(&rows);
                right += rows.tr_mul(&residual);
            }
            let Some(factor) = Cholesky::new(normal) else {
                break;
            };
            out.add(&factor.solve(&right));
        }
        out.offsets = out.offsets.map(wrapped);
        out
    }
}

/// Into (−π, π].
fn wrapped(angle: f64) -> f64 {
    let (s, c) = angle.sin_cos();
    s.atan2(c)
}

/// The axes of an arm, and how far they are from those of equation (1).
#[derive(Debug)]
pub(crate) struct Axes {
    lines: Vec<Line>,
    joints: Vec<String>,
    tool: Isometry3<f64>,
}

/// Six turning joints that lead to the tool.
///
/// # Errors
/// Why they are not.
pub(crate) fn axes(file: &RobotModelFile, chain: &[usize]) -> Result<Axes, String> {
    let (lines, tool) = lines(file, chain);
    let joint = |line: &Line| &file.joints[line.joint];
    let names = |of: &mut dyn Iterator<Item = &Line>| -> Vec<String> {
        of.map(|l| joint(l).name.clone()).collect()
    };
    let slides = names(
        &mut lines
            .iter()
            .filter(|l| joint(l).motion == ModelMotion::Prismatic),
    );
    if let Some(name) = slides.first() {
        return Err(format!("{name} is a sliding joint of the chain"));
    }
    let mimics = names(&mut lines.iter().filter(|l| joint(l).mimic.is_some()));
    if let Some(name) = mimics.first() {
        return Err(format!("{name} follows another joint"));
    }
    if lines.len() != 6 {
        return Err(format!(
            "its chain has {} joints that move, and not six",
            lines.len()
        ));
    }
    let joints = names(&mut lines.iter());
    Ok(Axes {
        lines,
        joints,
        tool,
    })
}

impl Axes {
    /// The point next to axes 4, 5 and 6: Σ (1 − w wᵀ)(x − p) = 0.
    fn wrist(&self) -> Option<Vector3<f64>> {
        let mut across = Matrix3::zeros();
        let mut right = Vector3::zeros();
        for line in &self.lines[3..] {
            let w = line.direction;
            let projected = Matrix3::identity() - w * w.transpose();
            across += projected;
            right += projected * line.point.coords;
        }
        across.try_inverse().map(|inverse| inverse * right)
    }

    /// Equation (1) from where the axes are at readings 0; `None` where axes that have to cross are parallel.
    pub(crate) fn closed_form(&self) -> Option<Opw> {
        let w = |i: usize| self.lines[i - 1].direction;
        let p = |i: usize| self.lines[i - 1].point;
        let wrist = self.wrist()?;
        let sign = |x: f64| if x < 0.0 { -1.0 } else { 1.0 };
        let mut signs = [1.0; 6];

        // z of the base goes up with the root's; its origin is the point of axis 1 next to the root's.
        signs[0] = sign(w(1).z);
        let z = w(1) * signs[0];
        let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &z)?;
        let foot = p(1).coords - z * z.dot(&p(1).coords);
        let base = Isometry3::from_parts(Translation3::from(foot), rotation);
        // y of the arm's plane lies along axis 2, within 90° of the base's.
        let across = rotation.inverse() * w(2);
        signs[1] = sign(across.y);
        let y = Vector3::new(across.x, across.y, 0.0).try_normalize(NOT_PARALLEL)? * signs[1];
        let theta_1 = (-y.x).atan2(y.y);
        let arm = base * turn(RZ, theta_1);
        let seen = |v: Vector3<f64>| arm.rotation.inverse() * v;
        signs[2] = sign(seen(w(3)).y);
        let (p2, p3) = (arm.inverse() * p(2), arm.inverse() * p(3));
        let c = arm.inverse_transform_point(&wrist.into());
        let upper = p3 - p2;
        let theta_2 = upper.x.atan2(upper.z);
        // Axis 4 points from the elbow to the wrist.
        let fore = c - p3;
        let w4 = seen(w(4));
        signs[3] = sign(fore.x * w4.x + fore.z * w4.z);
        let theta_23 = (signs[3] * w4.x).atan2(signs[3] * w4.z);
        let (sin, cos) = theta_23.sin_cos();
        let elbow = arm.rotation * turn(RY, theta_23).rotation;
        let w5 = elbow.inverse() * w(5);
        signs[4] = sign(w5.y);
        let theta_4 = (-signs[4] * w5.x).atan2(signs[4] * w5.y);
        let hand = elbow * turn(RZ, theta_4).rotation;
        // Axis 6 points to the tool.
        let reach = (self.tool.translation.vector - wrist).dot(&w(6));
        let forward = (self.tool.rotation * Vector3::z()).dot(&w(6));
        signs[5] = sign(if reach.abs() > 1e-3 { reach } else { forward });
        let w6 = hand.inverse() * w(6) * signs[5];
        let theta_5 = w6.x.atan2(w6.z);
        let wrist_3 = hand * turn(RY, theta_5).rotation;
        // The part about z of what is left is joint 6.
        let left = (wrist_3.inverse() * self.tool.rotation).into_inner();
        let theta_6 = 2.0 * left.k.atan2(left.w);
        let mut out = Opw {
            joints: self.joints.clone(),
            lengths: Lengths {
                a1: p2.x,
                a2: fore.x * cos - fore.z * sin,
                b: c.y,
                c1: p2.z,
                c2: upper.x.hypot(upper.z),
                c3: fore.x * sin + fore.z * cos,
                c4: reach * signs[5],
            },
            offsets: [
                theta_1,
                theta_2,
                theta_23 - theta_2,
                theta_4,
                theta_5,
                theta_6,
            ]
            .map(|theta| wrapped(-theta)),
            signs,
            root_from_base: base,
            flange_from_tool: Isometry3::identity(),
        };
        out.flange_from_tool = out.forward(&[0.0; 6]).inverse() * self.tool;
        let finite = out.forward(&[1.0; 6]).to_homogeneous();
        finite.iter().all(|x| x.is_finite()).then_some(out)
    }

    /// How far the axes are from those of equation (1), for a person.
    pub(crate) fn deviations(&self) -> String {
        let w = |i: usize| self.lines[i - 1].direction;
        let angle = |i: usize, k: usize| w(i).cross(&w(k)).norm().atan2(w(i).dot(&w(k)).abs());
        let far = |wrist: Vector3<f64>| {
            let off = self.lines[3..].iter().map(|l| {
                let d = wrist - l.point.coords;
                (d - l.direction * l.direction.dot(&d)).norm()
            });
            off.fold(0.0, f64::max)
        };
        let wrist = self.wrist().map_or_else(
            || "axes 4, 5 and 6 are parallel".to_owned(),
            |wrist| {
                format!(
                    "axes 4, 5 and 6 pass within {:.1} mm of a common point (0 expected)",
                    1e3 * far(wrist)
                )
            },
        );
        format!(
            "{wrist}; axes 2 and 3 are {:.2}° from parallel (0° expected); the angles of axes 1 and 2, 3 and 4, 4 and 5, 5 and 6 are {:.2}°, {:.2}°, {:.2}° \
             and {:.2}° (90° expected)",
            angle(2, 3).to_degrees(),
            angle(1, 2).to_degrees(),
            angle(3, 4).to_degrees(),
            angle(4, 5).to_degrees(),
            angle(5, 6).to_degrees(),
        )
    }
}

/// Sine of an angle below which axes that have to cross are parallel: no arm of this kind is 84° off.
const NOT_PARALLEL: f64 = 0.1;
