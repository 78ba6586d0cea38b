//! The limits of the profile against what was measured, the scope, and what to do next.

use calib_profile::{Limits, Method};
use calib_report::{
    HeldOut, Judgment, Limit, Limited, MissingPhysics, NextStep, ReasonId, Scope, Verdict,
};

use crate::output::evidence::Evidence;
use crate::output::export::calibration_name;
use crate::output::files::alone_name;
use crate::output::model_file::model_name;
use crate::output::of_data::missing_finding;
use crate::verify::motions::Motions;

pub(crate) fn limits(limits: &Limits, e: &Evidence<'_>) -> Vec<Limit> {
    let mut out = Vec::new();
    let over_all = e.held_out.and_then(|h| h.left_out_over_all);
    // (limit, what it is about, value and its interval)
    type Value = Option<(f64, Option<(f64, f64)>)>;
    let mut compare = |limit: Option<f64>, of: Limited, value: Value| {
        let Some(limit) = limit else { return };
        out.push(match value {
            Some((value, interval)) => {
                Limit::compared(of, limit, value, interval).left_out(over_all)
            }
            None => of.unknown(limit),
        });
    };
    let held_out = e.held_out;
    let left_out = held_out.is_some_and(|h| h.left_out);
    let position = held_out.and_then(|h| h.calibrated);
    let angle = held_out
        .and_then(|h| h.orientation)
        .and_then(|o| o.calibrated);
    let expected = held_out
        .and_then(|h| h.expected)
        .map(|x| (x.low_m, x.high_m));
    let of_angle = held_out.and_then(|h: &HeldOut| h.orientation_interval_rad);
    compare(
        limits.held_out_rms,
        Limited::position_rms(left_out),
        position.map(|p| (p.rms_m, expected)),
    );
    compare(
        limits.held_out_max,
        Limited::position_max(left_out),
        position.map(|p| (p.max_m, None)),
    );
    compare(
        limits.held_out_rms_rad,
        Limited::orientation_rms(left_out),
        angle.map(|a| (a.rms_rad, of_angle.map(|[low, high]| (low, high)))),
    );
    compare(
        limits.held_out_max_rad,
        Limited::orientation_max(left_out),
        angle.map(|a| (a.max_rad, None)),
    );
    for (name, limit) in &limits.loop_mean {
        let closed = e.loops.iter().find(|l| l.name == *name);
        let mean = closed.map(|l| {
            let interval = l.translation_m.mean_interval(l.samples);
            (l.translation_m.mean, interval)
        });
        compare(Some(*limit), Limited::loop_mean(name), mean);
    }
    for f in e.found.iter().filter(|_| limits.origin_sigma.is_some()) {
        let sigma = f
            .covariance
            .map(|c| c.fixed_view::<3, 3>(3, 3).trace().max(0.0).sqrt());
        compare(
            limits.origin_sigma,
            Limited::origin_sigma(&f.name),
            sigma.map(|sigma| (sigma, None)),
        );
    }
    out
}

pub(crate) fn scope(e: &Evidence<'_>, motions: &Motions) -> Vec<Scope> {
    let profile = &e.inputs.robot.profile;
    let mut scope = vec![if profile.bodies.is_empty() {
        Scope::Contacts
    } else {
        Scope::TrackedBodies {
            frame: profile.tracker.frame.clone(),
        }
    }];
    if motions.fitted_one_by_one {
        scope.push(Scope::SingleJointMotions);
    }
    match &e.held_out {
        Some(held_out) if held_out.left_out => scope.push(Scope::LeftOutPoses {
            postures: held_out.postures,
        }),
        Some(held_out) => {
            scope.push(Scope::HeldOutPoses {
                postures: motions.postures,
                outside: motions.outside,
                still: motions.still.clone(),
            });
            if held_out.orientation.is_none() {
                scope.push(Scope::PositionsOnly);
            }
        }
        None => {}
    }
    let refitted = e.held_out.and_then(|h| h.urdf_refitted);
    let alone = refitted.map(|_| alone_name(&e.inputs.robot.profile.outputs.urdf));
    scope.extend(effects_file(e).map(|file| Scope::EffectsOf { file, alone }));
    if e.method == Method::Paper {
        scope.push(Scope::OriginsOneByOne);
    }
    scope
}

/// The file with the effects that a URDF cannot hold, where there are any.
fn effects_file(e: &Evidence<'_>) -> Option<String> {
    let beyond = e.robot.effects.iter().any(|j| !j.fits_into_urdf());
    beyond.then(|| calibration_name(&e.inputs.robot.profile.outputs.urdf))
}

pub(crate) fn next_steps(
    e: &Evidence<'_>,
    judgment: &Judgment,
    missing: &[MissingPhysics],
) -> Vec<NextStep> {
    let has_limits = e.inputs.robot.profile.solve.limits != Limits::default();
    let has_validation = e.held_out.is_some_and(|h| !h.left_out);
    let unchanged = e.urdf.changes.is_empty() && effects_file(e).is_none();
    let no_better = ReasonId::NotBetterThanRegistration;
    let gains = !judgment.reasons.iter().any(|r| r.id == no_better);
    let alone_gains = e.held_out.is_none_or(HeldOut::urdf_alone_gains);
    let mut steps = vec![match judgment.verdict {
        Verdict::Accepted | Verdict::AcceptedWithWarnings if unchanged => NextStep::KeepUrdf {
            scene: e.inputs.robot.profile.outputs.scene.clone(),
        },
        Verdict::Accepted | Verdict::AcceptedWithWarnings if !gains => NextStep::NothingGained,
        Verdict::Accepted | Verdict::AcceptedWithWarnings if !alone_gains => NextStep::UseModel {
            model: model_name(&e.inputs.robot.profile.outputs.urdf),
            alone: e
                .held_out
                .filter(|held_out| held_out.urdf_refitted_gains())
                .map(|_| alone_name(&e.inputs.robot.profile.outputs.urdf)),
        },
        Verdict::Accepted | Verdict::AcceptedWithWarnings => NextStep::Use {
            urdf: e.inputs.robot.profile.outputs.urdf.clone(),
            effects: effects_file(e),
        },
        Verdict::NotEvaluated if !has_limits || !has_validation => NextStep::AddValidation {
            poses: !has_validation,
            limits: !has_limits,
        },
        Verdict::Rejected | Verdict::NotEvaluated => NextStep::FixProblems,
    }];
    if let Some(first) = missing.first() {
        let finding = missing_finding(e, first);
        steps.push(match finding.facts.get("recording").is_some() {
            true => NextStep::Resolve {
                subject: finding.subject.to_string(),
                finding: finding.id.to_string(),
                remedy: finding.remedy(),
            },
            false => NextStep::EnableEffect {
                missing: first.clone(),
            },
        });
    }
    if let Some(worst) = e
        .findings
        .iter()
        .filter(|f| f.severity >= calib_finding::Severity::Warning)
        .max_by_key(|f| f.severity)
    {
        steps.push(NextStep::Resolve {
            subject: worst.subject.to_string(),
            finding: worst.id.to_string(),
            remedy: worst.remedy(),
        });
    }
    if e.method == Method::Paper {
        steps.push(NextStep::SolveJointly);
    }
    steps
}
