//! A stated problem with the names of its parts, and what solving it gives.

use std::collections::BTreeMap;

use calib_core::{
    EdgeId, FrameId, GroupId, NoiseChoice, NoiseKind, NoiseModel, ParameterId, PointId, Problem,
    Solution, WidthEstimate,
};
use calib_profile::SharedWidth;

use crate::formulate::kinematics::Calibration;
use crate::prepare::inputs::Inputs;
use crate::prepare::loads::FirstMoment;

/// What to free in a solve: the profile's choice, or the bodies and the robot's place only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FreeSet {
    /// What the profile says.
    Profile,
    /// Mounts and `tracker_from_root` only: the baseline.
    RegistrationOnly,
}

/// A stated problem, and how its parts are called there.
#[derive(Debug, Clone)]
pub struct Formulation {
    /// The problem.
    pub problem: Problem,
    /// Recording and row of each sample.
    pub samples: Vec<(String, usize)>,
    /// Frame of the tracker.
    pub tracker: FrameId,
    /// Frame per link index; `None` for links that no path uses.
    pub links: Vec<Option<FrameId>>,
    /// Frame per body that has one.
    pub bodies: BTreeMap<String, FrameId>,
    /// Joint edge per joint index.
    pub joints: Vec<Option<EdgeId>>,
    /// Origin edge per joint index, where it can change.
    pub origins: Vec<Option<EdgeId>>,
    /// `tracker_from_root`.
    pub root: EdgeId,
    /// Mount edge per body that has one.
    pub mounts: BTreeMap<String, EdgeId>,
    /// Points by body and marker.
    pub points: BTreeMap<String, BTreeMap<String, PointId>>,
    /// Touching points by name.
    pub contact_points: BTreeMap<String, PointId>,
    /// Places of what is touched, by contact.
    pub contacts: BTreeMap<String, EdgeId>,
    /// Places of spots that are estimated, by contact and spot.
    pub spots: BTreeMap<String, BTreeMap<String, EdgeId>>,
    /// First moments that are estimated beyond the given masses.
    pub masses: Vec<(FirstMoment, ParameterId)>,
    /// What is left of the clocks' offset, by recording.
    pub clocks: BTreeMap<String, ClockParameters>,
    /// Noise levels that the problem has.
    pub noise: NoiseGroups,
    /// Prior widths that several joints share.
    pub widths: Vec<PriorKind>,
    /// Regressors are needed at predictions (compliance or coupling is free).
    pub loaded: bool,
}

/// What is left of the clocks' offset of one recording: offset in its middle, s, and change to its end, s.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClockParameters {
    /// In the middle of the recording.
    pub offset: ParameterId,
    /// From there to its end, where the clocks are two.
    pub drift: Option<ParameterId>,
}

/// Parameters whose prior has the width of one key of `solve.prior`.
#[derive(Debug, Clone)]
pub struct PriorKind {
    /// The key, and where its width is from.
    pub width: SharedWidth,
    /// The parameters of joints that move.
    pub parameters: Vec<ParameterId>,
}

/// Noise levels of a problem.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct NoiseGroups {
    /// Positions of markers.
    pub marker: Option<GroupId>,
    /// Positions of bodies.
    pub body_position: Option<GroupId>,
    /// Readings of joints that turn.
    pub joint: Option<GroupId>,
}

impl Formulation {
    /// The same with this noise from pose to pose, where the problem has anything for it.
    #[must_use]
    pub fn with_noise(mut self, model: NoiseModel) -> Self {
        if let Some(problem) = self.problem.with_noise_model(model) {
            self.problem = problem;
            if !matches!(model, NoiseModel::Joint | NoiseModel::JointAndSlide) {
                self.noise.joint = None;
            }
        }
        self
    }

    /// First sample of every recording but the first.
    #[must_use]
    pub fn borders(&self) -> Vec<usize> {
        self.problem.borders.clone()
    }

    /// The body of a frame; markers without a frame of their own are points of their link.
    pub(crate) fn body_of<'a>(&'a self, inputs: &'a Inputs, frame: FrameId) -> Option<&'a String> {
        let own = self.bodies.iter().find(|(_, f)| **f == frame);
        let on_link = || {
            let mut bodies = inputs.robot.profile.bodies.iter();
            bodies.find(|(_, b)| self.links[b.link.index()] == Some(frame))
        };
        own.map(|(name, _)| name)
            .or_else(|| on_link().map(|(name, _)| name))
    }
}

/// Noise levels that were taken by evidence beside the common ones.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct OwnLevels {
    /// One for each body.
    pub by_body: bool,
    /// One for each of these markers.
    pub markers: Vec<PointId>,
}

/// A solved problem.
#[derive(Debug, Clone)]
pub struct MlFit {
    /// What was tried of the noise from pose to pose; `None` where the profile states it.
    pub noise: Option<NoiseChoice>,
    /// Which noise levels of their own were taken beside those that were stated.
    pub levels: OwnLevels,
    /// What was found of each of the formulation's widths; `None` for those that are as stated, or that the data cannot tell.
    pub widths: Vec<Option<WidthEstimate>>,
    /// Standard deviations over those of a given model, where the model was chosen and its choice cost something.
    pub widened: Option<f64>,
    /// The problem's names.
    pub formulation: Formulation,
    /// What was found.
    pub solution: Solution,
    /// The robot that follows.
    pub calibration: Calibration,
}

impl MlFit {
    /// Whether something has noise of its own along the line of sight.
    #[must_use]
    pub fn has_sight(&self) -> bool {
        let mut measurements = self.formulation.problem.measurements().iter();
        measurements.any(|m| m.kind.sight().is_some())
    }

    /// Noise of the reading of a joint that turns, rms over the joints that have any, rad; `None` where none has.
    #[must_use]
    pub fn joint_sigma(&self) -> Option<f64> {
        self.sigma_of(NoiseKind::Joint)
    }

    /// The same of a joint that slides, m.
    #[must_use]
    pub fn slide_sigma(&self) -> Option<f64> {
        self.sigma_of(NoiseKind::Slide)
    }

    fn sigma_of(&self, kind: NoiseKind) -> Option<f64> {
        let noise = self.solution.noise.iter();
        let of_joints = noise.filter(|n| n.kind == kind && n.samples > 0);
        let squares: Vec<f64> = of_joints.map(|n| n.sigma * n.sigma).collect();
        let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        (!squares.is_empty()).then(|| mean.sqrt())
    }
}
