//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

/// Finds where a robot's joints are relative to the bodies that an optical tracker sees, and makes its kinematic
/// model true.
///
/// Exit codes: 0 accepted · 1 finished, verdict not a pass · 2 usage or profile error · 3 data error · 4 a requested
/// quantity is not observable · 5 did not converge · 6 plugin error · 7 output not written.
#[derive(Debug, Parser)]
#[command(name = "calib", version, about)]
pub struct Arguments {
    /// What to do
    #[command(subcommand)]
    pub command: Command,
    /// Say nothing but results and errors
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Say more on standard error
    #[arg(short, long, global = true)]
    pub verbose: bool,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Calibrate: from recordings to patched URDF, scene and report
    Run(Run),
    /// Check a profile and its recordings without solving
    Check {
        /// The robot's profile
        profile: PathBuf,
        /// Print findings as JSON
        #[arg(long)]
        json: bool,
    },
    /// Make recordings with known truth for a profile
    Simulate {
        /// The robot's profile
        profile: PathBuf,
        /// Seed of the random numbers; the profile's when not given
        #[arg(long)]
        seed: Option<u64>,
        /// Folder to write to
        #[arg(long)]
        out: PathBuf,
    },
    /// One estimator on one table, no profile
    Fit {
        /// What to fit
        #[command(subcommand)]
        what: Fit,
    },
    /// Write a calibration into your own description of the robot: URDF, xacro, or the YAML of its origins
    Apply(Apply),
    /// What differs between two robots: URDFs, xacros, YAMLs of origins
    Diff {
        /// The one
        a: PathBuf,
        /// The other
        b: PathBuf,
        /// How to show it
        #[arg(long, value_enum, default_value_t = DiffFormat::Table)]
        format: DiffFormat,
    },
    /// What changed between two calibrations of one robot, with 1 % false alarms; exit code 1 when something did
    Drift {
        /// Results of the old calibration: a folder or report.json
        old: PathBuf,
        /// Results of the new one
        new: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Give the original bytes of a changed URDF, xacro or YAML back
    Revert {
        /// The changed file; its change record `<file>.changes.json` stands beside it
        file: PathBuf,
        /// Where to write the original
        #[arg(long, required_unless_present = "in_place")]
        out: Option<PathBuf>,
        /// Over the changed file; the record is removed
        #[arg(long, conflicts_with = "out")]
        in_place: bool,
    },
    /// Simulation studies of the estimators, with the statistical bound in every cell
    Study(StudyRun),
    /// Record a sweep from a live tracker, guided from pose to pose
    Record(Record),
    /// Any recording as canonical CSV
    Convert {
        /// The recording
        input: PathBuf,
        /// The CSV to write; it must not exist
        output: PathBuf,
        /// Reader to use instead of the one found from the content
        #[arg(long)]
        format: Option<String>,
    },
    /// Estimators, readers and plugins there are; checks and makes plugins
    Plugins {
        /// What to do; lists when not given
        #[command(subcommand)]
        what: Option<Plugins>,
    },
    /// Print a JSON Schema
    Schema {
        /// Of what
        #[arg(value_enum, default_value_t = SchemaOf::Profile)]
        of: SchemaOf,
        /// With the plugins that this profile names (only for `parameters`)
        #[arg(long)]
        profile: Option<PathBuf>,
    },
    /// Print completions for a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
}

/// `calib run`.
#[derive(Debug, Args)]
pub struct Run {
    /// The robot's profile
    pub profile: PathBuf,
    /// Folder to write to; `results/<profile name>` when not given
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Instead of the profile's method
    #[arg(long, value_enum)]
    pub method: Option<MethodName>,
    /// Go on although the data checks found errors
    #[arg(long)]
    pub force: bool,
    /// Rank models by how well they predict each fitted pose from the others; writes nothing
    #[arg(long)]
    pub compare_models: bool,
    /// Load no plugin
    #[arg(long)]
    pub no_plugins: bool,
    /// Print the report as JSON instead of the summary
    #[arg(long)]
    pub json: bool,
}

/// `calib record`.
#[derive(Debug, Args)]
pub struct Record {
    /// The robot's profile
    pub profile: PathBuf,
    /// `dtrack:PORT` (DTrack sends to this port), `vrpn:HOST[:PORT]` or `vrpn:DEVICE@HOST[:PORT]`
    #[arg(long)]
    pub source: String,
    /// Which recording of the profile; needed when it has several
    #[arg(long)]
    pub recording: Option<String>,
    /// The CSV to write; the recording's file when not given. It must not exist
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Go on with a file that was begun
    #[arg(long)]
    pub append: bool,
    /// Where joint values come from: `targets` (the poses asked for) or `udp:PORT` (the robot sends `name_deg=value`)
    #[arg(long, default_value = "targets")]
    pub joints: String,
    /// A joint that stands still, as `waist_deg=20`
    #[arg(long, value_delimiter = ',')]
    pub at: Vec<String>,
    /// Body or marker of the profile and the tracker's name for it, as `gripM=body_0`
    #[arg(long, value_delimiter = ',')]
    pub map: Vec<String>,
    /// Values of each swept joint; 11 for one joint, 6 for several when not given
    #[arg(long)]
    pub poses: Option<usize>,
    /// How long each pose is recorded, s
    #[arg(long, default_value_t = 1.0)]
    pub hold: f64,
    /// Write rows also while the robot moves
    #[arg(long)]
    pub all: bool,
    /// Give up when nothing comes from the tracker for this long, s
    #[arg(long, default_value_t = 30.0)]
    pub patience: f64,
    /// End after this long, s
    #[arg(long)]
    pub seconds: Option<f64>,
}

/// `calib apply`.
#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("destination").required(true).args(["out", "in_place", "diff"])))]
pub struct Apply {
    /// What `calib run` wrote: its folder, report.json, or the calibrated URDF
    pub result: PathBuf,
    /// What to change: a URDF, a xacro, or a YAML with origins of joints
    pub target: PathBuf,
    /// Write here; a folder where the xacro's YAML changes too
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Write over the target, with the record that `calib revert` needs beside it
    #[arg(long)]
    pub in_place: bool,
    /// Write nothing; show the difference line by line
    #[arg(long)]
    pub diff: bool,
    /// The YAML that the xacro loads, where its path cannot be followed
    #[arg(long, value_name = "FILE")]
    pub yaml: Option<PathBuf>,
    /// Also a calibration that was not accepted
    #[arg(long)]
    pub force: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Estimation methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodName {
    /// The closed forms of the paper, each origin alone
    Paper,
    /// Maximum likelihood over all loops at once
    Ml,
}

/// Renderings of a difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum DiffFormat {
    /// A table for people
    Table,
    /// JSON
    Json,
    /// Unified text difference
    Unified,
}

/// What has a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SchemaOf {
    /// The profile
    Profile,
    /// report.json
    Report,
    /// The scene
    Scene,
    /// Parameters of estimators, readers and report writers, by kind and name
    Parameters,
}

/// `calib fit …`.
#[derive(Debug, Subcommand)]
pub enum Fit {
    /// Center of rotation
    Cor(FitTable),
    /// Axis of rotation
    Aor(FitTable),
    /// Frame of a joint with two axes, from body poses and two joint columns
    Frame(FitFrame),
    /// Hand-eye: AX = ZB from two poses per row
    Handeye(FitHandEye),
}

/// One table, one estimator.
#[derive(Debug, Args)]
pub struct FitTable {
    /// The table: points (`<marker>.x_m`, …) or poses (`x_m`, …, `qw`)
    #[arg(required_unless_present = "list")]
    pub file: Option<PathBuf>,
    /// Which estimator
    #[arg(long)]
    pub estimator: Option<String>,
    /// All estimators that take these data, with their agreement
    #[arg(long)]
    pub all: bool,
    /// The estimators there are
    #[arg(long)]
    pub list: bool,
    /// Only these markers (points) or this body (poses)
    #[arg(long, value_delimiter = ',')]
    pub use_only: Vec<String>,
    /// Markers (or the body) on one side of the joint, for estimators of two moving bodies
    #[arg(long, value_delimiter = ',')]
    pub parent: Vec<String>,
    /// Markers (or the body) on the other side
    #[arg(long, value_delimiter = ',')]
    pub child: Vec<String>,
    /// Stated noise of one coordinate, mm
    #[arg(long)]
    pub sigma_mm: Option<f64>,
    /// Stated noise of the orientation about each axis, deg
    #[arg(long)]
    pub sigma_deg: Option<f64>,
    /// Stated noise along the line of sight, mm; --sigma-mm is then the noise across it
    #[arg(long)]
    pub sigma_sight_mm: Option<f64>,
    /// Where the line of sight begins, m in the tracker's frame
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, default_value = "0,0,0", allow_hyphen_values = true)]
    pub camera_m: [f64; 3],
    /// Covariance of every sample: a CSV with `<marker>.xx_mm2`, xy, xz, yy, yz, zz, line by line as the table
    #[arg(long, value_name = "FILE")]
    pub covariances: Option<PathBuf>,
    /// How many readings each row is worth: a CSV with the column `weight`, line by line as the table
    #[arg(long, value_name = "FILE")]
    pub weights: Option<PathBuf>,
    /// Every marker has a noise of its own, estimated (centers)
    #[arg(long)]
    pub noise_per_marker: bool,
    /// Joint column whose angles are taken as exact (axes); rows without an angle are left out
    #[arg(long)]
    pub joint: Option<String>,
    /// A center that the axis passes through, m (axes: `planar_radial`)
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    pub center_m: Option<[f64; 3]>,
    /// Report the axis towards this direction, where joint angles do not decide (axes)
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    pub towards: Option<[f64; 3]>,
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

/// `calib fit frame`.
#[derive(Debug, Args)]
pub struct FitFrame {
    /// The table: poses of one body and two joint columns
    pub file: PathBuf,
    /// The joint nearer to the base, as `axis=joint` (`z=pan`)
    #[arg(long)]
    pub proximal: String,
    /// The joint nearer to the body, as `axis=joint` (`x=tilt`)
    #[arg(long)]
    pub distal: String,
    /// The body, when the table has several
    #[arg(long)]
    pub body: Option<String>,
    /// `algorithm1` or `frame_ml`
    #[arg(long, default_value = "algorithm1")]
    pub estimator: String,
    /// Stated noise of one coordinate, mm
    #[arg(long)]
    pub sigma_mm: Option<f64>,
    /// Stated noise of the orientation about each axis, deg
    #[arg(long)]
    pub sigma_deg: Option<f64>,
    /// How many readings each row is worth: a CSV with the column `weight`, line by line as the table
    #[arg(long, value_name = "FILE")]
    pub weights: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `calib fit handeye`.
#[derive(Debug, Args)]
pub struct FitHandEye {
    /// The table with two bodies per row
    pub file: PathBuf,
    /// Prefix of the columns of the first pose (robot flange), e.g. `flange`
    #[arg(long, default_value = "flange")]
    pub robot: String,
    /// Prefix of the columns of the second pose (measurement), e.g. `meas`
    #[arg(long, default_value = "meas")]
    pub measured: String,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `calib study`.
#[derive(Debug, Args)]
pub struct StudyRun {
    /// Which study
    #[arg(value_enum)]
    pub study: StudyName,
    /// Trials of an ordinary cell (cor, aor: 1500); robots drawn (justin, ripley: 100)
    #[arg(long)]
    pub trials: Option<u64>,
    /// Seed
    #[arg(long)]
    pub seed: Option<u64>,
    /// Threads; all processors when not given
    #[arg(long)]
    pub threads: Option<usize>,
    /// Folder for the tables and pictures; an interrupted study continues there
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// The robot of a case study, instead of robots/justin.yaml or robots/ripley.yaml
    #[arg(long)]
    pub profile: Option<PathBuf>,
    /// Begin anew instead of continuing
    #[arg(long)]
    pub restart: bool,
    /// Print JSON instead of Markdown
    #[arg(long)]
    pub json: bool,
}

/// Simulation studies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum StudyName {
    /// Centers of rotation, paper §3.3
    Cor,
    /// Axes of rotation and frames, paper §4 and §5.2
    Aor,
    /// Case study over many simulated robots, paper §5: Table 1
    Justin,
    /// Case study over many simulated robots, paper §6: Table 2
    Ripley,
}

/// `calib plugins …`.
#[derive(Debug, Subcommand)]
pub enum Plugins {
    /// Conformance of one plugin: a table, exit code 6 when something fails
    Check {
        /// Its path, or its name on the search path
        plugin: String,
    },
    /// Make a complete plugin project
    New {
        /// Its name: small letters, digits, hyphens
        name: String,
        /// rust or c
        #[arg(long, default_value = "rust")]
        lang: String,
        /// Folder to make it in
        #[arg(long, default_value = ".")]
        out: PathBuf,
    },
    /// Print the contract, calib_plugin.h
    Header,
}
