//! `calib study`.

use std::path::PathBuf;

use calib_files::{OutputFile, write_results};
use calib_fleet::shard::{Identity, Shard};
use calib_fleet::work::{Unit, results};
use calib_pipeline::{ExitCode, PipelineError};
use calib_plugin::Tables;
use calib_study::{Study, StudyOptions, Tried, Units, cases, faults};
use clap::{Args, ValueEnum};

use super::plugin_options::{NamedPlugins, PluginOptions};
use super::shard_options::{Making, ShardOptions, identity, make};
use crate::error::CliError;
use crate::terminal::{Console, Counted, emit, emit_written};

/// Arguments of `calib study`.
#[derive(Debug, Args)]
pub struct StudyRun {
    /// Which study
    #[arg(value_enum)]
    study: StudyName,
    /// Trials of an ordinary cell [cor, aor: 1500], robots drawn [justin, ripley: 100], or cases of each cell [faults: 4]
    #[arg(long)]
    trials: Option<u64>,
    /// Recordings of each robot, whose results show the repeatability [justin, ripley]
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u64).range(1..))]
    recorded: u64,
    /// Seed of the random numbers
    #[arg(long)]
    seed: Option<u64>,
    /// Number of threads [default: one for each processor]
    #[arg(long)]
    threads: Option<usize>,
    /// Folder for the tables and figures; an interrupted study continues there
    #[arg(short, long)]
    out: Option<PathBuf>,
    /// Profile for a case study [default: robots/justin.yaml or robots/ripley.yaml]
    #[arg(long)]
    profile: Option<PathBuf>,
    /// Start over instead of continuing
    #[arg(long)]
    restart: bool,
    /// Which plugins are loaded
    #[command(flatten)]
    plugins: PluginOptions,
    /// Which part of the work is done here
    #[command(flatten)]
    shards: ShardOptions,
    /// Estimators of plugins to try beside the built-in ones [cor, aor]
    #[command(flatten)]
    named: NamedPlugins,
    /// Print JSON instead of Markdown
    #[arg(long)]
    json: bool,
}

/// Simulation studies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum StudyName {
    /// Centers of rotation, paper §3.3
    Cor,
    /// Axes of rotation and frames, paper §4 and §5.2
    Aor,
    /// Case study over many simulated robots, paper §5: Table 1
    Justin,
    /// Case study over many simulated robots, paper §6: Table 2
    Ripley,
    /// Faults of robots, recordings and profiles: what `calib run` says of each
    Faults,
}

/// Runs a study.
pub fn run(console: &Console, study: &StudyRun) -> Result<ExitCode, CliError> {
    let of_estimators = matches!(study.study, StudyName::Cor | StudyName::Aor);
    if !of_estimators && !study.named.plugin.is_empty() {
        return Err(CliError::NoEstimatorStudied);
    }
    match study.study {
        StudyName::Cor => estimators(console, study, Study::Cor),
        StudyName::Aor => estimators(console, study, Study::Aor),
        StudyName::Justin => robots(console, study, "justin"),
        StudyName::Ripley => robots(console, study, "ripley"),
        StudyName::Faults => of_faults(console, study),
    }
}

impl StudyRun {
    /// A part of the study.
    fn make(
        &self,
        console: &Console,
        (shard, identity, counted): (Shard, &Identity, &'static str),
        one: Unit<'_>,
    ) -> Result<ExitCode, CliError> {
        let out = self.out.clone();
        let out = out.unwrap_or_else(|| PathBuf::from("results").join(&identity.kind));
        let store = self.shards.store()?;
        let making = Making {
            identity,
            out: &out,
            resume: !self.restart,
            threads: self.threads,
            store: store.as_ref(),
            counted,
        };
        make(console, shard, &making, one)
    }
}

/// A study of estimators.
fn estimators(console: &Console, study: &StudyRun, which: Study) -> Result<ExitCode, CliError> {
    let default = StudyOptions::default();
    let options = StudyOptions {
        trials: study.trials.unwrap_or(default.trials),
        seed: study.seed.unwrap_or(default.seed),
        threads: study.threads,
        out: study.out.clone(),
        resume: !study.restart,
        only: Vec::new(),
    };
    let mut tables = Tables::default();
    let added = tables.add_named(&study.named.plugin);
    let tried = added.and_then(|()| Tried::of(&tables, &study.named.parameter));
    let tried = tried.map_err(PipelineError::from)?;
    let units = Units::new(which, &tried, &options)?;
    let work = || identity(which.word(), options.seed, units.count(), &units.settings());
    if let Some(shard) = study.shards.shard {
        let one = |unit| {
            let (name, sums) = units.one(unit).unzip();
            Ok((name.unwrap_or_default(), serde_json::to_string(&sums)?))
        };
        return study.make(console, (shard, &work(), "parts of scenes"), &one);
    }
    let result = match &study.shards.from {
        Some(file) => units.result(results(file, &work())?)?,
        None => {
            let bar = Counted::new(console, "trials");
            let progress = |done, total| bar.at(done, total);
            let result = calib_study::run_with(which, &tried, &options, &progress)?;
            bar.end();
            result
        }
    };
    emit(&if study.json {
        calib_study::json(&result)
    } else {
        calib_study::markdown(&result)
    })?;
    if let Some(out) = &study.out {
        for path in calib_study::write(&result, out)? {
            emit_written(console, &path);
        }
    }
    Ok(ExitCode::Accepted)
}

/// A case study over many simulated robots.
fn robots(console: &Console, study: &StudyRun, name: &str) -> Result<ExitCode, CliError> {
    let default_profile = || PathBuf::from(format!("robots/{name}.yaml"));
    let options = cases::CaseOptions {
        profile: study.profile.clone().unwrap_or_else(default_profile),
        name: name.to_owned(),
        robots: study.trials.unwrap_or(100),
        recorded: study.recorded,
        seed: study.seed.unwrap_or(1),
        threads: study.threads,
        out: study.out.clone(),
        resume: !study.restart,
        plugins: study.plugins.plugins(),
    };
    let units = cases::Units::new(&options)?;
    let settings = units.settings()?;
    let work = || identity(name, options.seed, units.count(), &settings);
    if let Some(shard) = study.shards.shard {
        let one = |unit| {
            Ok((
                units.seed(unit).to_string(),
                serde_json::to_string(&units.one(unit))?,
            ))
        };
        return study.make(console, (shard, &work(), "robots"), &one);
    }
    let result = match &study.shards.from {
        Some(file) => units.result(results(file, &work())?.collect::<Result<_, _>>()?),
        None => {
            let bar = Counted::new(console, "robots");
            let result = cases::run_cases(&units, &|done, total| bar.at(done, total))?;
            bar.end();
            result
        }
    };
    let json = cases::json(&result).map_err(|source| CliError::Json {
        what: "the study",
        source,
        remedy: "leave out --json",
    })?;
    let text = cases::markdown(&result);
    emit(if study.json { &json } else { &text })?;
    if let Some(out) = &study.out {
        let files = [
            OutputFile::text(format!("{name}.csv"), cases::csv(&result)),
            OutputFile::text(format!("{name}.json"), json),
            OutputFile::text(format!("{name}.md"), text),
            OutputFile::text(format!("{name}.svg"), cases::svg(&result)),
        ];
        for path in write_results(out, &files)? {
            emit_written(console, &path);
        }
    }
    Ok(ExitCode::Accepted)
}

/// The matrix of faults.
fn of_faults(console: &Console, study: &StudyRun) -> Result<ExitCode, CliError> {
    let default = faults::FaultOptions::default();
    let options = faults::FaultOptions {
        cases: study.trials.unwrap_or(default.cases),
        seed: study.seed.unwrap_or(default.seed),
        threads: study.threads,
        out: study.out.clone(),
        resume: !study.restart,
        only: Vec::new(),
    };
    let units = faults::Units::new(&options)?;
    let work = || identity("faults", options.seed, units.count(), &units.settings());
    if let Some(shard) = study.shards.shard {
        let one = |unit| {
            let case = units.one(unit);
            let name = case.as_ref().map(|(name, _)| name.clone());
            let result = serde_json::to_string(&case.map(|(_, result)| result))?;
            Ok((name.unwrap_or_default(), result))
        };
        return study.make(console, (shard, &work(), "cases"), &one);
    }
    let result = match &study.shards.from {
        Some(file) => units.result(results(file, &work())?.collect::<Result<_, _>>()?),
        None => {
            let bar = Counted::new(console, "cases");
            let result = faults::run_faults(&options, &|done, total| bar.at(done, total))?;
            bar.end();
            result
        }
    };
    let json = faults::json(&result)?;
    let text = faults::markdown(&result);
    emit(if study.json { &json } else { &text })?;
    if let Some(out) = &study.out {
        let files = [
            OutputFile::text("faults.csv", faults::csv(&result)),
            OutputFile::text("faults.json", json),
            OutputFile::text("faults.md", text),
        ];
        for path in write_results(out, &files)? {
            emit_written(console, &path);
        }
    }
    Ok(ExitCode::Accepted)
}
