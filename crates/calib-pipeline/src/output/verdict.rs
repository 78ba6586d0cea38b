//! The limits of the profile against what was measured, and what to do next.

use calib_profile::{Limits, Method};
use calib_report::{Limit, MissingPhysics, NextStep, Scope, Unit, Verdict};

use crate::output::evidence::Evidence;

pub(crate) fn limits(limits: &Limits, e: &Evidence<'_>) -> Vec<Limit> {
    let calibrated = e.held_out.as_ref().and_then(|h| h.calibrated);
    let mut out = Vec::new();
    let mut held_out = |name: &str, quantity: &str, limit: Option<f64>, value: Option<f64>| {
        let Some(limit) = limit else { return };
        out.push(match value {
            Some(value) => Limit::evaluated(name, quantity, Unit::Meter, limit, value),
            None => Limit::not_evaluated(name, quantity, Unit::Meter, limit, "no validation poses"),
        });
    };
    held_out(
        "held_out_rms_mm",
        "rms position error on held-out poses",
        limits.held_out_rms,
        calibrated.map(|c| c.rms_m),
    );
    held_out(
        "held_out_max_mm",
        "largest position error on held-out poses",
        limits.held_out_max,
        calibrated.map(|c| c.max_m),
    );
    for (name, limit) in &limits.loop_mean {
        let closed = e.loops.iter().find(|l| l.name == *name);
        held_out(
            &format!("loop_mean_mm.{name}"),
            &format!("mean translation error of loop `{name}`"),
            Some(*limit),
            closed.map(|l| l.translation_m.mean),
        );
    }
    if let Some(limit) = limits.origin_sigma {
        for f in e.found {
            let sigma = f
                .covariance
                .map(|c| c.fixed_view::<3, 3>(3, 3).trace().max(0.0).sqrt());
            held_out(
                "origin_sigma_mm",
                &format!("standard deviation of the position of `{}`", f.name),
                Some(limit),
                sigma,
            );
        }
    }
    out
}

pub(crate) fn scope(e: &Evidence<'_>) -> Vec<Scope> {
    let profile = &e.inputs.robot.profile;
    let mut scope = vec![if profile.bodies.is_empty() {
        Scope::Contacts
    } else {
        Scope::TrackedBodies {
            frame: profile.tracker.frame.clone(),
        }
    }];
    if e.robot.effects.iter().any(|j| !j.fits_into_urdf()) {
        scope.push(Scope::EffectsOf {
            file: crate::output::export::calibration_name(&profile.outputs.urdf),
        });
    }
    if e.method == Method::Paper {
        scope.push(Scope::OriginsOneByOne);
    }
    scope
}

pub(crate) fn next_steps(
    e: &Evidence<'_>,
    verdict: Verdict,
    missing: &[MissingPhysics],
) -> Vec<NextStep> {
    let mut steps = vec![match verdict {
        Verdict::Accepted => NextStep::Use {
            urdf: e.inputs.robot.profile.outputs.urdf.clone(),
        },
        Verdict::Rejected => NextStep::FixProblems,
        Verdict::NotEvaluated => NextStep::AddValidation,
    }];
    if let Some(first) = missing.first() {
        steps.push(NextStep::EnableEffect {
            missing: first.clone(),
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
