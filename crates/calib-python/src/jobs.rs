//! `calib.simulate`, `calib.plan` and `calib.twin`.

use std::path::{Path, PathBuf};

use calib_cli::CliError;
use calib_pipeline::prepare::load::load_robot;
use calib_plan::{Goal, Known};
use calib_twin::{About, profile_of, session};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::background::waited;
use crate::error::misused;
use crate::recording::plain;
use crate::run::{named, plugins_by};
use crate::table::as_recording;

/// Recordings by name, and the truth as JSON.
#[pyfunction]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    profile: PathBuf,
    seed: Option<u64>,
) -> PyResult<(Bound<'py, PyDict>, String)> {
    let (recordings, truth) = waited(py, None, move |_| {
        let robot = load_robot(&profile)?;
        let simulated = calib_sim::simulate(&robot.profile, &robot.model, seed);
        let simulated = simulated.map_err(|source| CliError::Simulation {
            file: robot.file.clone(),
            source: Box::new(source),
        })?;
        let truth = serde_json::to_string(&simulated.truth).map_err(|source| CliError::Json {
            what: "the truth",
            source,
            remedy: "check the numbers of the `simulate` section",
        })?;
        Ok::<_, CliError>((simulated.recordings, truth))
    })?;
    let by_name = PyDict::new(py);
    for (name, poses) in recordings {
        by_name.set_item(&name, plain(py, &as_recording(poses, &name, "simulated"))?)?;
    }
    Ok((by_name, truth))
}

/// What `calib plan --json` prints, and the files of the plan.
#[pyfunction]
pub(crate) fn plan<'py>(
    py: Python<'py>,
    profile: PathBuf,
    options: &Bound<'py, PyDict>,
    plugins: &str,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyBytes>, Bound<'py, PyDict>)> {
    let plugins = plugins_by(py, plugins)?;
    let mut asked = calib_plan::Options::default();
    for (key, value) in options {
        match key.extract::<String>()?.as_str() {
            "poses" => asked.poses = value.extract()?,
            "sigma_m" => asked.sigma = value.extract()?,
            "path_time_s" => asked.path_time = value.extract()?,
            "of" => asked.of = value.extract()?,
            "candidates" => asked.candidates = value.extract()?,
            "seed" => asked.seed = value.extract()?,
            "task" => asked.task = value.extract()?,
            "goal" => {
                asked.goal = match value.extract::<String>()?.as_str() {
                    "task" => Goal::Task,
                    "parameters" => Goal::Parameters,
                    "variances" => Goal::Variances,
                    "weakest" => Goal::Weakest,
                    other => {
                        let text = format!(
                            "goal: found {other}; expected task, parameters, variances or weakest"
                        );
                        return Err(misused(py, &text));
                    }
                }
            }
            other => return Err(misused(py, &format!("there is no option {other}"))),
        }
    }
    if let Some(sigma) = asked.sigma.filter(|s| !(*s > 0.0 && s.is_finite())) {
        return Err(misused(
            py,
            &format!("sigma_m is {sigma}; give a number above 0"),
        ));
    }
    let (json, files) = waited(py, progress.as_ref(), move |teller| {
        teller.stage("read profile and robot");
        let robot = load_robot(&profile)?;
        teller.stage("fit what is recorded already");
        let known = Known::of(robot, plugins)?;
        teller.stage("choose postures");
        let plan = calib_plan::plan(&known, &asked)?;
        let model = &known.robot.model;
        Ok::<_, CliError>((plan.json(model)?, plan.files(model, &known.robot.file)?))
    })?;
    Ok((PyBytes::new(py, json.as_bytes()), named(py, &files)?))
}

/// `twin.json` and `twin.html`.
#[pyfunction]
#[pyo3(signature = (of, options, truth, plugins, progress))]
pub(crate) fn twin<'py>(
    py: Python<'py>,
    of: PathBuf,
    options: &Bound<'py, PyDict>,
    truth: Option<&str>,
    plugins: &str,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let plugins = plugins_by(py, plugins)?;
    let about = match truth {
        None => None,
        Some("found") => Some(About::Found),
        Some("prior") => Some(About::Prior),
        Some(other) => {
            let text = format!("truth: found {other}; expected found or prior");
            return Err(misused(py, &text));
        }
    };
    let mut asked = calib_twin::Options::default();
    for (key, value) in options {
        match key.extract::<String>()?.as_str() {
            "trials" => asked.trials = value.extract()?,
            "seed" => asked.seed = value.extract()?,
            "noise_times" => asked.noise = value.extract()?,
            "sigma_m" => asked.sigma = value.extract()?,
            "threads" => asked.threads = value.extract()?,
            other => return Err(misused(py, &format!("there is no option {other}"))),
        }
    }
    for (name, value) in [("noise_times", Some(asked.noise)), ("sigma_m", asked.sigma)] {
        if let Some(value) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
            return Err(misused(
                py,
                &format!("{name} is {value}; give a number above 0"),
            ));
        }
    }
    let files = waited(py, progress.as_ref(), move |teller| {
        let profile = profile_of(Path::new(&of))?;
        let robot = load_robot(&profile)?;
        let (session, source) = session(robot, None, plugins, about)?;
        let count = |done, total| teller.count(done, total);
        let found = calib_twin::twin(&session, source, &asked, &count)?;
        Ok::<_, CliError>(calib_twin::write::files(&found)?)
    })?;
    named(py, &files)
}
