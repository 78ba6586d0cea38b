//! Tracking bodies.

use calib_urdf::LinkId;
use nalgebra::Isometry3;
use nalgebra::Point3;

use crate::raw::RawSplit;

/// A tracking body on a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// The link that carries it.
    pub link: LinkId,
    /// What is recorded of it.
    pub kind: BodyKind,
    /// Prior σ of each coordinate of the template, m; `None`: exact.
    pub template_sigma: Option<f64>,
    /// `link_from_body` where known by construction.
    pub mount: Option<Isometry3<f64>>,
    /// Where it moved on its link, in the numbers of the recordings' rows.
    pub split: Option<RawSplit>,
}

/// What is recorded of a tracking body.
#[derive(Debug, Clone, PartialEq)]
pub enum BodyKind {
    /// Markers, in the order that defines the body frame; with their positions in it (m) where known.
    Markers {
        /// Names as in the recordings.
        names: Vec<String>,
        /// Positions in the body frame, one per name, m.
        template: Option<Vec<Point3<f64>>>,
    },
    /// Poses of the body.
    Pose,
}
