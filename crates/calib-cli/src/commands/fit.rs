//! `calib fit`.

use std::path::PathBuf;

use calib_fit as fit;
use calib_pipeline::ExitCode;
use clap::{Args, Subcommand};

use super::plugin_options::NamedPlugins;
use crate::error::CliError;
use crate::terminal::emit;

/// Arguments of `calib fit`.
#[derive(Debug, Args)]
pub struct FitCommand {
    /// What to fit
    #[command(subcommand)]
    what: Fit,
}

/// What to fit.
#[derive(Debug, Subcommand)]
pub enum Fit {
    /// Center of rotation
    Cor(FitTable),
    /// Axis of rotation
    Aor(FitTable),
    /// Frame of a joint with two axes, from body poses and two joint columns
    Frame(FitFrame),
    /// Hand-eye: where a camera or a tracked body is on the flange, and the tracker in the robot's base
    ///
    /// Each row has the flange in the robot's base (base_from_flange) and the body in the tracker
    /// (tracker_from_body). X = flange_from_body and Z = base_from_tracker follow from
    /// base_from_flange * X = Z * tracker_from_body. Of a camera on the flange the body is the camera
    /// and the tracker is the board or tag; a detector states the board in the camera: --inverted.
    Handeye(FitHandEye),
}

/// Arguments of `calib fit cor` and `aor`.
#[derive(Debug, Args)]
pub struct FitTable {
    /// The table: points (`<marker>.x_m`, …) or poses (`x_m`, …, `qw`)
    #[arg(required_unless_present = "list")]
    pub file: Option<PathBuf>,
    /// Estimator to use
    #[arg(long)]
    pub estimator: Option<String>,
    /// Run all estimators that accept these data, and compare them
    #[arg(long)]
    pub all: bool,
    /// List the estimators
    #[arg(long)]
    pub list: bool,
    /// Use only these markers (points) or this body (poses)
    #[arg(long, value_delimiter = ',')]
    pub use_only: Vec<String>,
    /// Markers (or the body) on one side of the joint, for estimators of two moving bodies
    #[arg(long, value_delimiter = ',')]
    pub parent: Vec<String>,
    /// Markers (or the body) on the other side
    #[arg(long, value_delimiter = ',')]
    pub child: Vec<String>,
    /// Noise of one coordinate, mm (standard deviation)
    #[arg(long)]
    pub sigma_mm: Option<f64>,
    /// Noise of the orientation about each axis, deg (standard deviation)
    #[arg(long)]
    pub sigma_deg: Option<f64>,
    /// Noise along the line of sight, mm; --sigma-mm is then the noise across it
    #[arg(long)]
    pub sigma_sight_mm: Option<f64>,
    /// Origin of the line of sight in the tracker's frame, m
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, default_value = "0,0,0", allow_hyphen_values = true)]
    pub camera_m: [f64; 3],
    /// Covariance of each sample: a CSV with the columns `<marker>.xx_mm2`, xy, xz, yy, yz, zz and one line per line of the table
    #[arg(long, value_name = "FILE")]
    pub covariances: Option<PathBuf>,
    /// Weight of each row in readings: a CSV with the column `weight` and one line per line of the table
    #[arg(long, value_name = "FILE")]
    pub weights: Option<PathBuf>,
    /// Estimate the noise of each marker separately (centers)
    #[arg(long)]
    pub noise_per_marker: bool,
    /// Joint column whose angles are taken as exact (axes); rows without an angle are excluded
    #[arg(long)]
    pub joint: Option<String>,
    /// Center that the axis passes through, m (axes, for estimators that take one: see `--list`)
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    pub center_m: Option<[f64; 3]>,
    /// Direction that fixes the sign of the axis if there are no joint angles (axes)
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    pub towards: Option<[f64; 3]>,
    /// Plugins whose estimator is used
    #[command(flatten)]
    pub plugins: NamedPlugins,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Three numbers, `0.1,-0.2,0.3`.
fn triple(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let numbers: Option<Vec<f64>> = parts
        .iter()
        .map(|p| p.parse().ok().filter(|x: &f64| x.is_finite()))
        .collect();
    numbers
        .and_then(|n| n.try_into().ok())
        .ok_or_else(|| "write three numbers with commas between them, like 0.1,-0.2,0.3".to_owned())
}

/// Arguments of `calib fit frame`.
#[derive(Debug, Args)]
pub struct FitFrame {
    /// The table: poses of one body and two joint columns
    #[arg(required_unless_present = "list")]
    pub file: Option<PathBuf>,
    /// Joint closer to the base, as `axis=joint` (`z=pan`)
    #[arg(long, required_unless_present = "list")]
    pub proximal: Option<String>,
    /// Joint closer to the body, as `axis=joint` (`x=tilt`)
    #[arg(long, required_unless_present = "list")]
    pub distal: Option<String>,
    /// The body, if the table has several
    #[arg(long)]
    pub body: Option<String>,
    /// Estimator to use; `algorithm1` if none is named
    #[arg(long)]
    pub estimator: Option<String>,
    /// Run all estimators, and compare them
    #[arg(long)]
    pub all: bool,
    /// List the estimators
    #[arg(long)]
    pub list: bool,
    /// Noise of one coordinate, mm (standard deviation)
    #[arg(long)]
    pub sigma_mm: Option<f64>,
    /// Noise of the orientation about each axis, deg (standard deviation)
    #[arg(long)]
    pub sigma_deg: Option<f64>,
    /// Weight of each row in readings: a CSV with the column `weight` and one line per line of the table
    #[arg(long, value_name = "FILE")]
    pub weights: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `calib fit handeye`.
#[derive(Debug, Args)]
pub struct FitHandEye {
    /// The table: poses of two bodies in each row
    #[arg(required_unless_present = "list")]
    pub file: Option<PathBuf>,
    /// Prefix of the columns of the flange in the robot's base: `flange_x` … `flange_qw`, `flange_rvec_z` or `flange_r33`
    #[arg(long, default_value = "flange")]
    pub robot: String,
    /// Prefix of the columns of the measured body in the tracker's frame: `meas_x` … `meas_qw`, `meas_rvec_z` or `meas_r33`
    #[arg(long, default_value = "meas")]
    pub measured: String,
    /// The measured poses are inverted: the board or tag in the camera, as its detector states it
    #[arg(long)]
    pub inverted: bool,
    /// The body is the optical frame of a camera (z along the view): give its URDF frame too (x along the view)
    #[arg(long)]
    pub optical: bool,
    /// Estimator to use; `handeye` if none is named
    #[arg(long)]
    pub estimator: Option<String>,
    /// Run all estimators, and compare them
    #[arg(long)]
    pub all: bool,
    /// List the estimators
    #[arg(long)]
    pub list: bool,
    /// Noise of one coordinate, mm (standard deviation)
    #[arg(long)]
    pub sigma_mm: Option<f64>,
    /// Noise of the orientation about each axis, deg (standard deviation)
    #[arg(long)]
    pub sigma_deg: Option<f64>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Fits.
pub fn run(options: &FitCommand) -> Result<ExitCode, CliError> {
    let answer = match &options.what {
        Fit::Cor(table) => fit::cor(&table.request())?,
        Fit::Aor(table) => fit::aor(&table.request())?,
        Fit::Frame(frame) => fit::frame(&frame.request())?,
        Fit::Handeye(pairs) => fit::handeye(&pairs.request())?,
    };
    let json = match &options.what {
        Fit::Cor(t) | Fit::Aor(t) => t.json,
        Fit::Frame(f) => f.json,
        Fit::Handeye(f) => f.json,
    };
    emit(if json { &answer.json } else { &answer.text })?;
    Ok(if answer.observable {
        ExitCode::Accepted
    } else {
        ExitCode::NotObservable
    })
}

impl FitFrame {
    fn request(&self) -> fit::FrameRequest {
        fit::FrameRequest {
            file: self.file.clone().map(Into::into),
            proximal: self.proximal.clone().unwrap_or_default(),
            distal: self.distal.clone().unwrap_or_default(),
            body: self.body.clone(),
            estimator: self.estimator.clone(),
            all: self.all,
            list: self.list,
            sigma_m: self.sigma_mm.map(|s| s * 1e-3),
            sigma_rad: self.sigma_deg.map(f64::to_radians),
            weights: self.weights.clone(),
        }
    }
}

impl FitHandEye {
    fn request(&self) -> fit::HandEyeRequest {
        fit::HandEyeRequest {
            file: self.file.clone().map(Into::into),
            robot: self.robot.clone(),
            measured: self.measured.clone(),
            inverted: self.inverted,
            optical: self.optical,
            estimator: self.estimator.clone(),
            all: self.all,
            list: self.list,
            sigma_m: self.sigma_mm.map(|s| s * 1e-3),
            sigma_rad: self.sigma_deg.map(f64::to_radians),
        }
    }
}

impl FitTable {
    fn request(&self) -> fit::TableRequest {
        fit::TableRequest {
            file: self.file.clone().map(Into::into),
            estimator: self.estimator.clone(),
            all: self.all,
            list: self.list,
            only: self.use_only.clone(),
            parent: self.parent.clone(),
            child: self.child.clone(),
            sigma_m: self.sigma_mm.map(|s| s * 1e-3),
            sigma_rad: self.sigma_deg.map(f64::to_radians),
            sight_m: self.sigma_sight_mm.map(|s| s * 1e-3),
            camera_m: self.camera_m.into(),
            covariances: self.covariances.clone(),
            weights: self.weights.clone(),
            noise_per_marker: self.noise_per_marker,
            joint: self.joint.clone(),
            center_m: self.center_m.map(Into::into),
            towards: self.towards.map(Into::into),
            plugins: self.plugins.plugin.clone(),
            parameters: self.plugins.parameter.clone(),
        }
    }
}
