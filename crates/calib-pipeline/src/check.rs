//! `calib check`.

use std::collections::BTreeMap;
use std::path::Path;

use calib_core::Settings;
use calib_finding::{Fact, Finding, Severity, Subject, catalog};
use calib_geometry::statistics::median;
use calib_profile::{Body, BodyKind, Method, Usage};
use calib_report::{BodyNoise, CheckOutcome, Checked, CheckedRecording, DataCheck, DataChecks};

use crate::error::{ExitCode, PipelineError};
use crate::estimate::paper;
use crate::estimate::start::{Start, start};
use crate::formulate::bad_rows::{bad_rows, is_judged, say};
use crate::formulate::by_likelihood::only_a_cross_check;
use crate::formulate::completed::beside;
use crate::formulate::formulation::{FreeSet, MlFit};
use crate::formulate::stuck::without_stuck;
use crate::formulate::{held, ml, model_checks};
use crate::options::Plugins;
use crate::output::of_data::{coverage, lost, used_for};
use crate::prepare::aligned::Alignment;
use crate::prepare::checks;
use crate::prepare::condensed::condense;
use crate::prepare::effects;
use crate::prepare::ghosts;
use crate::prepare::inputs::Inputs;
use crate::prepare::load::load_recordings;
use crate::prepare::named;
use crate::prepare::relabel::relabel;
use crate::prepare::repeats;
use crate::prepare::robot::load_robot;
use crate::prepare::split::split;
use crate::prepare::tracks::{BodyTrack, body_tracks};
use crate::verify::causes::causes;

/// Checks a profile, its robot and its recordings; solves nothing.
///
/// # Errors
/// [`PipelineError`] for what cannot be read at all.
pub fn check(profile: &Path, plugins: Plugins) -> Result<DataChecks, PipelineError> {
    let mut inputs = load_recordings(load_robot(profile)?, plugins)?;
    effects::taken(&inputs, inputs.robot.profile.solve.method)?;
    let mut findings = inputs.findings.clone();
    if inputs.robot.profile.solve.robust {
        findings.extend(relabel(&mut inputs));
        findings.extend(held::take_out(&mut inputs));
    }
    let of_data = checks::check(&inputs);
    // A column written twice does not keep the others from being compared with the robot, row by row.
    let is_wrong = |f: &Finding| f.severity == Severity::Error && f.id != catalog::DUPLICATE_COLUMN;
    let wrong = of_data.iter().any(is_wrong);
    findings.extend(of_data);
    if inputs.robot.profile.solve.robust {
        ghosts::take_out(&mut inputs, &findings);
    }
    let mut noise = Vec::new();
    let mut moved = false;
    // What was recorded is said of bodies as they are, whatever a `split` makes of them.
    let is_split = |body: &Body| body.split.is_some();
    let shown = (inputs.robot.profile.bodies.values().any(is_split)).then(|| {
        let mut whole = inputs.clone();
        condense(&mut whole);
        whole
    });
    split(&mut inputs);
    findings.extend(condense(&mut inputs));
    match body_tracks(&inputs, &mut findings) {
        Ok(tracks) => {
            noise = noise_of(&inputs, &tracks);
            findings.extend(noise.iter().filter_map(noise_is_stated));
            moved = true;
            let start = start(&inputs, &tracks);
            model_checks::before_the_fit(&inputs, &tracks, &start, &mut findings);
            let wrong = findings.iter().any(is_wrong);
            if !wrong && inputs.robot.profile.solve.robust {
                single_rows(&inputs, &tracks, &start, &mut findings)?;
            }
            // What a plugin does with these data shows when it is called.
            if !wrong && named::plugins_find_origins(&inputs) {
                let mut of_origins = Vec::new();
                paper::origins(
                    &inputs,
                    &tracks,
                    &start,
                    &inputs.estimators,
                    &mut of_origins,
                )?;
                if inputs.robot.profile.solve.method == Method::Ml {
                    only_a_cross_check(&mut of_origins);
                }
                findings.extend(of_origins);
            }
        }
        // What the data checks found is the reason.
        Err(_) if wrong => {}
        Err(error) => return Err(error),
    }
    findings.extend(repeats::found(&inputs));
    findings.sort_by_key(|f| std::cmp::Reverse(f.severity));
    Ok(DataChecks {
        robot: inputs.robot.profile.robot.clone(),
        recordings: recordings(shown.as_ref().unwrap_or(&inputs)),
        coverage: coverage(&inputs),
        noise,
        checks: checks_of(&inputs, &findings, moved),
        findings,
    })
}

/// The rows that a robust fit of the profile's model leaves out, and what changed while recording where that is why it did.
fn single_rows(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    start: &Start,
    findings: &mut Vec<Finding>,
) -> Result<(), PipelineError> {
    if !inputs.recordings.values().any(is_judged) {
        return Ok(());
    }
    let settings = Settings::default();
    let settings = settings.clone().with_robust(settings.robust.gate_alone());
    let stated = ml::state(inputs, tracks, start, FreeSet::Profile);
    // An effect that is suspected may be a change.
    let suspected = findings.iter().any(|f| f.facts.get("effect").is_some());
    let is_fine = |fit: &MlFit| {
        let converged = fit.solution.status.is_converged();
        converged && bad_rows(inputs, tracks, fit).findings.is_empty()
    };
    if !suspected && ml::fit_some(&stated, inputs, &settings)?.is_some_and(|fit| is_fine(&fit)) {
        return Ok(());
    }
    let fit = ml::fit(stated, inputs, &settings)?;
    let (mut inputs, mut tracks) = (inputs.clone(), tracks.clone());
    let of_stuck = without_stuck(&mut inputs, &mut tracks, start, fit, &settings);
    of_stuck.leave_out_explained(findings);
    let (fit, bad) = (of_stuck.fit, of_stuck.bad);
    if bad.findings.is_empty() && of_stuck.findings.is_empty() && !suspected {
        return Ok(());
    }
    let known = (&tracks, &findings[..]);
    let rows = beside(&inputs, known, &fit, &settings).map_or(bad, |beside| beside.bad);
    findings.extend(of_stuck.findings);
    let causes = causes(&inputs, &fit, findings, None);
    causes.leave_unexplained(findings);
    say(findings, rows.findings);
    // `calib run` decides what it does to the result.
    let change = causes.change.or(causes.scatter);
    findings.extend(change.map(|f| f.with_severity(Severity::Warning)));
    Ok(())
}

/// 3 with an error among the findings, else 0.
#[must_use]
pub fn exit_code(of: &DataChecks) -> ExitCode {
    if checks::stops(&of.findings) {
        ExitCode::Data
    } else {
        ExitCode::Accepted
    }
}

/// Scatter of the markers of each body about it, of all recordings together.
fn noise_of(inputs: &Inputs, tracks: &BTreeMap<String, BodyTrack>) -> Vec<BodyNoise> {
    let bodies = inputs.robot.profile.bodies.keys();
    let of = bodies.map(|body| BodyNoise {
        body: body.clone(),
        sigma_m: tracks.get(body).and_then(|track| track.marker_sigma),
        stated_m: inputs.robot.profile.tracker.marker_coordinate(),
    });
    of.collect()
}

/// Where the stated noise is another one than that of the markers about their body: a unit, most often.
fn noise_is_stated(of: &BodyNoise) -> Option<Finding> {
    /// A body's own scatter, of a few rows, and a tracker's data sheet differ by less.
    const ABOVE: f64 = 5.0;
    /// What is smoothed or averaged scatters by less than a data sheet says; a unit is a thousand.
    const BELOW: f64 = 100.0;
    let (sigma, stated) = (of.sigma_m?, of.stated_m?);
    let (kind, ratio, most) = match sigma > stated {
        true => ("above", sigma / stated, ABOVE),
        false => ("below", stated / sigma, BELOW),
    };
    (ratio > most && ratio.is_finite()).then(|| {
        Finding::of_kind(catalog::NOISE_STATED, kind, Subject::body(&of.body))
            .with("body", Fact::name(&of.body))
            .with("sigma", Fact::meters(sigma))
            .with("stated", Fact::meters(stated))
            .with("ratio", Fact::ratio(ratio))
    })
}

fn recordings(inputs: &Inputs) -> Vec<CheckedRecording> {
    let of = inputs.recordings.values().map(|r| CheckedRecording {
        name: r.name.clone(),
        used_for: used_for(r.spec.usage),
        rows: r.poses.len(),
        joints: r.poses.joints.len(),
        bodies: r.poses.bodies.len(),
        markers: r.poses.markers.len(),
        rate_hz: r.poses.t.as_deref().and_then(rate),
        lost: lost(inputs, &r.name),
        alignment: r
            .alignment
            .as_ref()
            .map_or_else(String::new, Alignment::text),
    });
    of.collect()
}

/// Rows per second, by the median step of time.
fn rate(t: &[f64]) -> Option<f64> {
    let steps = t.windows(2).map(|pair| pair[1] - pair[0]);
    let steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    median(steps).map(|step| 1.0 / step)
}

/// Every check, how it ended, and why it could not be made where it could not.
fn checks_of(inputs: &Inputs, findings: &[Finding], moved: bool) -> Vec<Checked> {
    let model = &inputs.robot.model;
    let mut joints = model.independent_joints();
    let limited = joints.any(|id| model.joint(id).limits.range().is_some());
    let bodies = inputs.robot.profile.bodies.values();
    let rigid = bodies.clone().any(|body| match &body.kind {
        BodyKind::Markers { names, .. } => names.len() > 2,
        BodyKind::Pose => true,
    });
    let recordings = || inputs.recordings.values();
    let validation = recordings().any(|r| r.spec.usage == Usage::Validation);
    let streams = recordings().any(|r| r.alignment.is_some());
    // In a wrong unit no reading is inside its limits, and no body moves as the robot.
    let units = findings.iter().all(|f| f.id != catalog::UNIT_MISMATCH);
    let unless = |check: DataCheck| {
        let (possible, why) = match check {
            DataCheck::JointLimits if limited => (units, CheckOutcome::AfterErrors),
            DataCheck::JointLimits => (limited, CheckOutcome::NoJointLimits),
            DataCheck::RigidBodies => (rigid, CheckOutcome::NoRigidBody),
            DataCheck::Validation => (validation, CheckOutcome::NoValidation),
            DataCheck::Structure => (moved && units, CheckOutcome::AfterErrors),
            DataCheck::Clocks => (streams, CheckOutcome::OneTable),
            _ => (true, CheckOutcome::Passed),
        };
        (!possible).then_some(why)
    };
    let all = DataCheck::ALL.into_iter();
    all.map(|check| check.ended(findings, unless(check)))
        .collect()
}
