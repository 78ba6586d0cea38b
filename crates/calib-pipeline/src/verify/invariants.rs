//! Numbers of a robot that no choice of frames changes: how the axes of its joints lie to each other at zero.
//!
//! ```text
//! two neighbors k, k+1          distance a and angle α between the axes; for parallel axes the distance and two tilts
//! three neighbors k, k+1, k+2   along axis k+1: the offset d between the feet of the common normals,
//!                                and the angle θ between these normals, which a zero offset moves
//! ```
//!
//! Joints that slide have directions only. One along an axis is passed over: the axes on both sides of it are neighbors.
//! The normal of two parallel axes is the direction from the one to the other, and has no foot: three parallel axes have θ and no d.
//!
//! These are Denavit and Hartenberg's four (1955). Where an origin lies on its axis and where a frame's x points are
//! conventions that a calibration cannot know; none of these numbers contains them.

use std::collections::BTreeMap;

use calib_report::Unit;
use calib_urdf::{JointId, RobotModel};
use nalgebra::{Point3, Unit as UnitVector, Vector3};

/// Which of the numbers between neighboring axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum InvariantKind {
    /// Angle between two axes.
    Angle,
    /// Distance between two axes.
    Distance,
    /// Tilt of a parallel axis in the plane of both.
    Tilt,
    /// Tilt of a parallel axis out of that plane.
    Twist,
    /// Offset along the middle one of three axes.
    Offset,
    /// Angle between the common normals of three axes.
    Zero,
}

impl InvariantKind {
    fn word(self) -> &'static str {
        match self {
            Self::Angle => "angle",
            Self::Distance => "distance",
            Self::Tilt => "tilt",
            Self::Twist => "twist",
            Self::Offset => "offset",
            Self::Zero => "zero",
        }
    }
}

/// A number that no choice of frames changes.
#[derive(Debug, Clone, PartialEq)]
pub struct Invariant {
    /// Which number.
    pub kind: InvariantKind,
    /// Of which joints: two neighbors, or the middle one twice.
    pub joints: [JointId; 2],
    /// `distance.shoulder.elbow`
    pub name: String,
    /// In words.
    pub text: String,
    /// Meters or radians.
    pub unit: Unit,
    /// m or rad.
    pub value: f64,
}

impl Invariant {
    /// Is it known up to full turns?
    #[must_use]
    pub fn is_angle(&self) -> bool {
        self.unit == Unit::Radian
    }
}

/// Axes whose angle's sine is below this (about 9°) are treated as parallel: their common normal is badly defined.
const PARALLEL: f64 = 0.15;
/// Axes nearer than this to each other, and parallel, are one line: no direction between them (m).
const ONE_LINE: f64 = 1e-3;

/// An axis of a joint at zero, in the root's frame.
struct Line {
    id: JointId,
    name: String,
    slides: bool,
    point: Point3<f64>,
    direction: UnitVector<Vector3<f64>>,
}

/// All invariants of a robot's moving joints, from the root outwards.
#[must_use]
pub fn invariants(model: &RobotModel) -> Vec<Invariant> {
    let poses = model.forward_kinematics(&model.zero_positions());
    let line = |id: JointId| {
        let joint = model.joint(id);
        let axis = joint.kind.axis()?;
        // At zero the child stands where the joint's origin is.
        let at = poses[joint.child.index()];
        Some(Line {
            id,
            name: joint.name.clone(),
            slides: !joint.kind.turns(),
            point: at.translation.vector.into(),
            direction: at.rotation * axis,
        })
    };
    let mut found = Vec::new();
    // The third joint of what is named after the middle one.
    let mut thirds = BTreeMap::new();
    for id in model.joint_ids() {
        let Some(last) = line(id) else { continue };
        let above: Vec<Line> = moving_joints_above(model, id).filter_map(line).collect();
        let Some(nearest) = above.first() else {
            continue;
        };
        pair(nearest, &last, &mut found);
        let Some(at) = above.iter().position(|other| !other.slides) else {
            continue;
        };
        let middle = &above[at];
        // A slide along an axis does not change how the axes on both sides of it lie to each other.
        if at > 0 && !last.slides {
            pair(middle, &last, &mut found);
        }
        let of_slide = |slide: &Line| slide.slides && !is_parallel(middle, slide);
        let nearest_behind = !above[..at].iter().any(of_slide) && (!last.slides || of_slide(&last));
        let first = above[at + 1..]
            .iter()
            .find(|other| !other.slides || of_slide(other));
        if let Some(first) = first.filter(|_| nearest_behind) {
            let before = found.len();
            triple(first, middle, &last, &mut found);
            thirds.extend((before..found.len()).map(|place| (place, last.name.clone())));
        }
    }
    name_branches(&mut found, &thirds);
    found
}

/// Where a joint carries several others, the numbers that are named after it are named after the one that it carries as well.
fn name_branches(found: &mut [Invariant], thirds: &BTreeMap<usize, String>) {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for invariant in found.iter() {
        *counts.entry(invariant.name.clone()).or_default() += 1;
    }
    for (place, third) in thirds {
        let name = &mut found[*place].name;
        if counts.get(name).is_some_and(|count| *count > 1) {
            *name = format!("{name}.{third}");
        }
    }
}

/// The moving joints between a joint and the root, nearest first.
fn moving_joints_above(model: &RobotModel, id: JointId) -> impl Iterator<Item = JointId> {
    let mut link = model.joint(id).parent;
    std::iter::from_fn(move || {
        loop {
            let above = model.link(link).parent_joint?;
            link = model.joint(above).parent;
            if model.joint(above).kind.axis().is_some() {
                return Some(above);
            }
        }
    })
}

fn pair(a: &Line, b: &Line, found: &mut Vec<Invariant>) {
    let cross = a.direction.cross(&b.direction);
    let between = b.point - a.point;
    // Two lines that slide have directions only.
    let places = !(a.slides || b.slides);
    let mut push = |kind: InvariantKind, text: String, unit: Unit, value: f64| {
        found.push(Invariant {
            kind,
            joints: [a.id, b.id],
            name: format!("{}.{}.{}", kind.word(), a.name, b.name),
            text,
            unit,
            value,
        });
    };
    let axes = format!("the axes of {} and {}", a.name, b.name);
    if cross.norm() > PARALLEL {
        push(
            InvariantKind::Angle,
            format!("angle between {axes}"),
            Unit::Radian,
            cross.norm().atan2(a.direction.dot(&b.direction)),
        );
        if places {
            // Signed along a × b: smooth also where the axes meet.
            push(
                InvariantKind::Distance,
                format!("signed distance between {axes}"),
                Unit::Meter,
                between.dot(&(cross / cross.norm())),
            );
        }
        return;
    }
    let across = across(a, b);
    if !places || across.norm() < ONE_LINE {
        return;
    }
    let towards = across / across.norm();
    let sign = a.direction.dot(&b.direction).signum();
    push(
        InvariantKind::Distance,
        format!("distance between {axes}"),
        Unit::Meter,
        across.norm(),
    );
    push(
        InvariantKind::Tilt,
        format!("tilt of {} toward {}", b.name, a.name),
        Unit::Radian,
        (sign * b.direction.dot(&towards)).asin(),
    );
    push(
        InvariantKind::Twist,
        format!("tilt of {} out of its plane with {}", b.name, a.name),
        Unit::Radian,
        (sign * b.direction.dot(&a.direction.cross(&towards))).asin(),
    );
}

fn triple(a: &Line, b: &Line, c: &Line, found: &mut Vec<Invariant>) {
    let slides = a.slides || c.slides;
    let feet = || Some((foot(b, a)?, foot(b, c)?));
    if let Some((to_a, to_c)) = feet().filter(|_| !slides) {
        found.push(Invariant {
            kind: InvariantKind::Offset,
            joints: [b.id; 2],
            name: format!("offset.{}", b.name),
            text: format!("offset along {} between {} and {}", b.name, a.name, c.name),
            unit: Unit::Meter,
            value: to_c - to_a,
        });
    }
    if let (Some(to_a), Some(to_c)) = (normal(b, a), normal(b, c)) {
        let sine = b.direction.dot(&to_a.cross(&to_c));
        found.push(Invariant {
            kind: InvariantKind::Zero,
            joints: [b.id; 2],
            name: format!("zero.{}", b.name),
            text: format!("zero angle of {} between {} and {}", b.name, a.name, c.name),
            unit: Unit::Radian,
            value: sine.atan2(to_a.dot(&to_c)),
        });
    }
}

/// Foot of the common normal on `b`, m along it; `None` for parallel axes, which have many.
fn foot(b: &Line, other: &Line) -> Option<f64> {
    let cross = b.direction.cross(&other.direction);
    let squared = cross.norm_squared();
    // s: |p_b + s·d_b − p_o − t·d_o| is smallest
    let between = other.point - b.point;
    (squared.sqrt() > PARALLEL).then(|| between.cross(&other.direction).dot(&cross) / squared)
}

fn is_parallel(a: &Line, b: &Line) -> bool {
    a.direction.cross(&b.direction).norm() <= PARALLEL
}

/// Direction of the common normal; `None` for axes on one line, and for a slide along the axis.
fn normal(b: &Line, other: &Line) -> Option<Vector3<f64>> {
    if !is_parallel(b, other) {
        return Some(b.direction.cross(&other.direction).normalize());
    }
    if other.slides {
        return None;
    }
    let across = across(b, other);
    (across.norm() >= ONE_LINE).then(|| across.normalize())
}

/// From `a` to a parallel axis, at a right angle to `a`.
fn across(a: &Line, b: &Line) -> Vector3<f64> {
    let between = b.point - a.point;
    between - a.direction.into_inner() * between.dot(&a.direction)
}
