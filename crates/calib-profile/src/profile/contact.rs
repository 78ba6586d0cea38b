//! Contact points and contacts.

use calib_urdf::LinkId;
use nalgebra::Isometry3;
use nalgebra::Point3;

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

/// What a touched thing is fixed to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactBase {
    /// The tracker's frame.
    Tracker,
    /// A link.
    Link(LinkId),
}
