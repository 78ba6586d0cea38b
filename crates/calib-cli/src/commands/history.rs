//! `calib history`.

use std::path::PathBuf;

use calib_files::{OutputFile, folder_of, write_new};
use calib_pipeline::ExitCode;
use clap::Args;

use crate::error::CliError;
use crate::terminal::{Console, emit, emit_written, look};

/// Arguments of `calib history`.
#[derive(Debug, Args)]
pub struct History {
    /// Results of the calibrations: folders or report.json
    #[arg(required = true)]
    results: Vec<PathBuf>,
    /// Also write a page with a picture of each quantity, which must not exist
    #[arg(short, long, value_name = "FILE.html")]
    out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Shows a robot's quantities over time.
pub fn run(console: &Console, options: &History) -> Result<ExitCode, CliError> {
    let history = calib_drift::history(&options.results)?;
    emit(&if options.json || console.json {
        calib_drift::history_json(&history)?
    } else {
        calib_drift::history_text(&history, look(console.color).columns)
    })?;
    if let Some(out) = &options.out {
        let name = out.file_name().unwrap_or_default().to_string_lossy();
        let page = calib_drift::history_page(&history);
        write_new(folder_of(out), &[OutputFile::text(name, page)])?;
        let console = Console {
            json: options.json || console.json,
            ..*console
        };
        emit_written(&console, out);
    }
    Ok(ExitCode::Accepted)
}
