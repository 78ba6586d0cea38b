//! Options and outcome: data alone, no sentences.

use serde::Serialize;

use super::continuous::Continuous;
use super::hypothesis::Scoped;
use super::ids::{JointIndex, RecordingIndex, SampleIndex};
use super::jump::Jump;
use super::readings::WrongReadings;

/// How decisions are made. The defaults are measured, see the book's page on structural hypotheses.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// A hypothesis is named where it divides the residual by at least this (times 1 + 4/ν, ν degrees of freedom): clean data reached 1.33 in none of 1 744 cases.
    pub name_ratio: f64,
    /// Two faults at once must divide the residual by at least this: there are ten thousand pairs.
    pub pair_ratio: f64,
    /// Another hypothesis with a residual at most this many times the best is named too.
    pub runner_up_ratio: f64,
    /// Residual on a noise-free twin (m) up to which two hypotheses are equivalent on this design.
    pub twin_tolerance: f64,
    /// Prior standard deviation of the nominal angles, rad: loose, so that an alarm is the data's.
    pub prior_angle: f64,
    /// Prior standard deviation of the nominal lengths, m.
    pub prior_length: f64,
    /// Standard deviation of a marker coordinate, m: start value of the score tests, and part of the expected residual.
    pub sigma: f64,
    /// Familywise rate of false names among the score tests.
    pub false_alarm: f64,
    /// A gain or coupling that moves the registration residual by less (m) is not named.
    pub least_effect: f64,
    /// Leading hypotheses that are combined with every other one.
    pub beam: usize,
    /// More rows are thinned out evenly: a residual of 400 rows has a sampling error of 2 %, a ratio of 1.5 is far beyond it.
    /// Row shifts are tried only where every row is scored.
    pub most_rows: usize,
    /// List the hypotheses that this design cannot distinguish from correct data.
    pub list_invisible: bool,
    /// Recordings that alone may be wrong; empty: all.
    pub suspects: Vec<RecordingIndex>,
    /// Test gains and fractional couplings.
    pub score_tests: bool,
    /// The fit estimates how late the readings of a recording are as a whole: joints are late in comparison with the others.
    pub clocks_estimated: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            name_ratio: 1.5,
            pair_ratio: 3.0,
            runner_up_ratio: 1.1,
            twin_tolerance: 2e-5,
            prior_angle: 1.0_f64.to_radians(),
            prior_length: 0.01,
            sigma: 3e-4,
            false_alarm: 1e-4,
            least_effect: 7e-4,
            beam: 6,
            most_rows: 400,
            list_invisible: true,
            suspects: Vec::new(),
            score_tests: true,
            clocks_estimated: false,
        }
    }
}

/// The registration residual that nominal errors within the priors explain, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Expected {
    /// Root mean square.
    pub rms: f64,
    /// Exceeded in 1 of 100 robots.
    pub limit: f64,
}

/// Residuals of the registration, rms, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Evidence {
    /// Of the data as they are.
    pub none: f64,
    /// After the correction.
    pub best: f64,
    /// After the best correction that is not equivalent to it, if there is one.
    pub next: Option<f64>,
    /// How many times smaller the residual is after the correction, per unit of the measured coordinates.
    pub ratio: f64,
}

/// Noise of a marker coordinate that is left where the robot may be off as far as the priors say, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Allowing {
    /// Of the data as they are.
    pub none: f64,
    /// After the correction.
    pub best: f64,
}

/// Corrections that belong together: one, or two.
pub type Correction = Vec<Scoped>;

/// What explains the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Named {
    /// The corrections, in the order of application.
    pub correction: Correction,
    /// Corrections that this design cannot distinguish from it.
    pub equivalent: Vec<Correction>,
    /// Corrections that are not equivalent, but explain the data nearly as well, with their residual over the best.
    pub alternatives: Vec<(Correction, f64)>,
    /// Residuals.
    pub evidence: Evidence,
    /// By how much a further hypothesis would divide the residual that is left: under `name_ratio` where the name is verified.
    pub left: f64,
    /// The residual that is left is within the limit of the expected one.
    pub within_expected: Option<bool>,
    /// Where the residuals of registrations did not decide: what is left beside errors of the robot.
    pub allowing: Option<Allowing>,
}

impl Named {
    /// No further hypothesis stands out after the correction.
    #[must_use]
    pub fn verified(&self, options: &Options) -> bool {
        self.left < options.name_ratio
    }
}

/// The decision.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub enum Decision {
    /// Fewer measurements than a registration needs to leave a residual.
    TooFewData {
        /// Degrees of freedom that the registration leaves.
        freedom: f64,
    },
    /// No hypothesis stands out, and nominal errors explain the residual.
    Consistent {
        /// The hypothesis with the smallest residual.
        best: Option<Scoped>,
        /// By how much it divides the residual.
        ratio: f64,
    },
    /// Named.
    Named(Named),
    /// Something is wrong, and no hypothesis explains it: the residual exceeds what nominal errors explain, or the best
    /// explanation leaves another one standing out.
    Undecided {
        /// The best explanation, if one stands out.
        leading: Option<Named>,
        /// By how much the best single hypothesis divides the residual.
        ratio: f64,
    },
}

/// What the engine found.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Outcome {
    /// The decision on discrete hypotheses.
    pub decision: Decision,
    /// Where nothing is named: the joint without whose readings nominal errors explain the data.
    pub readings: Option<WrongReadings>,
    /// Where nothing is named: a change at one row, with which nominal errors explain the data.
    pub jump: Option<Jump>,
    /// A gain or a coupling that the data demand beside (or without) the discrete correction.
    pub continuous: Option<Continuous>,
    /// Residual of the data as they are, rms, m, screened samples left out.
    pub rms: f64,
    /// What nominal errors explain; `None` where it cannot be computed.
    pub expected: Option<Expected>,
    /// Hypotheses that this design cannot distinguish from correct data (empty unless asked for): harmless for what was measured, unknown beyond.
    pub invisible: Vec<Scoped>,
    /// Samples left out as gross outliers under the best explanation; rows as in the input.
    pub screened: Vec<SampleIndex>,
    /// Empty columns that were taken as 0.
    pub assumed_zero: Vec<(JointIndex, RecordingIndex)>,
    /// Rows that were scored.
    pub rows_scored: usize,
    /// Rows of the input.
    pub rows: usize,
    /// Facts about the design.
    pub design: Design,
}

/// Facts about the design that limit what it can show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Design {
    /// Joints whose readings change.
    pub moving: Vec<JointIndex>,
    /// Joints above a body whose readings never change: nothing about them can be seen.
    pub still: Vec<JointIndex>,
    /// Share of the steps between rows of a recording in which at most one joint moves.
    pub one_joint_steps: f64,
}
