//! How the columns of an orientation are read.

use calib_recording::{BodyColumns, EulerAxes, RotationColumns};
use serde::Serialize;

/// How numbers state an orientation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Notation {
    /// A quaternion.
    Quaternion {
        /// The scalar part is its first number.
        scalar_first: bool,
    },
    /// Axis times angle.
    RotationVector,
    /// Angles about axes that turn with the body.
    Euler(EulerAxes),
    /// A matrix, row by row.
    Matrix,
    /// The axis, and the angle about it.
    AxisAngle,
}

impl Notation {
    /// That of a body's columns, and these in its order.
    #[must_use]
    pub fn of(body: &BodyColumns) -> Option<(Self, Vec<String>)> {
        Some(match body.rotations().next()? {
            RotationColumns::QuaternionXyzw(of) => {
                let scalar_first = false;
                (Self::Quaternion { scalar_first }, of.to_vec())
            }
            RotationColumns::QuaternionWxyz(of) => {
                let scalar_first = true;
                (Self::Quaternion { scalar_first }, of.to_vec())
            }
            RotationColumns::RotationVector(of) => (Self::RotationVector, of.to_vec()),
            RotationColumns::FixedXyz(of) => {
                let of = of.iter().rev().cloned().collect();
                (Self::Euler(EulerAxes::Zyx), of)
            }
            RotationColumns::Euler(axes, of) => (Self::Euler(axes), of.to_vec()),
            RotationColumns::Matrix(of) => (Self::Matrix, of.to_vec()),
            RotationColumns::AxisAngle(of) => (Self::AxisAngle, of.to_vec()),
        })
    }

    /// Whether some of its numbers have a unit.
    #[must_use]
    pub fn has_angles(self) -> bool {
        !matches!(self, Self::Quaternion { .. } | Self::Matrix)
    }
}

/// How the notation of an orientation was found. Residuals of bodies on their links, rms, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TurnsHow {
    /// The names of the columns say it.
    Named,
    /// Bodies follow the robot with this one alone.
    Motion {
        /// With it.
        rms: f64,
        /// With the next best one.
        next: f64,
    },
    /// As those of other bodies of the same names, which the motion shows.
    AsOthers,
    /// The usual one for such names: the motion does not show it.
    Assumed,
}
