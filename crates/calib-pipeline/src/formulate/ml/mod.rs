//! The robot, its bodies and its recordings as one estimation problem for `calib-core`.

use std::collections::BTreeMap;

use bodies::add_bodies;
use calib_core::{Chart, EdgeId, FrameId, Problem, Role, Settings, Solution};
use calib_profile::{Free, Usage};
use couplings::coupling_candidates;
use joints::{Row, add_joint, joint_noise_group, link_frame};
use masses::free_masses;
use starts::open_starts;

use crate::error::PipelineError;
use crate::estimate::start::Start;
use crate::formulate::contacts::add_contacts;
use crate::formulate::formulation::{Formulation, FreeSet, MlFit, NoiseGroups, OwnLevels};
use crate::prepare::conditions::{Conditions, conditions};
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

mod bodies;
mod calibration;
mod couplings;
mod joints;
mod masses;
mod starts;
mod widths;

pub(crate) use bodies::{BODY_ABOUT_SIGHT, BODY_ALONG_SIGHT, MARKER_ALONG_SIGHT, MARKER_SIGMA};
pub(crate) use calibration::calibration;
pub use calibration::calibration_at;
pub use joints::JOINT_SIGMA;
pub(crate) use joints::{moves, used_joints};

/// States the problem of a profile.
#[must_use]
pub fn state(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    start: &Start,
    free_set: FreeSet,
) -> Formulation {
    let profile = &inputs.robot.profile;
    let model = &inputs.robot.model;
    let samples = samples(inputs);
    let conditions_of: BTreeMap<&str, Vec<Conditions>> = inputs
        .recordings
        .iter()
        .map(|(name, r)| {
            (
                name.as_str(),
                conditions(r, &inputs.robot, profile.solve.load),
            )
        })
        .collect();
    let rows: Vec<Row<'_>> = samples
        .iter()
        .filter_map(|(r, row)| {
            let q = inputs.recordings[r].q[*row].as_ref()?;
            let under = &conditions_of[r.as_str()][*row];
            Some(Row {
                q,
                under,
                loads: inputs.robot.masses.under(q, under.torque.as_deref()),
            })
        })
        .collect();
    let mut problem = Problem::new(samples.len());
    for (i, (recording, _)) in samples.iter().enumerate() {
        if inputs.recordings[recording].spec.usage == Usage::Validation {
            problem.held_out.insert(i);
        }
    }
    let starts = (1..samples.len()).filter(|s| samples[*s].0 != samples[s - 1].0);
    problem.borders = starts.collect();
    let (tracker, root_frame, root) = add_root(&mut problem, inputs, start, free_set);
    let mut formulation = Formulation {
        problem,
        tracker,
        links: vec![None; model.links().len()],
        bodies: BTreeMap::new(),
        joints: vec![None; model.joints().len()],
        origins: vec![None; model.joints().len()],
        root,
        mounts: BTreeMap::new(),
        points: BTreeMap::new(),
        contact_points: BTreeMap::new(),
        contacts: BTreeMap::new(),
        spots: BTreeMap::new(),
        masses: Vec::new(),
        clocks: BTreeMap::new(),
        noise: NoiseGroups::default(),
        widths: Vec::new(),
        loaded: false,
        samples,
    };
    formulation.links[model.root().index()] = Some(root_frame);
    let joint_noise = joint_noise_group(&mut formulation.problem, profile);
    formulation.noise.joint = joint_noise;
    for joint in used_joints(inputs, model) {
        add_joint(
            &mut formulation,
            inputs,
            joint,
            &rows,
            joint_noise,
            free_set,
        );
    }
    if free_set == FreeSet::Profile {
        open_starts(&mut formulation, inputs, &rows);
        coupling_candidates(&mut formulation, inputs, &rows);
    }
    if free_set == FreeSet::Profile && profile.solve.free.contains(&Free::Masses) {
        free_masses(&mut formulation, inputs, &rows);
    }
    add_bodies(&mut formulation, inputs, tracks, start);
    add_contacts(&mut formulation, inputs);
    crate::formulate::clock::add_clocks(&mut formulation, inputs, free_set);
    if free_set == FreeSet::Profile {
        formulation.widths = widths::shared(&formulation, inputs);
    }
    match profile.solve.noise.model {
        Some(model) if free_set == FreeSet::Profile => formulation.with_noise(model),
        _ => formulation,
    }
}

/// The tracker's frame, that of the root link, and the edge between them: nominal, measured, or to be found.
fn add_root(
    problem: &mut Problem,
    inputs: &Inputs,
    start: &Start,
    free_set: FreeSet,
) -> (FrameId, FrameId, EdgeId) {
    let profile = &inputs.robot.profile;
    let model = &inputs.robot.model;
    let tracker = problem.frame(&format!("tracker {}", profile.tracker.frame));
    let root_frame = problem.frame(&link_frame(model, model.root()));
    let tracker_free = !profile.bodies.is_empty()
        && (profile.solve.free.contains(&Free::Tracker) || free_set == FreeSet::RegistrationOnly);
    let chart = if tracker_free {
        Chart::full()
    } else {
        Chart::none()
    };
    let measured = profile.tracker.from_root.as_ref();
    let nominal = measured.map_or(start.tracker_from_root, |measured| measured.pose);
    let root = problem.unknown("tracker_from_root", tracker, root_frame, nominal, chart);
    problem.set_role(root, Role::World, None);
    if let Some(measured) = measured {
        problem.set_prior(root, Some(measured.sigma_rad), Some(measured.sigma));
    }
    (tracker, root_frame, root)
}

/// Solves a stated problem.
///
/// # Errors
/// [`PipelineError::Solve`] when the problem cannot be stated so.
pub fn fit(
    formulation: Formulation,
    inputs: &Inputs,
    settings: &Settings,
) -> Result<MlFit, PipelineError> {
    let solution = calib_core::solve(&formulation.problem, settings)?;
    Ok(found(formulation, inputs, solution))
}

/// As [`fit`], from some rows of long recordings, with what is off in any; `None` where [`fit`] takes no longer.
///
/// # Errors
/// As [`fit`].
pub(crate) fn fit_some(
    formulation: &Formulation,
    inputs: &Inputs,
    settings: &Settings,
) -> Result<Option<MlFit>, PipelineError> {
    let solution = calib_core::solve_some(&formulation.problem, settings)?;
    Ok(solution.map(|solution| found(formulation.clone(), inputs, solution)))
}

/// As [`fit`], with noise levels to begin with, σ² per group.
///
/// # Errors
/// As [`fit`].
pub(crate) fn fit_from(
    formulation: Formulation,
    inputs: &Inputs,
    levels: &[f64],
    settings: &Settings,
) -> Result<MlFit, PipelineError> {
    let solution = calib_core::solve_from(&formulation.problem, levels, settings)?;
    Ok(found(formulation, inputs, solution))
}

/// As [`fit`], from the observations only that another fit kept; `None` where the two do not have the same ones, or too few are left.
pub fn fit_kept(
    formulation: &Formulation,
    inputs: &Inputs,
    kept: &Solution,
    settings: &Settings,
) -> Option<MlFit> {
    let solution = calib_core::solve_kept(&formulation.problem, kept, settings).ok()?;
    Some(found(formulation.clone(), inputs, solution))
}

/// As [`fit`], from where the fit of other observations of the same robot ended; `None` where that has other parameters or noise groups.
pub(crate) fn fit_near(
    formulation: Formulation,
    inputs: &Inputs,
    near: &Solution,
    settings: &Settings,
) -> Option<MlFit> {
    let solution = calib_core::solve_near(&formulation.problem, near, settings).ok()?;
    Some(found(formulation, inputs, solution))
}

pub(crate) fn found(formulation: Formulation, inputs: &Inputs, solution: Solution) -> MlFit {
    MlFit {
        noise: None,
        levels: OwnLevels::default(),
        widths: Vec::new(),
        widened: None,
        calibration: calibration(&formulation, &solution, inputs),
        formulation,
        solution,
    }
}

/// All rows with known joint positions, recording after recording.
fn samples(inputs: &Inputs) -> Vec<(String, usize)> {
    let mut samples = Vec::new();
    let mut recordings: Vec<(&String, &Loaded)> = inputs.recordings.iter().collect();
    recordings.sort_by_key(|(_, loaded)| loaded.spec.place);
    for (name, loaded) in recordings {
        samples.extend(
            loaded
                .q
                .iter()
                .enumerate()
                .filter(|(_, q)| q.is_some())
                .map(|(row, _)| (name.clone(), row)),
        );
    }
    samples
}
