//! `calib plan`.

use std::path::{Path, PathBuf};

use calib_files::{ResultsFolder, input};
use calib_pipeline::ExitCode;
use calib_pipeline::prepare::load::load_robot;
use calib_plan::{Goal, Known, Options, PlanError, terminal, write};
use clap::{Args, ValueEnum};

use super::plugin_options::PluginOptions;
use crate::error::CliError;
use crate::terminal::{Console, emit, look, say_stage, spinner};

/// Arguments of `calib plan`.
#[derive(Debug, Args)]
pub struct PlanPostures {
    /// The robot's profile; its recordings need not exist yet
    profile: PathBuf,
    /// Number of postures to record [default: 36]
    #[arg(long, value_parser = clap::value_parser!(u16).range(6..=400))]
    poses: Option<u16>,
    /// As many postures as this σ of the tool's position needs, mm
    #[arg(long, conflicts_with = "poses")]
    sigma_mm: Option<f64>,
    /// Longest time of all motions, s: fewer postures are taken where they take longer
    #[arg(long)]
    path_time_s: Option<f64>,
    /// What the postures are chosen for [default: task; with `--of` parameters]
    #[arg(long, value_enum)]
    goal: Option<GoalName>,
    /// Only these parameters, by a part of their names; for the goals `parameters`, `variances` and `weakest`
    #[arg(long, value_delimiter = ',')]
    of: Vec<String>,
    /// Table of joint positions, or of places of one link, body or marker (`flange.x_m,flange.y_m,flange.z_m`), where the robot is to be accurate [default: `plan.task_box_mm`, else all postures]
    #[arg(long)]
    task: Option<PathBuf>,
    /// Postures that the choice is made from, before impossible ones are removed
    #[arg(long, default_value_t = 4096, value_parser = clap::value_parser!(u32).range(64..=100_000))]
    candidates: u32,
    /// Seed of the candidates
    #[arg(long, default_value_t = 1)]
    seed: u32,
    /// Folder to write to [default: results/PROFILE-plan]
    #[arg(short, long)]
    out: Option<PathBuf>,
    /// Which plugins are loaded, for readers of recordings
    #[command(flatten)]
    plugins: PluginOptions,
}

/// What postures are chosen for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum GoalName {
    /// The tool's position over the task
    Task,
    /// All parameters together
    Parameters,
    /// The mean variance of the parameters
    Variances,
    /// The least determined combination of the parameters
    Weakest,
}

/// Largest table of task postures, bytes.
const LARGEST: u64 = 64 << 20;

/// Plans, and writes the files.
pub fn run(console: &Console, options: &PlanPostures) -> Result<ExitCode, CliError> {
    let bar = spinner(console.quiet);
    let progress = |stage: &'static str| {
        bar.set_message(stage);
        if console.json && !console.quiet {
            say_stage(stage);
        }
    };
    if let Some(sigma) = options.sigma_mm.filter(|s| !(*s > 0.0 && s.is_finite())) {
        return Err(CliError::NotASigma { sigma });
    }
    if let Some(time) = options.path_time_s.filter(|t| !(*t > 0.0 && t.is_finite())) {
        return Err(CliError::NotATime { time });
    }
    progress("read profile and robot");
    let robot = load_robot(&options.profile)?;
    let out = options
        .out
        .clone()
        .unwrap_or_else(|| default_folder(&options.profile));
    let folder = ResultsFolder::open(&out)?;
    progress("fit what is recorded already");
    let known = Known::of(robot, options.plugins.plugins())?;
    progress("choose postures");
    let mut asked = Options {
        poses: options.poses.map(usize::from),
        sigma: options.sigma_mm.map(|mm| mm * 1e-3),
        path_time: options.path_time_s,
        goal: match (options.goal, options.of.is_empty()) {
            (Some(GoalName::Task), false) => {
                return Err(PlanError::OfWithoutParameters {
                    file: options.profile.display().to_string(),
                }
                .into());
            }
            (Some(GoalName::Task) | None, true) => Goal::Task,
            (Some(GoalName::Parameters), _) | (None, false) => Goal::Parameters,
            (Some(GoalName::Variances), _) => Goal::Variances,
            (Some(GoalName::Weakest), _) => Goal::Weakest,
        },
        of: options.of.clone(),
        candidates: options.candidates as usize,
        task: None,
        seed: options.seed,
    };
    if let Some(path) = &options.task {
        asked.task = Some(task(&known, path)?);
    }
    let plan = calib_plan::plan(&known, &asked)?;
    let model = &known.robot.model;
    progress("write the plan");
    let files = plan.files(model, &known.robot.file)?;
    let folder = folder.without(&write::not_written(&files));
    folder.write(&files)?;
    bar.finish_and_clear();
    emit(&match (console.json, console.quiet) {
        (true, _) => plan.json(model)?,
        (false, true) => format!("{}\n", out.join("plan.csv").display()),
        (false, false) => {
            let columns = look(console.color).columns;
            terminal::summary(&plan, &out.display().to_string(), columns)
        }
    })?;
    Ok(ExitCode::Accepted)
}

/// The postures of a table.
fn task(known: &Known, path: &Path) -> Result<Vec<Vec<f64>>, CliError> {
    let shown = path.display().to_string();
    let bytes = input::read(path, LARGEST).map_err(|e| PlanError::NotJoints {
        file: shown.clone(),
        why: e.to_string(),
    })?;
    Ok(write::read_task(&bytes, &shown, known)?)
}

fn default_folder(profile: &Path) -> PathBuf {
    let name = profile.file_stem().map(std::ffi::OsStr::to_string_lossy);
    let name = name.unwrap_or("profile".into());
    PathBuf::from("results").join(format!("{name}-plan"))
}
