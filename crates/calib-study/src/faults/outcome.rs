//! What the program made of a case: its verdict and findings against the truth.

use std::collections::{BTreeMap, BTreeSet};

use calib_finding::{Fact, Finding, Severity, catalog};
use calib_pipeline::error::DataProblem;
use calib_pipeline::prepare::inputs::Written;
use calib_pipeline::prepare::load::{RobotProfile, of_tables};
use calib_pipeline::prepare::loads::Masses;
use calib_pipeline::run::{Plugins, RunOptions, RunOutput, run_on};
use calib_pipeline::{ExitCode, PipelineError};
use calib_recording::Poses;
use calib_report::Verdict;
use calib_report::verdict::{Effect, ReasonId};
use calib_urdf::RobotModel;
use serde::{Deserialize, Serialize};

use super::case::{Case, Cell, LIMIT_MM};
use super::design::{Design, Validation};
use super::evidence::shown;
use super::fault::{Class, Fault};
use super::names::names_the_cause;
use super::odds::odds;
use super::place;
use super::true_error::{error, rms};
use crate::noise::Noise;

/// What became of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Not accepted without reserve, and a finding names the cause, or what the data cannot distinguish from it.
    Named,
    /// Not accepted, and the cause is not named.
    Stopped,
    /// Accepted, and true: the error is within the limit, and the stated uncertainty covers it.
    Harmless,
    /// Accepted, and the error is beyond the limit, or beyond its stated uncertainty.
    Wrong,
}

/// One case with what became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaseResult {
    /// Which cell.
    pub cell: Cell,
    /// Number of the case in its cell; the robot's family follows from it.
    pub number: u64,
    /// What became of it.
    pub outcome: Outcome,
    /// A finding names the cause.
    pub named: bool,
    /// The verdict, or the kind of error that stopped the run.
    pub verdict: String,
    /// Ids of findings that are warnings or errors.
    pub findings: BTreeSet<String>,
    /// Rules that kept the verdict from an acceptance without reserve.
    pub reasons: BTreeSet<ReasonId>,
    /// Those of them that kept it from an acceptance with warnings.
    #[serde(default)]
    pub refused_by: BTreeSet<ReasonId>,
    /// True rms position error at new poses, m, where there is a result.
    pub rms_m: Option<f64>,
    /// The same with registration only.
    #[serde(default)]
    pub registered_rms_m: Option<f64>,
    /// Largest χ² of a predicted position over its threshold: above 1 the stated uncertainty does not cover the error.
    pub worst_z: Option<f64>,
    /// What the fitted recordings show of an effect or a change to a test that knows it, σ.
    #[serde(default)]
    pub evidence: Option<f64>,
    /// The evidence that a test needs which does not know the noise, σ.
    #[serde(default)]
    pub needed: Option<f64>,
    /// How often the best test that knows the fault, and not the noise, names it.
    #[serde(default)]
    pub chance: Option<f64>,
    /// How often the best estimate that knows all but the row of a step is within a row of it.
    #[serde(default)]
    pub row_chance: Option<f64>,
    /// What the fault moves the residual of a registration of the nominal robot by, rms, m.
    #[serde(default)]
    pub moved_m: Option<f64>,
    /// ln of how many times likelier than everything else a discrete fault is that was not named, noise and priors known.
    #[serde(default)]
    pub odds: Option<f64>,
    /// Rows by which a named change lies off the true one.
    #[serde(default)]
    pub row_off: Option<i64>,
    /// Share of the postures whose error lies within the 95 % region that the fit states.
    #[serde(default)]
    pub covered: Option<f64>,
}

impl CaseResult {
    /// Accepted without a warning, and wrong.
    #[must_use]
    pub fn confidently_wrong(&self) -> bool {
        self.outcome == Outcome::Wrong && self.verdict == Verdict::Accepted.word()
    }

    /// Good data that was not accepted, for whatever reason.
    #[must_use]
    pub fn refused(&self) -> bool {
        let accepted = [Outcome::Harmless, Outcome::Wrong];
        self.cell.fault.class() == Class::Clean && !accepted.contains(&self.outcome)
    }

    /// Good data that was not accepted for a reason that is true of it: all that kept it from acceptance is that the data are
    /// too few to decide, or that the error exceeds a limit, where it truly does.
    #[must_use]
    pub fn truly_undecided(&self) -> bool {
        let over = self.rms_m.is_some_and(|rms| rms > LIMIT_MM * 1e-3);
        let exceeds = |id: &ReasonId| {
            (over && *id == ReasonId::LimitExceeded)
                || (self.truly_worse() && *id == ReasonId::WorseThanRegistration)
        };
        let nothing_held_out = self.cell.validation == Validation::Absent;
        let not_verified = |id: &ReasonId| nothing_held_out && NOT_VERIFIED.contains(id);
        let too_few = |id: &ReasonId| TOO_FEW.contains(id) || not_verified(id) || exceeds(id);
        self.refused() && !self.refused_by.is_empty() && self.refused_by.iter().all(too_few)
    }

    /// At new poses, the calibrated robot is off by more than with registration only.
    fn truly_worse(&self) -> bool {
        let both = self.rms_m.zip(self.registered_rms_m);
        both.is_some_and(|(calibrated, registered)| calibrated > registered)
    }

    /// Good data that was not accepted for a reason that is not true of it.
    #[must_use]
    pub fn false_refusal(&self) -> bool {
        self.refused() && !self.truly_undecided()
    }

    /// Good data of which a finding names a cause.
    #[must_use]
    pub fn false_name(&self) -> bool {
        let names = |id: &String| NAMES.contains(&id.as_str());
        self.cell.fault.class() == Class::Clean && self.findings.iter().any(names)
    }

    /// Whether all that kept it from acceptance is that the data are too few to decide.
    #[must_use]
    pub fn only_undecided(&self) -> bool {
        let nothing_held_out = self.cell.validation == Validation::Absent;
        let too_few =
            |id: &ReasonId| TOO_FEW.contains(id) || (nothing_held_out && NOT_VERIFIED.contains(id));
        !self.refused_by.is_empty() && self.refused_by.iter().all(too_few)
    }

    /// Good data of which a finding or a reason says what is not true. What a design does not show, outliers
    /// that there are, and a calibration that is worse at new poses, are said with reason.
    #[must_use]
    pub fn false_warning(&self) -> bool {
        let true_of_outliers = [
            "marker-outlier",
            "row-outlier",
            "body-not-rigid",
            "not-rigid",
        ];
        let outliers = self.cell.fault == Fault::Outliers;
        let few = [Design::Few, Design::Six].contains(&self.cell.design);
        let said_with_reason = |id: &str| {
            // It counts degrees of freedom.
            id == "not-tested"
                || (outliers && true_of_outliers.contains(&id))
                || (few && TRUE_OF_FEW.contains(&id))
        };
        let untrue = |id: &String| !said_with_reason(id);
        let about_the_model = [
            ReasonId::ImplausibleChange,
            ReasonId::ReversedAxis,
            ReasonId::GoodnessOfFit,
            ReasonId::NoiseAboveStated,
            ReasonId::NoiseBelowStated,
        ];
        // Of so few poses it says that a reading may be wrong, and one is.
        let wrong_reading = |id: &ReasonId| outliers && few && *id == ReasonId::NoiseAboveStated;
        let untrue_of_model = |id: &ReasonId| about_the_model.contains(id) && !wrong_reading(id);
        let worse = self.reasons.contains(&ReasonId::WorseThanRegistration);
        self.cell.fault.class() == Class::Clean
            && (self.findings.iter().any(untrue)
                || (worse && !self.truly_worse())
                || self.reasons.iter().any(untrue_of_model))
    }
}

/// Findings that name a cause.
const NAMES: [&str; 23] = [
    "joint-sign",
    "joint-axis",
    "tracker-scale",
    "joint-order",
    "unit-mismatch",
    "joint-coupling",
    "joint-offset",
    "joint-gain",
    "clock-lag",
    "joint-column-missing",
    "wrong-mount",
    "mirrored",
    "quaternion-order",
    "pose-convention",
    "tracker-moved",
    "body-remounted",
    "joint-zero-changed",
    "body-flip",
    "missing-physics",
    "changed-while-recording",
    "rows-repeated",
    "noise-has-memory",
    "held-out-in-training",
];

/// Reasons that say of the data that they are too few, and nothing of what is wrong: they ask for more poses.
const TOO_FEW: [ReasonId; 4] = [
    ReasonId::LimitUndecided,
    ReasonId::PredictionUndecided,
    ReasonId::EffectsNotExcluded,
    ReasonId::UncertaintyTooSmall,
];

/// Reasons that say that nothing was verified: where nothing was held out, and poses are too few to leave one out, that is so.
const NOT_VERIFIED: [ReasonId; 2] = [ReasonId::NoValidation, ReasonId::LimitNotEvaluated];

/// Findings that say of few poses what they leave open.
const TRUE_OF_FEW: [&str; 3] = ["held-by-priors", "size-not-seen", "not-checked"];

/// Draws a case and runs the program on it.
pub(crate) fn run_case(cell: Cell, number: u64, seed: u64) -> CaseResult {
    let (case, tables, ran) = run(cell, number, seed);
    let result = match ran {
        Ok(output) => judged(&case, number, &output),
        Err(error) => stopped(&case, number, error),
    };
    with_shown(&case, &tables, result)
}

/// The recordings by name.
type Tables = BTreeMap<String, Poses>;

/// The result beside what the recordings show of the fault.
fn with_shown(case: &Case, tables: &Tables, result: CaseResult) -> CaseResult {
    let shown = shown(case);
    let unnamed = case.cell.fault.class() == Class::Discrete && !result.named;
    CaseResult {
        odds: unnamed.then(|| odds(case, tables)).flatten(),
        evidence: shown.evidence,
        needed: shown.needed,
        chance: shown.chance,
        row_chance: place::chance(case),
        moved_m: shown.moved_m,
        ..result
    }
}

/// How far from the true row a finding says that something changed in the first recording.
fn row_off(case: &Case, findings: &[Finding]) -> Option<i64> {
    let (name, rows) = case.readings.first()?;
    let about = |name: &str, f: &Finding| match f.facts.get(name) {
        Some(Fact::Name(word)) => Some(word.to_string()),
        _ => None,
    };
    let found = findings.iter().find(|f| {
        f.id == catalog::CHANGED_WHILE_RECORDING && about("recording", f).as_deref() == Some(name)
    })?;
    // Rows of a table are counted from 2, below its header.
    let row: i64 = about("row", found)?.parse().ok()?;
    Some(row - 2 - case.change(rows.len()) as i64)
}

fn run(cell: Cell, number: u64, seed: u64) -> (Case, Tables, Result<RunOutput, PipelineError>) {
    let mut noise = Noise::of_trial(seed, &cell.id(), number);
    let case = Case::draw(cell, number, &mut noise);
    let tables = case.tables(&mut noise);
    let ran = robot_profile(&case.profile(), &case.robot.urdf())
        .and_then(|robot| of_tables(robot, tables.clone(), Plugins::Refused))
        .and_then(|inputs| run_on(inputs, &RunOptions::default(), &mut |_| {}));
    (case, tables, ran)
}

/// A single case: what became of it, and the whole report.
///
/// # Errors
/// What stopped the run, beside what became of it.
pub fn report_of(
    cell: Cell,
    number: u64,
    seed: u64,
) -> (CaseResult, Result<calib_report::Report, String>) {
    let (case, tables, ran) = run(cell, number, seed);
    match ran {
        Ok(output) => {
            let result = judged(&case, number, &output);
            (with_shown(&case, &tables, result), Ok(output.report))
        }
        Err(error) => {
            let text = error.to_string();
            let result = stopped(&case, number, error);
            (with_shown(&case, &tables, result), Err(text))
        }
    }
}

/// A run without a result: what stopped it names the cause, or does not.
fn stopped(case: &Case, number: u64, error: PipelineError) -> CaseResult {
    let findings = match error {
        PipelineError::Data { problem, .. } => match *problem {
            DataProblem::Checks(findings) => findings,
            _ => Vec::new(),
        },
        _ => Vec::new(),
    };
    let named = findings.iter().any(|f| names_the_cause(case, f));
    CaseResult {
        cell: case.cell,
        number,
        outcome: if named {
            Outcome::Named
        } else {
            Outcome::Stopped
        },
        named,
        verdict: "stopped".to_owned(),
        findings: ids(&findings),
        reasons: BTreeSet::new(),
        refused_by: BTreeSet::new(),
        rms_m: None,
        registered_rms_m: None,
        worst_z: None,
        evidence: None,
        needed: None,
        chance: None,
        row_chance: None,
        moved_m: None,
        odds: None,
        row_off: None,
        covered: None,
    }
}

fn robot_profile(profile: &str, urdf: &str) -> Result<RobotProfile, PipelineError> {
    let raw = calib_profile::parse(profile, "arm.yaml")?;
    let model = RobotModel::from_urdf_text(urdf, "arm.urdf")?;
    let checked = calib_profile::check(&raw, profile, "arm.yaml", &model)?;
    Ok(RobotProfile {
        file: "arm.yaml".to_owned(),
        written: Written::default(),
        folder: std::path::PathBuf::new(),
        masses: Masses::of(&model, &checked.load),
        profile: checked,
        model,
        urdf_text: urdf.to_owned(),
        digests: Vec::new(),
    })
}

fn ids(findings: &[Finding]) -> BTreeSet<String> {
    let noted = findings.iter().filter(|f| f.severity >= Severity::Warning);
    noted.map(|f| f.id.to_string()).collect()
}

fn judged(case: &Case, number: u64, output: &RunOutput) -> CaseResult {
    let findings = &output.report.findings;
    let named = findings.iter().any(|f| names_the_cause(case, f));
    let error = error(case, &output.solved, widened(output));
    let over = error.rms_m > LIMIT_MM * 1e-3 || error.worst_z.is_some_and(|z| z > 1.0);
    let verdict = output.report.verdict;
    let outcome = if verdict == Verdict::Accepted {
        if over {
            Outcome::Wrong
        } else {
            Outcome::Harmless
        }
    } else if output.exit != ExitCode::Accepted {
        if named {
            Outcome::Named
        } else {
            Outcome::Stopped
        }
    } else if named {
        Outcome::Named
    } else if over {
        Outcome::Wrong
    } else {
        Outcome::Harmless
    };
    let reasons = output.report.reason_facts.iter();
    let against: Vec<_> = reasons
        .filter(|reason| reason.effect != Effect::Supports)
        .collect();
    let refusing = against.iter().filter(|r| r.effect > Effect::Warns);
    CaseResult {
        cell: case.cell,
        number,
        outcome,
        named,
        verdict: verdict.word().to_owned(),
        findings: ids(findings),
        refused_by: refusing.map(|reason| reason.id).collect(),
        reasons: against.iter().map(|reason| reason.id).collect(),
        rms_m: Some(error.rms_m),
        registered_rms_m: output.solved.registered.as_ref().map(|r| rms(case, r)),
        worst_z: error.worst_z,
        evidence: None,
        needed: None,
        chance: None,
        row_chance: None,
        moved_m: None,
        odds: None,
        row_off: row_off(case, findings),
        covered: error.covered,
    }
}

/// Variance of a prediction as the report states it over that of the fit's parameters alone: `prediction-expected`.
fn widened(output: &RunOutput) -> f64 {
    let mut reasons = output.report.reason_facts.iter();
    let of = reasons.find(|reason| reason.id == ReasonId::PredictionExpected);
    let value = |name: &str| of.and_then(|reason| reason.values.get(name)?.value());
    match (value("expected"), value("stated")) {
        (Some(expected), Some(stated)) if stated > 0.0 => (expected / stated).powi(2).max(1.0),
        _ => 1.0,
    }
}
