//! Links as capsules, and how far they are from each other, from boxes and from the ground.
//!
//! ```text
//! capsule: every point within r of the segment a b;   distance of two: |segment − segment| − r₁ − r₂      (1)
//! segment − segment: least |a₁ + s d₁ − a₂ − t d₂| over s, t in [0, 1] (Ericson, Real-Time Collision Detection, 5.1.9)
//! ```
//!
//! A capsule holds its shape whole, so that what is clear here is clear; a flat box becomes several side by side.

use calib_geometry::decompose;
use nalgebra::{DMatrix, Isometry3, Point3, Vector3};

/// All points within a radius of a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capsule {
    /// One end of the segment, m.
    pub a: Point3<f64>,
    /// The other end, m.
    pub b: Point3<f64>,
    /// Radius, m.
    pub r: f64,
}

/// Strips that a flat shape is cut into at the most.
const STRIPS: usize = 12;

impl Capsule {
    /// The same in another frame.
    #[must_use]
    pub fn moved(&self, to_from_this: &Isometry3<f64>) -> Self {
        Self {
            a: to_from_this * self.a,
            b: to_from_this * self.b,
            r: self.r,
        }
    }

    /// Distance to another one, m; below 0 where they overlap.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        between_segments((&self.a, &self.b), (&other.a, &other.b)) - self.r - other.r
    }

    /// Distance to a box around the origin of its frame, m.
    #[must_use]
    pub fn distance_to_box(&self, size: &Vector3<f64>, root_from_box: &Isometry3<f64>) -> f64 {
        let into = root_from_box.inverse();
        let (a, b) = (into * self.a, into * self.b);
        let half = size / 2.0;
        let outside = |t: f64| {
            let p = a.coords.lerp(&b.coords, t).abs() - half;
            p.sup(&Vector3::zeros()).norm()
        };
        // The distance to a convex set is convex along a line: thirds are cut off until 1e-6 of the segment is left.
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..35 {
            let (x, y) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if outside(x) <= outside(y) {
                high = y;
            } else {
                low = x;
            }
        }
        outside((low + high) / 2.0) - self.r
    }

    /// Height of its lowest point, m.
    #[must_use]
    pub fn lowest(&self) -> f64 {
        self.a.z.min(self.b.z) - self.r
    }

    /// Whether it covers the way from one point to another.
    #[must_use]
    pub fn hides(&self, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        between_segments((&self.a, &self.b), (from, to)) < self.r
    }
}

/// Least distance between two segments, m.
fn between_segments(
    (a1, b1): (&Point3<f64>, &Point3<f64>),
    (a2, b2): (&Point3<f64>, &Point3<f64>),
) -> f64 {
    /// Squared lengths below this are points.
    const POINT: f64 = 1e-18;
    let (d1, d2, w) = (b1 - a1, b2 - a2, a1 - a2);
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&w));
    let c = d1.dot(&w);
    let b = d1.dot(&d2);
    let (s, t) = if a <= POINT && e <= POINT {
        (0.0, 0.0)
    } else if a <= POINT {
        (0.0, (f / e).clamp(0.0, 1.0))
    } else if e <= POINT {
        ((-c / a).clamp(0.0, 1.0), 0.0)
    } else {
        let denominator = a * e - b * b;
        let s = if denominator > 1e-12 * a * e {
            ((b * f - c * e) / denominator).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let t = (b * s + f) / e;
        if t < 0.0 {
            ((-c / a).clamp(0.0, 1.0), 0.0)
        } else if t > 1.0 {
            (((b - c) / a).clamp(0.0, 1.0), 1.0)
        } else {
            (s, t)
        }
    };
    (w + d1 * s - d2 * t).norm()
}

/// Capsules that hold all these points (the corners of a shape): one along its longest direction, or strips of a flat shape.
#[must_use]
pub fn capsules(points: &[Point3<f64>]) -> Vec<Capsule> {
    let Some((center, axes, half)) = oriented_box(points) else {
        return Vec::new();
    };
    let [long, wide, thin] = [half[0], half[1], half[2]];
    let strips = if wide > 2.0 * thin {
        ((wide / thin.max(wide / STRIPS as f64)).ceil() as usize).clamp(1, STRIPS)
    } else {
        1
    };
    if strips > 1 {
        let step = 2.0 * wide / strips as f64;
        let r = (thin * thin + step * step / 4.0).sqrt();
        let at = |k: usize| center + axes[1] * (step * (k as f64 + 0.5) - wide);
        let strip = |k: usize| Capsule {
            a: at(k) - axes[0] * long,
            b: at(k) + axes[0] * long,
            r,
        };
        return (0..strips).map(strip).collect();
    }
    let off_axis = |p: &Point3<f64>| {
        let d = p - center;
        let along = d.dot(&axes[0]);
        (along, (d - axes[0] * along).norm())
    };
    let r = points.iter().map(|p| off_axis(p).1).fold(0.0, f64::max);
    // A point at d from the axis is within the end's half ball of the segment up to |along| − √(r² − d²).
    let reach = |p: &Point3<f64>| {
        let (along, d) = off_axis(p);
        along.abs() - (r * r - d * d).max(0.0).sqrt()
    };
    let h = points.iter().map(reach).fold(0.0, f64::max);
    vec![Capsule {
        a: center - axes[0] * h,
        b: center + axes[0] * h,
        r,
    }]
}

/// Center, axes and half extents of a box, the longest first.
type OrientedBox = (Point3<f64>, [Vector3<f64>; 3], [f64; 3]);

/// The smaller of the boxes along the scatter of the points and along the axes of their frame.
fn oriented_box(points: &[Point3<f64>]) -> Option<OrientedBox> {
    let n = points.len();
    let mean = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / n.max(1) as f64;
    if n == 0 || !mean.iter().all(|x| x.is_finite()) {
        return None;
    }
    let mut scatter = DMatrix::zeros(3, 3);
    for p in points {
        let d = p.coords - mean;
        scatter += DMatrix::from_fn(3, 3, |i, j| d[i] * d[j]);
    }
    let eigen = decompose::symmetric_eigen(&scatter);
    let of_scatter = [0, 1, 2].map(|k| {
        let v = eigen.vectors.column(k);
        Vector3::new(v[0], v[1], v[2])
    });
    let own = [Vector3::x(), Vector3::y(), Vector3::z()];
    // A cube has no direction of its own: the smaller of both boxes.
    let boxes = [of_scatter, own].map(|axes| extents(points, &axes));
    let volume = |b: &(Point3<f64>, [(Vector3<f64>, f64); 3])| b.1.iter().map(|a| a.1).product();
    let (a, b): (f64, f64) = (volume(&boxes[0]), volume(&boxes[1]));
    let [scattered, own] = boxes;
    let (center, mut sides) = if b <= a * 1.001 { own } else { scattered };
    sides.sort_by(|x, y| y.1.total_cmp(&x.1));
    Some((center, sides.map(|s| s.0), sides.map(|s| s.1)))
}

fn extents(
    points: &[Point3<f64>],
    axes: &[Vector3<f64>; 3],
) -> (Point3<f64>, [(Vector3<f64>, f64); 3]) {
    let mut center = Point3::origin();
    let sides = axes.map(|axis| {
        let along = points.iter().map(|p| p.coords.dot(&axis));
        let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        });
        center += axis * ((low + high) / 2.0);
        (axis, (high - low) / 2.0)
    });
    (center, sides)
}
