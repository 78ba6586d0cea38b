//! The paper's method: each origin alone, by closed forms.
//!
//! ```text
//! center   m in the tracker from the sweep (§3)        axes by Algorithm 1 (§5.2), brought back by the joint angles
//! body_from_origin = mean over samples of T_i⁻¹ · world_from_origin(q_i)
//! ```
//!
//! The errata are applied: the frame is expressed in the *body*, axes are averaged without sign after they are turned
//! back by the known joint angles, and a sweep about one axis gives a line, never a point on it.

mod axis;
mod center;
mod frame;
mod nominal;

use std::collections::BTreeMap;

use calib_finding::{About, Fact, Finding, catalog};
use calib_geometry::{Line, Twist, se3};
use calib_plugin::BodyPose;
use calib_profile::{Orientation, Origin, PointChoice};
use calib_report::{EstimatorResult, Status, Unobservable};
use nalgebra::{Isometry3, Matrix6, Point3};

use crate::error::PipelineError;
use crate::estimate::start::Start;
use crate::prepare::estimators::Estimators;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

/// One origin found by closed forms.
#[derive(Debug, Clone)]
pub struct OriginEstimate {
    /// `body_from_origin`; `None` where the data cannot give it.
    pub pose: Option<Isometry3<f64>>,
    /// 6×6 in `[ω; v]` of the origin.
    pub covariance: Option<Matrix6<f64>>,
    /// Directions that the sweep does not see; what is reported along them is a choice.
    pub unobservable: Vec<Unobservable>,
    /// Calibrated, or assumed where its orientation is taken from the nominal URDF.
    pub status: Status,
    /// Center of rotation in the tracker's frame, where there is one.
    pub center: Option<Point3<f64>>,
    /// σ of the center along one axis (rms over the three), m, where the estimator states it.
    pub center_sigma: Option<f64>,
    /// Axis of rotation in the tracker's frame, where one joint was swept.
    pub axis: Option<Line>,
    /// σ of the axis' point across it (m) and of its direction (rad), where the estimator states them.
    pub axis_sigma: [Option<f64>; 2],
    /// The same quantity by other estimators.
    pub estimators: Vec<EstimatorResult>,
}

/// A row of a sweep that has joint positions and a pose of the body.
struct Row<'a> {
    q: &'a [f64],
    tracker_from_body: Isometry3<f64>,
}

/// All origins of the profile, by name. A failed origin is a finding, not an error.
///
/// # Errors
/// [`PipelineError::Plugin`] for an estimator that does not exist or does not fit the data, [`PipelineError::Origin`] for
/// poses that make no frame.
pub fn origins(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    start: &Start,
    estimators: &Estimators,
    findings: &mut Vec<Finding>,
) -> Result<BTreeMap<String, OriginEstimate>, PipelineError> {
    let mut found: BTreeMap<String, OriginEstimate> = BTreeMap::new();
    let profile = &inputs.robot.profile;
    // An origin whose point is counted from another comes after it.
    let depends = |o: &Origin| matches!(o.point, Some(PointChoice::NominalDistanceFrom(_)));
    let mut order: Vec<(&String, &Origin)> = profile.origins.iter().collect();
    order.sort_by_key(|(_, o)| depends(o));
    for (name, origin) in order {
        let task = Task {
            estimators,
            inputs,
            name,
            origin,
            track: &tracks[&origin.body],
            start,
        };
        let estimate = task.estimate(&found, findings)?;
        found.insert(name.clone(), estimate);
    }
    Ok(found)
}

fn body_pose(pose: &Isometry3<f64>) -> BodyPose {
    let r = pose.rotation.to_rotation_matrix();
    BodyPose {
        rotation: std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)])),
        translation_m: pose.translation.vector.into(),
    }
}

struct Task<'a> {
    estimators: &'a Estimators,
    inputs: &'a Inputs,
    name: &'a str,
    origin: &'a Origin,
    track: &'a BodyTrack,
    start: &'a Start,
}

impl Task<'_> {
    fn sweep(&self) -> &Loaded {
        &self.inputs.recordings[&self.origin.sweep]
    }

    fn rows(&self) -> Vec<Row<'_>> {
        let poses = self.track.in_recording(&self.origin.sweep);
        let rows = self.sweep().q.iter().zip(poses);
        rows.filter_map(|(q, pose)| {
            Some(Row {
                q: q.as_ref()?,
                tracker_from_body: (*pose)?,
            })
        })
        .collect()
    }

    fn estimate(
        &self,
        found: &BTreeMap<String, OriginEstimate>,
        findings: &mut Vec<Finding>,
    ) -> Result<OriginEstimate, PipelineError> {
        match (self.origin.axes.len(), &self.origin.orientation) {
            (1, _) => self.single_axis(found, findings),
            (2, Orientation::Axes) => self.frame(findings),
            _ => self.center_only(findings),
        }
    }

    /// Says that an estimator stated no uncertainty, and what stands in its place.
    fn without_covariance(&self, findings: &mut Vec<Finding>, of_axis: bool) {
        let (form, estimator) = match of_axis {
            false => ("center", &self.origin.center),
            true => ("axis", &self.origin.axis),
        };
        let prior = &self.inputs.robot.profile.solve.prior;
        let about = About::Origin(self.name.to_owned());
        findings.push(
            Finding::of_kind(catalog::ORIGIN_WITHOUT_COVARIANCE, form, about)
                .with("estimator", Fact::name(estimator))
                .with("sigma", Fact::meters(prior.position))
                .with_some("sigma_angle", of_axis.then(|| Fact::radians(prior.angle))),
        );
    }

    fn refused(&self, findings: &mut Vec<Finding>, why: Refusal) -> OriginEstimate {
        let about = About::Origin(self.name.to_owned());
        let (form, estimator, said) = match why {
            Refusal::Center(said) => ("center", Some(&self.origin.center), Some(said)),
            Refusal::Axis(said) => ("axis", Some(&self.origin.axis), Some(said)),
            Refusal::Frame(said) => ("frame", None, Some(said)),
            Refusal::Orientation => ("orientation", None, None),
            Refusal::MeanAxis => ("mean_axis", None, None),
        };
        let finding = Finding::of_kind(catalog::ORIGIN_NOT_OBSERVABLE, form, about)
            .with("sweep", Fact::name(&self.origin.sweep))
            .with_some("estimator", estimator.map(Fact::name))
            .with_some("said", said.map(Fact::name));
        let unobservable = Unobservable {
            direction: [0.0; 6],
            text: finding.text(),
            remedy: finding.remedy(),
        };
        findings.push(finding);
        OriginEstimate {
            pose: None,
            covariance: None,
            unobservable: vec![unobservable],
            status: Status::Assumed,
            center: None,
            center_sigma: None,
            axis: None,
            axis_sigma: [None; 2],
            estimators: Vec::new(),
        }
    }
}

/// Why a sweep does not determine an origin. An estimator, which may be a plugin's, says its reason itself.
enum Refusal {
    /// No center.
    Center(String),
    /// No axis.
    Axis(String),
    /// Two axes give no frame.
    Frame(String),
    /// The assumed orientation, or the reference point along the axis, is not known.
    Orientation,
    /// The axis has no mean direction in the body.
    MeanAxis,
}

/// Covariance of `a_from_c = a_from_b · b_from_c` from that of `a_from_b`: `Ad(c_from_b) C Ad(c_from_b)ᵀ`.
#[must_use]
pub fn transported(covariance: &Matrix6<f64>, b_from_c: &Isometry3<f64>) -> Matrix6<f64> {
    let ad = se3::adjoint(&b_from_c.inverse());
    ad * covariance * ad.transpose()
}

/// Twist between two poses of the same frame, in its own axes.
#[must_use]
pub fn difference(from: &Isometry3<f64>, to: &Isometry3<f64>) -> Twist {
    se3::log(&(from.inverse() * to))
}
