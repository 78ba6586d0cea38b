//! Everything that was found, as the report's data. Renderers compute nothing; this does.

use std::collections::BTreeMap;

use calib_core::{Configuration, FeatureKind, RejectReason};
use calib_profile::{Limits, Method, Usage};
use calib_recording::Finding;
use calib_report::{
    AccuracyLimit, Clock, EstimatorResult, FitSummary, HeldOut, Input, JointCoverage, Limit,
    LoopClosure, Lost, NotObservable, Output, Parameter, RecordingSummary, RecordingUse, Rejected,
    Report, ResidualRow, Residuals, Term, Transform, Unit, Verdict, Verification, Workspace,
    WorkspacePoint, judge,
};
use calib_urdf::LinkId;
use nalgebra::{Isometry3, Matrix6};

use crate::export::{Found, PatchedUrdf};
use crate::kinematics::{Calibration, Loads};
use crate::load::Inputs;
use crate::ml::MlFit;
use crate::paper::OriginEstimate;
use crate::residuals::subject;
use crate::tracks::BodyTrack;

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
    let mut reasons: Vec<String> = limits.iter().map(reason).collect();
    if limits.is_empty() {
        reasons.push(
            "the profile names no limits (`solve.limits`), so nothing could be accepted".to_owned(),
        );
    }
    for (name, origin) in e.origins {
        if origin.pose.is_none() && e.method == Method::Paper {
            verdict = Verdict::Rejected;
            reasons.insert(0, format!("origin `{name}` is not observable in its sweep"));
        }
    }
    if let Some(fit) = e.fit
        && !fit.solution.status.is_converged()
    {
        verdict = Verdict::Rejected;
        reasons.insert(
            0,
            format!("the solver did not converge: {:?}", fit.solution.status),
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
        scope: scope(e),
        limits,
        next_steps: next_steps(e, verdict, &missing),
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
                "the profile names no validation recording".to_owned()
            } else {
                String::new()
            },
        },
        estimators: estimators(e),
        fit: e.fit.map(fit_summary),
        residuals: Residuals::from_rows(e.residuals),
        noise: e.fit.map_or_else(Vec::new, |fit| noise(e, fit)),
        clocks: clocks(e.inputs),
        recordings: recordings(e),
        coverage: coverage(e.inputs),
        rejected: e.fit.map_or_else(Vec::new, |fit| rejected(e.inputs, fit)),
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

fn reason(limit: &Limit) -> String {
    match (limit.outcome, limit.value) {
        (calib_report::Outcome::NotEvaluated, _) | (_, None) => {
            format!("{}: not evaluated: {}", limit.quantity, limit.reason)
        }
        (outcome, Some(value)) => format!(
            "{}: {:.2} mm, limit {:.2} mm: {}",
            limit.quantity,
            value * 1e3,
            limit.limit * 1e3,
            outcome.word()
        ),
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

fn scope(e: &Evidence<'_>) -> Vec<String> {
    let mut scope = vec![
        "positions of the tracked bodies, in the joint ranges and at the load of the recordings"
            .to_owned(),
    ];
    if e.robot.effects.iter().any(|j| !j.fits_into_urdf()) {
        scope.push("with the joint effects of the calibration.yaml applied; the URDF alone leaves them uncorrected".to_owned());
    }
    if e.method == Method::Paper {
        scope.push("origins are estimated one by one (method: paper); the robot's own geometry is taken as described".to_owned());
    }
    scope
}

fn next_steps(e: &Evidence<'_>, verdict: Verdict, missing: &[String]) -> Vec<String> {
    let mut steps = Vec::new();
    match verdict {
        Verdict::Accepted => steps.push(format!(
            "use `{}`; keep this folder: it holds what is needed to take it back",
            e.inputs.robot.profile.outputs.urdf
        )),
        Verdict::Rejected => {
            steps.push("do not use the result before the reasons above are gone".to_owned())
        }
        Verdict::NotEvaluated => {
            steps.push("record validation poses and name limits, then run again".to_owned())
        }
    }
    if let Some(first) = missing.first() {
        steps.push(format!("free the missing effect in the profile: {first}"));
    }
    if let Some(worst) = e
        .findings
        .iter()
        .filter(|f| f.severity >= calib_recording::Severity::Warning)
        .max_by_key(|f| f.severity)
    {
        steps.push(format!(
            "{} ({}): {}",
            worst.subject, worst.id, worst.remedy
        ));
    }
    if e.method == Method::Paper {
        steps.push("solve with `method: ml` to use all recordings at once".to_owned());
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
    let held = |i: usize| fit.stated.problem.parameters()[i].fixed;
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
            subject: joint.clone(),
            direction: Vec::new(),
            text: format!(
                "joint `{joint}` never moved in the fitted recordings: it is held as described"
            ),
            remedy: "move it in a sweep or in static poses".to_owned(),
        });
    }
    out
}

fn fit_summary(fit: &MlFit) -> FitSummary {
    let s = &fit.solution;
    FitSummary {
        status: format!("{:?}", s.status),
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
            unit: match n.kind {
                calib_core::NoiseKind::Position => Unit::Metre,
                _ => Unit::Radian,
            },
            sigma: Some(n.sigma),
            stated: stated(&n.name),
            samples: fit.solution.weights.iter().filter(|w| **w > 0.0).count(),
            text: if n.estimated {
                "variance components (REML)".to_owned()
            } else {
                "as stated".to_owned()
            },
        })
        .collect()
}

fn clocks(inputs: &Inputs) -> Vec<Clock> {
    let untimed = inputs.recordings.values().all(|r| r.poses.t.is_none());
    if untimed {
        return vec![Clock {
            recording: "all".to_owned(),
            clock: "tracker".to_owned(),
            against: "joints".to_owned(),
            agrees: Some(true),
            text: "static poses, joints and tracker in one row: the clocks do not matter"
                .to_owned(),
            ..Clock::default()
        }];
    }
    inputs
        .recordings
        .values()
        .map(|r| Clock {
            recording: r.name.clone(),
            clock: "tracker".to_owned(),
            against: "joints".to_owned(),
            agrees: r.poses.t.is_none().then_some(true),
            text: if r.poses.t.is_none() {
                "static poses: the clocks do not matter".to_owned()
            } else {
                "joints and tracker share the rows of one table; their offset was not tested"
                    .to_owned()
            },
            ..Clock::default()
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

fn rejected(inputs: &Inputs, fit: &MlFit) -> Vec<Rejected> {
    let mut groups: BTreeMap<(String, String, &'static str), Vec<u64>> = BTreeMap::new();
    for r in &fit.solution.rejected {
        let (recording, row) = &fit.stated.samples[r.sample];
        let reason = match r.reason {
            RejectReason::Swap => "lies where another marker of the body should be",
            RejectReason::Occlusion => "a measured pose on its way was lost",
            RejectReason::Outlier => "further off than noise explains",
            RejectReason::NotSettled => "the whole body is off: not settled, or a wrong reading",
        };
        let row = inputs.recordings[recording].poses.rows[*row];
        groups
            .entry((recording.clone(), subject(fit, &r.head, r.item), reason))
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

fn findings(e: &Evidence<'_>, missing: &[String]) -> Vec<calib_report::Finding> {
    let mut findings: Vec<calib_report::Finding> = e
        .findings
        .iter()
        .map(|f| calib_report::Finding {
            id: f.id.to_owned(),
            severity: match f.severity {
                calib_recording::Severity::Info => calib_report::Severity::Info,
                calib_recording::Severity::Warning => calib_report::Severity::Warning,
                calib_recording::Severity::Error => calib_report::Severity::Error,
            },
            subject: f.subject.clone(),
            rows: f.rows.clone(),
            text: f.text.clone(),
            remedy: f.remedy.clone(),
        })
        .collect();
    for missing in missing {
        findings.push(calib_report::Finding {
                id: "missing-physics".to_owned(),
                severity: calib_report::Severity::Warning,
                subject: "fit".to_owned(),
                rows: Vec::new(),
                text: missing.clone(),
                remedy: "free the effect under `solve.free` or `solve.joints`, and compare the held-out errors".to_owned(),
            });
    }
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
        let difference = crate::paper::difference(&found.pose, &pose);
        let combined = found.covariance.zip(origin.covariance).map(|(a, b)| a + b);
        /// Squared Mahalanobis distance that two estimates of one pose stay under in 99.9 % (χ² with 6 degrees).
        const AGREES: f64 = 22.46;
        let z2 = combined
            .and_then(nalgebra::Cholesky::new)
            .map(|c| difference.0.dot(&c.solve(&difference.0)));
        out.push(EstimatorResult {
            quantity: format!("{body}_from_{name}"),
            estimator: "paper (closed forms)".to_owned(),
            value: Some(pose.translation.vector.as_slice().to_vec()),
            sigma: origin
                .covariance
                .map(|c| (3..6).map(|i| c[(i, i)].max(0.0).sqrt()).collect()),
            agrees: z2.is_some_and(|z2| z2 <= AGREES),
            unit: Unit::Metre,
            distance: Some((pose.translation.vector - found.pose.translation.vector).norm()),
            text: format!(
                "{:.2} deg apart in orientation",
                difference.angular().norm().to_degrees()
            ),
        });
    }
    out
}

fn outputs(e: &Evidence<'_>) -> Vec<Output> {
    let outputs = &e.inputs.robot.profile.outputs;
    let urdf = &e.inputs.robot.profile.urdf;
    let output = |path: &str, what: String, text: Option<&str>, changes: Option<String>| Output {
        path: path.to_owned(),
        what,
        sha256: text.map(|t| calib_urdf::sha256_hex(t.as_bytes())),
        changes,
    };
    vec![
        output(
            &outputs.urdf,
            format!("URDF with {} changed numbers", e.urdf.changes.len()),
            Some(&e.urdf.text),
            Some(urdf.clone()),
        ),
        output(
            &format!("{}.changes.json", outputs.urdf),
            "what `calib revert` needs".to_owned(),
            None,
            None,
        ),
        output(
            &outputs.scene,
            "scene for the situation model".to_owned(),
            None,
            None,
        ),
        output(
            "report.md",
            "this report as Markdown".to_owned(),
            None,
            None,
        ),
        output("report.json", "this report as data".to_owned(), None, None),
        output(
            "report.html",
            "this report as a page".to_owned(),
            None,
            None,
        ),
        output(
            "residuals.csv",
            "residuals of the fit".to_owned(),
            None,
            None,
        ),
    ]
}

/// Indicated joint positions of a sample as a prediction's configuration, loads included.
fn configuration(inputs: &Inputs, fit: &MlFit, q: &[f64]) -> Configuration {
    let model = &inputs.robot.model;
    let mut at = Configuration::zero();
    let loads = fit.stated.loaded.then(|| Loads::at(model, q));
    for joint in model.joint_ids() {
        let Some(edge) = fit.stated.joints[joint.index()] else {
            continue;
        };
        at = at.with(edge, model.position(q, joint));
        if let Some(loads) = &loads {
            let index = joint.index();
            at.regressors.insert(
                (edge, FeatureKind::TorqueCompliance),
                loads.about_axis[index],
            );
            at.regressors
                .insert((edge, FeatureKind::Lateral1), loads.across[index][0]);
            at.regressors
                .insert((edge, FeatureKind::Lateral2), loads.across[index][1]);
        }
    }
    at
}

/// The link that the longest chain of joints carries a body on.
fn tool_link(inputs: &Inputs) -> Option<LinkId> {
    let model = &inputs.robot.model;
    inputs
        .robot
        .profile
        .bodies
        .values()
        .map(|b| b.link)
        .max_by_key(|l| {
            model
                .chain(model.root(), *l)
                .iter()
                .filter(|s| model.joint(s.joint).kind.axis().is_some())
                .count()
        })
}

/// Postures at which the workspace is sampled at most.
const WORKSPACE_POSES: usize = 60;

fn workspace(inputs: &Inputs, fit: &MlFit) -> Option<Workspace> {
    let model = &inputs.robot.model;
    let tool = tool_link(inputs)?;
    let from = fit.stated.links[model.root().index()]?;
    let to = fit.stated.links[tool.index()]?;
    let rows: Vec<&Vec<f64>> = inputs
        .recordings
        .values()
        .filter(|r| r.spec.usage != Usage::Sweep)
        .flat_map(|r| r.q.iter().flatten())
        .collect();
    let step = rows.len().div_ceil(WORKSPACE_POSES).max(1);
    let mut points = Vec::new();
    for q in rows.iter().step_by(step) {
        let at = configuration(inputs, fit, q);
        let body = fit
            .stated
            .bodies
            .iter()
            .find(|(name, _)| inputs.robot.profile.bodies[*name].link == tool);
        // The body, not the link: a zero offset against a mount is a convention that a link frame would show as error.
        let target = body.map_or(to, |(_, frame)| *frame);
        let pose = fit.solution.relative_pose(from, target, &at).ok()?;
        let covariance = pose.covariance?;
        points.push(WorkspacePoint {
            position_m: pose.pose.translation.vector.into(),
            sigma_m: covariance.fixed_view::<3, 3>(3, 3).trace().max(0.0).sqrt(),
        });
    }
    Workspace::of(
        &model.link(tool).name,
        &model.link(model.root()).name,
        points,
    )
}

/// What a tool error on a new pose is made of: rms over the held-out poses, in metres.
fn accuracy_limits(
    e: &Evidence<'_>,
    fit: &MlFit,
    workspace: Option<&Workspace>,
) -> Vec<AccuracyLimit> {
    let Some(measured) = e.held_out.as_ref().and_then(|h| h.calibrated) else {
        return Vec::new();
    };
    let sigma_of = |name: &str| {
        fit.solution
            .noise
            .iter()
            .find(|n| n.name == name)
            .map(|n| n.sigma)
    };
    let parameters = workspace.map_or(0.0, |w| w.rms_sigma_m);
    let tracker = sigma_of("marker")
        .or_else(|| sigma_of("body position"))
        .unwrap_or(0.0)
        * 3.0_f64.sqrt();
    let joints = sigma_of("joint").unwrap_or(0.0) * joint_lever(e.inputs);
    let explained = parameters.powi(2) + tracker.powi(2) + joints.powi(2);
    let rest = (measured.rms_m.powi(2) - explained).max(0.0).sqrt();
    let total = explained + rest.powi(2);
    let limit = |source: &str, sigma: f64, text: &str, remedy: &str| AccuracyLimit {
        source: source.to_owned(),
        sigma_m: Some(sigma),
        share: Some(if total > 0.0 {
            sigma.powi(2) / total
        } else {
            0.0
        }),
        text: text.to_owned(),
        remedy: remedy.to_owned(),
    };
    let mut limits = vec![
        limit(
            "tracker noise",
            tracker,
            "one measurement of the body on a held-out pose",
            "average several frames per pose",
        ),
        limit(
            "joint noise",
            joints,
            "the joints do not stop where their encoders say, differently at each pose",
            "let the robot settle; warm it up",
        ),
        limit(
            "parameters",
            parameters,
            "what the recordings leave open about the geometry",
            "record more poses, spread over the range of motion",
        ),
        limit(
            "not modelled",
            rest,
            "what neither noise nor uncertainty explains",
            "see the missing physics among the findings",
        ),
    ];
    limits.sort_by(|a, b| b.share.unwrap_or(0.0).total_cmp(&a.share.unwrap_or(0.0)));
    limits
}

/// Root sum of squares over the joints of how far the tool moves per radian, rms over held-out poses, m.
fn joint_lever(inputs: &Inputs) -> f64 {
    let model = &inputs.robot.model;
    let Some(tool) = tool_link(inputs) else {
        return 0.0;
    };
    let rows: Vec<&Vec<f64>> = inputs
        .recordings
        .values()
        .filter(|r| r.spec.usage == Usage::Validation)
        .flat_map(|r| r.q.iter().flatten())
        .collect();
    let squares: f64 = rows
        .iter()
        .map(|q| {
            let columns = model.jacobian(q, tool);
            columns
                .iter()
                .filter(|(id, _)| model.joint(*id).kind.turns())
                .map(|(_, c)| c.fixed_rows::<3>(3).norm_squared())
                .sum::<f64>()
        })
        .sum();
    (squares / rows.len().max(1) as f64).sqrt()
}

/// σ of every number of every calibrated origin, by `<joint>.<x|y|z|turn about x|y|z>` (m, rad).
#[must_use]
pub fn origin_sigmas(inputs: &Inputs, fit: &MlFit) -> BTreeMap<String, f64> {
    let model = &inputs.robot.model;
    let mut sigmas = BTreeMap::new();
    for joint in model.joints() {
        let (Some(parent), Some(child)) = (
            fit.stated.links[joint.parent.index()],
            fit.stated.links[joint.child.index()],
        ) else {
            continue;
        };
        let Ok(derived) = fit
            .solution
            .relative_pose(parent, child, &Configuration::zero())
        else {
            continue;
        };
        let Some(covariance) = derived.covariance else {
            continue;
        };
        for (what, sigma) in number_sigmas(&derived.pose, &covariance) {
            sigmas.insert(format!("{}.{what}", joint.name), sigma);
        }
    }
    sigmas
}

fn number_sigmas(pose: &Isometry3<f64>, covariance: &Matrix6<f64>) -> Vec<(&'static str, f64)> {
    let r = pose.rotation.to_rotation_matrix();
    let position = r.matrix() * covariance.fixed_view::<3, 3>(3, 3) * r.matrix().transpose();
    let sigma = |v: f64| v.max(0.0).sqrt();
    let mut out = vec![
        ("x", sigma(position[(0, 0)])),
        ("y", sigma(position[(1, 1)])),
        ("z", sigma(position[(2, 2)])),
    ];
    for (k, what) in ["turn about x", "turn about y", "turn about z"]
        .into_iter()
        .enumerate()
    {
        out.push((what, sigma(covariance[(k, k)])));
    }
    out
}
