//! `--profile` and `--recording`: a table that is written like a recording of a profile.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use calib_export::WrittenLike;
use calib_pipeline::prepare::robot::read_profile;
use calib_profile::raw::RawRecording;
use calib_recording::ColumnMap;
use clap::Args;

use crate::error::CliError;

/// Where the column map of a table is.
#[derive(Debug, Clone, Default, Args)]
pub struct Like {
    /// Profile that has a column map (`columns`) for tables like this one
    #[arg(long, value_name = "PROFILE")]
    profile: Option<PathBuf>,
    /// Recording of that profile whose column map it is [default: the one with this file, or the only map]
    #[arg(long, value_name = "NAME", requires = "profile")]
    recording: Option<String>,
}

impl Like {
    /// How a table is written; `of_robot`: it holds joints, as the robot's own log does.
    ///
    /// # Errors
    /// [`CliError`] for a profile that cannot be read, and for one that has no such recording, no map, or several.
    pub(super) fn written(&self, table: &Path, of_robot: bool) -> Result<WrittenLike, CliError> {
        let Some(path) = &self.profile else {
            return Ok(WrittenLike::default());
        };
        let (profile, _) = read_profile(path)?;
        let none = |finding: String, remedy: &'static str| CliError::NoColumnMap {
            file: path.display().to_string(),
            finding,
            remedy,
        };
        let all = &profile.recordings;
        let meant: Vec<&RawRecording> = match &self.recording {
            Some(name) => match all.get(name) {
                Some(recording) => vec![recording],
                None => {
                    let names: Vec<&str> = all.keys().map(String::as_str).collect();
                    let names = names.join(", ");
                    let finding = format!("there is no recording `{name}`; there are {names}");
                    return Err(none(finding, "name one of them"));
                }
            },
            None => match all.values().find(|recording| is_of(recording, table)) {
                Some(recording) => vec![recording],
                None => all.values().filter(|r| !maps(r, true).is_empty()).collect(),
            },
        };
        let mut found: Vec<WrittenLike> = Vec::new();
        for recording in meant {
            let written = WrittenLike {
                columns: maps(recording, of_robot).into_iter().cloned().collect(),
                held: held(recording),
            };
            if !found.contains(&written) {
                found.push(written);
            }
        }
        match found.as_slice() {
            [one] if !(one.columns.is_empty() && one.held.is_empty()) => Ok(one.clone()),
            [] | [_] => {
                let finding = match &self.recording {
                    Some(name) => format!("recording `{name}` has no column map (`columns`)"),
                    None => "no recording has a column map (`columns`)".to_owned(),
                };
                Err(none(
                    finding,
                    "leave out `--profile`, or name a recording that has one",
                ))
            }
            several => Err(none(
                format!(
                    "its recordings have {} different column maps or joints that they hold",
                    several.len()
                ),
                "name the recording that this table is written like: `--recording NAME`",
            )),
        }
    }
}

/// Whether a table has the file's name of a recording, or of its robot's log.
fn is_of(recording: &RawRecording, table: &Path) -> bool {
    let log = recording.robot_log.as_ref().map(|log| &log.file);
    let mut files = log.into_iter().chain([&recording.file]);
    table.file_name().is_some() && files.any(|f| Path::new(f).file_name() == table.file_name())
}

/// The column maps of a recording: where `of_robot`, that of the robot's log first.
fn maps(recording: &RawRecording, of_robot: bool) -> Vec<&ColumnMap> {
    let log = recording.robot_log.as_ref();
    let log = log.and_then(|log| log.columns.as_ref());
    let own = recording.columns.as_ref();
    let both = match of_robot {
        true => [log, own],
        false => [own, log],
    };
    both.into_iter().flatten().collect()
}

/// Joints that the table does not list and that stood still, rad or m.
fn held(recording: &RawRecording) -> BTreeMap<String, f64> {
    let joint = |(key, value): (&String, &f64)| {
        let (joint, unit) = key.rsplit_once('_')?;
        let si = match unit {
            "deg" => value.to_radians(),
            "mm" => 1e-3 * value,
            "rad" | "m" => *value,
            _ => return None,
        };
        Some((joint.to_owned(), si))
    };
    recording.hold.iter().filter_map(joint).collect()
}
