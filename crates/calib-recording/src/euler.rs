//! Euler angles: three rotations about axes that turn with the body.

use nalgebra::{Rotation3, Unit, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The axes of three rotations, each as the rotations before it have left it: `xyz` is `Rx(a)·Ry(b)·Rz(c)`. The same rotations about fixed axes
/// are those of the letters and angles in reverse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EulerAxes {
    /// `Rx(a)·Ry(b)·Rz(c)`
    Xyz,
    /// `Rx(a)·Rz(b)·Ry(c)`
    Xzy,
    /// `Ry(a)·Rx(b)·Rz(c)`
    Yxz,
    /// `Ry(a)·Rz(b)·Rx(c)`
    Yzx,
    /// `Rz(a)·Rx(b)·Ry(c)`
    Zxy,
    /// `Rz(a)·Ry(b)·Rx(c)`
    Zyx,
    /// `Rx(a)·Ry(b)·Rx(c)`
    Xyx,
    /// `Rx(a)·Rz(b)·Rx(c)`
    Xzx,
    /// `Ry(a)·Rx(b)·Ry(c)`
    Yxy,
    /// `Ry(a)·Rz(b)·Ry(c)`
    Yzy,
    /// `Rz(a)·Rx(b)·Rz(c)`
    Zxz,
    /// `Rz(a)·Ry(b)·Rz(c)`
    Zyz,
}

impl EulerAxes {
    /// All of them.
    pub const ALL: [EulerAxes; 12] = [
        EulerAxes::Xyz,
        EulerAxes::Xzy,
        EulerAxes::Yxz,
        EulerAxes::Yzx,
        EulerAxes::Zxy,
        EulerAxes::Zyx,
        EulerAxes::Xyx,
        EulerAxes::Xzx,
        EulerAxes::Yxy,
        EulerAxes::Yzy,
        EulerAxes::Zxz,
        EulerAxes::Zyz,
    ];

    /// As a column map writes it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            EulerAxes::Xyz => "xyz",
            EulerAxes::Xzy => "xzy",
            EulerAxes::Yxz => "yxz",
            EulerAxes::Yzx => "yzx",
            EulerAxes::Zxy => "zxy",
            EulerAxes::Zyx => "zyx",
            EulerAxes::Xyx => "xyx",
            EulerAxes::Xzx => "xzx",
            EulerAxes::Yxy => "yxy",
            EulerAxes::Yzy => "yzy",
            EulerAxes::Zxz => "zxz",
            EulerAxes::Zyz => "zyz",
        }
    }

    /// The axes: 0 is x.
    #[must_use]
    pub fn axes(self) -> [usize; 3] {
        let mut axes = [0; 3];
        for (axis, letter) in axes.iter_mut().zip(self.name().bytes()) {
            *axis = usize::from(letter - b'x');
        }
        axes
    }

    fn vectors(self) -> [Unit<Vector3<f64>>; 3] {
        self.axes().map(Vector3::ith_axis)
    }

    /// The rotation of three angles in rad.
    #[must_use]
    pub fn rotation(self, angles: [f64; 3]) -> UnitQuaternion<f64> {
        let [a, b, c] = self.vectors();
        UnitQuaternion::from_axis_angle(&a, angles[0])
            * UnitQuaternion::from_axis_angle(&b, angles[1])
            * UnitQuaternion::from_axis_angle(&c, angles[2])
    }

    /// Three angles in rad of a rotation, the third 0 where the first and the last axis lie on each other.
    #[must_use]
    pub fn angles(self, rotation: &UnitQuaternion<f64>) -> [f64; 3] {
        /// Cosine or sine of the second angle below which only a sum of the two others is known.
        const ON_EACH_OTHER: f64 = 1e-9;
        let r: Rotation3<f64> = rotation.to_rotation_matrix();
        let [i, j, last] = self.axes();
        let k = 3 - i - j;
        let right_handed = (i + 1) % 3 == j;
        let e = if right_handed { 1.0 } else { -1.0 };
        // What of the last axis lies across the first: it says how well the two are apart.
        let (second, apart) = if last == i {
            let across = r[(j, i)].hypot(r[(k, i)]);
            (across.atan2(r[(i, i)]), across)
        } else {
            let along = r[(i, i)].hypot(r[(i, j)]);
            ((e * r[(i, k)]).atan2(along), along)
        };
        if apart < ON_EACH_OTHER {
            return [(e * r[(k, j)]).atan2(r[(j, j)]), second, 0.0];
        }
        let (first, third) = if last == i {
            (
                r[(j, i)].atan2(-e * r[(k, i)]),
                r[(i, j)].atan2(e * r[(i, k)]),
            )
        } else {
            (
                (-e * r[(j, k)]).atan2(r[(k, k)]),
                (-e * r[(i, j)]).atan2(r[(i, i)]),
            )
        };
        [first, second, third]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_come_back_as_the_same_rotation() {
        for axes in EulerAxes::ALL {
            for k in 0..200 {
                let k = f64::from(k);
                let angles = [(1.7 * k).sin() * 3.1, (2.3 * k).sin() * 3.1, k.cos() * 3.1];
                let rotation = axes.rotation(angles);
                let again = axes.rotation(axes.angles(&rotation));
                assert!(rotation.angle_to(&again) < 1e-7, "{axes:?} {angles:?}");
            }
            for second in [0.0, 0.5, 1.0, -0.5].map(|k| k * std::f64::consts::PI) {
                let rotation = axes.rotation([0.4, second, -1.1]);
                let again = axes.rotation(axes.angles(&rotation));
                assert!(rotation.angle_to(&again) < 1e-7, "{axes:?} {second}");
            }
        }
    }

    #[test]
    fn fixed_axes_are_turning_ones_in_reverse() {
        let (a, b, c) = (0.3, -0.7, 1.9);
        let fixed = UnitQuaternion::from_euler_angles(a, b, c);
        assert!(EulerAxes::Zyx.rotation([c, b, a]).angle_to(&fixed) < 1e-12);
    }
}
