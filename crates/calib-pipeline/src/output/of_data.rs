//! Recordings, rejected measurements, findings and closed forms as the report's data.

use std::collections::BTreeMap;

use calib_core::RejectReason;
use calib_finding::{About, Fact, Finding, catalog};
use calib_profile::{Method, Usage};
use calib_report::{
    EstimatorResult, JointCoverage, Lost, MissingPhysics, RecordingSummary, RecordingUse, Rejected,
    RejectedFor, Unit, number,
};

use crate::formulate::formulation::MlFit;
use crate::output::evidence::Evidence;
use crate::prepare::inputs::Inputs;
use crate::verify::residuals::subject;

pub(crate) fn recordings(e: &Evidence<'_>) -> Vec<RecordingSummary> {
    let mut out = Vec::new();
    for (name, r) in &e.inputs.recordings {
        let mut lost = Vec::new();
        for (marker, track) in &r.poses.markers {
            lost.push(Lost {
                subject: marker.clone(),
                lost: track.iter().filter(|p| p.is_none()).count(),
                of: track.len(),
            });
        }
        for (body, track) in &r.poses.bodies {
            lost.push(Lost {
                subject: body.clone(),
                lost: track.iter().filter(|p| p.is_none()).count(),
                of: track.len(),
            });
        }
        lost.retain(|l| l.lost > 0);
        let whole_rows = r.q.iter().filter(|q| q.is_none()).count();
        out.push(RecordingSummary {
            name: name.clone(),
            path: r.spec.file.clone(),
            used_for: match r.spec.usage {
                Usage::Sweep => RecordingUse::Sweep,
                Usage::Static => RecordingUse::Static,
                Usage::Validation => RecordingUse::Validation,
            },
            rows: r.poses.len(),
            used: r.poses.len() - whole_rows,
            rejected: whole_rows,
            lost,
            conversions: r.meta.conversions.clone(),
            up_axis: r.meta.up_axis.clone(),
        });
    }
    out
}

pub(crate) fn coverage(inputs: &Inputs) -> Vec<JointCoverage> {
    let model = &inputs.robot.model;
    let mut out = Vec::new();
    for id in model.independent_joints() {
        let joint = model.joint(id);
        let fitted = inputs
            .recordings
            .values()
            .filter(|r| r.spec.usage != Usage::Validation);
        let recorded = fitted.filter(|r| r.poses.joints.contains_key(&joint.name));
        let positions: Vec<f64> = recorded
            .flat_map(|r| r.q.iter().flatten().map(|q| q[id.index()]))
            .collect();
        let unit = if joint.kind.turns() {
            Unit::Radian
        } else {
            Unit::Meter
        };
        let continuous = matches!(joint.kind, calib_urdf::JointKind::Continuous { .. });
        let range = joint.limits.range().filter(|_| !continuous);
        out.extend(JointCoverage::of(&joint.name, unit, range, &positions));
    }
    out
}

pub(crate) fn rejected(inputs: &Inputs, fit: Option<&MlFit>) -> Vec<Rejected> {
    let mut groups: BTreeMap<(String, String, RejectedFor), Vec<u64>> = BTreeMap::new();
    for out in &inputs.excluded {
        let row = inputs.recordings.get(&out.recording);
        if let Some(row) = row.and_then(|r| r.poses.rows.get(out.row)) {
            groups
                .entry((out.recording.clone(), out.body.clone(), out.cause))
                .or_default()
                .push(*row);
        }
    }
    for (fit, r) in fit
        .into_iter()
        .flat_map(|fit| fit.solution.rejected.iter().map(move |r| (fit, r)))
    {
        let (recording, row) = &fit.formulation.samples[r.sample];
        let cause = match r.reason {
            RejectReason::Swap => RejectedFor::Swap,
            RejectReason::Occlusion => RejectedFor::Occlusion,
            RejectReason::Outlier => RejectedFor::Outlier,
            RejectReason::NotSettled => RejectedFor::NotSettled,
        };
        let row = inputs.recordings[recording].poses.rows[*row];
        let subject = subject(fit, r.measurement, r.item);
        groups
            .entry((recording.clone(), subject, cause))
            .or_default()
            .push(row);
    }
    groups
        .into_iter()
        .map(|((recording, subject, cause), rows)| Rejected::new(recording, subject, rows, cause))
        .collect()
}

pub(crate) fn findings(
    e: &Evidence<'_>,
    missing: &[MissingPhysics],
    open: Vec<Finding>,
) -> Vec<Finding> {
    let mut findings = e.findings.to_vec();
    findings.extend(open);
    findings.extend(missing.iter().map(|m| {
        Finding::new(catalog::MISSING_PHYSICS, About::Fit)
            .with("physics", Fact::choice(m.physics.words()))
            .with("parameter", Fact::name(&m.parameter))
            .with("explains", Fact::ratio(m.explains))
            .with("p_value", Fact::ratio(m.p_value.max(f64::MIN_POSITIVE)))
    }));
    findings.sort_by_key(|f| std::cmp::Reverse(f.severity));
    findings
}

/// The closed forms against the result, and against each other.
pub(crate) fn estimators(e: &Evidence<'_>) -> Vec<EstimatorResult> {
    let mut out = Vec::new();
    for (name, origin) in e.origins {
        out.extend(origin.estimators.iter().cloned());
        let Some(pose) = origin.pose.filter(|_| e.method == Method::Ml) else {
            continue;
        };
        let Some(found) = e.found.iter().find(|f| f.origin.as_ref() == Some(name)) else {
            continue;
        };
        let difference = crate::estimate::paper::difference(&found.pose, &pose);
        let combined = found.covariance.zip(origin.covariance).map(|(a, b)| a + b);
        /// Squared Mahalanobis distance that two estimates of one pose stay under in 99.9 % (χ² with 6 degrees).
        const AGREES: f64 = 22.46;
        let z2 = combined
            .and_then(nalgebra::Cholesky::new)
            .map(|c| difference.0.dot(&c.solve(&difference.0)));
        out.push(EstimatorResult {
            quantity: found.name.clone(),
            estimator: "paper (closed form)".to_owned(),
            value: Some(pose.translation.vector.as_slice().to_vec()),
            sigma: origin
                .covariance
                .map(|c| (3..6).map(|i| c[(i, i)].max(0.0).sqrt()).collect()),
            agrees: z2.is_some_and(|z2| z2 <= AGREES),
            unit: Unit::Meter,
            distance: Some((pose.translation.vector - found.pose.translation.vector).norm()),
            text: format!(
                "orientation differs by {}",
                number::plain(difference.angular().norm(), Unit::Radian)
            ),
        });
    }
    out
}
