//! Finished robots on disk: one line of JSON each, below a line with the settings.

use std::collections::BTreeMap;

use calib_files::StateFile;

use super::{CaseError, RobotResult, Units};

pub(super) struct State {
    file: Option<StateFile>,
    finished: BTreeMap<u64, Vec<RobotResult>>,
}

impl State {
    pub fn open(units: &Units<'_>) -> Result<Self, CaseError> {
        let options = units.options;
        let Some(folder) = &options.out else {
            return Ok(Self {
                file: None,
                finished: BTreeMap::new(),
            });
        };
        let settings = units.settings()?;
        let path = folder.join(format!("{}.state.jsonl", options.name));
        let (file, lines) =
            StateFile::open(&path, &settings, options.resume, |l| both(l).is_some())?;
        let finished = lines.iter().filter_map(|l| both(l));
        Ok(Self {
            file: Some(file),
            finished: finished
                .filter_map(|both| Some((both.first()?.seed, both)))
                .collect(),
        })
    }

    pub fn finished(&self, seed: u64) -> Option<Vec<RobotResult>> {
        self.finished.get(&seed).cloned()
    }

    pub fn append(&mut self, both: &[RobotResult]) -> Result<(), CaseError> {
        if let Some(file) = &mut self.file {
            file.append(&serde_json::to_string(both)?)?;
        }
        Ok(())
    }
}

/// The results of one robot by both methods; `None` for a line that was cut off by an interruption.
fn both(line: &str) -> Option<Vec<RobotResult>> {
    serde_json::from_str(line).ok()
}
