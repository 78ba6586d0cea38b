//! The result of the fit of all loops.

use std::collections::BTreeMap;

use calib_core::{ParameterEstimate, ParameterKind, Settings};
use calib_finding::{About, Fact, Finding, Severity, Unit, catalog};
use calib_report::{Status, Unobservable};

use crate::error::PipelineError;
use crate::formulate::bad_rows::say;
use crate::formulate::cameras::Outcome;
use crate::formulate::checked::Checked;
use crate::formulate::chosen::Chosen;
use crate::formulate::completed::beside;
use crate::formulate::formulation::{FreeSet, MlFit};
use crate::formulate::found::Found;
use crate::formulate::memory::with_memory;
use crate::formulate::ml;
use crate::formulate::realign::realign;
use crate::formulate::solved::Solved;
use crate::formulate::stuck::{is_stuck, without_stuck};
use crate::formulate::{
    along_sight, cameras, clock, computed, gain_or_scale, gear_ratio, noise, places, priors,
    row_levels, starts, wanted, which_side,
};
use crate::prepare::inputs::Inputs;
use crate::prepare::repeats::merge;
use crate::prepare::tracks::{BodyTrack, body_tracks};

/// Rows of a motion are taken again at better times at most this often; the first time leaves what is of second order.
const ALIGNMENTS: usize = 3;
/// Sides that joints came from are asked for at most this often: those of small effects show once the others are known, and those
/// of held-out recordings last.
const SIDES: usize = 3;
/// Noise along the line of sight is stated again at most this often: how it grows shows once good rows of uncertain depth take part.
const SIGHTS: usize = 2;
/// Times that change by less, s, are right: at 1 m/s it is a hundredth of a millimeter.
const ALIGNED: f64 = 1e-5;

/// Fits all loops at once; rows of a motion are taken at the times that the fit gives, rows that had not settled are excluded
/// and the fit is repeated. What the choice of the model cost in folds, where it was `chosen`, is in the covariance.
///
/// # Errors
/// [`PipelineError::Solve`], and those of the body tracks.
pub fn likelihood(
    inputs: &mut Inputs,
    checked: &mut Checked,
    chosen: Option<&Chosen>,
    progress: &mut dyn FnMut(&str),
) -> Result<Solved, PipelineError> {
    only_a_cross_check(&mut checked.findings);
    let merged = merge(inputs);
    if !merged.is_empty() {
        checked.findings.extend(merged);
        checked.tracks = body_tracks(inputs, &mut Vec::new())?;
    }
    let mut settings = Settings::default();
    settings.robust.enabled = inputs.robot.profile.solve.robust;
    let how = How {
        settings: &settings,
        // Where gross errors are looked for, what is kept may hang on the start: then it is that of a run of the profile.
        near: chosen.filter(|_| !settings.robust.enabled),
    };
    let place = places::likeliest(inputs, checked, &settings, progress)?;
    checked.findings.extend(place);
    let mut as_read = which_side::matters(inputs).then(|| now(inputs, checked));
    let found = sided(inputs, checked, &how, progress)?;
    let found = from_its_side(inputs, checked, (&how, &mut as_read), found, progress)?;
    let found = along_its_sight(inputs, checked, (&how, as_read), found, progress)?;
    let (mut registered, mut fit, mut of_rows) =
        before_cameras(inputs, checked, &how, found, progress)?;
    for _ in 0..ALIGNMENTS {
        if !realign(inputs, &checked.tracks, &fit, ALIGNED) {
            break;
        }
        progress("fit again with the clocks brought together");
        let again = fits(inputs, checked, &how, progress)?;
        (registered, fit) = (again.0, again.1);
        // Rows that are out stay out; others are judged again.
        of_rows.retain(is_of_rows_out);
        of_rows.extend(again.2);
    }
    say(&mut checked.findings, of_rows);
    progress("choose the noise");
    // A prior that the robot contradicts looks like noise, and the noise decides what the data say of a prior.
    priors::by_evidence(&mut fit, inputs, &settings);
    if noise::by_evidence(&mut fit, inputs, &settings) {
        priors::by_evidence(&mut fit, inputs, &settings);
    }
    checked.findings.extend(noise::of_markers(&fit));
    checked.findings.extend(along_sight::findings(inputs, &fit));
    let of_rows = row_levels::findings(inputs, &fit.formulation.samples);
    checked.findings.extend(of_rows);
    checked.findings.extend(noise::meaning(&mut fit));
    checked
        .findings
        .extend(computed::of_bodies(inputs, &checked.tracks, &fit));
    checked.findings.extend(on_their_limit(&fit));
    checked.findings.extend(of_the_wrong_sign(&fit));
    checked.findings.extend(priors::contradicted(&fit));
    checked.findings.extend(with_memory(&mut fit));
    let nested = chosen.and_then(|chosen| chosen.nested.as_ref());
    if let Some((wider, by)) = nested.and_then(|nested| fit.solution.widened_by_choice(nested)) {
        fit.solution = wider;
        fit.widened = Some(by);
    }
    if chosen.is_some() {
        checked.findings.extend(gear_ratio::searched(&fit));
    }
    checked
        .findings
        .extend(gain_or_scale::findings(inputs, &fit));
    clock::noticed(&mut checked.findings, inputs, &fit);
    clock::correct(inputs, &fit);
    ml_result(inputs, fit, Some(registered))
}

/// [`fits`], again from the start where the residuals tell from which side joints came before their first motion.
fn sided(
    inputs: &mut Inputs,
    checked: &mut Checked,
    how: &How<'_>,
    progress: &mut dyn FnMut(&str),
) -> Result<Fits, PipelineError> {
    // Rows are judged again with the sides known.
    let first = starts::matter(inputs).then(|| (inputs.clone(), checked.tracks.clone()));
    let mut found = fits(inputs, checked, how, progress)?;
    let Some((as_read, tracks)) = first else {
        return Ok(found);
    };
    let mut sides = starts::Sides::new();
    for _ in 0..SIDES {
        let told = starts::fitted_first(inputs, starts::told(&found.1));
        if told.is_empty() {
            break;
        }
        sides.extend(told);
        *inputs = as_read.clone();
        checked.tracks = tracks.clone();
        starts::take(inputs, &sides);
        progress("fit again with the sides that joints came from");
        found = fits(inputs, checked, how, progress)?;
    }
    // They may have been said of a fit before this one.
    let told = starts::findings(inputs);
    checked.findings.retain(|finding| !told.contains(finding));
    checked.findings.extend(told);
    Ok(found)
}

/// Recordings before their rows were judged, and the bodies in them.
type AsRead = (Inputs, BTreeMap<String, BodyTrack>);

/// What was found, or again with the poses of some bodies measured from their other end, where the recordings say so.
fn from_its_side(
    inputs: &mut Inputs,
    checked: &mut Checked,
    (how, as_read): (&How<'_>, &mut Option<AsRead>),
    found: Fits,
    progress: &mut dyn FnMut(&str),
) -> Result<Fits, PipelineError> {
    let told = which_side::told(inputs, &found.1);
    if told.is_empty() {
        return Ok(found);
    }
    // Rows are judged again with the noise of the other end.
    let (mut read, mut tracks) = as_read.clone().unwrap_or_else(|| now(inputs, checked));
    which_side::exchange(&mut read, &mut tracks, &told);
    let exchanged = as_read.is_some().then(|| (read.clone(), tracks.clone()));
    progress("fit again with poses measured from their other end");
    let better = |_: &Inputs, _: &Checked, again: &Fits| {
        let by = again
            .1
            .solution
            .likelier_by(&found.1.solution, how.settings);
        by.is_some_and(|by| by > 0.0)
    };
    let again = tried(inputs, checked, (how, (read, tracks)), &better, progress);
    let Some(again) = again else {
        return Ok(found);
    };
    *as_read = exchanged;
    checked.findings.extend(which_side::findings(inputs, &told));
    Ok(again)
}

/// Recordings and bodies as they are now.
fn now(inputs: &Inputs, checked: &Checked) -> AsRead {
    (inputs.clone(), checked.tracks.clone())
}

/// The fit of recordings that were read in another way, where it is better; else everything is as before. What was fitted without this does not
/// depend on it.
fn tried(
    inputs: &mut Inputs,
    checked: &mut Checked,
    (how, (read, tracks)): (&How<'_>, AsRead),
    better: &dyn Fn(&Inputs, &Checked, &Fits) -> bool,
    progress: &mut dyn FnMut(&str),
) -> Option<Fits> {
    let inputs_before = std::mem::replace(inputs, read);
    let tracks_before = std::mem::replace(&mut checked.tracks, tracks);
    let findings_before = checked.findings.clone();
    let again = sided(inputs, checked, how, progress).ok();
    let again = again.filter(|again| better(inputs, checked, again));
    if again.is_none() {
        (*inputs, checked.tracks) = (inputs_before, tracks_before);
        checked.findings = findings_before;
    }
    again
}

/// What was found, or again with noise of its own along the line of sight, where the recordings say so.
fn along_its_sight(
    inputs: &mut Inputs,
    checked: &mut Checked,
    (how, as_read): (&How<'_>, Option<AsRead>),
    mut found: Fits,
    progress: &mut dyn FnMut(&str),
) -> Result<Fits, PipelineError> {
    // The levels of a model that was chosen before lack these.
    let how = How {
        settings: how.settings,
        near: None,
    };
    for _ in 0..SIGHTS {
        let Some(told) = along_sight::told(inputs, &found.1) else {
            break;
        };
        // Rows are judged again: with equal noise those of uncertain depth are gross errors.
        let (mut read, tracks) = as_read.clone().unwrap_or_else(|| now(inputs, checked));
        read.sights = told;
        progress("fit again with noise of its own along the line of sight");
        let better = |inputs: &Inputs, checked: &Checked, again: &Fits| {
            let seen = (inputs, &checked.tracks);
            along_sight::is_better(seen, &again.1, &found.1, how.settings)
        };
        match tried(inputs, checked, (&how, (read, tracks)), &better, progress) {
            Some(again) => found = again,
            None => break,
        }
    }
    Ok(found)
}

/// What was found with equal noise, or again with that of the profile's cameras where the recordings do not contradict it.
fn before_cameras(
    inputs: &mut Inputs,
    checked: &mut Checked,
    how: &How<'_>,
    equal: Fits,
    progress: &mut dyn FnMut(&str),
) -> Result<Fits, PipelineError> {
    // A long recording is copied only where it may have to come back.
    if inputs.robot.profile.plan.cameras.is_empty() {
        return Ok(equal);
    }
    let before = (inputs.clone(), checked.tracks.clone());
    if !cameras::take(inputs) {
        return Ok(equal);
    }
    progress("fit again with the noise of the cameras");
    // What was fitted without them does not depend on a fit with them.
    let with = fits(inputs, checked, how, progress).ok();
    let outcome = cameras::outcome(with.as_ref().map(|w| &w.1), &equal.1, how.settings);
    checked.findings.extend(cameras::finding(inputs, outcome));
    match with.filter(|_| outcome == Outcome::Taken) {
        Some(mut with) => {
            with.2.extend(equal.2.into_iter().filter(is_of_rows_out));
            Ok(with)
        }
        None => {
            (*inputs, checked.tracks) = before;
            Ok(equal)
        }
    }
}

/// Whether the rows that a finding names take no part in the fit, so that a further one says nothing of them.
fn is_of_rows_out(finding: &Finding) -> bool {
    finding.id == catalog::UNSETTLED_ROWS || is_stuck(finding)
}

/// How to fit.
struct How<'a> {
    settings: &'a Settings,
    /// The model that was chosen, where its values are to begin with.
    near: Option<&'a Chosen>,
}

/// Registration, fit, and what is wrong with rows.
type Fits = (MlFit, MlFit, Vec<Finding>);

/// The fit of mounts and place alone, that of everything, and what is wrong with the rows that it left out.
fn fits(
    inputs: &mut Inputs,
    checked: &mut Checked,
    how: &How<'_>,
    progress: &mut dyn FnMut(&str),
) -> Result<Fits, PipelineError> {
    progress("fit all loops");
    let settings = how.settings;
    // Which rows are off is asked of the gate alone.
    let alone = settings.clone().with_robust(settings.robust.gate_alone());
    let mut full = ml::state(inputs, &checked.tracks, &checked.start, FreeSet::Profile);
    let mut fit = match how.near {
        Some(chosen) => {
            chosen.start(&mut full.problem);
            ml::fit_from(full, inputs, &chosen.levels, &alone)?
        }
        None => ml::fit(full, inputs, &alone)?,
    };
    let mut findings = Vec::new();
    if settings.robust.enabled {
        let of_stuck = without_stuck(inputs, &mut checked.tracks, &checked.start, fit, &alone);
        of_stuck.leave_out_explained(&mut checked.findings);
        let mut bad = of_stuck.bad;
        fit = of_stuck.fit;
        let mut complete = None;
        if !bad.findings.is_empty() || !fit.solution.rejects_by_chance(&alone) {
            progress("judge rows beside what the model lacks");
            let known = (&checked.tracks, &checked.findings[..]);
            if let Some(beside) = beside(inputs, known, &fit, &alone) {
                complete = beside.fit;
                if !bad.findings.is_empty() {
                    bad = beside.bad;
                }
            }
        }
        findings = of_stuck.findings;
        findings.extend(bad.findings);
        let mut out = bad.unsettled;
        out.extend(bad.stuck);
        let unsettled = !out.is_empty();
        // What the model lacks is no gross error of the rows that show it.
        let explained = complete.and_then(|c| fit.solution.with_kept_of(&c.solution, &alone));
        if let Some(solution) = explained.filter(|_| !unsettled) {
            fit = ml::found(fit.formulation, inputs, solution);
        } else if unsettled || fit.solution.would_keep_more(settings) {
            progress("fit again with the rows that count");
            inputs.exclude(out);
            checked.tracks = body_tracks(inputs, &mut Vec::new())?;
            let full = ml::state(inputs, &checked.tracks, &checked.start, FreeSet::Profile);
            fit = ml::fit(full, inputs, settings)?;
        }
    }
    progress("fit registration only");
    let registered = registered(inputs, checked, &fit)?;
    Ok((registered, fit, findings))
}

/// The fit of mounts and place alone, from the observations that the fit of everything kept: rows that are wrong make no baseline
/// worse. It is plain least squares: what is left is the geometry's fault, not noise to be estimated.
fn registered(inputs: &Inputs, checked: &Checked, fit: &MlFit) -> Result<MlFit, PipelineError> {
    let (tracks, start) = (&checked.tracks, &checked.start);
    let mut baseline = ml::state(inputs, tracks, start, FreeSet::RegistrationOnly);
    baseline
        .problem
        .share_measurements(&fit.formulation.problem);
    let settings = Settings::plain();
    match ml::fit_kept(&baseline, inputs, &fit.solution, &settings) {
        Some(registered) => Ok(registered),
        None => ml::fit(baseline, inputs, &settings),
    }
}

/// Numbers that a physical limit of the profile stopped.
fn on_their_limit(fit: &MlFit) -> Vec<Finding> {
    let stated = fit.formulation.problem.parameters();
    let stopped = fit.solution.parameters.iter().zip(stated);
    let stopped = stopped.filter(|(found, _)| !at_physical_limit(found));
    stopped
        .filter(|(found, _)| found.at_bound)
        .filter_map(|(found, stated)| {
            let (_, limit) = stated.bounds?;
            let limit = match found.unit {
                calib_core::Unit::Meter => Fact::meters(limit),
                _ => Fact::radians(limit),
            };
            let about = About::Parameter(found.name.clone());
            Some(Finding::new(catalog::ON_ITS_LIMIT, about).with("limit", limit))
        })
        .collect()
}

/// Whether a parameter lies at 0 because physics allows no less.
fn at_physical_limit(found: &ParameterEstimate) -> bool {
    let one_sided = |kind: ParameterKind| match kind {
        ParameterKind::Effect(kind) => kind.effect().nonnegative,
        _ => false,
    };
    found.at_bound && found.value <= 0.0 && one_sided(found.kind)
}

/// Coefficients that the data put beyond what physics allows, by more than chance.
fn of_the_wrong_sign(fit: &MlFit) -> Vec<Finding> {
    /// Of fifty coefficients one exceeds this by chance in one run of a hundred.
    const SIGNIFICANT: f64 = 3.5;
    let solution = &fit.solution;
    let mut out = Vec::new();
    for without in solution.without_bounds().unwrap_or_default() {
        let found = &solution.parameters[without.parameter.index()];
        let ParameterKind::Effect(kind) = found.kind else {
            continue;
        };
        if !at_physical_limit(found) || -without.value < SIGNIFICANT * without.sigma {
            continue;
        }
        let unit = match found.unit {
            calib_core::Unit::RadianPerNewtonMeter => Unit::RadianPerNewtonMeter,
            calib_core::Unit::MeterPerNewton => Unit::MeterPerNewton,
            calib_core::Unit::Meter => Unit::Meter,
            _ => Unit::Radian,
        };
        let number = |value: f64| Fact::number(value, unit);
        let about = About::Parameter(found.name.clone());
        let finding = Finding::new(catalog::WRONG_SIGN, about)
            .with("physics", Fact::name(kind.physics()))
            .with("value", number(without.value))
            .with("sigma", number(without.sigma));
        out.push(finding);
    }
    out
}

/// The closed forms are start values here: where one has no answer, the likelihood may still have it.
/// An origin that its sweep does not determine is a warning: the fit of all loops does not need its closed form.
pub(crate) fn only_a_cross_check(findings: &mut [Finding]) {
    for finding in findings
        .iter_mut()
        .filter(|f| f.id == catalog::ORIGIN_NOT_OBSERVABLE)
    {
        finding.severity = Severity::Warning;
    }
}

pub(crate) fn ml_result(
    inputs: &Inputs,
    fit: MlFit,
    registered: Option<MlFit>,
) -> Result<Solved, PipelineError> {
    let at_zero = calib_core::Configuration::zero();
    let judged = priors::judged(&fit);
    let mut found = Vec::new();
    for (frames, from, to) in wanted::transforms(inputs, &fit) {
        let derived = judged.relative_pose(from, to, &at_zero)?;
        found.push(Found {
            pose: derived.pose,
            covariance: derived.covariance,
            unobservable: derived.unobservable.iter().map(unobservable).collect(),
            status: Status::Calibrated,
            ..frames
        });
    }
    let root = fit.formulation.links[inputs.robot.model.root().index()];
    let root_covariance = match root {
        Some(root) => {
            judged
                .relative_pose(fit.formulation.tracker, root, &at_zero)?
                .covariance
        }
        None => None,
    };
    drop(judged);
    Ok(Solved {
        robot: fit.calibration.clone(),
        fk: fit.calibration.clone(),
        registered: registered.as_ref().map(|r| r.calibration.clone()),
        registration: registered,
        found,
        root_covariance,
        fit: Some(fit),
    })
}

fn unobservable(twist: &calib_geometry::Twist) -> Unobservable {
    let (w, v) = (twist.angular(), twist.linear());
    Unobservable::along([w.x, w.y, w.z, v.x, v.y, v.z])
}
