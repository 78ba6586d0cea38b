//! Where a joint stands in its parent's frame, and the pose of its child there.

use calib_geometry::so3;
use nalgebra::{Matrix3, Vector3};

use crate::axis::Axis;
use crate::effect::SinCos;
use crate::pose::Pose;

/// Where a joint stands in its parent, and how its motion turns the child there.
///
/// ```text
/// R Exp(φ a) = R a aᵀ + cos φ R (1 − a aᵀ) + sin φ R [a]ₓ
/// ```
#[derive(Debug, Clone)]
pub(crate) struct Origin {
    /// `parent_from_joint`.
    pub pose: Pose,
    /// The summands: still, with the cosine, with the sine.
    parts: [Matrix3<f64>; 3],
    /// Which coordinate axis it turns about, and its sign; `None`: another one, or it slides.
    coordinate: Option<(usize, f64)>,
    /// The axis in the parent's frame.
    pub axis: Vector3<f64>,
}

impl Origin {
    pub fn of(pose: Pose, axis: Option<Axis>) -> Self {
        let a = axis.map_or_else(Vector3::z, |a| a.direction().into_inner());
        let still = a * a.transpose();
        let parts = [still, Matrix3::identity() - still, so3::skew(&a)].map(|m| pose.r * m);
        let k = a.iamax();
        let turns = matches!(axis, Some(Axis::Revolute(_)));
        let coordinate = (turns && a[k].abs() == 1.0 && a.norm() == 1.0).then(|| (k, a[k]));
        Self {
            axis: pose.r * a,
            pose,
            parts,
            coordinate,
        }
    }

    /// `parent_from_child` of a joint without θ: its motion is a rotation or a translation alone.
    #[inline(always)]
    pub fn moved(&self, axis: Option<Axis>, by: f64, turned: &SinCos) -> Pose {
        let r = match (axis, self.coordinate) {
            (Some(Axis::Revolute(_)), Some((k, sign))) => {
                let (sin, cos) = (sign * turned.sin, turned.cos);
                let columns = &self.pose.r.data.0;
                match k {
                    0 => mixed::<0, 1, 2>(columns, sin, cos),
                    1 => mixed::<1, 2, 0>(columns, sin, cos),
                    _ => mixed::<2, 0, 1>(columns, sin, cos),
                }
            }
            (Some(Axis::Revolute(_)), None) => {
                let [still, cos, sin] = &self.parts;
                still + cos * turned.cos + sin * turned.sin
            }
            (Some(Axis::Prismatic(_)), _) => {
                return Pose {
                    r: self.pose.r,
                    t: self.pose.t + self.axis * by,
                };
            }
            (None, _) => return self.pose,
        };
        Pose { r, t: self.pose.t }
    }
}

/// A rotation about the coordinate axis K mixes the two other columns.
#[inline(always)]
fn mixed<const K: usize, const I: usize, const J: usize>(
    columns: &[[f64; 3]; 3],
    sin: f64,
    cos: f64,
) -> Matrix3<f64> {
    let (x, y) = (columns[I], columns[J]);
    let mut out = [columns[K]; 3];
    for n in 0..3 {
        out[I][n] = cos * x[n] + sin * y[n];
        out[J][n] = cos * y[n] - sin * x[n];
    }
    Matrix3::from_data(nalgebra::ArrayStorage(out))
}
