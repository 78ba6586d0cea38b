//! `calib twin`.

use std::path::{Path, PathBuf};

use calib_files::ResultsFolder;
use calib_fleet::work::results;
use calib_pipeline::ExitCode;
use calib_pipeline::prepare::load::load_robot;
use calib_twin::{About, Options, profile_of, session, settings_text, terminal, twin_of, write};
use clap::{Args, ValueEnum};

use super::plan_file::plan_of;
use super::plugin_options::PluginOptions;
use super::shard_options::{Making, ShardOptions, identity, make};
use crate::error::CliError;
use crate::terminal::{Console, Counted, emit, look};

/// Arguments of `calib twin`.
#[derive(Debug, Args)]
pub struct TwinArguments {
    /// The robot's profile, or a folder of results of `calib run`
    #[arg(value_name = "PROFILE")]
    of: PathBuf,
    /// Trials without faults
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    trials: u64,
    /// Seed of the random numbers
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Postures of `calib plan`, recorded after what exists already
    #[arg(long)]
    plan: Option<PathBuf>,
    /// Where true robots are drawn [default: found where something is recorded, else prior]
    #[arg(long, value_enum)]
    truth: Option<TruthName>,
    /// How many postures this σ of the tool's position needs, mm
    #[arg(long)]
    sigma_mm: Option<f64>,
    /// Multiply the noise of the trials: what a better tracker would give, or what a wrong noise looks like
    #[arg(long, default_value_t = 1.0)]
    noise_times: f64,
    /// Number of threads [default: one for each processor]
    #[arg(long)]
    threads: Option<usize>,
    /// Folder to write to; an interrupted twin continues there [default: results/NAME-twin]
    #[arg(short, long)]
    out: Option<PathBuf>,
    /// Start over instead of continuing
    #[arg(long)]
    restart: bool,
    /// Which part of the work is done here
    #[command(flatten)]
    shards: ShardOptions,
    /// Which plugins are loaded
    #[command(flatten)]
    plugins: PluginOptions,
}

/// Where true robots are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum TruthName {
    /// About the robot that was found, as far as it is known
    Found,
    /// From the priors of the profile
    Prior,
}

/// Makes the trials, and writes the files.
pub fn run(console: &Console, options: &TwinArguments) -> Result<ExitCode, CliError> {
    let positive = |value: &f64| *value > 0.0 && value.is_finite();
    if let Some(sigma) = options.sigma_mm.filter(|v| !positive(v)) {
        return Err(CliError::NotASigma { sigma });
    }
    if !positive(&options.noise_times) {
        return Err(CliError::NotANoiseFactor {
            factor: options.noise_times,
        });
    }
    let profile = profile_of(&options.of)?;
    let robot = load_robot(&profile)?;
    let out = options
        .out
        .clone()
        .unwrap_or_else(|| default_folder(&profile));
    // A shard locks a folder of its own.
    let whole = options.shards.shard.is_none();
    let folder = whole.then(|| ResultsFolder::open(&out)).transpose()?;
    let plan = options.plan.as_ref().map(|path| plan_of(path, &robot));
    let about = options.truth.map(|truth| match truth {
        TruthName::Found => About::Found,
        TruthName::Prior => About::Prior,
    });
    let plugins = options.plugins.plugins();
    let (session, source) = session(robot, plan.transpose()?.as_ref(), plugins, about)?;
    let asked = Options {
        trials: options.trials,
        seed: options.seed,
        noise: options.noise_times,
        sigma: options.sigma_mm.map(|mm| mm * 1e-3),
        threads: options.threads,
        out: Some(out.clone()),
        resume: !options.restart,
    };
    let work = || -> Result<_, CliError> {
        let settings = settings_text(&session, &asked)?;
        Ok(identity("twin", asked.seed, asked.trials, &settings))
    };
    if let Some(shard) = options.shards.shard {
        let one = |unit| {
            let trial = session.trial(asked.seed, unit, asked.noise);
            Ok((unit.to_string(), serde_json::to_string(&trial)?))
        };
        let store = options.shards.store()?;
        let making = Making {
            identity: &work()?,
            out: &out,
            resume: asked.resume,
            threads: asked.threads,
            store: store.as_ref(),
            counted: "trials",
        };
        return make(console, shard, &making, &one);
    }
    let made = match &options.shards.from {
        Some(file) => results(file, &work()?)?.collect::<Result<_, _>>()?,
        None => Vec::new(),
    };
    let bar = Counted::new(console, "trials");
    let progress = |done, total| bar.at(done, total);
    let found = twin_of(&session, source, &asked, made, &progress)?;
    bar.end();
    if let Some(folder) = folder {
        folder.write(&write::files(&found)?)?;
    }
    emit(&match (console.json, console.quiet) {
        (true, _) => write::json(&found)?,
        (false, true) => terminal::line(&found),
        (false, false) => {
            let columns = look(console.color).columns;
            terminal::summary(&found, &out.display().to_string(), columns)
        }
    })?;
    Ok(ExitCode::Accepted)
}

fn default_folder(profile: &Path) -> PathBuf {
    let name = profile.file_stem().map(std::ffi::OsStr::to_string_lossy);
    let name = name.unwrap_or("profile".into());
    PathBuf::from("results").join(format!("{name}-twin"))
}
