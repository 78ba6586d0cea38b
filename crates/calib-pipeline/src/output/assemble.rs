//! Everything that was found, as the report's data. Renderers compute nothing; this does.

use calib_finding::shell_path;
use calib_profile::Method;
use calib_report::{
    AccuracyLimit, DataInformation, DhTable, HeldOut, Identification, Input, MissingPhysics,
    NextStep, Report, Residuals, RobotChange, Scope, Verdict, Verification, WeakDirections,
    Workspace, judge,
};

use crate::formulate::formulation::MlFit;
use crate::output::counts::fates;
use crate::output::evidence::Evidence;
use crate::output::facts::facts;
use crate::output::of_data::{coverage, estimators, findings, recordings, rejected};
use crate::output::of_fit::{
    contact_points, fit_summary, missing_physics, noise, noise_choice, not_observable, parameters,
    standardized, tested_effects, transform,
};
use crate::output::verdict::{limits, next_steps, scope};
use crate::output::weak::{self, weak_directions};
use crate::output::widths::prior_widths;
use crate::prepare::named;
use crate::verify::accuracy::{accuracy_limits, workspace};
use crate::verify::dh_table::dh_table;
use crate::verify::information::data_information;
use crate::verify::motions::motions;
use crate::verify::proportions;
use crate::verify::robot_changes::robot_changes;
use crate::verify::tracker_noise::TrackerNoise;

/// The report of a run.
#[must_use]
pub fn assemble(e: &Evidence<'_>) -> Report {
    let profile = &e.inputs.robot.profile;
    let file = &e.inputs.robot.file;
    let goodness = e.causes.goodness.as_ref();
    let Longest {
        workspace,
        weak,
        information,
        dh_table,
    } = longest(e);
    let missing: Vec<MissingPhysics> = goodness
        .iter()
        .flat_map(|g| &g.missing)
        .map(missing_physics)
        .collect();
    let (parameters, (robot_changes, accuracy_limits)) = rayon::join(
        || e.fit.map_or_else(Vec::new, parameters),
        || of_robot(e, information.as_ref()),
    );
    let mut open = weak::findings(e.inputs, weak.as_ref(), e.held_out);
    // A scale of the tracker that the fit was asked for says the same.
    if !e.findings.iter().any(|f| f.facts.get("scale").is_some()) {
        open.extend(proportions::finding(&robot_changes));
    }
    let findings = findings(e, &missing, open);
    let joint_sigma = e.fit.and_then(MlFit::joint_sigma).unwrap_or(0.0);
    let motions = motions(e.inputs, joint_sigma, e.held_out);
    let tracks = fates(e.inputs, e.tracks, e.fit, e.held_out);
    let limits = limits(&profile.solve.limits, e);
    let (judgment, residuals) = rayon::join(
        || judge(&facts(e, &findings, &limits, &motions, &tracks)),
        || residuals(e),
    );
    let verdict = judgment.verdict;
    let scope = scope(e, &motions);
    let report = Report {
        profile: file.clone(),
        robot: profile.robot.clone(),
        method: match e.method {
            Method::Paper => calib_report::Method::Paper,
            Method::Ml => calib_report::Method::Ml,
        },
        identification: identification(e),
        scope: scope.iter().map(Scope::sentence).collect(),
        not_for: scope.iter().filter_map(Scope::excluded).collect(),
        limits,
        next_steps: next_steps(e, &judgment, &missing)
            .iter()
            .map(NextStep::sentence)
            .collect(),
        transforms: e.found.iter().map(transform).collect(),
        contact_points: contact_points(e, &parameters),
        robot_changes,
        dh_table,
        changes: e.urdf.changes.clone(),
        urdf_diff: e.urdf.diff.clone(),
        not_observable: e.fit.map_or_else(Vec::new, not_observable),
        loops: e.loops.clone(),
        verification: verification(e, verdict),
        estimators: estimators(e),
        fit: e.fit.map(|fit| fit_summary(profile, fit, &parameters)),
        parameters,
        residuals,
        noise: e.fit.map_or_else(Vec::new, |fit| noise(e, fit)),
        noise_choice: e.fit.and_then(noise_choice),
        prior_widths: e.fit.map_or_else(Vec::new, prior_widths),
        tested_effects: goodness.map_or_else(Vec::new, tested_effects),
        clocks: crate::formulate::clock::clocks(e.inputs, e.fit, &findings),
        recordings: recordings(e.inputs, &tracks),
        coverage: coverage(e.inputs),
        rejected: rejected(e.inputs, e.fit, e.held_out),
        accuracy_limits,
        weak_directions: weak,
        selection: e.selection.clone(),
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
        components: named::components(e.inputs),
        reproduce: vec![reproduce(e)],
        undo: vec![format!(
            "calib revert {} --out original.urdf",
            shell_path(&profile.outputs.urdf)
        )],
        seed: 0,
        data_information: information,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        ..Report::default()
    };
    report.judged(judgment)
}

/// What takes longest.
struct Longest {
    workspace: Option<Workspace>,
    weak: Option<WeakDirections>,
    information: Option<DataInformation>,
    dh_table: Option<DhTable>,
}

fn longest(e: &Evidence<'_>) -> Longest {
    let ((workspace, weak), (information, dh_table)) = rayon::join(
        || {
            rayon::join(
                || e.fit.and_then(|fit| workspace(e.inputs, fit)),
                || e.fit.and_then(|fit| weak_directions(e.inputs, fit)),
            )
        },
        || {
            rayon::join(
                || e.fit.map(|fit| data_information(e.inputs, fit)),
                || e.fit.and_then(|fit| dh_table(e.inputs, fit)),
            )
        },
    );
    Longest {
        workspace,
        weak,
        information,
        dh_table,
    }
}

/// What changed of the robot, and how well what is said of it is known.
fn of_robot(
    e: &Evidence<'_>,
    information: Option<&DataInformation>,
) -> (Vec<RobotChange>, Vec<AccuracyLimit>) {
    let Some(fit) = e.fit else {
        return (Vec::new(), Vec::new());
    };
    let mut changes = information.map_or_else(Vec::new, |of| robot_changes(e.inputs, fit, of));
    for change in &mut changes {
        change.sigma = e.sigmas.get(&change.name).copied().or(change.sigma);
    }
    let changes = RobotChange::sorted(changes);
    let limits = accuracy_limits(e.inputs, e.held_out, fit, &tracker_noise(e, fit));
    (changes, limits)
}

fn residuals(e: &Evidence<'_>) -> Residuals {
    let found = e.fit.and_then(|fit| fit.solution.standardized_residuals());
    Residuals::from_rows(e.residuals)
        .with_standardized(found.and_then(|found| standardized(&found)))
}

/// What the held-out recordings say.
fn verification(e: &Evidence<'_>, verdict: Verdict) -> Verification {
    Verification {
        held_out: held_out(e),
        outcome: match (&e.held_out, verdict) {
            (None, _) | (_, Verdict::NotEvaluated) => calib_report::Outcome::NotEvaluated,
            (_, Verdict::Accepted | Verdict::AcceptedWithWarnings) => calib_report::Outcome::Met,
            (_, Verdict::Rejected) => calib_report::Outcome::Exceeded,
        },
        reason: if e.held_out.is_none() {
            "The profile names no validation recording.".to_owned()
        } else {
            String::new()
        },
    }
}

/// The tracker's noise, without what the model lacks.
fn tracker_noise<'a>(e: &Evidence<'a>, fit: &'a MlFit) -> TrackerNoise<'a> {
    TrackerNoise::beside_lacking(fit, e.inputs, e.tracks, e.causes.lacks_effects())
}

/// The held-out errors with the share of the tracker's noise.
fn held_out(e: &Evidence<'_>) -> Option<HeldOut> {
    let mut held_out = e.held_out.cloned()?;
    let tracker_m = e
        .fit
        .and_then(|fit| tracker_noise(e, fit).over(e.inputs, &held_out));
    if let Some(expected) = &mut held_out.expected {
        expected.tracker_m = tracker_m;
    }
    Some(held_out)
}

/// The command that gives this report again in the folder of the profile, with the method where it is not the profile's.
fn reproduce(e: &Evidence<'_>) -> String {
    let own = e.method == e.inputs.robot.profile.solve.method || e.selection.is_some();
    let method = match e.method {
        _ if own => None,
        Method::Paper => Some("--method paper"),
        Method::Ml => Some("--method ml"),
    };
    let file = shell_path(&e.inputs.robot.file);
    let words = ["calib run", &file].into_iter();
    let words = words.chain(method).chain(e.arguments.iter().copied());
    words.collect::<Vec<_>>().join(" ")
}

/// What the profile says of the measurement.
fn identification(e: &Evidence<'_>) -> Identification {
    let stated = &e.inputs.robot.profile.identification;
    Identification {
        serial_number: stated.serial_number.clone(),
        operator: stated.operator.clone(),
        date: stated.date.clone(),
        tracker: stated.tracker.clone(),
    }
}
