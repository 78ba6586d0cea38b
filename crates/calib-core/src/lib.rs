//! Maximum likelihood over all loops of a robot's frame graph.
//!
//! Nodes are frames, edges are `parent_from_child(s; x) ∈ SE(3)` for sample `s` (a static pose or an
//! instant). What a tracker says about the frames at the two ends of a path is a residual; all
//! residuals of all paths are minimized together:
//!
//! ```text
//! T(s; x) = Π_e T_e(s; x)^±1                                                             (1)
//!   known     constant                      measured   Z_s, with noise if stated
//!   joint     exp(S φ_s)·Exp(θ_s),  φ_s = q_s + Σ_j F_j(s) c_j                           (2)
//!   unknown   X₀ · (Exp ω, t)               random     exp(G u_s), u_s ~ N(0, σ²)
//!
//! x̂ = argmin Σ_s e_sᵀ V_s⁻¹ e_s + Σ_i (x_i − x₀_i)²/σ_i²                                 (3)
//! V_s = D_s + G_s diag(σ_u²) G_sᵀ,   H = Σ_s J_sᵀ V_s⁻¹ J_s + Λ,   C = H⁻¹               (4)
//! ```
//!
//! The joint effects `F_j` (zero offset, gain, gear eccentricity, compliance under a given torque,
//! lateral compliance, backlash, clock offset, coupling) are all linear in their unknown `c_j`.
//! Perturbations act on the right, twists are `[ω; v]`, lengths m, angles rad, σ and not σ².
//!
//! What it does **not** protect against: a wrong claim of what is bolted to what, a frame that moves
//! between recordings, and correlated noise inside one sample that no random effect describes.
//!
//! # How to use it
//!
//! 1. State a [`Problem`]: [`Problem::frame`], one edge method per kind ([`Problem::known`],
//!    [`Problem::unknown`] with a [`Chart`], [`Problem::joint`] with [`Problem::free_effect`],
//!    [`Problem::measured`], [`Problem::random`]), points, noise groups, measurements.
//!    [`Problem::set_role`] says what an unknown pose is; the words of the report depend on it.
//!    Priors are per parameter: [`Problem::set_prior`], [`Problem::parameter_mut`].
//! 2. [`solve`] it. Bad input is an [`Error`]; what the data cannot answer is in the [`Solution`].
//! 3. Read [`Solution::parameters`], [`Solution::relative_pose`], [`Solution::predict_point`] and the
//!    analyses:
//!
//! | question | answer |
//! |---|---|
//! | did it converge, and how good is it | [`Solution::status`], `chi2`, `chi2_stated`, `degrees_of_freedom` |
//! | are the readings radians at all | [`Problem::unlikely_units`]: ask before you solve |
//! | how noisy are markers, bodies, joints | [`Solution::noise`] (REML where [`NoiseGroup::estimate`] is set) |
//! | which rows were left out, and why | [`Solution::rejected`]; exchanged labels: [`relabel()`] before solving |
//! | what cannot be known, in words | [`Solution::observability`], [`ParameterEstimate::class`] and `data_share` |
//! | how well does it predict | [`Solution::leave_one_out`], [`Solution::held_out`] with [`Problem::held_out`], [`k_fold`] |
//! | against what | [`Problem::baseline`]: nominal, registration only |
//! | which physics is missing | [`Solution::goodness_of_fit`], with [`Problem::candidate`] effects |
//! | did something move meanwhile | [`Solution::changes`] |
//! | has the noise a memory, and what does that cost | [`Solution::dependence`], [`Solution::under`] |
//! | what would a posture tell that was not recorded yet | [`Model::whitened_rows`], [`Model::linear_points`] |
//! | which model | [`compare()`]; which effects and axes it should have: [`select()`] |
//! | what is random from pose to pose | [`Solution::weighed`] |
//! | how wide the priors should be | [`Solution::widened`] |
//! | can I trust the intervals if the noise model is wrong | [`sandwich`] |
//! | how well does a loop close | [`ClosureStatistics`], [`Solution::pose_at_sample`] |
//!
//! # Example: two joints, seen by a tracker
//!
//! ```
//! use calib_core::*;
//! use nalgebra::{Isometry3, Point3, Vector3};
//!
//! // What we pretend to measure: nominal geometry, but joint 2 reads 0.01 rad too little.
//! let upper = Isometry3::translation(0.0, 0.0, 0.4);
//! let tracker_from_base = Isometry3::new(Vector3::new(1.0, 0.2, 0.0), Vector3::new(0.0, 0.0, 0.5));
//! let link_from_body = Isometry3::translation(0.3, 0.0, 0.05);
//! let markers = [[0.04, 0.0, 0.0], [-0.02, 0.05, 0.0], [-0.03, -0.03, 0.02]].map(Point3::from);
//! let q1 = [-1.0, -0.5, 0.0, 0.5, 1.0, -0.8, 0.3, 0.9];
//! let q2 = [0.2, -0.9, 0.7, -0.3, 0.5, 0.9, -0.6, 0.0];
//!
//! let mut problem = Problem::new(q1.len());
//! let tracker = problem.frame("tracker");
//! let base = problem.frame("base");
//! let link1 = problem.frame("link1");
//! let elbow_frame = problem.frame("elbow_origin");
//! let link2 = problem.frame("link2");
//! let body = problem.frame("body");
//!
//! // tracker_from_base is unknown; the start value comes from a rough registration.
//! let world = problem.unknown("tracker_from_base", tracker, base, Isometry3::identity(), Chart::full());
//! problem.set_role(world, Role::World, None);
//! problem.set_start(world, &Isometry3::new(Vector3::new(0.9, 0.3, 0.1), Vector3::new(0.0, 0.1, 0.4)));
//!
//! let shoulder = problem.joint("shoulder", base, link1, Axis::Revolute(Vector3::z_axis()), q1.to_vec());
//! let origin = problem.unknown("elbow.origin", link1, elbow_frame, upper, Chart::none());
//! problem.set_role(origin, Role::JointOrigin, Some("elbow"));
//! let elbow = problem.joint("elbow", elbow_frame, link2, Axis::Revolute(Vector3::y_axis()), q2.to_vec());
//! problem.free_effect(elbow, EffectKind::ZeroOffset, Some(0.05));
//!
//! // Where the body sits on the last link is known to 1 cm across, but its rotation is not.
//! let mount = problem.unknown("body_mount", link2, body, link_from_body, Chart::full());
//! problem.set_role(mount, Role::Mount, None);
//! problem.set_prior(mount, None, Some(0.01));
//!
//! let noise = problem.noise_group("markers", NoiseKind::Position, 2e-4, false);
//! let points: Vec<PointId> = markers
//!     .iter()
//!     .enumerate()
//!     .map(|(i, p)| problem.known_point(&format!("body_{i}"), body, *p))
//!     .collect();
//! let mut seen = Vec::new();
//! for (sample, (a, b)) in q1.iter().zip(q2).enumerate() {
//!     let tracker_from_body = tracker_from_base
//!         * Isometry3::rotation(Vector3::z() * *a)
//!         * upper
//!         * Isometry3::rotation(Vector3::y() * (b + 0.01))
//!         * link_from_body;
//!     for (point, p) in points.iter().zip(&markers) {
//!         seen.push(MarkerObservation { sample, point: *point, position: tracker_from_body * p, shape: None });
//!     }
//! }
//! problem.markers("body", tracker, body, noise, seen);
//!
//! let solution = solve(&problem, &Settings::default())?;
//! assert!(solution.status.is_converged());
//!
//! // The pose of the body in the tracker at new joint angles, with its covariance [ω; v] of the body.
//! let at = Configuration::zero().with(shoulder, 0.4).with(elbow, -0.2);
//! let found = solution.relative_pose(tracker, body, &at)?;
//! let truth = tracker_from_base
//!     * Isometry3::rotation(Vector3::z() * 0.4)
//!     * upper
//!     * Isometry3::rotation(Vector3::y() * (-0.2 + 0.01))
//!     * link_from_body;
//! assert!(found.estimable);
//! assert!((found.pose.translation.vector - truth.translation.vector).norm() < 1e-6);
//! let sigma_m = found.covariance.expect("estimable")[(3, 3)].sqrt();
//! assert!(sigma_m < 2e-4);
//!
//! // Offset of the joint and rotation of the mount about the same axis cannot be distinguished: the fit says so.
//! let offset = solution.parameters.iter().find(|p| p.name == "elbow.offset").expect("named above");
//! assert_eq!(offset.class, ParameterClass::NotObservable);
//! # Ok::<(), Error>(())
//! ```

mod analysis;
#[cfg(test)]
mod example;
mod graph;
mod model;
mod solve;

pub use nalgebra;

pub use analysis::admit::Admission;
pub use analysis::along_sight::{AlongSight, Likelier};
pub use analysis::bounds::Unbounded;
pub use analysis::by_place::ByPlace;
pub use analysis::change::contest::{Contest, Suspect};
pub use analysis::change::{
    BesideScatter, ChanceOfChanges, Change, ChangeScan, ChangeSettings, Left, Moved, Scatter,
};
pub use analysis::closure::{ClosureStatistics, Spread};
pub use analysis::compare::{Criterion, RankedVariant, compare, compare_with};
pub use analysis::dependence::{Dependence, MemoryOf};
pub use analysis::estimate::{solve, solve_from, solve_kept, solve_near, solve_some};
pub use analysis::folds::{folds, k_fold};
pub use analysis::gauge::Gauge;
pub use analysis::gear_ratio::GearRatio;
pub use analysis::goodness::{GoodnessOfFit, Physics, ScoreTest};
pub use analysis::information::{Information, NULL_TOLERANCE};
pub use analysis::moved_before::{Displaced, HeldOutMotion, HeldOutMotions, PlaceOf};
pub use analysis::observability::{Direction, Observability, Term};
pub use analysis::sandwich::sandwich;
pub use analysis::select::{
    NestedError, Part, Selection, SelectionRule, SelectionStep, StepOutcome, select,
};
pub use analysis::settings::Settings;
pub use analysis::solution::{NoiseEstimate, ParameterClass, ParameterEstimate, Solution};
pub use analysis::spread::{LinearPoint, Placement, PostureSpread, SizeSpread, SpreadDirection};
pub use analysis::standardized::StandardizedResiduals;
pub use analysis::starts::StartDirection;
pub use analysis::tails::{ResidualVector, Tails};
pub use analysis::untested::{MovedPoint, Moves, OpenCause, OpenError, OpenErrors, UntestedEffect};
pub use analysis::validate::{CrossValidation, ErrorSummary, Level, SamplePrediction, VectorError};
pub use analysis::weigh::{NoiseCandidate, NoiseChoice, NoiseLevel, Weighed};
pub use analysis::widths::{Widened, WidthEstimate, WidthKind};
pub use calib_geometry::plausible::Unlikely;
pub use calib_model::axis::Axis;
pub use calib_model::effect::{self, EFFECTS, Effect, EffectKind, JointState};
pub use calib_model::motion::JointMotion;
pub use calib_model::unit::{DEFAULT_ROTATION_SIGMA, DEFAULT_TRANSLATION_SIGMA, Unit};
pub use graph::baseline::Baseline;
pub use graph::chart::Chart;
pub use graph::edge::{Candidate, Edge, EdgeKind, Joint, JointEffect, Role, Share, UnknownPose};
pub use graph::error::Error;
pub use graph::ids::{EdgeId, FrameId, GroupId, MeasurementId, ParameterId, PointId};
pub use graph::measurement::{
    self, DirectionObservation, MarkerObservation, Measurement, MeasurementKind, PoseNoise,
    PoseObservation,
};
pub use graph::parameter::{Parameter, ParameterKind};
pub use graph::problem::{
    NoiseGroup, NoiseKind, NoiseModel, OpenStart, OwnNoise, Point, Problem, StartChange,
};
pub use model::derived::{Configuration, DerivedPoint, DerivedPose, Target};
pub use model::layout::Model;
pub use model::values::Values;
pub use model::walk::MIN_JOINT_RANGE;
pub use solve::minimize::{MinimizeSettings, Minimum, SolveStatus, minimize};
pub use solve::relabel::{Relabeled, relabel};
pub use solve::robust::{RejectReason, Rejection, RobustSettings};

/// The README's example is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
