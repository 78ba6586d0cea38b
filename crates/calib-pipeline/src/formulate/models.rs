//! `calib run --compare-models`: which physics the recordings support, by leave-one-pose-out.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use calib_core::effect::Source;
use calib_core::{EFFECTS, RankedVariant, Settings, compare_with};
use calib_profile::Free;
use serde_json::json;

use crate::error::PipelineError;
use crate::estimate::start::start;
use crate::formulate::formulation::FreeSet;
use crate::formulate::ml::state;
use crate::prepare::checks;
use crate::prepare::inputs::Inputs;
use crate::prepare::load::load_recordings;
use crate::prepare::robot::load_robot;
use crate::prepare::tracks::body_tracks;

/// Models in order of growth; each adds to the one before.
fn steps() -> Vec<(String, Option<Free>)> {
    /// The axes follow the offsets: what a first calibration frees.
    const AXES: u8 = 2;
    let effects = EFFECTS.iter().filter_map(|effect| {
        let (place, label) = effect.ladder?;
        Some((place, label, Free::Effect(effect)))
    });
    let mut steps: Vec<_> = effects
        .chain([(AXES, "joint axes", Free::JointAxes)])
        .collect();
    steps.sort_by_key(|s| s.0);
    let first = ("registration only".to_owned(), None);
    let more = steps
        .into_iter()
        .map(|(_, label, free)| (format!("+ {label}"), Some(free)));
    std::iter::once(first).chain(more).collect()
}

/// Whether what is freed needs a load to be seen.
fn needs_load(free: Free) -> bool {
    matches!(free, Free::Effect(e) if e.terms.iter().any(|t| t.source == Source::Load))
}

/// Ranks the models on the fitted recordings alone; validation recordings are not looked at. `progress(stage, done, all)`
/// is told what is done next, and how many of all models are fitted; `all` is 0 until they are stated.
///
/// # Errors
/// [`PipelineError`] as for a run; data errors stop unless `force`.
pub fn compare_models(
    profile: &Path,
    force: bool,
    progress: &mut dyn FnMut(&str, usize, usize),
) -> Result<Vec<RankedVariant>, PipelineError> {
    let mut inputs = load_recordings(load_robot(profile)?, true)?;
    let mut findings = inputs.findings.clone();
    if inputs.robot.profile.solve.robust {
        findings.extend(crate::prepare::relabel::relabel(&mut inputs));
    }
    findings.extend(checks::check(&inputs));
    if checks::stops(&findings) && !force {
        return Err(crate::prepare::stopped::stopped(&inputs, &findings));
    }
    inputs
        .recordings
        .retain(|_, r| r.spec.usage != calib_profile::Usage::Validation);
    let tracks = body_tracks(&inputs, &mut findings)?;
    let start = start(&inputs, &tracks);
    let loaded = is_loaded(&inputs);
    let mut free: BTreeSet<Free> = [Free::Bodies, Free::Tracker].into();
    let mut variants = Vec::new();
    for (name, added) in steps() {
        if added.is_some_and(needs_load) && !loaded {
            continue;
        }
        free.extend(added);
        inputs.robot.profile.solve.free.clone_from(&free);
        let free_set = if added.is_none() {
            FreeSet::RegistrationOnly
        } else {
            FreeSet::Profile
        };
        progress(&format!("state model: {name}"), 0, 0);
        variants.push((name, state(&inputs, &tracks, &start, free_set).problem));
    }
    let all = variants.len();
    let stage = |done: usize| match variants.get(done) {
        Some((name, _)) => format!("fit and predict each pose from the others: {name}"),
        None => "rank".to_owned(),
    };
    progress(&stage(0), 0, all);
    Ok(compare_with(
        &variants,
        &Settings::default(),
        calib_core::Criterion::LogDensity,
        &mut |done| progress(&stage(done), done, all),
    )?)
}

/// Whether gravity loads any joint in any fitted pose.
fn is_loaded(inputs: &Inputs) -> bool {
    let poses = inputs
        .recordings
        .values()
        .flat_map(|r| r.q.iter().flatten());
    poses.take(1).any(|q| {
        let loads = inputs.robot.masses.at(q);
        loads.about_axis.iter().any(|t| *t != 0.0)
    })
}

/// The ranking for people.
#[must_use]
pub fn table(ranked: &[RankedVariant]) -> String {
    let mut text = String::from(
        "model                   known  left-out rms   worse by ± s.e. [nats per pose]\n",
    );
    for r in ranked {
        let _ = writeln!(
            text,
            "{} {:<21} {:>5}  {:>9.3} mm   {:>7.3} ± {:.3}",
            if r.chosen { "*" } else { " " },
            r.name,
            r.parameters,
            r.loo_rms * 1e3,
            r.worse_by,
            r.standard_error
        );
    }
    if let Some(chosen) = ranked.iter().find(|r| r.chosen) {
        let _ = writeln!(
            text,
            "\n* the smallest model within one standard error of the best: {}",
            chosen.name
        );
        if !chosen.noise_parameters.is_empty() {
            let _ = writeln!(
                text,
                "  {} parameters are not significantly different from zero (< 2σ); --json names them",
                chosen.noise_parameters.len()
            );
        }
    }
    text
}

/// The ranking for machines.
#[must_use]
pub fn json(ranked: &[RankedVariant]) -> String {
    let value = json!({ "models": ranked });
    calib_report::json::pretty(&calib_report::json::rounded(value)) + "\n"
}
