//! The report as data, its renderers, and the scene that other programs read.
//!
//! A calibration has `n` residuals and `m` parameters, and its user needs to know whether to trust it. The answer is a set of
//! numbers computed elsewhere:
//!
//! ```text
//! x̂ ± σ,  C = (JᵀWJ + prior)⁻¹                    estimate and uncertainty
//! {u : J·u ≈ 0}                                    directions that are not observable
//! e_s = p_predicted(s) − p_observed(s), s held out  error expected on a pose that was not fitted: [m]
//! ```
//!
//! [`Report`] holds them as a plain struct (SI: m, rad, s); [`markdown`], [`terminal`], [`json`], [`csv`] and [`html`] turn the
//! struct into text: they change units and round ([`mod@number`]), and compute nothing else. What has to be
//! *summarized* (quantiles, bins, a verdict from limits) is a constructor of the data, next to its type: [`Stats::of`],
//! [`ErrorStats::of`], [`HeldOut::from_poses`], [`Residuals::from_rows`], [`JointCoverage::of`], [`judge`], which
//! maps the facts of a result to its verdict.
//!
//! [`Scene`] is the calibrated world for a situation model: frames with covariance and status, markers, robot, provenance;
//! [`Scene::json`] keeps every bit, [`Scene::ros_launch`] and [`Scene::sdf`] are derived and lossy.
//!
//! What this crate does **not** protect against: a report that was filled with wrong data. It reads no clock and takes no
//! absolute path: the caller passes paths relative to the profile. The same report gives the same bytes.

mod budget;
mod check;
mod component;
mod contact_point;
pub mod csv;
mod data;
mod dh_table;
mod diagnosis;
mod error;
mod facts;
pub mod gallery;
pub mod glb;
mod held_out;
pub mod html;
mod identification;
pub mod json;
pub mod markdown;
pub mod mcap;
pub mod plots;
mod prior_width;
mod quantity;
mod read;
mod report;
mod residuals;
mod results;
mod robot_change;
pub mod scene;
mod schema;
mod sections;
mod selection;
mod standardized;
mod svg;
mod table;
pub mod terminal;
pub mod verdict;
mod verification;
pub mod view3d;
mod weak;
mod words;

pub use calib_finding::{Finding, Severity, Unit, number, printable_line, shell_path};
pub use check::{BodyNoise, CheckOutcome, Checked, CheckedRecording, DataCheck, DataChecks};
pub use component::{Component, PluginFile};
pub use contact_point::ContactPoint;
pub use data::{
    AccuracyLimit, Clock, Fates, FitSummary, Input, JointCoverage, Lost, Noise, NoiseCandidate,
    NoiseChoice, Output, RecordingSummary, RecordingUse, Rejected, RejectedFor, TestAnswer,
    TestedEffect, Workspace, WorkspacePoint,
};
pub use dh_table::{DhTable, DhTableRow, DhValue};
pub use diagnosis::Diagnosis;
pub use error::ReportError;
pub use facts::{
    ClockCheck, ErrorSource, FitEnd, MissingPhysics, NextStep, NoiseKind, NoiseModel, Physics,
    Scope,
};
pub use held_out::{Distance, ExpectedError, HeldOut, OrientationErrors, PoseError, screen};
pub use identification::Identification;
pub use prior_width::{PriorWidth, WidthSource};
pub use quantity::JointValue;
pub use read::{NotAReport, REPORT, read_report, report_path};
pub use report::{FormatVersion, Limit, Limited, Method, Outcome, Report, Verdict};
pub use residuals::{JointResiduals, ResidualBin, ResidualGroup, ResidualRow, Residuals};
pub use results::{
    Cause, Change, Class, DataInformation, EstimatorResult, Meaning, NotObservable, Parameter,
    Quantity, Status, Term, Transform, Unobservable,
};
pub use robot_change::RobotChange;
pub use scene::Scene;
pub use schema::{model_schema, report_schema, scene_schema};
pub use selection::{
    ModelPart, NestedSelection, PartKind, Selection, SelectionOutcome, SelectionStep,
};
pub use standardized::{Standardized, Tails};
pub use svg::picture;
pub use verdict::{
    Agreement, BodyError, Compared, Effect, FoundNoise, Goodness, ImplausibleChange, Improvement,
    Judgment, Orientation, Part, Predicted, Prediction, Reason, ReasonId, RejectedPart, Share,
    SingleJoint, Solver, UnseenBody, Untested, UntestedKind, UrdfAlone, Validation, VerdictFacts,
    judge,
};
pub use verification::{AngleStats, ErrorStats, LoopClosure, LoopGroup, Stats, Verification};
pub use view3d::View3d;
pub use weak::{HELD_BY_PRIOR, OpenDirection, RobotSize, WeakDirections, WeakTerm};
pub use words::answers::{Answer, answers};
