//! Lines in space, and the screw axis of a motion.

use nalgebra::{Isometry3, Point3, Unit, Vector3};
use serde::{Deserialize, Serialize};

use crate::se3;

/// An undirected line carried with one of its points (m) and a unit direction.
///
/// Two values that differ in the sign of the direction or in the point along it are the same line;
/// compare with [`Line::same_line`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// A point on the line, m.
    pub point: Point3<f64>,
    /// Unit direction.
    pub direction: Unit<Vector3<f64>>,
}

impl Line {
    /// The line through `point` along `direction`; `None` for a zero or non-finite direction.
    #[must_use]
    pub fn new(point: Point3<f64>, direction: Vector3<f64>) -> Option<Self> {
        let direction = Unit::try_new(direction, f64::MIN_POSITIVE.sqrt())?;
        let finite = point.iter().chain(direction.iter()).all(|x| x.is_finite());
        finite.then_some(Self { point, direction })
    }

    /// Foot of the perpendicular from `p`.
    #[must_use]
    pub fn closest_point_to(&self, p: &Point3<f64>) -> Point3<f64> {
        self.point + self.direction.into_inner() * (p - self.point).dot(&self.direction)
    }

    /// Distance of `p` from the line, m.
    #[must_use]
    pub fn distance_to_point(&self, p: &Point3<f64>) -> f64 {
        (p - self.closest_point_to(p)).norm()
    }

    /// Angle between the undirected lines, rad, in [0, π/2]; accurate for nearly parallel ones.
    #[must_use]
    pub fn angle_to(&self, other: &Self) -> f64 {
        let cross = self.direction.cross(&other.direction).norm();
        cross.atan2(self.direction.dot(&other.direction).abs())
    }

    /// The points of `self` and `other` that are nearest to each other.
    ///
    /// Parallel lines have no unique pair: then `self.point` and its foot on `other`.
    #[must_use]
    pub fn closest_points(&self, other: &Self) -> (Point3<f64>, Point3<f64>) {
        /// sin² of the angle below which rounding decides where the pair lies.
        const PARALLEL: f64 = 1e-20;
        let (d1, d2) = (self.direction.into_inner(), other.direction.into_inner());
        let normal = d1.cross(&d2);
        let n2 = normal.norm_squared();
        if n2 < PARALLEL {
            return (self.point, other.closest_point_to(&self.point));
        }
        let between = other.point - self.point;
        let s = between.cross(&d2).dot(&normal) / n2;
        let t = between.cross(&d1).dot(&normal) / n2;
        (self.point + d1 * s, other.point + d2 * t)
    }

    /// Shortest distance between the two lines, m.
    #[must_use]
    pub fn distance_to_line(&self, other: &Self) -> f64 {
        let (a, b) = self.closest_points(other);
        (a - b).norm()
    }

    /// The same line in another frame.
    #[must_use]
    pub fn moved_by(&self, new_from_old: &Isometry3<f64>) -> Self {
        let direction = new_from_old.rotation * self.direction;
        Self {
            point: new_from_old * self.point,
            direction,
        }
    }

    /// Whether both are one line to within `tolerance` in angle (rad) and distance (m).
    #[must_use]
    pub fn same_line(&self, other: &Self, tolerance: f64) -> bool {
        self.angle_to(other) <= tolerance && other.distance_to_point(&self.point) <= tolerance
    }

    /// The same undirected line with its direction within 90° of `reference`.
    #[must_use]
    pub fn towards(&self, reference: &Vector3<f64>) -> Self {
        let flip = self.direction.dot(reference) < 0.0;
        Self {
            point: self.point,
            direction: if flip {
                -self.direction
            } else {
                self.direction
            },
        }
    }
}

/// The screw of a rigid motion: a turn about a line and a slide along it (Chasles).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScrewAxis {
    /// The axis, its point the one nearest to the origin of the frame.
    pub line: Line,
    /// Turn about the axis, rad, in (0, π].
    pub angle: f64,
    /// Slide along the axis, m.
    pub slide: f64,
}

impl ScrewAxis {
    /// Screw of `motion`, `None` when it turns by less than `min_angle` (rad): a translation has no axis.
    #[must_use]
    pub fn of(motion: &Isometry3<f64>, min_angle: f64) -> Option<Self> {
        let twist = se3::log(motion);
        let omega = twist.angular();
        let angle = omega.norm();
        if !angle.is_finite() || angle <= min_angle {
            return None;
        }
        // a point on the axis: ω × v / θ²; slide along it: ω·v/θ
        let point = Point3::from(omega.cross(&twist.linear()) / (angle * angle));
        let line = Line::new(point, omega)?;
        Some(Self {
            line,
            angle,
            slide: omega.dot(&twist.linear()) / angle,
        })
    }
}
