//! The report as data, its renderers, and the scene that other programs read.
//!
//! A calibration is `n` residuals, `m` parameters and one question: may I trust it? The answer is a set of numbers that were
//! computed elsewhere:
//!
//! ```text
//! x̂ ± σ,  C = (JᵀWJ + prior)⁻¹                    what was found, and how well
//! {u : J·u ≈ 0}                                    what the data cannot say
//! e_s = p_predicted(s) − p_observed(s), s held out  what to expect on a pose that was not fitted: [m]
//! ```
//!
//! [`Report`] holds them as a plain struct (SI: m, rad, s); [`markdown`], [`terminal`], [`json`], [`csv`] and [`html`] turn the
//! struct into text and compute nothing. A renderer changes units and rounds ([`number`]): that is all. What has to be
//! *summarised* (quantiles, bins, a verdict from limits) is a constructor of the data, next to its struct: [`Stats::of`],
//! [`ErrorStats::of`], [`HeldOut::from_poses`], [`Residuals::from_rows`], [`JointCoverage::of`], [`judge`].
//!
//! [`Scene`] is the calibrated world for a situation model: frames with covariance and status, markers, robot, provenance;
//! [`Scene::json`] keeps every bit, [`Scene::ros_launch`] and [`Scene::sdf`] are derived and lossy.
//!
//! What this crate does **not** protect against: a report that was filled wrongly. It holds no clock and takes no
//! absolute path: whoever fills it passes paths relative to the profile. Same report, same bytes.

pub mod csv;
mod data;
mod error;
pub mod glb;
pub mod html;
pub mod json;
pub mod markdown;
pub mod number;
pub mod plots;
mod quantity;
mod read;
mod report;
mod residuals;
mod results;
pub mod scene;
mod schema;
mod sections;
mod svg;
mod table;
pub mod terminal;
mod verification;
pub mod view3d;
mod words;

pub use calib_finding::{Finding, Severity, Unit};
pub use data::{
    AccuracyLimit, Clock, FitSummary, Input, JointCoverage, Lost, Noise, Output, RecordingSummary,
    RecordingUse, Rejected, Workspace, WorkspacePoint,
};
pub use error::ReportError;
pub use quantity::JointValue;
pub use read::{NotAReport, REPORT, read_report, report_path};
pub use report::{FormatVersion, Limit, Method, Outcome, Report, Verdict, judge};
pub use residuals::{JointResiduals, ResidualBin, ResidualGroup, ResidualRow, Residuals};
pub use results::{
    Change, Class, DataInformation, EstimatorResult, Meaning, NotObservable, Parameter, Quantity,
    Status, Term, Transform, Unobservable,
};
pub use scene::Scene;
pub use schema::{report_schema, scene_schema};
pub use verification::{
    AngleStats, ErrorStats, ExpectedError, HeldOut, LoopClosure, LoopGroup, OrientationErrors,
    PoseError, Stats, Verification,
};
pub use view3d::View3d;
pub use words::answers::{Answer, answers};
