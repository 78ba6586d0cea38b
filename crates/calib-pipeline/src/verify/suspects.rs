//! What was suspected before the fit, as columns that the fit can be asked about, and what a cause must show.

use calib_core::{EffectKind, GoodnessOfFit, Suspect};
use calib_finding::{Fact, Finding, catalog};

use crate::formulate::formulation::MlFit;
use crate::formulate::late::speeds;
use crate::prepare::inputs::Inputs;

/// Chance of one false cause in so many analyses, as of the tests themselves.
pub(super) const SIGNIFICANT: f64 = 1e-3;
/// Share of what the other causes leave of χ²: smaller effects are real but do not matter.
pub(super) const RELEVANT: f64 = 0.02;

/// A suspicion from before the fit as a cause: its name and its column.
pub(super) fn suspected_before<'a>(
    inputs: &Inputs,
    fit: &MlFit,
    finding: &Finding,
    goodness: &'a GoodnessOfFit,
) -> Option<(String, Suspect<'a>)> {
    // Of the tests: mistakes of a whole row or of a whole coupling have no size, and a clock that was corrected no effect.
    finding.facts.get("effect")?;
    let word = |key: &str| finding.facts.get(key).and_then(Fact::word);
    let tested = |name: String| {
        let test = goodness.tests.iter().find(|t| t.name == name)?;
        Some((name, Suspect::Tested(&test.name)))
    };
    if let Some(Fact::Names(joints)) = finding.facts.get("joints")
        && finding.id == catalog::CLOCK_LAG
    {
        return late_together(inputs, fit, joints);
    }
    match finding.id {
        id if id == catalog::JOINT_GAIN => tested(format!("{}.gain", word("joint")?)),
        id if id == catalog::CLOCK_LAG => tested(match word("joint") {
            Some(joint) => format!("{joint}.latency"),
            None => format!("{}.clock_offset", word("recording")?),
        }),
        id if id == catalog::JOINT_COUPLING => {
            let model = &inputs.robot.model;
            let (joint, other) = (word("joint")?, word("other")?);
            let code = format!("{joint}.coupling.{other}");
            let (joint, other) = (model.joint_id(joint).ok()?, model.joint_id(other).ok()?);
            let reading = |(recording, row): &(String, usize)| {
                let q = inputs.recordings[recording].q[*row].as_ref();
                q.map_or(0.0, |q| model.position(q, other))
            };
            let suspect = Suspect::Effect {
                kind: EffectKind::Coupling,
                joints: vec![(
                    fit.formulation.joints[joint.index()]?,
                    fit.formulation.samples.iter().map(reading).collect(),
                )],
            };
            Some((code, suspect))
        }
        _ => None,
    }
}

/// Joints whose readings are late by one time.
fn late_together(
    inputs: &Inputs,
    fit: &MlFit,
    joints: &[String],
) -> Option<(String, Suspect<'static>)> {
    let column = |joint: &String| {
        let id = inputs.robot.model.joint_id(joint).ok()?;
        let edge = fit.formulation.joints[id.index()]?;
        Some((edge, speeds(inputs, &fit.formulation, joint)))
    };
    let suspect = Suspect::Effect {
        kind: EffectKind::Latency,
        joints: joints.iter().filter_map(column).collect(),
    };
    Some((format!("{}.latency", joints.join("+")), suspect))
}
