//! `calib.run`, and the program itself.

use std::ffi::OsString;
use std::path::PathBuf;

use calib_cli::CliError;
use calib_files::{OutputFile, ResultsFolder};
use calib_pipeline::run::{Plugins, RunOptions, run as run_profile};
use calib_profile::Method;
use calib_report::plots::plots;
use calib_report::{Report, picture};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::background::waited;
use crate::error::misused;
use crate::plugins::own_entries;

/// `calib`'s command line: `argv` begins with the program's name; the exit code.
#[pyfunction]
pub(crate) fn main(py: Python<'_>, argv: Vec<OsString>) -> u8 {
    py.detach(|| calib_cli::run(&argv))
}

/// Which plugins of the profile are loaded.
pub(crate) fn plugins_by(py: Python<'_>, name: &str) -> PyResult<Plugins> {
    match name {
        "refused" => Ok(Plugins::Refused),
        "placed" => Ok(Plugins::Placed),
        "allowed" => Ok(Plugins::Allowed),
        other => {
            let text = format!("plugins: found {other}; expected refused, placed or allowed");
            Err(misused(py, &text))
        }
    }
}

/// Calibrates; `(exit code, {file name: bytes})`. Files are written where `out` is given.
#[pyfunction]
pub(crate) fn run<'py>(
    py: Python<'py>,
    profile: PathBuf,
    options: &Bound<'py, PyDict>,
    out: Option<PathBuf>,
    own: Vec<Py<PyAny>>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<(u8, Bound<'py, PyDict>)> {
    let mut with = RunOptions {
        own: own_entries(py, own)?,
        ..RunOptions::default()
    };
    for (key, value) in options {
        match key.extract::<String>()?.as_str() {
            "method" => {
                with.method = match value.extract::<Option<String>>()?.as_deref() {
                    None => None,
                    Some("paper") => Some(Method::Paper),
                    Some("ml") => Some(Method::Ml),
                    Some(other) => {
                        let text = format!("method: found {other}; expected paper or ml");
                        return Err(misused(py, &text));
                    }
                }
            }
            "force" => with.force = value.extract()?,
            "strict" => with.strict = value.extract()?,
            "select" => with.select = value.extract()?,
            "plugins" => with.plugins = plugins_by(py, &value.extract::<String>()?)?,
            other => return Err(misused(py, &format!("there is no option {other}"))),
        }
    }
    let (exit, files) = waited(py, progress.as_ref(), move |teller| {
        let folder = out.as_deref().map(ResultsFolder::open).transpose()?;
        let output = run_profile(&profile, &with, &mut |stage| teller.stage(stage))?;
        // The last place where an interrupt is heard: what is begun here is written whole.
        teller.stage("write results");
        if let Some(folder) = folder {
            folder.write(&output.files)?;
        }
        Ok::<_, CliError>((output.exit as u8, output.files))
    })?;
    Ok((exit, named(py, &files)?))
}

/// The figures of a report by their ids: title, description and SVG.
#[pyfunction]
pub(crate) fn figures(
    py: Python<'_>,
    report_json: &[u8],
) -> PyResult<Vec<(String, String, String, String)>> {
    let report: Report = serde_json::from_slice(report_json)
        .map_err(|e| misused(py, &format!("report.json: {e}")))?;
    let drawn = plots(&report).into_iter().map(|plot| {
        let svg = picture(&plot);
        (plot.id, plot.title, plot.description, svg)
    });
    Ok(drawn.collect())
}

/// Files by their names.
pub(crate) fn named<'py>(py: Python<'py>, files: &[OutputFile]) -> PyResult<Bound<'py, PyDict>> {
    let by_name = PyDict::new(py);
    for file in files {
        by_name.set_item(&file.name, PyBytes::new(py, &file.bytes))?;
    }
    Ok(by_name)
}
