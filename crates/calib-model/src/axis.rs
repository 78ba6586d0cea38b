//! The axis of a joint, and the directions across it.

use nalgebra::{Unit, Vector3};

/// What a joint's motion is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Axis {
    /// Rotation about this direction through the joint frame's origin (q in rad).
    Revolute(Unit<Vector3<f64>>),
    /// Translation along this direction (q in m).
    Prismatic(Unit<Vector3<f64>>),
}

impl Axis {
    /// The direction, in the joint frame.
    #[must_use]
    pub fn direction(&self) -> Unit<Vector3<f64>> {
        match self {
            Self::Revolute(a) | Self::Prismatic(a) => *a,
        }
    }

    /// Two unit vectors that complete the axis to a right-handed basis (a, e₁, e₂): the axes of
    /// lateral compliance. For a coordinate axis they are coordinate axes (z: x and y).
    #[must_use]
    pub fn across(&self) -> [Vector3<f64>; 2] {
        let a = self.direction().into_inner();
        // The coordinate axis after the dominant one, orthogonalized.
        let k = a.iamax();
        let mut seed = Vector3::zeros();
        seed[(k + 1) % 3] = 1.0;
        let e1 = (seed - a * a.dot(&seed)).normalize();
        [e1, a.cross(&e1)]
    }
}
