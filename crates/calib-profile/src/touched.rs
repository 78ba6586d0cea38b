//! What a point touches: as a person writes it, and as the program uses it. All that profiles know of a kind of contact.
//!
//! The touched thing has a frame of its own with z along its normal or direction. With p the touching point in it,
//!
//! ```text
//! plane p_z = 0     line p_x = p_y = 0     point p = 0     distance |p| = ℓ     cylinder √(p_x² + p_y²) = r     (1)
//! ```
//!
//! Where the rows of a recording say which point was touched (`coordinates`, `spots`), p is relative to that point.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use crate::units::MM;

/// What a point touches, in the frame of what it is fixed to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RawTouched {
    /// A plane, e.g. a table.
    Plane {
        /// Any point of the plane, mm.
        through_mm: [f64; 3],
        /// Its normal; any length.
        normal: [f64; 3],
    },
    /// A line, e.g. an edge or a taut wire.
    Line {
        /// Any point of the line, mm.
        through_mm: [f64; 3],
        /// Its direction; any length.
        direction: [f64; 3],
    },
    /// A point, e.g. a cone or a socket.
    Point {
        /// Where it is, mm.
        at_mm: [f64; 3],
    },
    /// A point at a known distance, e.g. the far ball of a ball bar.
    Distance {
        /// Where the far point is, mm.
        from_mm: [f64; 3],
        /// How far away, mm.
        distance_mm: f64,
    },
    /// The mantle of a cylinder, e.g. a pin, a shaft or a bore.
    Cylinder {
        /// Any point of its axis, mm.
        through_mm: [f64; 3],
        /// Direction of its axis; any length.
        direction: [f64; 3],
        /// Distance of the contact point from the axis, mm: the radius, plus that of a ball which touches from outside.
        radius_mm: f64,
    },
    /// A point whose coordinates each row states, e.g. as a coordinate measuring machine measured it.
    Coordinates {
        /// Columns of the recording: with `target` these are `target.x_mm`, `target.y_mm` and `target.z_mm`. They are in the
        /// frame of what the thing is fixed to, or in that of the artifact where its place is estimated.
        columns: String,
    },
    /// One of several spots of a rigid thing, whose name each row states.
    Spots {
        /// Text column of the recording with the name of the touched spot.
        named_in: String,
        /// Where each spot is, mm. Without any, every spot is unknown: then it shows that the same spot was touched
        /// again, and nothing else.
        #[serde(default)]
        at_mm: BTreeMap<String, [f64; 3]>,
        /// Standard deviation of each stated coordinate, mm: the spots are estimated; exact when absent.
        #[serde(default)]
        sigma_mm: Option<f64>,
    },
}

/// What is touched, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Touched {
    /// The plane z = 0.
    Plane,
    /// The line along z.
    Line,
    /// The origin.
    Point,
    /// The sphere of this radius about the origin, m.
    Distance(f64),
    /// The cylinder of this radius about z, m.
    Cylinder(f64),
    /// A point that each row states.
    Listed,
    /// Spots of which nothing is known but that they are the same ones.
    Unknown,
}

/// What a written kind of contact consists of.
pub(crate) struct Parts {
    /// Where its frame stands, mm.
    pub at_mm: [f64; 3],
    /// Key and value of the vector that z is along.
    pub along: Option<(&'static str, [f64; 3])>,
    /// A length that must be positive.
    pub length: Option<Length>,
    pub touched: Touched,
}

/// A length that must be positive: what it is, and which kind of contact has length 0.
pub(crate) struct Length {
    pub mm: f64,
    pub what: &'static str,
    pub at_zero: &'static str,
}

impl RawTouched {
    pub(crate) fn parts(&self) -> Parts {
        let plain = |at_mm, along, touched| Parts {
            at_mm,
            along,
            length: None,
            touched,
        };
        match *self {
            Self::Coordinates { .. } => plain([0.0; 3], None, Touched::Listed),
            Self::Spots { ref at_mm, .. } if at_mm.is_empty() => {
                plain([0.0; 3], None, Touched::Unknown)
            }
            Self::Spots { .. } => plain([0.0; 3], None, Touched::Listed),
            Self::Plane { through_mm, normal } => {
                plain(through_mm, Some(("normal", normal)), Touched::Plane)
            }
            Self::Line {
                through_mm,
                direction,
            } => plain(through_mm, Some(("direction", direction)), Touched::Line),
            Self::Point { at_mm } => plain(at_mm, None, Touched::Point),
            Self::Distance {
                from_mm,
                distance_mm,
            } => Parts {
                length: Some(Length {
                    mm: distance_mm,
                    what: "distance",
                    at_zero: "point",
                }),
                ..plain(from_mm, None, Touched::Distance(distance_mm * MM))
            },
            Self::Cylinder {
                through_mm,
                direction,
                radius_mm,
            } => Parts {
                length: Some(Length {
                    mm: radius_mm,
                    what: "radius",
                    at_zero: "line",
                }),
                ..plain(
                    through_mm,
                    Some(("direction", direction)),
                    Touched::Cylinder(radius_mm * MM),
                )
            },
        }
    }
}

impl Touched {
    /// Rotations about and translations along x, y, z that equation (1) can tell apart.
    #[must_use]
    pub fn seen(self) -> ([bool; 3], [bool; 3]) {
        match self {
            Self::Plane => ([true, true, false], [false, false, true]),
            Self::Line | Self::Cylinder(_) => ([true, true, false], [true, true, false]),
            Self::Point | Self::Distance(_) => ([false; 3], [true; 3]),
            Self::Listed => ([true; 3], [true; 3]),
            Self::Unknown => ([false; 3], [false; 3]),
        }
    }

    /// How far a point is off, by equation (1).
    #[must_use]
    pub fn off(self, p: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Plane => Vector3::new(0.0, 0.0, p.z),
            Self::Line => Vector3::new(p.x, p.y, 0.0),
            Self::Point | Self::Listed | Self::Unknown => *p,
            Self::Distance(distance) if p.norm() > 0.0 => p * (1.0 - distance / p.norm()),
            Self::Distance(distance) => Vector3::new(0.0, 0.0, -distance),
            Self::Cylinder(radius) => {
                let across = Vector3::new(p.x, p.y, 0.0);
                let unit = across.try_normalize(0.0).unwrap_or_else(Vector3::x);
                across - unit * radius
            }
        }
    }
}
