//! Everything that was found, as the report's data. Renderers compute nothing; this does.

use std::collections::BTreeMap;

use calib_core::{Gauge, NoiseKind, RejectReason, SolveStatus};
use calib_files::OutputFile;
use calib_finding::{About, Fact, Finding, catalog};
use calib_profile::{Limits, Method, Usage};
use calib_report::{
    EstimatorResult, FitEnd, FitSummary, HeldOut, Input, JointCoverage, Limit, LoopClosure, Lost,
    Meaning, NextStep, NotObservable, Output, Parameter, RecordingSummary, RecordingUse, Rejected,
    Report, ResidualRow, Residuals, Scope, Term, Transform, Unit, Verdict, Verification, judge,
    number,
};

use crate::estimate::paper::OriginEstimate;
use crate::formulate::kinematics::Calibration;
use crate::formulate::ml::MlFit;
use crate::output::export::{Found, PatchedUrdf};
use crate::prepare::load::Inputs;
use crate::prepare::tracks::BodyTrack;
use crate::verify::accuracy::{accuracy_limits, workspace};
use crate::verify::residuals::subject;

/// What the report is made of.
#[derive(Debug)]
pub struct Evidence<'a> {
    /// Profile, robot, recordings.
    pub inputs: &'a Inputs,
    /// Body tracks.
    pub tracks: &'a BTreeMap<String, BodyTrack>,
    /// How it was solved.
    pub method: Method,
    /// Data checks and what the stages noticed.
    pub findings: &'a [Finding],
    /// Closed forms.
    pub origins: &'a BTreeMap<String, OriginEstimate>,
    /// Transforms found.
    pub found: &'a [Found],
    /// The fit, with `method: ml`.
    pub fit: Option<&'a MlFit>,
    /// The calibrated robot.
    pub robot: &'a Calibration,
    /// Loop closures.
    pub loops: Vec<LoopClosure>,
    /// Held-out errors.
    pub held_out: Option<HeldOut>,
    /// The patched description.
    pub urdf: &'a PatchedUrdf,
    /// Files that do not depend on the report, and what they are.
    pub written: &'a [(OutputFile, String)],
    /// Residuals of the fit.
    pub residuals: &'a [ResidualRow],
}

/// The report of a run.
#[must_use]
pub fn assemble(e: &Evidence<'_>) -> Report {
    let profile = &e.inputs.robot.profile;
    let file = &e.inputs.robot.file;
    let limits = limits(&profile.solve.limits, e);
    let mut verdict = judge(&limits);
    // What decided: with an exceeded limit the others do not matter.
    let decided = |l: &&Limit| match verdict {
        Verdict::Accepted => true,
        Verdict::Rejected => l.outcome == calib_report::Outcome::Exceeded,
        Verdict::NotEvaluated => l.outcome == calib_report::Outcome::NotEvaluated,
    };
    let mut reasons: Vec<String> = limits.iter().filter(decided).map(Limit::sentence).collect();
    if limits.is_empty() {
        reasons.push(
            "The profile sets no limits (`solve.limits`), so nothing could be accepted.".to_owned(),
        );
    }
    for (name, origin) in e.origins {
        if origin.pose.is_none() && e.method == Method::Paper {
            verdict = Verdict::Rejected;
            reasons.insert(
                0,
                format!("Origin `{name}` is not observable in its sweep."),
            );
        }
    }
    if let Some(fit) = e.fit
        && !fit.solution.status.is_converged()
    {
        verdict = Verdict::Rejected;
        reasons.insert(
            0,
            format!(
                "The solver did not converge: it {}.",
                fit_end(fit).after(fit.solution.iterations)
            ),
        );
    }
    let goodness = e.fit.and_then(|fit| fit.solution.goodness_of_fit());
    let missing = goodness.map(|g| g.missing).unwrap_or_default();
    let workspace = e.fit.and_then(|fit| workspace(e.inputs, fit));
    let findings = findings(e, &missing);
    Report {
        profile: file.clone(),
        robot: profile.robot.clone(),
        method: match e.method {
            Method::Paper => calib_report::Method::Paper,
            Method::Ml => calib_report::Method::Ml,
        },
        verdict,
        reasons,
        scope: scope(e).iter().map(Scope::sentence).collect(),
        limits,
        next_steps: next_steps(e, verdict, &missing)
            .iter()
            .map(NextStep::sentence)
            .collect(),
        transforms: e.found.iter().map(transform).collect(),
        parameters: e.fit.map_or_else(Vec::new, parameters),
        changes: e.urdf.changes.clone(),
        urdf_diff: e.urdf.diff.clone(),
        not_observable: e.fit.map_or_else(Vec::new, not_observable),
        loops: e.loops.clone(),
        verification: Verification {
            held_out: e.held_out.clone(),
            outcome: match (&e.held_out, verdict) {
                (None, _) | (_, Verdict::NotEvaluated) => calib_report::Outcome::NotEvaluated,
                (_, Verdict::Accepted) => calib_report::Outcome::Met,
                (_, Verdict::Rejected) => calib_report::Outcome::Exceeded,
            },
            reason: if e.held_out.is_none() {
                "The profile names no validation recording.".to_owned()
            } else {
                String::new()
            },
        },
        estimators: estimators(e),
        fit: e.fit.map(fit_summary),
        residuals: Residuals::from_rows(e.residuals),
        noise: e.fit.map_or_else(Vec::new, |fit| noise(e, fit)),
        clocks: crate::prepare::clock::clocks(e.inputs, e.fit),
        recordings: recordings(e),
        coverage: coverage(e.inputs),
        rejected: rejected(e.inputs, e.fit),
        accuracy_limits: e
            .fit
            .map_or_else(Vec::new, |fit| accuracy_limits(e, fit, workspace.as_ref())),
        workspace,
        findings,
        inputs: e
            .inputs
            .digests
            .iter()
            .map(|d| Input {
                path: d.path.clone(),
                sha256: d.sha256.clone(),
            })
            .collect(),
        outputs: outputs(e),
        reproduce: vec![reproduce(e)],
        undo: vec![format!(
            "calib revert {} --out original.urdf",
            profile.outputs.urdf
        )],
        seed: 0,
        data_information: e
            .fit
            .map(|fit| crate::verify::information::data_information(e.inputs, fit)),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        ..Report::default()
    }
}

/// The command that gives this report again, with the method where it is not the profile's.
fn reproduce(e: &Evidence<'_>) -> String {
    let file = &e.inputs.robot.file;
    match e.method {
        method if method == e.inputs.robot.profile.solve.method => format!("calib run {file}"),
        Method::Paper => format!("calib run {file} --method paper"),
        Method::Ml => format!("calib run {file} --method ml"),
    }
}

fn limits(limits: &Limits, e: &Evidence<'_>) -> Vec<Limit> {
    let calibrated = e.held_out.as_ref().and_then(|h| h.calibrated);
    let mut out = Vec::new();
    let mut held_out = |name: &str, quantity: &str, limit: Option<f64>, value: Option<f64>| {
        let Some(limit) = limit else { return };
        out.push(match value {
            Some(value) => Limit::evaluated(name, quantity, Unit::Metre, limit, value),
            None => Limit::not_evaluated(name, quantity, Unit::Metre, limit, "no validation poses"),
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

fn scope(e: &Evidence<'_>) -> Vec<Scope> {
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

fn next_steps(e: &Evidence<'_>, verdict: Verdict, missing: &[String]) -> Vec<NextStep> {
    let mut steps = vec![match verdict {
        Verdict::Accepted => NextStep::Use {
            urdf: e.inputs.robot.profile.outputs.urdf.clone(),
        },
        Verdict::Rejected => NextStep::FixProblems,
        Verdict::NotEvaluated => NextStep::AddValidation,
    }];
    if let Some(first) = missing.first() {
        steps.push(NextStep::EnableEffect {
            evidence: first.clone(),
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

fn transform(found: &Found) -> Transform {
    Transform::new(
        &found.name,
        &found.parent,
        &found.child,
        &found.pose,
        found.covariance.as_ref(),
        found.status,
    )
    .with_unobservable(found.unobservable.clone())
}

fn unit(unit: calib_core::Unit) -> Unit {
    match unit {
        calib_core::Unit::Metre => Unit::Metre,
        calib_core::Unit::Radian => Unit::Radian,
        calib_core::Unit::Second => Unit::Second,
        calib_core::Unit::One => Unit::One,
        calib_core::Unit::RadianPerNewtonMetre => Unit::RadianPerNewtonMetre,
        calib_core::Unit::MetrePerNewton => Unit::MetrePerNewton,
    }
}

fn parameters(fit: &MlFit) -> Vec<Parameter> {
    let held = |i: usize| fit.formulation.problem.parameters()[i].fixed;
    let all = fit
        .solution
        .parameters
        .iter()
        .enumerate()
        .filter(|(i, _)| !held(*i));
    all.map(|(_, p)| Parameter {
        name: p.name.clone(),
        joint: p.joint.clone(),
        kind: serde_json::to_value(p.kind)
            .ok()
            .and_then(|v| v.as_str().map(str::to_owned))
            .unwrap_or_default(),
        unit: unit(p.unit),
        nominal: p.nominal,
        value: p.value,
        sigma: p.sigma,
        data_share: Some(p.data_share),
        class: match p.class {
            calib_core::ParameterClass::Solid => calib_report::Class::Solid,
            calib_core::ParameterClass::Weak => calib_report::Class::Weak,
            calib_core::ParameterClass::Prior => calib_report::Class::Prior,
            calib_core::ParameterClass::NotObservable => calib_report::Class::NotObservable,
        },
    })
    .collect()
}

fn not_observable(fit: &MlFit) -> Vec<NotObservable> {
    let mut out: Vec<NotObservable> = fit
        .solution
        .observability
        .null
        .iter()
        .map(|d| NotObservable {
            meaning: match d.gauge {
                Gauge::WorldAgainstBase
                | Gauge::OffsetAgainstOwnOrigin
                | Gauge::OffsetAgainstNeighbour
                | Gauge::SlideAlongAxis
                | Gauge::TurnAboutAxis
                | Gauge::ParallelAxes
                | Gauge::ToolAgainstLastOrigin
                | Gauge::MarkersAgainstMount => Meaning::Convention,
                // With other motion or another mark it would show.
                _ => Meaning::NotMeasured,
            },
            subject: d.terms.first().map_or_else(String::new, |t| t.name.clone()),
            direction: d
                .terms
                .iter()
                .map(|t| Term {
                    parameter: t.name.clone(),
                    coefficient: t.amount,
                })
                .collect(),
            text: d.text.clone(),
            remedy: d.remedy.clone(),
        })
        .collect();
    for joint in &fit.solution.observability.unmoved {
        out.push(NotObservable {
            meaning: Meaning::NotMeasured,
            subject: joint.clone(),
            direction: Vec::new(),
            text: format!(
                "joint `{joint}` did not move in the fitted recordings and keeps its nominal parameters"
            ),
            remedy: "Move it in a sweep or in static poses.".to_owned(),
        });
    }
    out
}

fn fit_end(fit: &MlFit) -> FitEnd {
    match fit.solution.status {
        SolveStatus::Converged => FitEnd::Converged,
        SolveStatus::Stalled => FitEnd::Stalled,
        SolveStatus::MaxIterations => FitEnd::MaxIterations,
        SolveStatus::NotEvaluable => FitEnd::NotEvaluable,
    }
}

fn fit_summary(fit: &MlFit) -> FitSummary {
    let s = &fit.solution;
    FitSummary {
        ended: fit_end(fit),
        status: fit_end(fit).after(s.iterations),
        converged: s.status.is_converged(),
        iterations: s.iterations,
        observations: s.weights.iter().filter(|w| **w > 0.0).count(),
        unknowns: s.model.free(),
        chi2_per_dof: Some(s.chi2_stated / s.degrees_of_freedom.max(1.0)),
    }
}

fn noise(e: &Evidence<'_>, fit: &MlFit) -> Vec<calib_report::Noise> {
    let profile = &e.inputs.robot.profile;
    let stated = |name: &str| match name {
        "marker" => profile.tracker.marker_sigma,
        "body position" => profile.tracker.body_sigma,
        "body orientation" => profile.tracker.body_sigma_rad,
        _ => profile.solve.noise.joint,
    };
    fit.solution
        .noise
        .iter()
        .map(|n| calib_report::Noise {
            group: n.name.clone(),
            kind: match n.kind {
                NoiseKind::Position => calib_report::NoiseKind::Position,
                NoiseKind::Orientation => calib_report::NoiseKind::Orientation,
                NoiseKind::Joint => calib_report::NoiseKind::Joint,
                NoiseKind::Scale => calib_report::NoiseKind::Scale,
            },
            unit: match n.kind {
                NoiseKind::Position => Unit::Metre,
                _ => Unit::Radian,
            },
            sigma: Some(n.sigma),
            stated: stated(&n.name),
            samples: fit.solution.weights.iter().filter(|w| **w > 0.0).count(),
            text: calib_report::Noise::method(n.estimated).to_owned(),
        })
        .collect()
}

fn recordings(e: &Evidence<'_>) -> Vec<RecordingSummary> {
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

fn coverage(inputs: &Inputs) -> Vec<JointCoverage> {
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
            Unit::Metre
        };
        let continuous = matches!(joint.kind, calib_urdf::JointKind::Continuous { .. });
        let range = joint.limits.range().filter(|_| !continuous);
        out.extend(JointCoverage::of(&joint.name, unit, range, &positions));
    }
    out
}

fn rejected(inputs: &Inputs, fit: Option<&MlFit>) -> Vec<Rejected> {
    let mut groups: BTreeMap<(String, String, &str), Vec<u64>> = BTreeMap::new();
    for out in &inputs.excluded {
        let row = inputs.recordings.get(&out.recording);
        if let Some(row) = row.and_then(|r| r.poses.rows.get(out.row)) {
            groups
                .entry((out.recording.clone(), out.body.clone(), &out.reason))
                .or_default()
                .push(*row);
        }
    }
    for (fit, r) in fit
        .into_iter()
        .flat_map(|fit| fit.solution.rejected.iter().map(move |r| (fit, r)))
    {
        let (recording, row) = &fit.formulation.samples[r.sample];
        let reason = match r.reason {
            RejectReason::Swap => "swapped with another marker of the body",
            RejectReason::Occlusion => "occlusion: a pose needed to predict it was lost",
            RejectReason::Outlier => "outlier: residual too large for the noise",
            RejectReason::NotSettled => {
                "not settled: the whole body is displaced, or a joint reading is wrong"
            }
        };
        let row = inputs.recordings[recording].poses.rows[*row];
        groups
            .entry((
                recording.clone(),
                subject(fit, &r.measurement, r.item),
                reason,
            ))
            .or_default()
            .push(row);
    }
    groups
        .into_iter()
        .map(|((recording, subject, reason), rows)| Rejected {
            recording,
            subject,
            rows,
            reason: reason.to_owned(),
        })
        .collect()
}

fn findings(e: &Evidence<'_>, missing: &[String]) -> Vec<Finding> {
    let mut findings = e.findings.to_vec();
    findings.extend(missing.iter().map(|pattern| {
        Finding::new(catalog::MISSING_PHYSICS, About::Fit).with("pattern", Fact::name(pattern))
    }));
    findings.sort_by_key(|f| std::cmp::Reverse(f.severity));
    findings
}

/// The closed forms against the result, and against each other.
fn estimators(e: &Evidence<'_>) -> Vec<EstimatorResult> {
    let mut out = Vec::new();
    for (name, origin) in e.origins {
        out.extend(origin.estimators.iter().cloned());
        let Some(pose) = origin.pose.filter(|_| e.method == Method::Ml) else {
            continue;
        };
        let body = &e.inputs.robot.profile.origins[name].body;
        let Some(found) = e
            .found
            .iter()
            .find(|f| f.name == format!("{body}_from_{name}"))
        else {
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
            quantity: format!("{body}_from_{name}"),
            estimator: "paper (closed form)".to_owned(),
            value: Some(pose.translation.vector.as_slice().to_vec()),
            sigma: origin
                .covariance
                .map(|c| (3..6).map(|i| c[(i, i)].max(0.0).sqrt()).collect()),
            agrees: z2.is_some_and(|z2| z2 <= AGREES),
            unit: Unit::Metre,
            distance: Some((pose.translation.vector - found.pose.translation.vector).norm()),
            text: format!(
                "orientation differs by {}",
                number::plain(difference.angular().norm(), Unit::Radian)
            ),
        });
    }
    out
}

/// The files of a run: what they are, and their digests where they do not depend on the report itself.
fn outputs(e: &Evidence<'_>) -> Vec<Output> {
    let urdf = &e.inputs.robot.profile.urdf;
    let written = e.written.iter().map(|(file, what)| Output {
        path: file.name.clone(),
        what: (*what).to_owned(),
        sha256: Some(calib_urdf::sha256_hex(&file.bytes)),
        changes: (file.name == e.inputs.robot.profile.outputs.urdf).then(|| urdf.clone()),
    });
    let own = [
        ("report.md", "this report as Markdown"),
        ("report.json", "this report as data"),
        ("report.html", "this report as a page"),
    ];
    let own = own.map(|(path, what)| Output {
        path: path.to_owned(),
        what: what.to_owned(),
        sha256: None,
        changes: None,
    });
    written.chain(own).collect()
}
