use crate::{ClockCheck, ErrorSource, FitEnd, NoiseKind, NoiseModel, Unit};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A file that was read.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Input {
    /// Relative to the profile.
    pub path: String,
    /// Of its bytes, 64 hexadecimal digits.
    pub sha256: String,
}

/// A file that was written.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Output {
    /// Relative to the output folder.
    pub path: String,
    /// Its content in words: "URDF with 12 changed values".
    pub what: String,
    /// Of its bytes; null for the report itself, which cannot hold its own.
    pub sha256: Option<String>,
    /// The file that it replaces when the user applies it (the original stays untouched); null when there is none.
    pub changes: Option<String>,
}

/// What a recording was used for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordingUse {
    /// Joints swept for the fit.
    #[default]
    Sweep,
    /// Static poses for the fit.
    Static,
    /// Held out.
    Validation,
}

/// One recording.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RecordingSummary {
    /// Its name in the profile.
    pub name: String,
    /// The file, relative to the profile.
    pub path: String,
    /// What it was used for.
    pub used_for: RecordingUse,
    /// Rows in the file.
    pub rows: usize,
    /// Rows of which something took part: in the fit, or in the verification where the recording is held out.
    pub used: usize,
    /// Rows of which everything that was seen was rejected. Rows used, rejected, excluded and lost add up to `rows`.
    pub rejected: usize,
    /// Rows of which everything that was not rejected was excluded before the fit.
    #[serde(default)]
    pub excluded: usize,
    /// Rows without a joint reading or anything that was seen.
    #[serde(default)]
    pub rows_lost: usize,
    /// The same of the single measurements: markers, measured bodies and contacts of the profile.
    #[serde(default)]
    pub measurements: Fates,
    /// Samples that the tracker or encoder lost.
    pub lost: Vec<Lost>,
    /// Conversions on reading: units, rotation conventions, ignored columns. One clause each.
    #[serde(default)]
    pub conversions: Vec<String>,
    /// The axis that points up, where the file states it (`+Z`).
    #[serde(default)]
    pub up_axis: Option<String>,
}

/// What became of measurements: `used`, `rejected`, `excluded` and `lost` add up to `of`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Fates {
    /// All.
    pub of: usize,
    /// Took part in the fit, or in the verification where their recording is held out.
    pub used: usize,
    /// Rejected by the fit, or screened out of the verification.
    pub rejected: usize,
    /// Excluded before the fit.
    pub excluded: usize,
    /// Not seen by the tracker, or without a joint reading.
    pub lost: usize,
}

/// Lost samples of one marker, body or joint.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Lost {
    /// The marker, body or joint.
    pub subject: String,
    /// How many samples are missing.
    pub lost: usize,
    /// Of how many.
    pub of: usize,
}

/// Rows that did not take part in the fit.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Rejected {
    /// The recording.
    pub recording: String,
    /// The body or marker; empty when the whole row was rejected.
    pub subject: String,
    /// Rows, as the recording numbers them: lines from 1 of our own tables, frames of a tracker's file.
    pub rows: Vec<u64>,
    /// How many measurements these are: an excluded body counts once per marker that was seen.
    #[serde(default)]
    pub measurements: usize,
    /// Why, as an id.
    #[serde(default)]
    pub cause: RejectedFor,
    /// Why, in words.
    pub reason: String,
}

/// Why a sample did not take part in the fit.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum RejectedFor {
    /// It is a copy of an earlier measurement.
    Copied,
    /// The distances to the other markers of its body prove it false.
    OutOfPlace,
    /// It lies on the way to a neighboring row.
    OnTheWay,
    /// Its hold drifts or scatters.
    RestlessHold,
    /// Its joint readings are those of an earlier row, and the body had moved meanwhile.
    HeldReadings,
    /// The readings of one joint are those of earlier rows, and the joint had moved meanwhile.
    StuckReading,
    /// The whole body is off, markers together.
    NotSettled,
    /// A pose needed to predict it was lost.
    Occlusion,
    /// It is off by more than noise explains.
    Outlier,
    /// It lies where another marker of the same body should be.
    Swap,
    /// It is a gross outlier among the held-out errors.
    Screened,
    /// Not stated: a report of an earlier version.
    #[default]
    Unstated,
}

/// The noise of a group of observations.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Noise {
    /// What is noisy, as the profile names it: "marker", "joint".
    pub group: String,
    /// What the level is the noise of.
    #[serde(default)]
    pub kind: NoiseKind,
    /// SI unit of the numbers.
    pub unit: Unit,
    /// Standard deviation per component estimated from the data; null when it is not observable.
    pub sigma: Option<f64>,
    /// Standard error of `sigma` divided by `sigma`; null where the data did not decide it.
    #[serde(default)]
    pub relative_error: Option<f64>,
    /// Stated by the profile.
    pub stated: Option<f64>,
    /// Number of observations.
    pub samples: usize,
    /// How it was determined, or why it was not: "variance components (REML)".
    pub text: String,
}

/// What is random from pose to pose: what was tried, and what was taken.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NoiseChoice {
    /// The one that was taken.
    pub chosen: NoiseModel,
    /// What was tried, in order of growth.
    pub candidates: Vec<NoiseCandidate>,
    /// Poses that were left out in turn.
    pub poses: usize,
    /// Measurements that the robust fit rejected, where they were more than chance rejects.
    pub rejected: usize,
    /// Those of them that take part after all.
    pub readmitted: usize,
}

/// One statement of what is random from pose to pose, tried on left-out poses.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NoiseCandidate {
    /// The statement.
    pub model: NoiseModel,
    /// rms error of a left-out measurement, m.
    pub left_out_rms_m: f64,
    /// Negative log-density of a left-out pose minus the least of all candidates, nats.
    pub surprise: f64,
    /// Standard error of `surprise` over the poses.
    pub surprise_error: f64,
    /// Its weights predict left-out poses no worse than weights that trust no model of the robot.
    pub admitted: bool,
    /// Largest noise of a joint under it, rad; null without joint noise.
    pub joint_sigma_rad: Option<f64>,
}

/// An effect that the model lacks at some joints, tested there without a fit: the most significant of its tests.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TestedEffect {
    /// The effect, as in the table of effects; null for a drift of tracker or base.
    pub effect: Option<String>,
    /// Coefficients that were tested.
    pub tested: usize,
    /// The most significant one, for instance `elbow.compliance`.
    pub parameter: String,
    /// Share of χ² that it would remove.
    pub explains: f64,
    /// Probability of so much by chance, corrected for all tests.
    pub p_value: f64,
    /// What the data say.
    pub answer: TestAnswer,
}

/// What a test of an effect says.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TestAnswer {
    /// It is there, and matters: the finding `missing-physics`.
    AskedFor,
    /// It is there, and explains little.
    Small,
    /// It is not distinguishable from noise.
    #[default]
    NotSeen,
}

/// The offset between two clocks.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Clock {
    /// The recording.
    pub recording: String,
    /// How the clocks were brought together.
    #[serde(default)]
    pub check: ClockCheck,
    /// Which clock is late: "tracker".
    pub clock: String,
    /// Against which: "joints".
    pub against: String,
    /// How late, s; null when it could not be estimated.
    pub offset_s: Option<f64>,
    /// Standard deviation, s.
    pub sigma_s: Option<f64>,
    /// How much faster the first runs, 1 (5e-5 = 50 ppm); null when it was not estimated.
    #[serde(default)]
    pub drift: Option<f64>,
    /// Its standard deviation.
    #[serde(default)]
    pub drift_sigma: Option<f64>,
    /// Whether the clocks agree well enough for this recording; null when this was not tested.
    pub agrees: Option<bool>,
    /// The reason in words.
    pub text: String,
}

/// The range of a joint in the data.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JointCoverage {
    /// The joint's name in the URDF.
    pub joint: String,
    /// rad or m.
    pub unit: Unit,
    /// Lower limit of the URDF; null for a continuous joint.
    pub lower_limit: Option<f64>,
    /// Upper limit of the URDF.
    pub upper_limit: Option<f64>,
    /// Smallest position in the data.
    pub min: f64,
    /// Largest position in the data.
    pub max: f64,
    /// Number of samples.
    pub samples: usize,
    /// (max − min) / (upper − lower), at most 1; a continuous joint is compared with one revolution; null when there is no range.
    pub share: Option<f64>,
    /// Left end of the first bin and right end of the last.
    pub bins_from: f64,
    /// Right end of the last bin.
    pub bins_to: f64,
    /// Samples in equal bins from `bins_from` to `bins_to`.
    pub bins: Vec<u64>,
}

/// Bins of a joint's range: 15° each over a full revolution.
const COVERAGE_BINS: usize = 24;

impl JointCoverage {
    /// Count positions into bins over the joint's limits, or over one revolution or the range of the data where it has none. Positions outside count in the end bins.
    ///
    /// `None` when there is no finite position.
    #[must_use]
    pub fn of(
        joint: impl Into<String>,
        unit: Unit,
        limits: Option<(f64, f64)>,
        positions: &[f64],
    ) -> Option<Self> {
        let finite: Vec<f64> = positions
            .iter()
            .copied()
            .filter(|x| x.is_finite())
            .collect();
        let min = finite.iter().copied().reduce(f64::min)?;
        let max = finite.iter().copied().reduce(f64::max)?;
        let limits =
            limits.filter(|(lower, upper)| lower.is_finite() && upper.is_finite() && lower < upper);
        let half = std::f64::consts::PI;
        let (from, to) = match limits {
            Some(limits) => limits,
            None if unit == Unit::Radian && -half <= min && max <= half => (-half, half),
            None => (min, max),
        };
        let mut bins = vec![0; COVERAGE_BINS];
        for position in &finite {
            let place = if to > from {
                (position - from) / (to - from) * COVERAGE_BINS as f64
            } else {
                0.0
            };
            bins[(place.max(0.0) as usize).min(COVERAGE_BINS - 1)] += 1;
        }
        let whole = limits
            .map(|(lower, upper)| upper - lower)
            .or((unit == Unit::Radian).then_some(2.0 * half));
        Some(Self {
            joint: joint.into(),
            unit,
            lower_limit: limits.map(|limits| limits.0),
            upper_limit: limits.map(|limits| limits.1),
            min,
            max,
            samples: finite.len(),
            share: whole.map(|whole| ((max - min) / whole).min(1.0)),
            bins_from: from,
            bins_to: to,
            bins,
        })
    }
}

/// How the solver ended.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FitSummary {
    /// How the solver ended.
    #[serde(default)]
    pub ended: FitEnd,
    /// The same in words: "converged after 7 iterations".
    pub status: String,
    /// Whether the solver reached an optimum. It is not the verdict.
    pub converged: bool,
    /// Iterations.
    pub iterations: usize,
    /// Scalar observations.
    pub observations: usize,
    /// Scalar unknowns.
    pub unknowns: usize,
    /// χ² per degree of freedom with the noise that the profile states, and with the noise that was found where it states
    /// none: about 1 when the noise explains the residuals; null for the closed forms.
    pub chi2_per_dof: Option<f64>,
    /// The same with the noise that the stated uncertainty is made of; 1 by construction where all noise was estimated.
    #[serde(default)]
    pub chi2_used_per_dof: Option<f64>,
    /// Groups of observations whose noise the profile states; empty: `chi2_per_dof` is 1 by construction.
    #[serde(default)]
    pub stated_noise: Vec<String>,
    /// Median over the parameters that the data determine of the cluster-robust standard deviation over the stated one:
    /// about 1 where the noise model is right.
    #[serde(default)]
    pub cluster_robust_ratio: Option<f64>,
}

/// The predicted uncertainty of the tool over the workspace.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Workspace {
    /// The link or tool.
    pub link: String,
    /// The frame of the positions.
    pub frame: String,
    /// The frame in which the point is predicted with this uncertainty: the tracker's. Empty where it is [`Workspace::frame`].
    #[serde(default)]
    pub relative_to: String,
    /// Positions and their uncertainty.
    pub points: Vec<WorkspacePoint>,
    /// Root mean square of σ over the points, m.
    pub rms_sigma_m: f64,
    /// Largest σ, m.
    pub max_sigma_m: f64,
}

impl Workspace {
    /// The same with the frame in which the point is predicted.
    #[must_use]
    pub fn relative_to(mut self, frame: impl Into<String>) -> Self {
        self.relative_to = frame.into();
        self
    }
}

/// The tool at one place.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorkspacePoint {
    /// m.
    pub position_m: [f64; 3],
    /// √trace of the 3×3 covariance of the position, m.
    pub sigma_m: f64,
}

impl Workspace {
    /// From points; the summary over the finite ones. `None` when there is none.
    #[must_use]
    pub fn of(
        link: impl Into<String>,
        frame: impl Into<String>,
        points: Vec<WorkspacePoint>,
    ) -> Option<Self> {
        let points: Vec<_> = points
            .into_iter()
            .filter(|p| p.sigma_m.is_finite() && p.position_m.iter().all(|x| x.is_finite()))
            .collect();
        let sigmas: Vec<f64> = points.iter().map(|p| p.sigma_m).collect();
        let stats = crate::Stats::of(&sigmas)?;
        Some(Self {
            link: link.into(),
            frame: frame.into(),
            relative_to: String::new(),
            points,
            rms_sigma_m: stats.rms,
            max_sigma_m: stats.max,
        })
    }
}

/// One source of the remaining error.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AccuracyLimit {
    /// Which source.
    #[serde(default)]
    pub kind: ErrorSource,
    /// The source in words: "joint noise".
    pub source: String,
    /// Its contribution to the position error of the tool, m; null when it is not quantified.
    pub sigma_m: Option<f64>,
    /// Its share of the variance, in [0, 1].
    pub share: Option<f64>,
    /// How it was determined.
    pub text: String,
    /// What reduces it.
    pub remedy: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_counts_every_sample_once() {
        let positions = [-3.0, -1.0, 0.0, 0.999, 1.0, 5.0, f64::NAN];
        let coverage =
            JointCoverage::of("j", Unit::Radian, Some((-1.0, 1.0)), &positions).expect("positions");
        assert_eq!(coverage.bins.iter().sum::<u64>(), 6);
        assert_eq!(
            (coverage.bins[0], coverage.bins[12], coverage.bins[23]),
            (2, 1, 3)
        );
        assert_eq!(coverage.share, Some(1.0));
    }

    #[test]
    fn a_joint_without_limits_or_motion_still_has_bins() {
        let still = JointCoverage::of("j", Unit::Meter, None, &[0.2, 0.2]).expect("positions");
        assert_eq!((still.bins[0], still.share), (2, None));
        let turning = JointCoverage::of("j", Unit::Radian, None, &[0.0, std::f64::consts::PI])
            .expect("positions");
        assert_eq!(turning.share, Some(0.5));
        assert_eq!(turning.bins_from, -std::f64::consts::PI);
        assert_eq!(JointCoverage::of("j", Unit::Radian, None, &[]), None);
        let backwards =
            JointCoverage::of("j", Unit::Radian, Some((0.0, 0.0)), &[0.5]).expect("positions");
        assert_eq!(backwards.lower_limit, None);
    }

    #[test]
    fn a_workspace_without_points_is_none() {
        assert_eq!(Workspace::of("tool", "base", vec![]), None);
        let point = WorkspacePoint {
            position_m: [0.0; 3],
            sigma_m: f64::NAN,
        };
        assert_eq!(Workspace::of("tool", "base", vec![point]), None);
    }
}
