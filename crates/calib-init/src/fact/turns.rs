//! How the columns of an orientation are read.

use calib_recording::{BodyColumns, EulerAxes};
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
}

impl Notation {
    /// That of a body's columns, and these in its order.
    #[must_use]
    pub fn of(body: &BodyColumns) -> Option<(Self, Vec<String>)> {
        let quaternion = |columns: &[String; 4], scalar_first| {
            (Self::Quaternion { scalar_first }, columns.to_vec())
        };
        if let Some(columns) = &body.quaternion_xyzw {
            return Some(quaternion(columns, false));
        }
        if let Some(columns) = &body.quaternion_wxyz {
            return Some(quaternion(columns, true));
        }
        if let Some(columns) = &body.rotation_vector {
            return Some((Self::RotationVector, columns.to_vec()));
        }
        if let Some(columns) = &body.fixed_xyz {
            let columns = columns.iter().rev().cloned().collect();
            return Some((Self::Euler(EulerAxes::Zyx), columns));
        }
        let euler = body.euler.as_ref()?;
        Some((Self::Euler(euler.axes), euler.columns.to_vec()))
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
