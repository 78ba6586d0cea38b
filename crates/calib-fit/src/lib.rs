//! `calib fit`: one estimator on one table, without a profile.
//!
//! A table of markers that move against each other is refused until the caller says which of them are one body: taken as one,
//! a sweep about a single axis would look like a center.

mod answer;
mod aor;
mod comparison;
mod cor;
mod error;
mod explained;
mod frame;
mod handeye;
mod marker_noise;
mod measured;
mod noise;
mod plugin;
mod road;
mod table;

pub use aor::aor;
pub use cor::cor;
pub use frame::frame;
pub use handeye::handeye;
pub use measured::{Held, Measured};

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};

pub use answer::Answer;
pub use error::FitError;

/// What to fit with what.
#[derive(Debug, Clone, Default)]
pub struct TableRequest {
    /// The table.
    pub file: Option<Measured>,
    /// Estimator id; the kind of data decides when not given.
    pub estimator: Option<String>,
    /// All estimators that take the data.
    pub all: bool,
    /// Only list the estimators.
    pub list: bool,
    /// Markers or bodies to use; all when empty.
    pub only: Vec<String>,
    /// Markers (or the body) on one side of the joint, for estimators of two moving bodies.
    pub parent: Vec<String>,
    /// Markers (or the body) on the other side.
    pub child: Vec<String>,
    /// Stated noise of one coordinate, m.
    pub sigma_m: Option<f64>,
    /// Stated noise of the orientation about each axis, rad.
    pub sigma_rad: Option<f64>,
    /// Stated noise along the line of sight, m; `sigma_m` is then that across it.
    pub sight_m: Option<f64>,
    /// Where the line of sight begins, m in the tracker's frame.
    pub camera_m: Point3<f64>,
    /// CSV with the covariance of every sample.
    pub covariances: Option<PathBuf>,
    /// CSV with the weight of every row.
    pub weights: Option<PathBuf>,
    /// Centers: every marker has a noise of its own.
    pub noise_per_marker: bool,
    /// Axes: the joint column whose angles are taken as exact.
    pub joint: Option<String>,
    /// Axes: a center that the axis passes through, m.
    pub center_m: Option<Point3<f64>>,
    /// Axes: the side that the direction is reported towards.
    pub towards: Option<Vector3<f64>>,
    /// Plugins, by name or path: where any is named, its estimator answers.
    pub plugins: Vec<String>,
    /// Parameters of the plugin's estimator: names and values as they were written.
    pub parameters: Vec<(String, String)>,
}

/// What to make a frame of.
#[derive(Debug, Clone, Default)]
pub struct FrameRequest {
    /// The table: poses of one body and two joint columns.
    pub file: Option<Measured>,
    /// `z=pan`.
    pub proximal: String,
    /// `x=tilt`.
    pub distal: String,
    /// The body, when there are several.
    pub body: Option<String>,
    /// Estimator id; `algorithm1` when not given.
    pub estimator: Option<String>,
    /// All estimators.
    pub all: bool,
    /// Only list the estimators.
    pub list: bool,
    /// Stated noise of one coordinate, m.
    pub sigma_m: Option<f64>,
    /// Stated noise of the orientation about each axis, rad.
    pub sigma_rad: Option<f64>,
    /// CSV with the weight of every row.
    pub weights: Option<PathBuf>,
}

/// Which two poses of each row are tied by a hand and an eye.
#[derive(Debug, Clone, Default)]
pub struct HandEyeRequest {
    /// The table: two poses per row.
    pub file: Option<Measured>,
    /// Prefix of the columns of the robot's pose `base_from_flange`, or the name of a body.
    pub robot: String,
    /// Prefix of the columns of the measured pose `tracker_from_body`, or the name of a body.
    pub measured: String,
    /// The measured pose is `body_from_tracker`: a detector states where the board or tag is in the camera.
    pub inverted: bool,
    /// The body is a camera's optical frame (z along the view, x to the right): its URDF frame (x along the view, z up) is asked for as well.
    pub optical: bool,
    /// Estimator id; `handeye` when not given.
    pub estimator: Option<String>,
    /// All estimators.
    pub all: bool,
    /// Only list the estimators.
    pub list: bool,
    /// Stated noise of one coordinate, m.
    pub sigma_m: Option<f64>,
    /// Stated noise of the orientation about each axis, rad.
    pub sigma_rad: Option<f64>,
}

/// Name and samples of a marker, row by row.
type Track = (String, Vec<Option<Point3<f64>>>);

fn usage(finding: impl Into<String>, remedy: impl Into<String>) -> FitError {
    FitError::Usage {
        finding: finding.into(),
        remedy: remedy.into(),
    }
}

fn data(file: &Path, finding: impl Into<String>, remedy: impl Into<String>) -> FitError {
    FitError::Data {
        file: file.display().to_string(),
        finding: finding.into(),
        remedy: remedy.into(),
    }
}
