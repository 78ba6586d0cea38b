//! `calib man`.

use std::io;
use std::path::PathBuf;

use calib_files::{FileError, OutputFile, write_results};
use calib_pipeline::ExitCode;
use clap::{Args, Command};
use clap_mangen::Man;

use crate::error::CliError;
use crate::terminal::{Console, emit, emit_paths};

/// Arguments of `calib man`.
#[derive(Debug, Args)]
pub struct ManPages {
    /// Folder to write one page for each command to [default: prints the page of calib itself]
    #[arg(short, long)]
    out: Option<PathBuf>,
}

/// Prints the program's manual page, or writes the pages of all commands.
pub fn run(
    console: &Console,
    options: &ManPages,
    mut command: Command,
) -> Result<ExitCode, CliError> {
    command = command.disable_help_subcommand(true);
    command.build();
    let pages = pages(&command).map_err(|source| FileError::Write {
        path: options.out.clone().unwrap_or_default(),
        source,
    })?;
    match &options.out {
        Some(out) => emit_paths(console.json, &write_results(out, &pages)?)?,
        None => {
            let page = String::from_utf8_lossy(&pages[0].bytes);
            emit(&if console.json {
                format!(
                    "{}\n",
                    serde_json::json!({"name": pages[0].name, "page": page})
                )
            } else {
                page.into_owned()
            })?;
        }
    }
    Ok(ExitCode::Accepted)
}

/// The pages of a command and of those below it, `calib.1` first.
fn pages(command: &Command) -> io::Result<Vec<OutputFile>> {
    let man = Man::new(command.clone());
    let mut bytes = Vec::new();
    man.render(&mut bytes)?;
    let mut found = vec![OutputFile {
        name: man.get_filename(),
        bytes,
    }];
    let below = command.get_subcommands().filter(|c| !c.is_hide_set());
    for command in below {
        found.extend(pages(command)?);
    }
    Ok(found)
}
