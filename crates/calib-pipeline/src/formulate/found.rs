//! A transform that was found.

use calib_report::Status;
use nalgebra::{Isometry3, Matrix6};

/// A transform to be reported: an origin on its body, or one between links.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Name in the report.
    pub name: String,
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
