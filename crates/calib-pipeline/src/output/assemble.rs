//! Everything that was found, as the report's data. Renderers compute nothing; this does.

use calib_finding::{Finding, Severity};
use calib_profile::Method;
use calib_report::{
    Input, Limit, MissingPhysics, NextStep, Output, Report, Residuals, Scope, Verdict,
    Verification, judge,
};

use crate::output::evidence::{Evidence, fit_end};
use crate::output::of_data::{coverage, estimators, findings, recordings, rejected};
use crate::output::of_fit::{
    fit_summary, missing_physics, noise, not_observable, parameters, transform,
};
use crate::output::verdict::{limits, next_steps, scope};
use crate::output::weak::{self, weak_directions};
use crate::verify::accuracy::{accuracy_limits, workspace};

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
    let missing: Vec<MissingPhysics> = goodness
        .iter()
        .flat_map(|g| &g.missing)
        .map(missing_physics)
        .collect();
    let workspace = e.fit.and_then(|fit| workspace(e.inputs, fit));
    let weak = e.fit.and_then(|fit| weak_directions(e.inputs, fit));
    let open = weak::findings(e.inputs, weak.as_ref(), e.held_out.as_ref());
    if verdict == Verdict::Accepted && open.iter().any(|f| f.severity == Severity::Error) {
        verdict = Verdict::NotEvaluated;
        reasons.splice(0..0, open.iter().map(Finding::text));
    }
    let findings = findings(e, &missing, open);
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
        clocks: crate::formulate::clock::clocks(e.inputs, e.fit),
        recordings: recordings(e),
        coverage: coverage(e.inputs),
        rejected: rejected(e.inputs, e.fit),
        accuracy_limits: e.fit.map_or_else(Vec::new, |fit| {
            accuracy_limits(
                e.inputs,
                e.tracks,
                e.held_out.as_ref(),
                fit,
                workspace.as_ref(),
            )
        }),
        weak_directions: weak,
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
