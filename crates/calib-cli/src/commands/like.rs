//! `--profile` and `--recording`: a table that is written like a recording of a profile.

use std::path::{Path, PathBuf};

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
    /// The column map of a table; `of_robot`: it holds joints, as the robot's own log does.
    ///
    /// # Errors
    /// [`CliError`] for a profile that cannot be read, and for one that has no such recording, no map, or several.
    pub(super) fn map(&self, table: &Path, of_robot: bool) -> Result<Option<ColumnMap>, CliError> {
        let Some(path) = &self.profile else {
            return Ok(None);
        };
        let shown = path.display().to_string();
        let (profile, _) = read_profile(path)?;
        let none = |finding: String, remedy: &'static str| CliError::NoColumnMap {
            file: shown.clone(),
            finding,
            remedy,
        };
        if let Some(name) = &self.recording {
            let Some(recording) = profile.recordings.get(name) else {
                let names: Vec<&str> = profile.recordings.keys().map(String::as_str).collect();
                let finding = format!(
                    "there is no recording `{name}`; there are {}",
                    names.join(", ")
                );
                return Err(none(finding, "name one of them"));
            };
            let map = maps(recording, of_robot).into_iter().next();
            let map = map.map(|(_, map)| Some(map.clone()));
            let finding = || format!("recording `{name}` has no column map (`columns`)");
            return map.ok_or_else(|| {
                none(
                    finding(),
                    "leave out `--profile`, or name a recording that has one",
                )
            });
        }
        let all: Vec<(&str, &ColumnMap)> = profile
            .recordings
            .values()
            .flat_map(|recording| maps(recording, of_robot))
            .collect();
        let own = all.iter().find(|(file, _)| {
            Path::new(file).file_name().is_some()
                && Path::new(file).file_name() == table.file_name()
        });
        let mut different: Vec<&ColumnMap> = Vec::new();
        for (_, map) in &all {
            if !different.contains(map) {
                different.push(map);
            }
        }
        match (own, different.as_slice()) {
            (Some((_, map)), _) => Ok(Some((*map).clone())),
            (None, [map]) => Ok(Some((*map).clone())),
            (None, []) => Err(none(
                "no recording has a column map (`columns`)".to_owned(),
                "leave out `--profile`",
            )),
            (None, maps) => Err(none(
                format!("its recordings have {} different column maps", maps.len()),
                "name the recording that this table is written like: `--recording NAME`",
            )),
        }
    }
}

/// The column maps of a recording with their files: where `of_robot`, that of the robot's log first.
fn maps(recording: &RawRecording, of_robot: bool) -> Vec<(&str, &ColumnMap)> {
    let log = recording.robot_log.as_ref();
    let log = log.and_then(|log| Some((log.file.as_str(), log.columns.as_ref()?)));
    let own = recording.columns.as_ref();
    let own = own.map(|map| (recording.file.as_str(), map));
    let both = match of_robot {
        true => [log, own],
        false => [own, log],
    };
    both.into_iter().flatten().collect()
}
