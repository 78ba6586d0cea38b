//! A direction with two unit vectors across it, and small turns of it.

use nalgebra::{Matrix3, Unit, Vector3};

/// Orthonormal `[e₁ e₂ n]`, right-handed, n the axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AxisFrame {
    pub e1: Vector3<f64>,
    pub e2: Vector3<f64>,
    pub n: Vector3<f64>,
}

impl AxisFrame {
    /// A frame whose third axis is `n`; the other two are chosen by n alone.
    pub fn of(n: Vector3<f64>) -> Self {
        let n = n.normalize();
        // The coordinate axis farthest from n.
        let k = n.iamin();
        let e1 = Vector3::ith(k, 1.0).cross(&n).normalize();
        Self {
            e1,
            e2: n.cross(&e1),
            n,
        }
    }

    /// n turned by the small vector `a e₁ + b e₂` (exact length one, second order in the step).
    pub fn turned(&self, a: f64, b: f64) -> Self {
        let n = (self.n + self.e1 * a + self.e2 * b).normalize();
        let e1 = (self.e1 - n * self.e1.dot(&n)).normalize();
        Self {
            e1,
            e2: n.cross(&e1),
            n,
        }
    }

    /// Coordinates (e₁, e₂, n) of a vector.
    pub fn coordinates(&self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(v.dot(&self.e1), v.dot(&self.e2), v.dot(&self.n))
    }

    /// The frame's axes in columns.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_columns(&[self.e1, self.e2, self.n])
    }
}

/// Angle in [0, 2π) that the samples cover: a full turn less the widest gap.
pub(crate) fn arc_covered(angles: &mut [f64]) -> f64 {
    angles.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (angles.first(), angles.last()) else {
        return 0.0;
    };
    let wrap = first + std::f64::consts::TAU - last;
    let widest = angles.windows(2).map(|w| w[1] - w[0]).fold(wrap, f64::max);
    std::f64::consts::TAU - widest
}

/// The sign (±1) that an axis gets: by the joint angles where given, else towards a reference, else so that
/// its largest component is positive. `turn` pairs a sample's angle about the axis with its joint angle.
pub(crate) fn sign(
    n: &Vector3<f64>,
    towards: Option<Unit<Vector3<f64>>>,
    turn: impl Iterator<Item = (f64, f64)> + Clone,
) -> f64 {
    // |Σ exp i(φ − q)| against |Σ exp i(φ + q)|: which sense keeps φ and q in step?
    let coherence = |s: f64| {
        let (mut c, mut d) = (0.0, 0.0);
        for (phi, q) in turn.clone() {
            let (sin, cos) = (phi - s * q).sin_cos();
            c += cos;
            d += sin;
        }
        c.hypot(d)
    };
    let (with, against) = (coherence(1.0), coherence(-1.0));
    if with != against {
        return if with > against { 1.0 } else { -1.0 };
    }
    let reference = towards.map_or(n[n.iamax()], |r| r.dot(n));
    if reference < 0.0 { -1.0 } else { 1.0 }
}
