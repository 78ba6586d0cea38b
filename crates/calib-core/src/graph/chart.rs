//! Which of a pose's six degrees of freedom are unknown, and in which axes.
//!
//! ```text
//! X(c) = X₀ · ( Exp(Q ω), Q t ),   c = [ω; t] ∈ R⁶, entries that are not free are 0        (1)
//! X(c + dc) = X(c) · exp(D dc),    D = blkdiag( Jr(Qω) Q, Exp(Qω)ᵀ Q )                    (2)
//! ```
//!
//! Q turns the chart's axes into the child frame's (identity for the usual charts). Near X₀ this is
//! `X₀·exp(B c)`; away from it, equation (1) keeps a restricted chart on its surface (repeated
//! `exp(B δ)` with B = {rx, ry} would creep about z), makes the prior on c exactly quadratic, and
//! makes a box for an origin a box.

use calib_geometry::so3;
use nalgebra::{Isometry3, Matrix6, Translation3, Unit, UnitQuaternion, Vector3, Vector6};

/// The free directions of an unknown pose, order `[rx, ry, rz, tx, ty, tz]` in chart axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    child_from_chart: UnitQuaternion<f64>,
    free: [bool; 6],
    labels: [&'static str; 6],
}

/// Components below this are rounding of a unit vector along a coordinate axis.
const ALONG_AXIS: f64 = 1e-9;

impl Chart {
    /// Any subset of `[rx, ry, rz, x, y, z]` along the child frame's axes.
    #[must_use]
    pub fn of(free: [bool; 6]) -> Self {
        Self {
            child_from_chart: UnitQuaternion::identity(),
            free,
            labels: ["rx", "ry", "rz", "x", "y", "z"],
        }
    }

    /// All six.
    #[must_use]
    pub fn full() -> Self {
        Self::of([true; 6])
    }

    /// Nothing free.
    #[must_use]
    pub fn none() -> Self {
        Self::of([false; 6])
    }

    /// The three translations.
    #[must_use]
    pub fn position() -> Self {
        Self::of([false, false, false, true, true, true])
    }

    /// The three rotations.
    #[must_use]
    pub fn orientation() -> Self {
        Self::of([true, true, true, false, false, false])
    }

    /// The line through the child's origin along `axis` (child axes): two tilts and two shifts
    /// across it. For a joint origin: what the motion of that joint alone can tell.
    #[must_use]
    pub fn axis_line(axis: &Unit<Vector3<f64>>) -> Self {
        Self::along(axis, [true, true, false, true, true, false])
    }

    /// The direction `axis` (child axes): two tilts.
    #[must_use]
    pub fn direction(axis: &Unit<Vector3<f64>>) -> Self {
        Self::along(axis, [true, true, false, false, false, false])
    }

    /// A shift along `axis` (child axes).
    #[must_use]
    pub fn slide(axis: &Unit<Vector3<f64>>) -> Self {
        Self::along(axis, [false, false, false, false, false, true])
    }

    /// A turn about `axis` (child axes).
    #[must_use]
    pub fn turn(axis: &Unit<Vector3<f64>>) -> Self {
        Self::along(axis, [false, false, true, false, false, false])
    }

    /// `free` says for the two directions across the axis and the axis itself; coordinate axes keep
    /// their own names.
    fn along(axis: &Unit<Vector3<f64>>, free: [bool; 6]) -> Self {
        for k in 0..3 {
            if (axis[k].abs() - 1.0).abs() < ALONG_AXIS {
                let mut own = [false; 6];
                for half in [0, 3] {
                    let mut across = 0;
                    for i in 0..3 {
                        own[half + i] = if i == k {
                            free[half + 2]
                        } else {
                            across += 1;
                            free[half + across - 1]
                        };
                    }
                }
                return Self::of(own);
            }
        }
        let child_from_chart = UnitQuaternion::rotation_between(&Vector3::z(), axis)
            .unwrap_or_else(UnitQuaternion::identity);
        Self {
            child_from_chart,
            free,
            labels: ["r1", "r2", "raxis", "t1", "t2", "taxis"],
        }
    }

    /// Which of the six are free.
    #[must_use]
    pub fn free(&self) -> [bool; 6] {
        self.free
    }

    /// Name endings of the six coordinates.
    #[must_use]
    pub fn labels(&self) -> [&'static str; 6] {
        self.labels
    }

    /// Rotation from chart axes to the child frame's axes (Q of equation 1).
    #[must_use]
    pub fn child_from_chart(&self) -> UnitQuaternion<f64> {
        self.child_from_chart
    }

    /// Equation (1) without X₀: the displacement `nominal⁻¹ · X` at coordinates c.
    #[must_use]
    pub fn displacement(&self, c: &Vector6<f64>) -> Isometry3<f64> {
        let omega = self.child_from_chart * Vector3::new(c[0], c[1], c[2]);
        let t = self.child_from_chart * Vector3::new(c[3], c[4], c[5]);
        Isometry3::from_parts(Translation3::from(t), so3::exp(&omega))
    }

    /// Coordinates of a displacement; those that are not free come out too (their size says how far
    /// the displacement lies off the chart).
    #[must_use]
    pub fn coordinates(&self, displacement: &Isometry3<f64>) -> Vector6<f64> {
        let chart_from_child = self.child_from_chart.inverse();
        let omega = chart_from_child * so3::log(&displacement.rotation);
        let t = chart_from_child * displacement.translation.vector;
        Vector6::new(omega.x, omega.y, omega.z, t.x, t.y, t.z)
    }

    /// D of equation (2): columns are right twists of X per unit of each coordinate.
    #[must_use]
    pub fn differential(&self, c: &Vector6<f64>) -> Matrix6<f64> {
        let q = self.child_from_chart.to_rotation_matrix();
        let omega = q * Vector3::new(c[0], c[1], c[2]);
        let mut d = Matrix6::zeros();
        d.fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(so3::right_jacobian(&omega) * q.matrix()));
        d.fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&(so3::exp(&omega).to_rotation_matrix().matrix().transpose() * q.matrix()));
        d
    }
}
