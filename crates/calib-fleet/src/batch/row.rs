//! One robot of a fleet as a row: what `calib run` says of it, and what changed since last time.

use std::collections::BTreeMap;

use calib_drift::{Drift, DriftError};
use calib_report::{Input, Report, Unit, Verdict};
use serde::{Deserialize, Serialize};

/// Why a robot has no result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// Stable id of the error: `profile`, `recording`, `panic`.
    pub id: String,
    /// What the program says.
    pub text: String,
}

/// A quantity of a robot, and its change since last time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Quantity {
    /// Stable name: `distance.shoulder.elbow`, `elbow.offset`.
    pub name: String,
    /// The joint whose parameters it depends on most.
    pub joint: Option<String>,
    /// Of the numbers.
    pub unit: Unit,
    /// SI.
    pub value: f64,
    /// σ of the value; of the change where there is one.
    pub sigma: Option<f64>,
    /// Since last time; none where it was not compared.
    pub change: Option<f64>,
    /// Probability of such a change where nothing changed, for this quantity alone.
    pub p_value: Option<f64>,
}

/// One joint since last time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointDrift {
    /// The joint.
    pub joint: String,
    /// Probability of its most certain change where nothing changed, times the number of quantities that were looked at.
    pub p_value: f64,
    /// That change, SI.
    pub change: f64,
    /// Its σ.
    pub sigma: f64,
    /// Its unit.
    pub unit: Unit,
}

/// A robot since last time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Drifted {
    /// Probability of what changed where nothing changed: below 1 % exactly where `calib drift` says that the robot changed.
    pub p_value: f64,
    /// Joints in the order of their names.
    pub joints: Vec<JointDrift>,
}

/// One robot.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Robot {
    /// Its name in the fleet.
    pub name: String,
    /// Its series.
    pub series: String,
    /// Whether the result may be used; none where there is no result.
    pub verdict: Option<Verdict>,
    /// The exit code of `calib run`.
    pub exit_code: u8,
    /// Why there is no result.
    pub failure: Option<Failure>,
    /// Root mean square of the position errors of poses that were not fitted, m.
    pub held_out_rms_m: Option<f64>,
    /// Poses that these are of.
    pub held_out_poses: Option<usize>,
    /// Warnings of the result.
    pub warnings: usize,
    /// Joint offsets, and what no choice of frames changes.
    pub quantities: Vec<Quantity>,
    /// Since last time; none where there is no last time, or it cannot be compared.
    pub drift: Option<Drifted>,
    /// Why it was not compared.
    pub not_compared: Option<Failure>,
    /// What was read, relative to the profile.
    pub inputs: Vec<Input>,
}

impl Robot {
    /// A robot without a result.
    pub(crate) fn failed(name: &str, series: &str, exit_code: u8, failure: Failure) -> Self {
        Self {
            name: name.to_owned(),
            series: series.to_owned(),
            exit_code,
            failure: Some(failure),
            ..Self::default()
        }
    }

    /// From a finished run.
    pub(crate) fn of(name: &str, series: Option<&str>, report: &Report, exit_code: u8) -> Self {
        let held_out = report.verification.held_out.as_ref();
        let calibrated = held_out.and_then(|h| h.calibrated.as_ref());
        Self {
            name: name.to_owned(),
            series: series.unwrap_or(&report.robot).to_owned(),
            verdict: Some(report.verdict),
            exit_code,
            held_out_rms_m: calibrated.map(|stats| stats.rms_m),
            held_out_poses: held_out.map(|h| h.postures),
            warnings: report.warnings(),
            quantities: quantities(report),
            inputs: report.inputs.clone(),
            ..Self::default()
        }
    }

    /// The joint that changed most certainly.
    #[must_use]
    pub fn most_changed(&self) -> Option<&JointDrift> {
        let joints = self.drift.iter().flat_map(|drift| &drift.joints);
        joints.min_by(|a, b| a.p_value.total_cmp(&b.p_value))
    }

    /// The same with its changes.
    pub(crate) fn compared(mut self, report: &Report, drift: Result<Drift, DriftError>) -> Self {
        let not_compared = |text: String| Failure {
            id: "drift".to_owned(),
            text,
        };
        let drift = match drift {
            Ok(drift) => drift,
            Err(error) => {
                self.not_compared = Some(not_compared(error.to_string()));
                return self;
            }
        };
        if let Some(why) = drift.undecided {
            self.not_compared = Some(not_compared(why.remedy().to_owned()));
            return self;
        }
        for changed in &drift.numbers {
            let known = self.quantities.iter().position(|q| q.name == changed.name);
            let quantity = Quantity {
                name: changed.name.clone(),
                joint: joint_of(report, &changed.name),
                unit: changed.unit,
                value: changed.new,
                sigma: Some(changed.sigma),
                change: Some(changed.change),
                p_value: Some(changed.p_value),
            };
            match known {
                Some(place) => self.quantities[place] = quantity,
                None => self.quantities.push(quantity),
            }
        }
        // Half of the false alarms are for everything at once, half for all numbers by Holm's procedure.
        let least = drift.numbers.iter().map(|n| n.p_adjusted);
        let least = least.fold(drift.joint.p_value, f64::min);
        self.drift = Some(Drifted {
            p_value: (2.0 * least).min(1.0),
            joints: joints(&self.quantities),
        });
        self
    }
}

/// Joint offsets and what no choice of frames changes.
fn quantities(report: &Report) -> Vec<Quantity> {
    let offsets = report.parameters.iter().filter(|p| p.kind == OFFSET);
    let offsets = offsets.map(|p| Quantity {
        name: p.name.clone(),
        joint: p.joint.clone(),
        unit: p.unit,
        value: p.value,
        sigma: p.sigma,
        change: None,
        p_value: None,
    });
    let invariants = report.data_information.iter().flat_map(|i| &i.quantities);
    let invariants = invariants.map(|q| Quantity {
        name: q.name.clone(),
        joint: joint_of(report, &q.name),
        unit: q.unit,
        value: q.value,
        sigma: None,
        change: None,
        p_value: None,
    });
    offsets.chain(invariants).collect()
}

/// The kind of the parameters that are joint offsets.
const OFFSET: &str = "zero_offset";

/// The joint whose parameters a number depends on most: of joint offsets where it depends on any, as an offset is what drifts.
fn joint_of(report: &Report, name: &str) -> Option<String> {
    let parameter = |name: &str| report.parameters.iter().find(|p| p.name == name);
    if let Some(own) = parameter(name) {
        return own.joint.clone();
    }
    let information = report.data_information.as_ref()?;
    let quantity = information.quantities.iter().find(|q| q.name == name)?;
    let terms = quantity.gradient.iter().filter_map(|term| {
        let parameter = parameter(&term.parameter)?;
        let joint = parameter.joint.as_ref()?;
        Some((parameter.kind == OFFSET, term.coefficient.abs(), joint))
    });
    let most = terms.max_by(|a, b| {
        (a.0, a.1)
            .partial_cmp(&(b.0, b.1))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    most.map(|(_, _, joint)| joint.clone())
}

/// The most certain change of each joint.
fn joints(quantities: &[Quantity]) -> Vec<JointDrift> {
    let mut found: BTreeMap<&str, (usize, JointDrift)> = BTreeMap::new();
    for quantity in quantities {
        let (Some(joint), Some(p), Some(change), Some(sigma)) = (
            &quantity.joint,
            quantity.p_value,
            quantity.change,
            quantity.sigma,
        ) else {
            continue;
        };
        let drift = JointDrift {
            joint: joint.clone(),
            p_value: p,
            change,
            sigma,
            unit: quantity.unit,
        };
        let entry = found.entry(joint).or_insert_with(|| (0, drift.clone()));
        entry.0 += 1;
        if p < entry.1.p_value {
            entry.1 = drift;
        }
    }
    // Bonferroni: of m quantities the smallest probability counts m times.
    let drifts = found.into_values().map(|(count, drift)| JointDrift {
        p_value: (drift.p_value * count as f64).min(1.0),
        ..drift
    });
    drifts.collect()
}
