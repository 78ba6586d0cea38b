//! `calib revert`.

use std::path::PathBuf;

use calib_pipeline::ExitCode;
use clap::Args;

use crate::error::CliError;
use crate::terminal::{Console, emit_paths, say, say_note};

/// Arguments of `calib revert`.
#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("destination").required(true).args(["out", "in_place"])))]
pub struct Revert {
    /// The changed file, with its change record `<file>.changes.json` beside it
    file: PathBuf,
    /// Where to write the original
    #[arg(short, long)]
    out: Option<PathBuf>,
    /// Overwrite the changed file and remove the record
    #[arg(long)]
    in_place: bool,
}

/// Restores the original.
pub fn run(console: &Console, options: &Revert) -> Result<ExitCode, CliError> {
    let written = match &options.out {
        Some(out) => calib_apply::revert(&options.file, out)?,
        None => calib_apply::revert_in_place(&options.file)?,
    };
    for note in calib_apply::not_reverted(&options.file) {
        match console.json {
            true => say_note(console, &note),
            false => say(&format!("note: {note}")),
        }
    }
    emit_paths(console.json, &[written])?;
    Ok(ExitCode::Accepted)
}

#[cfg(test)]
mod tests {
    use super::Revert;
    use clap::{Args as _, Command};

    #[test]
    fn both_destinations_are_named_where_none_is_given() {
        let parsed = |arguments: &[&str]| {
            let command = Revert::augment_args(Command::new("revert"));
            let refused = command.try_get_matches_from(arguments).map(|_| ());
            refused.map_err(|error| error.to_string())
        };
        let said = parsed(&["revert", "arm.urdf"]).expect_err("no destination");
        assert!(
            said.contains("--out <OUT>") && said.contains("--in-place"),
            "{said}"
        );
        assert!(parsed(&["revert", "arm.urdf", "--in-place"]).is_ok());
        assert!(parsed(&["revert", "arm.urdf", "--out", "o.urdf"]).is_ok());
        assert!(parsed(&["revert", "arm.urdf", "--in-place", "--out", "o.urdf"]).is_err());
    }
}
