//! What each command does: results on standard output, progress on standard error.

use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use calib_fit::{self as fit, FitError};
use calib_pipeline::apply::{self, ApplyRequest, Destination};
use calib_pipeline::formulate::models;
use calib_pipeline::output::write;
use calib_pipeline::prepare::{inspect, load};
use calib_pipeline::run::{RunOptions, run as run_profile};
use calib_pipeline::{ExitCode, PipelineError, cases, convert, drift, simulate, take_back};
use calib_study::{Study, StudyOptions};
use clap::CommandFactory as _;
use indicatif::{ProgressBar, ProgressStyle};

use crate::arguments::{
    Apply, Arguments, Command, DiffFormat, Fit, MethodName, Run, SchemaOf, StudyName, StudyRun,
};
use crate::remaining::with_remaining;
use crate::{plugins, record};

/// Writes results to standard output; a reader that went away (`| head`) is no error.
fn emit(text: &str) {
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<ExitCode, PipelineError> {
    match &arguments.command {
        Command::Run(options) => calibrate(arguments, options),
        Command::Check { profile, json } => {
            let checked = inspect::check(profile)?;
            emit(&if *json {
                checked.json()?
            } else {
                checked.text()
            });
            Ok(checked.exit_code())
        }
        Command::Simulate { profile, seed, out } => {
            let robot = load::load_robot(profile)?;
            for path in write::write_all(out, &simulate::simulate(&robot, *seed)?)? {
                emit(&format!("{}\n", path.display()));
            }
            Ok(ExitCode::Accepted)
        }
        Command::Fit { what } => {
            let answer = fit_answer(what).map_err(fit_error)?;
            let json = match what {
                Fit::Cor(t) | Fit::Aor(t) => t.json,
                Fit::Frame(f) => f.json,
                Fit::Handeye(f) => f.json,
            };
            emit(if json { &answer.json } else { &answer.text });
            Ok(if answer.observable {
                ExitCode::Accepted
            } else {
                ExitCode::NotObservable
            })
        }
        Command::Diff { a, b, format } => {
            let text = match format {
                DiffFormat::Table => take_back::diff_table(a, b)?,
                DiffFormat::Json => take_back::diff_json(a, b)?,
                DiffFormat::Unified => take_back::diff_unified(a, b)?,
            };
            emit(&text);
            Ok(ExitCode::Accepted)
        }
        Command::Apply(options) => apply_result(options),
        Command::Drift { old, new, json } => {
            let found = drift::drift(old, new)?;
            emit(&if *json {
                drift::json(&found)?
            } else {
                drift::text(&found)
            });
            Ok(if found.changed {
                ExitCode::VerdictFail
            } else {
                ExitCode::Accepted
            })
        }
        Command::Revert { file, out, .. } => {
            let written = match out {
                Some(out) => take_back::revert(file, out)?,
                None => take_back::revert_in_place(file)?,
            };
            emit(&format!("{}\n", written.display()));
            Ok(ExitCode::Accepted)
        }
        Command::Study(study) => run_study(arguments, study),
        Command::Record(options) => record::run(arguments.quiet, options),
        Command::Convert {
            input,
            output,
            format,
        } => {
            let bar = byte_bar(arguments.quiet);
            let progress = &mut |read, all| {
                bar.set_length(all);
                bar.set_position(read);
            };
            let converted = convert::convert(input, output, format.as_deref(), progress);
            bar.finish_and_clear();
            let converted = converted?;
            for note in &converted.notes {
                eprintln!("calib: {note}");
            }
            for path in write::write_new(&converted.folder, &converted.files)? {
                emit(&format!("{}\n", path.display()));
            }
            Ok(ExitCode::Accepted)
        }
        Command::Plugins { what } => plugins::run(what.as_ref()),
        Command::Schema { of, profile } => {
            let text = match of {
                SchemaOf::Profile => calib_profile::json_schema(),
                SchemaOf::Report => inspect::report_schema(),
                SchemaOf::Scene => inspect::scene_schema(),
                SchemaOf::Parameters => inspect::parameter_schemas(profile.as_deref())?,
            };
            emit(&text);
            Ok(ExitCode::Accepted)
        }
        Command::Completions { shell } => {
            clap_complete::generate(
                *shell,
                &mut Arguments::command(),
                "calib",
                &mut std::io::stdout(),
            );
            Ok(ExitCode::Accepted)
        }
    }
}

fn fit_answer(what: &Fit) -> Result<fit::Answer, FitError> {
    match what {
        Fit::Cor(table) => fit::cor(&fit_table(table)),
        Fit::Aor(table) => fit::aor(&fit_table(table)),
        Fit::Frame(f) => fit::frame(&fit::FrameRequest {
            file: f.file.clone(),
            proximal: f.proximal.clone(),
            distal: f.distal.clone(),
            body: f.body.clone(),
            estimator: f.estimator.clone(),
            sigma_m: f.sigma_mm.map(|s| s * 1e-3),
            sigma_rad: f.sigma_deg.map(f64::to_radians),
            weights: f.weights.clone(),
        }),
        Fit::Handeye(f) => fit::handeye(&f.file, &f.robot, &f.measured),
    }
}

/// The same finding with the program's exit codes.
fn fit_error(error: FitError) -> PipelineError {
    match error {
        FitError::Data {
            file,
            finding,
            remedy,
        } => PipelineError::Data {
            file,
            finding,
            remedy,
        },
        FitError::Recording(error) => PipelineError::Recording(error),
        FitError::Usage { finding, remedy } => PipelineError::Usage { finding, remedy },
        error => PipelineError::Usage {
            finding: error.to_string(),
            remedy: "`calib fit --help` shows what it takes".to_owned(),
        },
    }
}

fn fit_table(table: &crate::arguments::FitTable) -> fit::TableRequest {
    fit::TableRequest {
        file: table.file.clone(),
        estimator: table.estimator.clone(),
        all: table.all,
        list: table.list,
        only: table.use_only.clone(),
        parent: table.parent.clone(),
        child: table.child.clone(),
        sigma_m: table.sigma_mm.map(|s| s * 1e-3),
        sigma_rad: table.sigma_deg.map(f64::to_radians),
        sight_m: table.sigma_sight_mm.map(|s| s * 1e-3),
        camera_m: table.camera_m.into(),
        covariances: table.covariances.clone(),
        weights: table.weights.clone(),
        noise_per_marker: table.noise_per_marker,
        joint: table.joint.clone(),
        center_m: table.center_m.map(Into::into),
        towards: table.towards.map(Into::into),
    }
}

fn apply_result(options: &Apply) -> Result<ExitCode, PipelineError> {
    let destination = match &options.out {
        Some(out) => Destination::To(out.clone()),
        None if options.in_place => Destination::InPlace,
        None => Destination::Nowhere,
    };
    let applied = apply::apply(&ApplyRequest {
        result: options.result.clone(),
        target: options.target.clone(),
        yaml: options.yaml.clone(),
        destination,
        force: options.force,
    })?;
    emit(&if options.json {
        apply::json(&applied)?
    } else {
        apply::text(&applied)
    });
    Ok(ExitCode::Accepted)
}

fn run_cases(
    arguments: &Arguments,
    study: &StudyRun,
    name: &str,
) -> Result<ExitCode, PipelineError> {
    let options = cases::CaseOptions {
        profile: study
            .profile
            .clone()
            .unwrap_or_else(|| PathBuf::from(format!("robots/{name}.yaml"))),
        name: name.to_owned(),
        robots: study.trials.unwrap_or(100),
        seed: study.seed.unwrap_or(1),
        threads: study.threads,
        out: study.out.clone(),
        resume: !study.restart,
    };
    let bar = study_bar(arguments.quiet, "robots");
    let result = cases::run_cases(&options, &|done, total| {
        bar.set_length(total);
        bar.set_position(done);
    })?;
    bar.finish_and_clear();
    let json = cases::json(&result).map_err(|e| PipelineError::Usage {
        finding: format!("the study cannot be written: {e}"),
        remedy: "leave out --json".to_owned(),
    })?;
    let text = cases::markdown(&result);
    emit(if study.json { &json } else { &text });
    if let Some(out) = &study.out {
        let files = [
            write::OutputFile::text(format!("{name}.csv"), cases::csv(&result)),
            write::OutputFile::text(format!("{name}.json"), json),
            write::OutputFile::text(format!("{name}.md"), text),
            write::OutputFile::text(format!("{name}.svg"), cases::svg(&result)),
        ];
        for path in write::write_all(out, &files)? {
            eprintln!("wrote {}", path.display());
        }
    }
    Ok(ExitCode::Accepted)
}

fn study_bar(quiet: bool, what: &str) -> ProgressBar {
    let bar = if quiet || !std::io::stderr().is_terminal() {
        ProgressBar::hidden()
    } else {
        ProgressBar::new(0)
    };
    let template = format!("{{bar:30}} {{pos}}/{{len}} {what}, {{eta}} left");
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar
}

fn run_study(arguments: &Arguments, study: &StudyRun) -> Result<ExitCode, PipelineError> {
    let which = match study.study {
        StudyName::Cor => Study::Cor,
        StudyName::Aor => Study::Aor,
        StudyName::Justin => return run_cases(arguments, study, "justin"),
        StudyName::Ripley => return run_cases(arguments, study, "ripley"),
    };
    let default = StudyOptions::default();
    let options = StudyOptions {
        trials: study.trials.unwrap_or(default.trials),
        seed: study.seed.unwrap_or(default.seed),
        threads: study.threads,
        out: study.out.clone(),
        resume: !study.restart,
    };
    let bar = study_bar(arguments.quiet, "trials");
    let progress = |done: u64, total: u64| {
        bar.set_length(total);
        bar.set_position(done);
    };
    let failed = |e: calib_study::StudyError| PipelineError::Usage {
        finding: e.to_string(),
        remedy: "choose another folder with --out, or begin anew with --restart".to_owned(),
    };
    let result = calib_study::run(which, &options, &progress).map_err(failed)?;
    bar.finish_and_clear();
    emit(&if study.json {
        calib_study::json(&result)
    } else {
        calib_study::markdown(&result)
    });
    if let Some(out) = &study.out {
        for path in calib_study::write(&result, out).map_err(failed)? {
            eprintln!("wrote {}", path.display());
        }
    }
    Ok(ExitCode::Accepted)
}

fn calibrate(arguments: &Arguments, options: &Run) -> Result<ExitCode, PipelineError> {
    let out = options
        .out
        .clone()
        .unwrap_or_else(|| default_folder(&options.profile));
    let bar = progress_bar(arguments.quiet);
    let mut progress = |stage: &str| {
        bar.set_message(stage.to_owned());
        if arguments.verbose {
            eprintln!("calib: {stage}");
        }
    };
    if options.compare_models {
        let mut began = Instant::now();
        let mut report = |stage: &str, done: usize, all: usize| {
            if done == 0 {
                began = Instant::now();
            }
            progress(&with_remaining(stage, done, all, began.elapsed()));
        };
        let ranked = models::compare_models(&options.profile, options.force, &mut report)?;
        bar.finish_and_clear();
        emit(&if options.json {
            models::json(&ranked)
        } else {
            models::table(&ranked)
        });
        return Ok(ExitCode::Accepted);
    }
    let run_options = RunOptions {
        method: options.method.map(|m| match m {
            MethodName::Paper => calib_profile::raw::RawMethod::Paper,
            MethodName::Ml => calib_profile::raw::RawMethod::Ml,
        }),
        force: options.force,
        no_plugins: options.no_plugins,
    };
    let output = run_profile(&options.profile, &run_options, &mut progress)?;
    progress("write results");
    let written = write::write_all(&out, &output.files)?;
    bar.finish_and_clear();
    if options.json {
        emit(&inspect::report_json(&output.report)?);
    } else {
        let colour = std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none();
        emit(&inspect::summary(&output.report, colour));
        if !arguments.quiet {
            // Their names stand in the summary.
            let results = written
                .iter()
                .filter(|p| p.file_name().is_some_and(|n| n != write::MANIFEST));
            emit(&format!(
                "wrote {} files to {}\n",
                results.count(),
                out.display()
            ));
        }
    }
    Ok(output.exit)
}

fn default_folder(profile: &Path) -> PathBuf {
    let name = profile
        .file_stem()
        .map_or_else(|| "profile".into(), std::ffi::OsStr::to_os_string);
    PathBuf::from("results").join(name)
}

/// A bar of bytes on a terminal, nothing elsewhere.
fn byte_bar(quiet: bool) -> ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {bytes}/{total_bytes}, {eta} left") {
        bar.set_style(style);
    }
    bar
}

/// A spinner on a terminal, nothing elsewhere.
fn progress_bar(quiet: bool) -> ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} ({elapsed})") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}
