//! The frame of two swept axes.

use calib_aor::{
    Center, FrameAxes, FrameAxis, FrameOutcome, FrameSample, Options, frame_planes::algorithm1,
};
use calib_finding::Finding;
use calib_report::Status;

use super::{
    OriginEstimate, Refusal, Task,
    center::{Centers, center_sigma},
    transported,
};
use crate::error::PipelineError;

impl Task<'_> {
    /// Two swept axes: Algorithm 1.
    pub(super) fn frame(
        &self,
        findings: &mut Vec<Finding>,
    ) -> Result<OriginEstimate, PipelineError> {
        let Centers { chosen, others } = self.center(findings)?;
        let estimate = match chosen {
            Ok(estimate) => estimate,
            Err(reason) => return Ok(self.refused(findings, Refusal::Center(reason))),
        };
        let [proximal, distal] = [self.origin.axes[0], self.origin.axes[1]];
        let rows = self.rows();
        let samples: Vec<FrameSample> = rows
            .iter()
            .map(|r| FrameSample {
                world_from_body: Some(r.tracker_from_body.into()),
                proximal: self.inputs.robot.model.position(r.q, proximal.joint),
                distal: self.inputs.robot.model.position(r.q, distal.joint),
                weight: 1.0,
            })
            .collect();
        let tracker = &self.inputs.robot.profile.tracker;
        let options = Options {
            axes: FrameAxes {
                proximal: FrameAxis::Z,
                distal: FrameAxis::X,
            },
            sigma_t: self.track.position_sigma(tracker),
            sigma_r: tracker.body_sigma_rad,
            ..Options::default()
        };
        let center = Center::Given {
            point: estimate.center,
            covariance: self.covariance_of(&estimate),
        };
        let outcome =
            algorithm1(&samples, center, &options).map_err(|cause| PipelineError::Origin {
                origin: self.name.to_owned(),
                cause,
            })?;
        let frame = match outcome {
            FrameOutcome::Estimate(frame) => frame,
            FrameOutcome::NotObservable(n) => {
                return Ok(self.refused(
                    findings,
                    Refusal::Frame(format!("{}: {}", n.verdict, n.reason)),
                ));
            }
        };
        let canonical_from_origin =
            self.child_from_canonical().inverse() * self.child_from_origin();
        let pose = frame.body_from_joint * canonical_from_origin;
        let (point, covariance) = self.center_in_body(&estimate);
        Ok(OriginEstimate {
            pose: Some(pose),
            covariance: Some(transported(&frame.covariance, &canonical_from_origin)),
            unobservable: Vec::new(),
            status: Status::Calibrated,
            center: Some(estimate.center),
            center_sigma: center_sigma(&estimate),
            axis: None,
            axis_sigma: [None; 2],
            estimators: self.agreement(&point, &covariance, &others),
        })
    }
}
