//! Facts that a report states in sentences: ids and values; the sentences are those of [`crate::words`].

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One condition under which a result holds.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Scope {
    /// Positions of the tracked bodies in the tracker's frame of this name.
    TrackedBodies {
        /// The tracker's frame.
        frame: String,
    },
    /// The contacts that were recorded.
    Contacts,
    /// Only one joint at a time moved, away from the postures of the recordings.
    SingleJointMotions,
    /// Only positions: no orientation of the last body was measured.
    PositionsOnly,
    /// Where the held-out poses lie against the joint ranges of the fit.
    HeldOutPoses {
        /// Postures.
        postures: usize,
        /// Those with a joint outside of the fitted range.
        outside: usize,
        /// Joints that they hardly move, although the fit did.
        still: Vec<String>,
    },
    /// Every pose was left out in turn: no pose is independent of the recordings of the fit.
    LeftOutPoses {
        /// Postures.
        postures: usize,
    },
    /// Only together with the joint effects in this file.
    EffectsOf {
        /// The file that holds them.
        file: String,
        /// The URDF that was fitted to be used without them, where one was written.
        alone: Option<String>,
    },
    /// Origins were estimated one by one, with nominal link geometry.
    OriginsOneByOne,
}

/// Physics that the residuals show and the model lacks.
#[derive(Debug, Clone, PartialEq)]
pub struct MissingPhysics {
    /// What it is.
    pub physics: Physics,
    /// Name of its parameter, for instance `elbow.compliance`.
    pub parameter: String,
    /// Its value that one step towards the better model gives, in the unit of the parameter.
    pub estimate: f64,
    /// Share of χ² that it would remove.
    pub explains: f64,
    /// Probability of such residuals if it were absent.
    pub p_value: f64,
}

/// What a score test asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Physics {
    /// An effect of a joint, as its entry in the table of effects calls it.
    Effect(&'static str),
    /// A drift of the measuring frame over time.
    Drift,
}

/// What the reader should do now.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum NextStep {
    /// Use the calibrated URDF.
    Use {
        /// The file.
        urdf: String,
        /// The file with the joint effects that a URDF cannot hold, where there are any.
        effects: Option<String>,
    },
    /// Use the model file: the URDF is no better without the joint effects that it cannot hold.
    UseModel {
        /// The file.
        model: String,
        /// The URDF that was fitted to be used without the effects, where it is better than the untouched one.
        alone: Option<String>,
    },
    /// Nothing of the URDF changed.
    KeepUrdf {
        /// The file with what was found: where bodies and tracker are.
        scene: String,
    },
    /// The URDF predicts as well as it is.
    NothingGained,
    /// Fix the problems of a rejected result.
    FixProblems,
    /// Record validation poses and set limits.
    AddValidation {
        /// There are no validation poses.
        poses: bool,
        /// There are no limits.
        limits: bool,
    },
    /// Enable an effect that the residuals show and the model lacks.
    EnableEffect {
        /// What the residuals show.
        missing: MissingPhysics,
    },
    /// Follow the remedy of the most severe finding.
    Resolve {
        /// What the finding is about.
        subject: String,
        /// The finding's id.
        finding: String,
        /// Its remedy.
        remedy: String,
    },
    /// Use all recordings at once.
    SolveJointly,
}

/// How the solver ended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum FitEnd {
    /// The gradient vanished.
    Converged,
    /// No step lowered the cost.
    Stalled,
    /// The iterations did not suffice.
    MaxIterations,
    /// The model could not be evaluated at the start values.
    NotEvaluable,
    /// Not recorded.
    #[default]
    Unknown,
}

impl FitEnd {
    /// Every end and its word in data.
    const IDS: [(Self, &str); 5] = [
        (Self::Converged, "converged"),
        (Self::Stalled, "stalled"),
        (Self::MaxIterations, "max_iterations"),
        (Self::NotEvaluable, "not_evaluable"),
        (Self::Unknown, "unknown"),
    ];

    /// The word in data, as in JSON.
    #[must_use]
    pub fn id(self) -> &'static str {
        let ids = Self::IDS.iter();
        ids.into_iter()
            .find(|(end, _)| *end == self)
            .map_or("unknown", |(_, id)| id)
    }

    /// The end of a word in data.
    #[must_use]
    pub fn of_id(id: &str) -> Self {
        let ids = Self::IDS.iter();
        ids.into_iter()
            .find(|(_, known)| *known == id)
            .map_or(Self::Unknown, |(end, _)| *end)
    }
}

/// What a noise level is the noise of.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum NoiseKind {
    /// A position that the tracker measures.
    #[default]
    Position,
    /// An orientation or direction that the tracker measures.
    Orientation,
    /// The position of a joint that turns, as the robot reports it.
    Joint,
    /// That of a joint that slides.
    Slide,
    /// A factor on stated covariances.
    Scale,
}

/// What is random from pose to pose, beside the noise of each measurement.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum NoiseModel {
    /// Nothing: the weights of plain least squares.
    #[default]
    White,
    /// The positions of the joints that turn, with one level.
    Joint,
    /// With one more level for the joints that slide.
    JointAndSlide,
    /// The pose of each body with markers.
    BodyPose,
    /// The joint positions, with a level for each joint.
    JointEach,
}

/// A source of the error that remains.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ErrorSource {
    /// Noise of one measurement of the tracker.
    TrackerNoise,
    /// Noise of the joint positions.
    JointNoise,
    /// Uncertainty of the estimated parameters.
    Parameters,
    /// What neither noise nor uncertainty explains.
    #[default]
    NotModeled,
}

/// How the clocks of a recording were brought together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ClockCheck {
    /// Static poses: each row holds joints and tracker data of one pose.
    NotNeeded,
    /// Joints and tracker share the rows of one table; their offset was not estimated.
    #[default]
    NotTested,
    /// Streams were aligned.
    Aligned,
    /// Joints and tracker share the rows of one table, and a finding says that they are not of the same time.
    Noticed,
}
