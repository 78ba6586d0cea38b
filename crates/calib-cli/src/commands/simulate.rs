//! `calib simulate`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use calib_files::{OutputFile, ResultsFolder};
use calib_pipeline::ExitCode;
use calib_pipeline::prepare::load::{RobotProfile, load_robot};
use calib_plan::PlanError;
use calib_profile::{RecordingSpec, Usage};
use calib_recording::{
    ColumnMap, NotWritten, Poses, WriteOptions, renamed_comment, write_mapped, write_poses,
};
use calib_urdf::range::resting_positions;
use clap::Args;

use super::plan_file::plan_of;
use super::plugin_options::PluginOptions;
use crate::error::CliError;
use crate::terminal::{Console, emit_paths};

/// Arguments of `calib simulate`.
#[derive(Debug, Args)]
pub struct Simulate {
    /// The robot's profile
    profile: PathBuf,
    /// Seed of the random numbers [default: the profile's]
    #[arg(long)]
    seed: Option<u64>,
    /// `plan.yaml` of `calib plan`: its postures in recordings with `use: static`, its held-out ones in those with `use: validation`
    #[arg(long)]
    plan: Option<PathBuf>,
    /// Folder to write to
    #[arg(short, long)]
    out: PathBuf,
    /// Which plugins are loaded: a simulation needs none
    #[command(flatten)]
    _plugins: PluginOptions,
}

/// Simulates, and prints the names of the files.
pub fn run(console: &Console, options: &Simulate) -> Result<ExitCode, CliError> {
    let robot = load_robot(&options.profile)?;
    let folder = ResultsFolder::open(&options.out)?.over(&format!("# {SIMULATED}"));
    let postures = match &options.plan {
        Some(path) => postures(&robot, path)?,
        None => BTreeMap::new(),
    };
    let files = simulate(&robot, options.seed, &postures)?;
    emit_paths(console.json, &folder.write(&files)?)?;
    Ok(ExitCode::Accepted)
}

/// The files of a simulation: every recording under its profile path's file name, and `truth.json`.
fn simulate(
    robot: &RobotProfile,
    seed: Option<u64>,
    postures: &BTreeMap<String, Vec<Vec<f64>>>,
) -> Result<Vec<OutputFile>, CliError> {
    let (profile, model) = (&robot.profile, &robot.model);
    let simulated = calib_sim::simulate_postures(profile, model, seed, postures);
    let failed = |source| CliError::Simulation {
        file: robot.file.clone(),
        source: Box::new(source),
    };
    let simulated = simulated.map_err(failed)?;
    let mut files = Vec::new();
    for (name, poses) in &simulated.recordings {
        let spec = profile.recordings.get(name);
        let stream = spec.and_then(|spec| spec.timing.as_ref());
        let stream = stream.map(|timing| {
            calib_sim::timed(profile, model, seed, name, poses, timing).map_err(failed)
        });
        let mut poses = match stream {
            Some(stream) => stream?,
            None => poses.clone(),
        };
        let options = WriteOptions {
            comments: comments(robot, name, simulated.truth.seed),
            degrees: true,
            ..WriteOptions::micro()
        };
        let written = |poses: &Poses, columns: Option<&ColumnMap>| {
            table(poses, columns, &options).map_err(|source| CliError::Table {
                file: format!("recording `{name}`"),
                remedy: match source {
                    NotWritten::Mapped { .. } | NotWritten::Misread { .. } if columns.is_some() => {
                        "correct `columns` of this recording, or remove it while the recording is a simulated one"
                    }
                    _ => "use names without commas, quotes and line breaks",
                },
                source,
                code: ExitCode::Usage,
            })
        };
        // The robot's own log, where the profile has one.
        if let Some(log) = spec.and_then(|spec| spec.robot_log.as_ref()) {
            let joints = Poses {
                markers: BTreeMap::new(),
                bodies: BTreeMap::new(),
                ..poses.clone()
            };
            poses.joints.clear();
            files.push(OutputFile::text(
                file_name_of(&log.file),
                written(&joints, log.columns.as_ref())?,
            ));
        }
        let columns = spec.and_then(|spec| spec.columns.as_ref());
        let text = written(&poses, columns)?;
        files.push(OutputFile::text(file_name(robot, name), text));
    }
    let mut truth =
        serde_json::to_string_pretty(&simulated.truth).map_err(|source| CliError::Json {
            what: "the truth",
            source,
            remedy: "check the numbers of the `simulate` section",
        })?;
    truth.push('\n');
    files.push(OutputFile::text("truth.json", truth));
    Ok(files)
}

/// How the first comment of a simulated table begins: such a file is no measurement, and may be simulated again.
const SIMULATED: &str = "simulated by `calib simulate ";

/// Lines above a simulated table, which has the profile's names.
fn comments(robot: &RobotProfile, recording: &str, seed: u64) -> Vec<String> {
    let profile = &robot.profile;
    let mut comments = vec![
        format!(
            "{SIMULATED}{}` with seed {seed}; the truth is in truth.json",
            robot.file
        ),
        format!("recording {recording} of {}", profile.robot),
    ];
    let others = profile.names.iter().filter(|(name, from)| name != from);
    comments.extend(others.map(|(name, from)| renamed_comment(name, from)));
    comments
}

/// A table as the profile reads it: with the names and units of its column map, where it has one.
fn table(
    poses: &Poses,
    columns: Option<&ColumnMap>,
    options: &WriteOptions,
) -> Result<String, NotWritten> {
    let Some(map) = columns else {
        return write_poses(poses, options);
    };
    let mut map = map.clone();
    let texts = poses
        .labels
        .keys()
        .filter(|text| !map.labels.contains(text));
    let texts: Vec<String> = texts.cloned().collect();
    map.labels.extend(texts);
    write_mapped(poses, &map, options)
}

/// The postures of a plan by recording.
fn postures(
    robot: &RobotProfile,
    path: &Path,
) -> Result<BTreeMap<String, Vec<Vec<f64>>>, CliError> {
    let plan = plan_of(path, robot)?;
    let mut base = resting_positions(&robot.model);
    for (joint, value) in &robot.profile.plan.hold {
        base[joint.index()] = *value;
    }
    let [fitted, held_out] = plan.positions(&robot.model, &base);
    let recordings = robot.profile.recordings.iter();
    let of = |(name, spec): (&String, &RecordingSpec)| match spec.usage {
        Usage::Static => Some((name.clone(), fitted.clone())),
        Usage::Validation => Some((name.clone(), held_out.clone())),
        Usage::Sweep => None,
    };
    let postures: BTreeMap<String, Vec<Vec<f64>>> = recordings.filter_map(of).collect();
    if postures.is_empty() {
        let profile = robot.file.clone();
        return Err(PlanError::NoRecording { profile }.into());
    }
    Ok(postures)
}

fn file_name(robot: &RobotProfile, recording: &str) -> String {
    let spec = robot.profile.recordings.get(recording);
    let path = spec.map_or_else(|| format!("{recording}.csv"), |s| s.file.clone());
    file_name_of(&path)
}

fn file_name_of(path: &str) -> String {
    path.rsplit(['/', '\\']).next().unwrap_or(path).to_owned()
}
