//! Contact points and contacts.

use calib_urdf::LinkId;
use nalgebra::Isometry3;
use nalgebra::Point3;
use std::collections::BTreeMap;

use crate::touched::Touched;

/// A point of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Tip {
    /// Link that carries it.
    pub link: LinkId,
    /// Where it is in that link's frame, m.
    pub at: Point3<f64>,
    /// Prior σ of its coordinates where they are estimated, m.
    pub sigma: Option<f64>,
}

/// Poses in which a point of one link touches something that is fixed to another.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// Recordings whose every row is a touch.
    pub recordings: Vec<String>,
    /// The touching point.
    pub point: String,
    /// What carries the thing that is touched.
    pub on: ContactBase,
    /// Where the rows state what was touched.
    pub by_row: Option<ByRow>,
    /// What is touched; at `base_from_place` its own frame stands, with z along normal or direction.
    pub touched: Touched,
    /// Pose of the touched thing's frame in its base.
    pub base_from_place: Isometry3<f64>,
    /// Prior σ of its position where it is estimated, m.
    pub place_sigma: Option<f64>,
    /// Prior σ of its orientation where it is estimated, rad.
    pub place_sigma_rad: Option<f64>,
    /// σ of one touch, m.
    pub sigma: f64,
}

/// How the rows of a recording state which point was touched.
#[derive(Debug, Clone, PartialEq)]
pub enum ByRow {
    /// By its coordinates, recorded as those of a marker of this name.
    Coordinates(String),
    /// By its name in this text column.
    Spots(Spots),
}

/// Named spots of a rigid thing.
#[derive(Debug, Clone, PartialEq)]
pub struct Spots {
    /// The text column.
    pub named_in: String,
    /// Where each is, m; empty: all unknown.
    pub at: BTreeMap<String, Point3<f64>>,
    /// Prior σ of each coordinate where they are estimated, m.
    pub sigma: Option<f64>,
}

impl Contact {
    /// The marker name under which the touched points are recorded.
    #[must_use]
    pub fn coordinates(&self) -> Option<&String> {
        match &self.by_row {
            Some(ByRow::Coordinates(columns)) => Some(columns),
            _ => None,
        }
    }

    /// The named spots.
    #[must_use]
    pub fn spots(&self) -> Option<&Spots> {
        match &self.by_row {
            Some(ByRow::Spots(spots)) => Some(spots),
            _ => None,
        }
    }
}

/// What a touched thing is fixed to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactBase {
    /// The tracker's frame.
    Tracker,
    /// A link.
    Link(LinkId),
}
