//! A transform that was found.

use calib_report::Status;
use nalgebra::{Isometry3, Matrix6};

/// A transform to be reported: an origin on its body, or one between links.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Name in the report.
    pub name: String,
    /// The profile's origin that it places, if it is one on its body.
    pub origin: Option<String>,
    /// Parent frame.
    pub parent: String,
    /// Child frame.
    pub child: String,
    /// `parent_from_child`.
    pub pose: Isometry3<f64>,
    /// 6×6 in `[ω; v]` of the child; `None` where nothing determines a direction.
    pub covariance: Option<Matrix6<f64>>,
    /// Directions that the data do not see.
    pub unobservable: Vec<calib_report::Unobservable>,
    /// Measured, calibrated or assumed.
    pub status: Status,
}

impl Found {
    /// The two frames, with nothing found yet.
    #[must_use]
    pub fn between(name: String, parent: &str, child: &str) -> Self {
        Self {
            name,
            origin: None,
            parent: parent.to_owned(),
            child: child.to_owned(),
            pose: Isometry3::identity(),
            covariance: None,
            unobservable: Vec::new(),
            status: Status::Assumed,
        }
    }
}
