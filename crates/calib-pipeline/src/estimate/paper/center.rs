//! Centers of rotation by the estimators that the profile names, and origins that have a center only.

use std::collections::BTreeMap;

use calib_finding::Finding;
use calib_plugin::{BodyPose, MotionData, Shape};
use calib_profile::BodyKind;
use calib_report::{EstimatorResult, Status, Unit, Unobservable};
use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3};

use super::{OriginEstimate, Refusal, Task, body_pose, transported};
use crate::error::PipelineError;
use crate::prepare::estimators::CenterFit;

/// A center, or why the data do not determine one.
pub(super) type CenterOutcome = Result<CenterFit, String>;

/// The chosen estimator's center and what others say.
pub(super) struct Centers {
    pub chosen: CenterOutcome,
    pub others: Vec<(&'static str, CenterOutcome)>,
}

/// σ of one coordinate of a center, rms over the three, m.
pub(super) fn center_sigma(estimate: &CenterFit) -> Option<f64> {
    let covariance = estimate.covariance?;
    Some((covariance.trace() / 3.0).max(0.0).sqrt())
}

impl Task<'_> {
    /// The center by the profile's estimator, and by the others that take the same data.
    pub(super) fn center(&self, findings: &mut Vec<Finding>) -> Result<Centers, PipelineError> {
        let id = &self.origin.center;
        let parameters = crate::prepare::estimators::values(&self.origin.center_parameters);
        let chosen = self.fit_center(id, &parameters)?;
        if chosen.as_ref().is_ok_and(|fit| fit.covariance.is_none()) {
            self.without_covariance(findings, false);
        }
        let mut others = Vec::new();
        for other in ["sfe", "hse", "hotspot_ml", "ml_sphere", "ball_bundle"] {
            if other != id
                && let Ok(outcome) = self.fit_center(other, &BTreeMap::new())
            {
                others.push((other, outcome));
            }
        }
        Ok(Centers { chosen, others })
    }

    /// Runs one estimator: on the markers where it takes them, else on the poses of the body.
    fn fit_center(
        &self,
        id: &str,
        parameters: &BTreeMap<String, calib_plugin::Value>,
    ) -> Result<CenterOutcome, PipelineError> {
        let tracker = &self.inputs.robot.profile.tracker;
        let takes = &self.estimators.tables.cor.get(id)?.offer().shapes;
        let sweep = &self.sweep().poses;
        let markers = match &self.inputs.robot.profile.bodies[&self.origin.body].kind {
            BodyKind::Markers { names, .. } if takes.contains(&Shape::Markers) => Some(names),
            _ => None,
        };
        let motion = match markers {
            Some(names) => {
                let track = |m: &String| match sweep.markers.get(m) {
                    Some(track) => track.iter().map(|p| p.map(|p| p.coords.into())).collect(),
                    None => vec![None; sweep.len()],
                };
                let tracks: Vec<Vec<Option<[f64; 3]>>> = names.iter().map(track).collect();
                let mut motion = MotionData::markers(&tracks);
                motion.sigma_t_m = tracker.marker_sigma;
                motion
            }
            None => {
                let poses: Vec<Option<BodyPose>> = self
                    .track
                    .in_recording(&self.origin.sweep)
                    .iter()
                    .map(|p| p.map(|p| body_pose(&p)))
                    .collect();
                let mut motion = MotionData::poses(&poses);
                motion.sigma_t_m = self.track.position_sigma(tracker);
                motion.sigma_r_rad = tracker.body_sigma_rad;
                motion
            }
        };
        self.estimators.center(id, parameters, &motion)
    }

    /// The center in the body, averaged over the sweep, with its covariance.
    pub(super) fn center_in_body(&self, estimate: &CenterFit) -> (Point3<f64>, Matrix3<f64>) {
        let rows = self.rows();
        let n = rows.len().max(1) as f64;
        let in_body: Vec<Vector3<f64>> = rows
            .iter()
            .map(|r| {
                r.tracker_from_body
                    .inverse_transform_point(&estimate.center)
                    .coords
            })
            .collect();
        let mean = in_body.iter().sum::<Vector3<f64>>() / n;
        // δm in the tracker enters row i as R_iᵀ δm; the poses' own errors are independent from row to row.
        let turned: Matrix3<f64> = rows
            .iter()
            .map(|r| {
                r.tracker_from_body
                    .rotation
                    .inverse()
                    .to_rotation_matrix()
                    .into_inner()
            })
            .sum::<Matrix3<f64>>()
            / n;
        let scatter: Matrix3<f64> = in_body
            .iter()
            .map(|p| (p - mean) * (p - mean).transpose())
            .sum::<Matrix3<f64>>()
            / ((n - 1.0).max(1.0) * n);
        (
            Point3::from(mean),
            turned * self.covariance_of(estimate) * turned.transpose() + scatter,
        )
    }

    /// Covariance of a center; an estimator that states none is trusted no better than the prior.
    pub(super) fn covariance_of(&self, estimate: &CenterFit) -> Matrix3<f64> {
        let prior = self.inputs.robot.profile.solve.prior.position;
        estimate
            .covariance
            .unwrap_or_else(|| Matrix3::from_diagonal_element(prior * prior))
    }

    pub(super) fn agreement(
        &self,
        reference: &Point3<f64>,
        covariance: &Matrix3<f64>,
        others: &[(&'static str, CenterOutcome)],
    ) -> Vec<EstimatorResult> {
        /// Squared Mahalanobis distance that two estimates of one point stay under in 99.9 % (χ² with 3 degrees).
        const AGREES: f64 = 16.27;
        others
            .iter()
            .map(|(id, outcome)| {
                let quantity = format!("center of {} in {}", self.name, self.origin.body);
                let estimate = match outcome {
                    Ok(estimate) => estimate,
                    Err(reason) => {
                        return EstimatorResult {
                            quantity,
                            estimator: (*id).to_owned(),
                            value: None,
                            sigma: None,
                            agrees: false,
                            unit: Unit::Meter,
                            distance: None,
                            text: reason.clone(),
                        };
                    }
                };
                let (point, own) = self.center_in_body(estimate);
                let difference = point - reference;
                // Both use the same samples: the difference is at most as uncertain as the two together.
                let z2 = nalgebra::Cholesky::new(own + covariance)
                    .map_or(f64::INFINITY, |c| difference.dot(&c.solve(&difference)));
                EstimatorResult {
                    quantity,
                    estimator: (*id).to_owned(),
                    value: Some(point.coords.as_slice().to_vec()),
                    sigma: Some(own.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect()),
                    agrees: z2 <= AGREES,
                    unit: Unit::Meter,
                    distance: Some(difference.norm()),
                    text: String::new(),
                }
            })
            .collect()
    }

    /// A center without axes: the orientation is the nominal URDF's, relative to a body.
    pub(super) fn center_only(
        &self,
        findings: &mut Vec<Finding>,
    ) -> Result<OriginEstimate, PipelineError> {
        let Centers { chosen, others } = self.center(findings)?;
        let estimate = match chosen {
            Ok(estimate) => estimate,
            Err(reason) => return Ok(self.refused(findings, Refusal::Center(reason))),
        };
        let (point, covariance) = self.center_in_body(&estimate);
        let Some(rotation) = self.assumed_rotation() else {
            return Ok(self.refused(findings, Refusal::Orientation));
        };
        // body_from_child: the center of the swept joints lies at c in the child's frame.
        let child = Isometry3::from_parts(Translation3::from(point.coords), rotation)
            * Translation3::from(-self.child_from_canonical().translation.vector);
        let child_from_origin = self.child_from_origin();
        let assumed = self.assumed_covariance(&rotation, &covariance);
        Ok(OriginEstimate {
            pose: Some(child * child_from_origin),
            covariance: Some(transported(&assumed, &child_from_origin)),
            unobservable: vec![self.assumed_orientation()],
            status: Status::Assumed,
            center: Some(estimate.center),
            center_sigma: center_sigma(&estimate),
            axis: None,
            axis_sigma: [None; 2],
            estimators: self.agreement(&point, &covariance, &others),
        })
    }

    /// Covariance `[ω; v]` in the child: the orientation is only as good as the prior, the position is measured.
    fn assumed_covariance(
        &self,
        rotation: &UnitQuaternion<f64>,
        position_in_body: &Matrix3<f64>,
    ) -> Matrix6<f64> {
        let r = rotation.to_rotation_matrix();
        let angle = self.inputs.robot.profile.solve.prior.angle;
        let mut covariance = Matrix6::from_diagonal_element(angle * angle);
        covariance
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&(r.matrix().transpose() * position_in_body * r.matrix()));
        covariance
    }

    fn assumed_orientation(&self) -> Unobservable {
        Unobservable {
            direction: [1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
            text:
                "a center has no orientation: it is taken from the URDF at its zero configuration"
                    .to_owned(),
            remedy: "sweep two axes and name them under `axes`, or solve with `method: ml`"
                .to_owned(),
        }
    }
}
