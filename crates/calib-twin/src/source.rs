//! Where a session comes from: recordings, a plan, or the profile's `simulate` section.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use calib_files::folder_of;
use calib_pipeline::PipelineError;
use calib_pipeline::formulate::formulation::FreeSet;
use calib_pipeline::formulate::ml::{self, calibration_at};
use calib_pipeline::formulate::solved::nominal;
use calib_pipeline::options::Plugins;
use calib_pipeline::prepare::inputs::{Inputs, RobotProfile};
use calib_pipeline::prepare::load::{load_recordings, load_robot, of_tables};
use calib_plan::known::without_missing;
use calib_plan::linear::{joint_table, planned_recording};
use calib_plan::write::PlanFile;
use calib_plan::{JointNoiseOf, Known};
use calib_profile::{Profile, Usage};
use calib_report::{read_report, report_path};
use nalgebra::{Isometry3, Point3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::TwinError;
use crate::noise::Noise;
use crate::note::{NoiseOf, Note};
use crate::replay::Replay;
use crate::session::Session;
use crate::truth::About;

/// What the session is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// Recordings that exist.
    Recordings,
    /// A plan, beside recordings that exist.
    Plan,
    /// The `simulate` section of the profile.
    Simulation,
}

/// Names of the recordings that a plan would give.
const PLANNED: [&str; 2] = ["planned", "planned_held_out"];

/// The session of a profile, and what it was taken from. `about`: where true robots are drawn; of recordings about the robot that they show, else
/// from the priors.
///
/// # Errors
/// [`TwinError`] where there is nothing to take it from, or it cannot be calibrated.
pub fn session(
    mut robot: RobotProfile,
    plan: Option<&PlanFile>,
    plugins: Plugins,
    about: Option<About>,
) -> Result<(Session, Source), TwinError> {
    let prior = about.unwrap_or(About::Prior);
    if let Some(plan) = plan {
        let (inputs, noise, notes) = planned(robot, plan, plugins)?;
        let session = Session::new(inputs, prior, Some(noise), notes)?;
        return Ok((session, Source::Plan));
    }
    let as_stated = robot.clone();
    without_missing(&mut robot);
    let recorded = robot.profile.recordings.values();
    let fitted = recorded.filter(|r| r.usage != Usage::Validation).count();
    if fitted > 0 {
        let mut notes = Vec::new();
        without_sweep(&mut robot, &mut notes);
        let inputs = load_recordings(robot, plugins)?;
        let about = about.unwrap_or(About::Found);
        let session = Session::new(inputs, about, None, notes)?;
        return Ok((session, Source::Recordings));
    }
    let robot = as_stated;
    let Ok(simulated) = calib_sim::simulate(&robot.profile, &robot.model, None) else {
        return Err(TwinError::NothingToSimulate { file: robot.file });
    };
    let inputs = of_tables(robot, simulated.recordings, plugins)?;
    let session = Session::new(inputs, prior, None, vec![Note::FromSimulation])?;
    Ok((session, Source::Simulation))
}

/// Origins whose sweep does not exist cannot be found.
fn without_sweep(robot: &mut RobotProfile, notes: &mut Vec<Note>) {
    let profile = &mut robot.profile;
    let known: BTreeSet<&String> = profile.recordings.keys().collect();
    let lost = profile
        .origins
        .iter()
        .filter(|o| !known.contains(&o.1.sweep));
    let lost: Vec<String> = lost.map(|(name, _)| name.clone()).collect();
    if lost.is_empty() {
        return;
    }
    profile.origins.retain(|name, _| !lost.contains(name));
    let gone = |name: &String| lost.contains(name);
    profile.loops.retain(|_, l| !gone(&l.from) && !gone(&l.to));
    notes.push(Note::OriginsWithoutSweep { origins: lost });
}

/// What stands beside planned postures, and whose noise they have.
fn from_plan(known: &Known, postures: usize) -> Note {
    let before = known.inputs.iter().flat_map(|i| i.recordings.values());
    let fitted = before.filter(|r| r.spec.usage != Usage::Validation);
    let noise = match (known.inputs.is_some(), has_noise(&known.robot.profile)) {
        (true, _) => NoiseOf::Recordings,
        (false, true) => NoiseOf::Profile,
        (false, false) => NoiseOf::Program,
    };
    let (joint_sigma, of) = known.joint_noise();
    Note::FromPlan {
        postures,
        beside: fitted.map(|r| r.poses.len()).sum(),
        noise,
        joint_sigma,
        joint_noise: match of {
            JointNoiseOf::Recordings => NoiseOf::Recordings,
            JointNoiseOf::Solve => NoiseOf::Profile,
            JointNoiseOf::Simulation => NoiseOf::Simulation,
            JointNoiseOf::Program => NoiseOf::Program,
        },
    }
}

/// The postures of a plan, recorded by the robot as it is known.
fn planned(
    robot: RobotProfile,
    plan: &PlanFile,
    plugins: Plugins,
) -> Result<(Inputs, Noise, Vec<Note>), TwinError> {
    if plan.robot != robot.profile.robot {
        return Err(TwinError::OtherRobot {
            file: robot.file,
            planned: plan.robot.clone(),
            robot: robot.profile.robot,
        });
    }
    let known = Known::of(robot, plugins)?;
    let joints = known.joint_box()?;
    let [fitted, held_out] = plan.positions(&known.robot.model, &joints.base);
    let mut notes = vec![from_plan(&known, fitted.len())];
    let mut robot = known.robot.clone();
    let recorded = std::mem::take(&mut robot.profile.recordings);
    let usages = [Usage::Static, Usage::Validation];
    let mut tables = BTreeMap::new();
    let (mut feasible, _) = known.feasible(&joints, 1);
    let mut shapes = BTreeMap::new();
    for ((name, usage), postures) in PLANNED.iter().zip(usages).zip([fitted, held_out]) {
        let (seen, _) = feasible.all(postures);
        if seen.is_empty() {
            continue;
        }
        robot
            .profile
            .recordings
            .insert((*name).to_owned(), planned_recording(usage));
        let q: Vec<&Vec<f64>> = seen.iter().map(|c| &c.q).collect();
        let mut table = joint_table(&robot.model, &q);
        for (i, subject) in feasible.sight.subjects.iter().enumerate() {
            let in_sight = seen.iter().map(|c| c.seen[i].is_some());
            match &subject.marker {
                Some(marker) => {
                    let track = in_sight.map(|is| is.then(Point3::origin)).collect();
                    table.markers.insert(marker.clone(), track);
                    let of: Vec<_> = seen.iter().map(|c| c.seen[i].flatten()).collect();
                    shapes.insert(((*name).to_owned(), marker.clone()), of);
                }
                None => {
                    let track = in_sight.map(|is| is.then(Isometry3::identity)).collect();
                    table.bodies.insert(subject.body.clone(), track);
                }
            }
        }
        tables.insert((*name).to_owned(), table);
    }
    let mut inputs = of_tables(robot, tables, Plugins::Refused)?;
    for ((recording, marker), of) in shapes {
        let loaded = inputs.recordings.get_mut(&recording);
        if let Some(loaded) = loaded.filter(|_| of.iter().any(Option::is_some)) {
            loaded.shapes.insert(marker, of);
        }
    }
    let stated = ml::state(&inputs, &known.tracks, &known.start, FreeSet::Profile);
    let model = calib_core::Model::new(&stated.problem).map_err(PipelineError::from)?;
    // Beside recordings, by the robot that they show: postures of the nominal one would be rejected as gross errors.
    let start = match known.values.is_empty() {
        true => nominal(&inputs, &known.start),
        false => calibration_at(&stated, &model, &known.values_of(&model), &inputs),
    };
    let groups = stated.problem.groups();
    let level = |group: calib_core::GroupId| {
        let group = &groups[group.index()];
        known.noise.get(&group.name).copied().unwrap_or(group.sigma)
    };
    let noise = Noise::of(&stated, &inputs.robot.model, &level);
    let replay = Replay {
        inputs: &inputs,
        tracks: &known.tracks,
        robot: &start,
        noise: &noise,
        fault: None,
    };
    let mut inputs = replay.recordings(&mut Session::numbers(1, 0));
    inputs.robot.profile.recordings.extend(recorded);
    if let Some(before) = &known.inputs {
        inputs.recordings.extend(before.recordings.clone());
    }
    let existing = &inputs.recordings;
    inputs
        .robot
        .profile
        .recordings
        .retain(|name, _| existing.contains_key(name));
    without_sweep(&mut inputs.robot, &mut notes);
    Ok((inputs, noise, notes))
}

/// A file in the folders beside and in theirs, in the order of their names; of folders with very many, only in `robots`.
fn in_folders(at: &Path, file: &str) -> Vec<PathBuf> {
    const MOST: usize = 1000;
    let inside = |folder: &Path| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).into_iter().flatten();
        let entries = entries.take(MOST + 1).filter_map(Result::ok);
        let folders = entries.filter(|e| e.file_type().is_ok_and(|t| t.is_dir()));
        let mut folders: Vec<PathBuf> = folders.map(|e| e.path()).collect();
        folders.sort();
        folders
    };
    let beside = inside(at);
    if beside.len() > MOST {
        return vec![at.join("robots").join(file)];
    }
    let below: Vec<PathBuf> = beside.iter().flat_map(|f| inside(f)).take(MOST).collect();
    let folders = beside.into_iter().chain(below);
    folders.map(|folder| folder.join(file)).collect()
}

/// The profile states the tracker's noise.
fn has_noise(profile: &Profile) -> bool {
    profile.tracker.marker_sigma.is_some() || profile.tracker.body_sigma.is_some()
}

/// The profile that was given, or the one that a folder of results was made from.
///
/// # Errors
/// [`TwinError::NoProfile`] where it is not beside the folder or was changed, [`TwinError::Changed`] for other recordings.
pub fn profile_of(given: &Path) -> Result<PathBuf, TwinError> {
    let extension = report_path(given).extension().map(ToOwned::to_owned);
    if extension.is_none_or(|e| e != "json") {
        return Ok(given.to_path_buf());
    }
    let report = read_report(given)?;
    let folder = folder_of(&report_path(given)).to_path_buf();
    let shown = || given.display().to_string();
    let absolute = std::path::absolute(&folder).unwrap_or(folder);
    // As far up as a project reaches, and where the shipped robots lie.
    const UP: usize = 4;
    let around = absolute.ancestors().take(UP);
    let candidates = around.flat_map(|at| {
        let own = at.join(&report.profile);
        std::iter::once(own).chain(in_folders(at, &report.profile))
    });
    let digest = |name: &str| {
        let input = report.inputs.iter().find(|input| input.path == name);
        input.map(|input| input.sha256.clone())
    };
    let same = |path: &PathBuf| {
        let robot = load_robot(path).ok()?;
        let own = robot.digests.first()?;
        (Some(&own.sha256) == digest(&own.path).as_ref()).then_some(robot)
    };
    let found = candidates.filter(|path| path.is_file());
    let found = found.filter_map(|path| same(&path).map(|robot| (path, robot)));
    let Some((path, robot)) = found.into_iter().next() else {
        return Err(TwinError::NoProfile {
            folder: shown(),
            profile: report.profile.clone(),
        });
    };
    for input in &report.inputs {
        let bytes = calib_files::input::read(&robot.folder.join(&input.path), u64::MAX);
        let now = bytes.ok().map(|bytes| calib_urdf::sha256_hex(&bytes));
        if now.as_ref() != Some(&input.sha256) {
            return Err(TwinError::Changed {
                folder: shown(),
                file: input.path.clone(),
            });
        }
    }
    Ok(path)
}
