//! `calib fit`: one estimator on one table, without a profile.
//!
//! A table of markers that move against each other is refused until the caller says which of them are one body: taken as one,
//! a sweep about a single axis would look like a center.

mod aor;
mod comparison;
mod cor;
mod error;
mod frame;
mod handeye;
mod noise;
mod road;
mod table;

pub use aor::aor;
pub use cor::cor;
pub use frame::frame;
pub use handeye::handeye;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3, Vector3};
use serde_json::{Value, json};

pub use error::FitError;

/// What to fit with what.
#[derive(Debug, Clone, Default)]
pub struct TableRequest {
    /// The table.
    pub file: Option<PathBuf>,
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
}

/// What to make a frame of.
#[derive(Debug, Clone, Default)]
pub struct FrameRequest {
    /// The table: poses of one body and two joint columns.
    pub file: PathBuf,
    /// `z=pan`.
    pub proximal: String,
    /// `x=tilt`.
    pub distal: String,
    /// The body, when there are several.
    pub body: Option<String>,
    /// `algorithm1` or `frame_ml`.
    pub estimator: String,
    /// Stated noise of one coordinate, m.
    pub sigma_m: Option<f64>,
    /// Stated noise of the orientation about each axis, rad.
    pub sigma_rad: Option<f64>,
    /// CSV with the weight of every row.
    pub weights: Option<PathBuf>,
}

/// An answer in both forms.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Answer {
    /// For people.
    pub text: String,
    /// For machines.
    pub json: String,
    /// The quantity is determined by the data.
    pub observable: bool,
}

fn answer(text: String, value: &Value, observable: bool) -> Answer {
    let json = calib_report::json::pretty(&calib_report::json::rounded(value.clone())) + "\n";
    Answer {
        text,
        json,
        observable,
    }
}

/// An estimator that there is not, with the nearest there is.
fn unknown(id: &str, known: &[String], list: &str) -> FitError {
    let remedy = match calib_finding::nearest_word(id, known.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`? `{list} --list` shows them all"),
        None => format!("`{list} --list` shows what there is"),
    };
    usage(format!("there is no estimator `{id}`"), remedy)
}

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

/// The line of an answer that is not to be relied upon.
fn doubt(reason: Option<&str>) -> String {
    reason.map_or_else(String::new, |why| format!("  weak: {why}\n"))
}

fn not_observable(id: &str, verdict: &str, reason: &str) -> Answer {
    let value =
        json!({ "estimator": id, "observable": false, "verdict": verdict, "reason": reason });
    answer(
        format!("{id}: not observable ({verdict}): {reason}\n"),
        &value,
        false,
    )
}

fn listed<'a>(rows: impl Iterator<Item = (&'a str, String, &'a str, &'a str)>) -> Answer {
    let mut text = String::new();
    let mut values = Vec::new();
    for (id, input, name, source) in rows {
        let _ = writeln!(text, "{id:<16} {input:<10} {name} ({source})");
        values.push(json!({ "id": id, "input": input, "name": name, "source": source }));
    }
    answer(text, &Value::Array(values), true)
}

fn coordinates(values: &[f64]) -> String {
    let shown: Vec<String> = values.iter().map(|v| format!("{v:.6}")).collect();
    format!("[{}]", shown.join(", "))
}

fn matrix(rows: Vec<Vec<f64>>) -> Value {
    json!(rows)
}

fn pose_value(pose: &Isometry3<f64>) -> Value {
    json!({ "translation_m": pose.translation.vector.as_slice(), "rotation_xyzw": pose.rotation.coords.as_slice() })
}

fn pose_text(pose: &Isometry3<f64>) -> String {
    format!(
        "xyz {} m, xyzw {}",
        coordinates(pose.translation.vector.as_slice()),
        coordinates(pose.rotation.coords.as_slice())
    )
}
