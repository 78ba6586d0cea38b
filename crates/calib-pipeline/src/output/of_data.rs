//! Recordings, rejected measurements, findings and closed forms as the report's data.

use std::collections::BTreeMap;

use calib_core::RejectReason;
use calib_core::effect::{Effect, clock_offset, latency};
use calib_finding::{About, Fact, Finding, catalog};
use calib_profile::{Method, Usage};
use calib_report::{
    EstimatorResult, HeldOut, JointCoverage, Lost, MissingPhysics, PoseError, RecordingSummary,
    RecordingUse, Rejected, RejectedFor, Unit, number,
};

use crate::formulate::formulation::MlFit;
use crate::formulate::late::with_late_joint;
use crate::output::counts::{Tracks, count, rows};
use crate::output::evidence::Evidence;
use crate::prepare::effects::free_with;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::verify::residuals::subject;

pub(crate) fn recordings(inputs: &Inputs, tracks: &Tracks) -> Vec<RecordingSummary> {
    let mut out = Vec::new();
    for (name, r) in &inputs.recordings {
        let of_profile = &tracks[name];
        let rows = count(rows(of_profile, r.poses.len()));
        let fates = of_profile.iter().flat_map(|t| t.fates.iter().copied());
        out.push(RecordingSummary {
            name: name.clone(),
            path: r.spec.file.clone(),
            used_for: used_for(r.spec.usage),
            rows: rows.of,
            used: rows.used,
            rejected: rows.rejected,
            excluded: rows.excluded,
            rows_lost: rows.lost,
            measurements: count(fates),
            lost: lost(inputs, name),
            conversions: r.meta.conversions.clone(),
            up_axis: r.meta.up_axis.clone(),
        });
    }
    out
}

/// What a recording is used for.
pub(crate) fn used_for(usage: Usage) -> RecordingUse {
    match usage {
        Usage::Sweep => RecordingUse::Sweep,
        Usage::Static => RecordingUse::Static,
        Usage::Validation => RecordingUse::Validation,
    }
}

/// Samples that the tracker did not see, by marker and body of the file; what was excluded had been seen.
pub(crate) fn lost(inputs: &Inputs, recording: &str) -> Vec<Lost> {
    let poses = &inputs.recordings[recording].poses;
    let markers = poses.markers.iter().map(|(name, track)| {
        let seen: Vec<bool> = track.iter().map(Option::is_some).collect();
        (name, seen)
    });
    let bodies = poses.bodies.iter().map(|(name, track)| {
        let seen: Vec<bool> = track.iter().map(Option::is_some).collect();
        (name, seen)
    });
    let taken_out = |row: usize, subject: &str| {
        let key = (recording.to_owned(), row, subject.to_owned());
        inputs.taken_out.contains(&key)
    };
    markers
        .chain(bodies)
        .map(|(subject, seen)| Lost {
            subject: subject.clone(),
            lost: (0..seen.len())
                .filter(|row| !seen[*row] && !taken_out(*row, subject))
                .count(),
            of: seen.len(),
        })
        .filter(|l| l.lost > 0)
        .collect()
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

/// Recording, body or marker, and why.
type Cause = (String, String, RejectedFor);

/// What took no part, by cause: excluded before the fit, rejected by it, screened out of the held-out errors.
pub(crate) fn rejected(
    inputs: &Inputs,
    fit: Option<&MlFit>,
    held_out: Option<&HeldOut>,
) -> Vec<Rejected> {
    let mut groups: BTreeMap<Cause, (Vec<u64>, usize)> = BTreeMap::new();
    let mut add = |recording: &str, subject: &str, cause: RejectedFor, row: usize, measurements| {
        let rows = inputs.recordings.get(recording).map(|r| &r.poses.rows);
        let Some(row) = rows.and_then(|rows| rows.get(row)) else {
            return;
        };
        let cause = (recording.to_owned(), subject.to_owned(), cause);
        let group = groups.entry(cause).or_default();
        group.0.push(*row);
        group.1 += measurements;
    };
    for out in &inputs.excluded {
        let seen = inputs.taken_out_of(out);
        add(&out.recording, &out.body, out.cause, out.row, seen);
    }
    for (fit, r) in fit
        .into_iter()
        .flat_map(|fit| fit.solution.rejected.iter().map(move |r| (fit, r)))
    {
        let (recording, row) = &fit.formulation.samples[r.sample];
        let subject = subject(fit, r.measurement, r.item);
        add(recording, &subject, cause(r.reason), *row, 1);
    }
    // Errors of left-out poses repeat what the fit rejected.
    let screened = held_out
        .into_iter()
        .filter(|h| !h.left_out)
        .flat_map(|h| &h.poses)
        .filter(|pose| pose.screened);
    for (recording, row, subject) in screened.filter_map(|pose| place(inputs, pose)) {
        add(recording, subject, RejectedFor::Screened, row, 1);
    }
    groups
        .into_iter()
        .map(
            |((recording, subject, cause), (rows, measurements))| Rejected {
                measurements,
                ..Rejected::new(recording, subject, rows, cause)
            },
        )
        .collect()
}

fn cause(reason: RejectReason) -> RejectedFor {
    match reason {
        RejectReason::Swap => RejectedFor::Swap,
        RejectReason::Occlusion => RejectedFor::Occlusion,
        RejectReason::Outlier => RejectedFor::Outlier,
        RejectReason::NotSettled => RejectedFor::NotSettled,
    }
}

/// Recording, row from 0 and subject of an error.
fn place<'a>(inputs: &'a Inputs, pose: &'a PoseError) -> Option<(&'a str, usize, &'a str)> {
    let validation = |r: &&Loaded| r.spec.usage == Usage::Validation;
    let mut recordings = inputs.recordings.values().filter(validation);
    recordings.find_map(|r| {
        let rows = r.poses.rows.iter();
        let mut labels = rows.map(|row| format!("{}:{row}", r.name));
        let row = labels.position(|label| label == pose.pose)?;
        Some((r.name.as_str(), row, pose.subject.as_str()))
    })
}

pub(crate) fn findings(
    e: &Evidence<'_>,
    missing: &[MissingPhysics],
    open: Vec<Finding>,
) -> Vec<Finding> {
    let mut findings = e.findings.to_vec();
    findings.extend(open);
    findings.extend(missing.iter().map(|m| missing_finding(e, m)));
    findings.sort_by_key(|f| std::cmp::Reverse(f.severity));
    findings
}

/// Physics that the residuals show; neither a clock nor late readings are freed as an effect is.
pub(crate) fn missing_finding(e: &Evidence<'_>, missing: &MissingPhysics) -> Finding {
    let of = |effect: &'static Effect| {
        effect.terms.iter().find_map(|term| {
            let name = missing.parameter.strip_suffix(term.name)?;
            name.strip_suffix('.')
        })
    };
    let recordings = &e.inputs.recordings;
    let clock = of(&clock_offset::EFFECT).filter(|name| recordings.contains_key(*name));
    let joints = &e.inputs.robot.model;
    let late = of(&latency::EFFECT).filter(|name| joints.joint_id(name).is_ok());
    let kind = |kind| Finding::of_kind(catalog::MISSING_PHYSICS, kind, About::Fit);
    let finding = match (clock, late) {
        (Some(recording), _) => kind("clock").with("recording", Fact::name(recording)),
        (None, Some(joint)) => {
            let timed = recordings.values().filter(|r| !r.velocities.is_empty());
            let finding = kind("latency").with("recordings", Fact::names(timed.map(|r| &r.name)));
            with_late_joint(finding, e.inputs, joint, missing.estimate)
        }
        (None, None) => {
            let effects = calib_core::EFFECTS.iter().copied();
            let mut effects = effects.filter(|effect| effect.profile.is_some());
            let found = effects.find_map(|effect| Some((of(effect)?, effect)));
            let finding = kind("effect");
            match found
                .and_then(|(joint, effect)| Some((joint, free_with(e.inputs, joint, effect)?)))
            {
                Some((joint, free)) => finding.with("joint", Fact::name(joint)).with("free", free),
                None => finding,
            }
        }
    };
    let alike = e.causes.alike.iter();
    let alike = alike.filter(|(name, _)| *name == missing.parameter);
    let alike: Vec<String> = alike.flat_map(|(_, all)| all.clone()).collect();
    finding
        .with_some(
            "alternatives",
            (!alike.is_empty()).then(|| Fact::names(alike)),
        )
        .with("physics", Fact::choice(missing.physics.words()))
        .with("parameter", Fact::name(&missing.parameter))
        .with("explains", Fact::ratio(missing.explains))
        .with(
            "p_value",
            Fact::ratio(missing.p_value.max(f64::MIN_POSITIVE)),
        )
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
