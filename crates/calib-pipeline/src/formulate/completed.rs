//! The fit with everything that its tests say is missing, to judge single rows by.
//!
//! Where the model lacks an effect, or a body moved on its link, the robust fit rejects the rows that show it. They are no bad rows: with the
//! effects free and the body split they fit as well as the others. Where something else moved, the rows on the shorter side of the change are left
//! out: they say nothing of single rows. What is named here decides about rows only.

use std::collections::BTreeMap;

use calib_core::{Change, ChangeSettings, Moved, Physics, ScoreTest, Settings};
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::{Split, Usage};
use nalgebra::Isometry3;

use crate::estimate::start::start_near;
use crate::formulate::bad_rows::{BadRows, bad_rows};
use crate::formulate::formulation::{FreeSet, MlFit};
use crate::formulate::parts::{RobotPart, What, with_parts};
use crate::formulate::{ml, starts};
use crate::prepare::excluded::Excluded;
use crate::prepare::inputs::Inputs;
use crate::prepare::split::{BEFORE, split};
use crate::prepare::tracks::{BodyTrack, body_tracks};

/// A fit that has what another lacks.
pub(crate) struct Beside {
    /// What is wrong with rows there.
    pub bad: BadRows,
    /// The fit, where it has the rows of the other and no body split.
    pub fit: Option<MlFit>,
}

/// The fit with what it lacks; `None` where it lacks nothing, or cannot have it. `before`: what was found before the fit.
pub(crate) fn beside(
    inputs: &Inputs,
    (tracks, before): (&BTreeMap<String, BodyTrack>, &[Finding]),
    fit: &MlFit,
    settings: &Settings,
) -> Option<Beside> {
    let mut scanned = ChangeSettings::default();
    scanned.borders = fit.formulation.borders();
    let (goodness, scan) = rayon::join(
        || fit.solution.goodness_of_fit(),
        || fit.solution.changes(&scanned),
    );
    let missing = goodness.map_or_else(Vec::new, |g| g.missing);
    let mut parts = of_tests(inputs, &missing);
    for part in before.iter().filter_map(|f| suspected(inputs, f)) {
        if !parts.contains(&part) {
            parts.push(part);
        }
    }
    let change = scan.as_ref().and_then(|scan| scan.significant());
    let moved = change.and_then(|change| split_at(inputs, fit, change));
    if parts.is_empty() && change.is_none() {
        return None;
    }
    let mut inputs = inputs.clone();
    let other = change.filter(|_| moved.is_none());
    let shorter = other.map_or_else(Vec::new, |change| shorter_side(&inputs, fit, change));
    let divided = moved.is_some() || !shorter.is_empty();
    inputs.exclude(shorter);
    inputs.robot.profile.solve = with_parts(&inputs, &parts);
    let name = moved.map(|(name, at)| {
        if let Some(body) = inputs.robot.profile.bodies.get_mut(&name) {
            body.split = Some(at);
        }
        name
    });
    let tracks = match divided {
        true => {
            split(&mut inputs);
            body_tracks(&inputs, &mut Vec::new()).ok()?
        }
        false => tracks.clone(),
    };
    let fit = fit_of(
        &mut inputs,
        &tracks,
        &fit.calibration.tracker_from_root,
        settings,
    )?;
    if !fit.solution.status.is_converged() {
        return None;
    }
    let mut bad = bad_rows(&inputs, &tracks, &fit);
    if let Some(name) = name {
        renamed(&mut bad, &name);
    }
    let fit = (!divided).then_some(fit);
    Some(Beside { bad, fit })
}

/// The effects of tests as parts of the model, those that a profile can free.
pub(crate) fn of_tests(inputs: &Inputs, missing: &[ScoreTest]) -> Vec<RobotPart> {
    let part = |test: &ScoreTest| {
        let Physics::Effect(kind) = test.physics else {
            return None;
        };
        let effect = kind.effect();
        effect.profile.as_ref()?;
        Some(RobotPart {
            what: What::Effect(effect),
            joint: Some(inputs.robot.model.joint_id(test.joint.as_ref()?).ok()?),
        })
    };
    missing.iter().filter_map(part).collect()
}

/// What was suspected before the fit, as a part.
fn suspected(inputs: &Inputs, finding: &Finding) -> Option<RobotPart> {
    // Mistakes of whole couplings have no size.
    finding.facts.get("effect")?;
    let joint = |key: &str| {
        let name = finding.facts.get(key).and_then(Fact::word)?;
        inputs.robot.model.joint_id(name).ok()
    };
    let what = match finding.id {
        id if id == catalog::JOINT_GAIN => What::Effect(calib_core::EffectKind::Gain.effect()),
        id if id == catalog::JOINT_COUPLING => What::Coupling(joint("other")?),
        _ => return None,
    };
    Some(RobotPart {
        what,
        joint: Some(joint("joint")?),
    })
}

/// The body that moved, and where a profile would split it; `None` for what is no body, or where the order of the recordings is open.
fn split_at(inputs: &Inputs, fit: &MlFit, change: &Change) -> Option<(String, Split)> {
    let Moved::Body(frame) = change.moved else {
        return None;
    };
    if change.first == 0 {
        return None;
    }
    let name = fit.formulation.body_of(inputs, frame)?;
    let samples = &fit.formulation.samples;
    let (recording, row) = &samples[change.first];
    let is_after = |name: &String| change.also.iter().any(|s| samples[*s].0 == *name);
    let before = inputs.recordings.iter().filter(|(name, loaded)| {
        let fitted = loaded.spec.usage != Usage::Validation;
        fitted && *name != recording && !is_after(name)
    });
    let at = Split {
        recording: recording.clone(),
        at_row: inputs.recordings[recording].poses.rows[*row],
        before: before.map(|(name, _)| name.clone()).collect(),
    };
    Some((name.clone(), at))
}

/// All bodies in the rows before or after a change, whichever are fewer; none for what is no step.
fn shorter_side(inputs: &Inputs, fit: &MlFit, change: &Change) -> Vec<Excluded> {
    if !matches!(
        change.moved,
        Moved::Body(_) | Moved::Reference(_) | Moved::Joint(_) | Moved::Zeros
    ) {
        return Vec::new();
    }
    let samples = &fit.formulation.samples;
    let also: Vec<&String> = change.also.iter().map(|s| &samples[*s].0).collect();
    let is_fitted = |name: &String| inputs.recordings[name].spec.usage != Usage::Validation;
    let fitted = samples
        .iter()
        .enumerate()
        .filter(|(_, (name, _))| is_fitted(name));
    let is_after =
        |s: usize, name: &String| (change.first..change.end).contains(&s) || also.contains(&name);
    let (after, before): (Vec<_>, Vec<_>) = fitted.partition(|(s, (name, _))| is_after(*s, name));
    let fewer = if after.len() <= before.len() {
        after
    } else {
        before
    };
    let bodies = inputs.robot.profile.bodies.keys();
    let of = |body: &String| -> Vec<Excluded> {
        let row = |(_, (recording, row)): &(usize, &(String, usize))| Excluded {
            recording: recording.clone(),
            row: *row,
            body: body.clone(),
            cause: calib_report::RejectedFor::OnTheWay,
        };
        fewer.iter().map(row).collect()
    };
    bodies.flat_map(of).collect()
}

fn fit_of(
    inputs: &mut Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    near: &Isometry3<f64>,
    settings: &Settings,
) -> Option<MlFit> {
    let start = start_near(inputs, tracks, near);
    let fit = |inputs: &Inputs| {
        let stated = ml::state(inputs, tracks, &start, FreeSet::Profile);
        ml::fit(stated, inputs, settings).ok()
    };
    let first = fit(inputs)?;
    let sides = starts::fitted_first(inputs, starts::told(&first));
    if sides.is_empty() {
        return Some(first);
    }
    starts::take(inputs, &sides);
    fit(inputs)
}

/// The part of a body before it moved is called as the body is.
fn renamed(bad: &mut BadRows, name: &str) {
    let part = format!("{name}{BEFORE}");
    for out in bad.unsettled.iter_mut().filter(|out| out.body == part) {
        name.clone_into(&mut out.body);
    }
    let (of_part, own) = (Subject::body(&*part), Subject::body(name));
    for finding in &mut bad.findings {
        if finding.subject.about == of_part.about {
            finding.subject.about = own.about.clone();
        }
        for key in ["first", "second", "body"] {
            if finding.facts.get(key).and_then(Fact::word) == Some(&part) {
                finding.facts.insert(key, Fact::name(name));
            }
        }
    }
}
