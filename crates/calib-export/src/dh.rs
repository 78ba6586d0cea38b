//! Denavit–Hartenberg parameters of a chain, and Hayati's where axes are nearly parallel.
//!
//! ```text
//! root_from_tool = base · Π_i A_i · tool                                                                (1)
//! A_i = Rz(θ_i) Tz(d_i) Tx(a_i) Rx(α_i) Ry(β_i),   θ_i + q_i of a turning joint, d_i + q_i of a sliding one
//! ```
//!
//! Frame i lies on the axis of joint i + 1 (z along it): distal, or standard, parameters after Denavit and Hartenberg (1955). β is 0 but
//! for nearly parallel axes of the second form: there the common normal of the two may be meters away, and frame i lies where the axis
//! meets the plane through frame i − 1 across its z, after Hayati (1983). Both forms are exact; only the sizes of their numbers differ.

use calib_model::Pose;
use calib_model::axis::Axis;
use calib_model::file::RobotModelFile;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::geometric::{axis_of, isometry};

/// Axes within this angle count as nearly parallel (rad): the common normal of axes 1° apart moves by 57 times what one of them does.
const NEARLY: f64 = 0.1;

/// Axes within this angle (rad) are parallel: their common normal is anywhere.
const PARALLEL: f64 = 1e-9;

/// One joint.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Row {
    pub joint: String,
    pub prismatic: bool,
    /// rad
    pub theta: f64,
    /// m
    pub d: f64,
    /// m
    pub a: f64,
    /// rad
    pub alpha: f64,
    /// rad; 0 in the form of Denavit and Hartenberg.
    pub beta: f64,
    /// Multiplier and offset of a mimicking joint's reading, and the joint that it follows.
    pub reads: String,
    pub multiplier: f64,
    pub offset: f64,
}

/// Equation (1).
#[derive(Debug, Clone)]
pub(crate) struct Table {
    /// root_from_0
    pub base: Isometry3<f64>,
    pub rows: Vec<Row>,
    /// n_from_tool
    pub tool: Isometry3<f64>,
}

/// An axis in the root at positions 0.
#[derive(Debug)]
pub(crate) struct Line {
    pub joint: usize,
    pub point: Point3<f64>,
    pub direction: Vector3<f64>,
}

/// The table of the joints of a chain; `hayati`: β for nearly parallel axes.
pub(crate) fn table(file: &RobotModelFile, chain: &[usize], hayati: bool) -> Table {
    let (lines, end) = lines(file, chain);
    let Some(first) = lines.first() else {
        return Table {
            base: end,
            rows: Vec::new(),
            tool: Isometry3::identity(),
        };
    };
    let mut frame = frame_at(&first.point, &first.direction);
    let base = frame;
    let mut rows = Vec::new();
    for (k, line) in lines.iter().enumerate() {
        let next = lines.get(k + 1);
        // The last frame is the one before: its motion is Rz(q), and the rest is the tool.
        let mut row = empty(file, line.joint);
        if let Some(next) = next {
            fill(&mut row, &frame, next, hayati);
        }
        frame *= motion(&row, 0.0);
        rows.push(row);
    }
    Table {
        base,
        rows,
        tool: frame.inverse() * end,
    }
}

/// The first two joints whose common normal lies far beyond the robot, and how far, m; `None` where none does.
pub(crate) fn far<'t>(
    file: &RobotModelFile,
    chain: &[usize],
    table: &'t Table,
) -> Option<(&'t str, &'t str, f64)> {
    /// Times the robot's size: no tool is mounted so far from its arm.
    const FAR: f64 = 10.0;
    let (lines, end) = lines(file, chain);
    let first = lines.first()?.point;
    let points = lines.iter().map(|line| line.point);
    let points = points.chain([Point3::from(end.translation.vector)]);
    let size = points.map(|p| (p - first).norm()).fold(0.0, f64::max);
    let mut pairs = table.rows.windows(2);
    let pair = pairs.find(|pair| pair[0].d.abs() > FAR * size)?;
    Some((&pair[0].joint, &pair[1].joint, pair[0].d.abs()))
}

/// Axes of the joints that move, with mimics at their own zero; and root_from_tool there.
pub(crate) fn lines(file: &RobotModelFile, chain: &[usize]) -> (Vec<Line>, Isometry3<f64>) {
    let mut at = Isometry3::identity();
    let mut lines = Vec::new();
    for &i in chain {
        let joint = &file.joints[i];
        at *= isometry(&joint.parent_from_joint);
        if let Some(axis) = axis_of(joint) {
            lines.push(Line {
                joint: i,
                point: Point3::from(at.translation.vector),
                direction: at.rotation * axis.direction().into_inner(),
            });
        }
    }
    (lines, at)
}

fn empty(file: &RobotModelFile, i: usize) -> Row {
    let joint = &file.joints[i];
    let mimic = joint.mimic.as_ref();
    Row {
        joint: joint.name.clone(),
        prismatic: matches!(axis_of(joint), Some(Axis::Prismatic(_))),
        theta: 0.0,
        d: 0.0,
        a: 0.0,
        alpha: 0.0,
        beta: 0.0,
        reads: mimic.map_or_else(|| joint.name.clone(), |m| m.joint.clone()),
        multiplier: mimic.map_or(1.0, |m| m.multiplier),
        offset: mimic.map_or(0.0, |m| m.offset),
    }
}

/// From the frame on one axis to the next axis.
fn fill(row: &mut Row, frame: &Isometry3<f64>, next: &Line, hayati: bool) {
    // The next axis as the frame sees it: p + s w, this axis being z.
    let p = frame.inverse() * next.point;
    let w = frame.rotation.inverse() * next.direction;
    let across = w.x.hypot(w.y);
    // Where on the next axis the frame is put, and in which direction x points.
    let (foot, x) = if across < PARALLEL || (hayati && across < NEARLY) {
        // Where it meets the plane z = 0.
        let foot = p - w * (p.z / w.z);
        (foot, Vector3::new(foot.x, foot.y, 0.0))
    } else {
        // Feet of the common normal: on z at height d, on the next axis at s.
        let s = -(p.x * w.x + p.y * w.y) / (across * across);
        let foot = p + w * s;
        row.d = foot.z;
        (foot, Vector3::z().cross(&w))
    };
    let normal = Vector3::new(foot.x, foot.y, 0.0);
    // The normal's own direction where it has one; axes that meet have none.
    let x = if normal.norm() > MEET { normal } else { x };
    let x = if x.norm() > MEET {
        x.normalize()
    } else {
        Vector3::x()
    };
    row.theta = x.y.atan2(x.x);
    row.a = normal.dot(&x);
    let y = Vector3::z().cross(&x);
    // w after Rz: Rx(α) Ry(β) z = (sin β, −sin α cos β, cos α cos β)
    let (wx, wy, wz) = (w.dot(&x), w.dot(&y), w.z);
    row.beta = if across < PARALLEL || (hayati && across < NEARLY) {
        wx.clamp(-1.0, 1.0).asin()
    } else {
        0.0
    };
    row.alpha = (-wy).atan2(wz);
}

/// Axes nearer than this (m) meet.
const MEET: f64 = 1e-9;

/// A frame with z along a direction.
fn frame_at(point: &Point3<f64>, z: &Vector3<f64>) -> Isometry3<f64> {
    let mut seed = Vector3::zeros();
    seed[z.iamin()] = 1.0;
    let x = (seed - z * z.dot(&seed)).normalize();
    let r = Matrix3::from_columns(&[x, z.cross(&x), *z]);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r));
    Isometry3::from_parts(Translation3::from(point.coords), turn)
}

/// A_i of equation (1) at a position of the joint itself.
fn motion(row: &Row, q: f64) -> Isometry3<f64> {
    let (turn, slide) = if row.prismatic { (0.0, q) } else { (q, 0.0) };
    let z = Isometry3::new(
        Vector3::z() * (row.d + slide),
        Vector3::z() * (row.theta + turn),
    );
    let x = Isometry3::new(Vector3::x() * row.a, Vector3::x() * row.alpha);
    z * x * Isometry3::rotation(Vector3::y() * row.beta)
}

/// Equation (1) at readings by name.
pub(crate) fn forward(table: &Table, q: &dyn Fn(&str) -> f64) -> Pose {
    let rows = table.rows.iter();
    let end = rows.fold(table.base, |at, row| {
        at * motion(row, row.multiplier * q(&row.reads) + row.offset)
    });
    Pose::of(&(end * table.tool))
}
