//! Finished cases on disk: one line of JSON each, below a line with the settings.

use std::collections::BTreeMap;

use calib_files::StateFile;
use serde::{Deserialize, Serialize};

use super::case::Cell;
use super::outcome::CaseResult;
use super::settings::FaultOptions;
use crate::settings::StudyError;

/// What must be the same for cases to be kept. The number of cases is not: a longer study continues a shorter one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Settings {
    calib_fault_study: u32,
    seed: u64,
    version: String,
}

pub(super) struct State {
    file: Option<StateFile>,
    finished: BTreeMap<(Cell, u64), CaseResult>,
}

impl State {
    pub fn open(options: &FaultOptions) -> Result<Self, StudyError> {
        let Some(folder) = &options.out else {
            return Ok(Self {
                file: None,
                finished: BTreeMap::new(),
            });
        };
        let settings = serde_json::to_string(&Settings {
            calib_fault_study: 3,
            seed: options.seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        })?;
        let path = folder.join("faults.state.jsonl");
        let (file, lines) =
            StateFile::open(&path, &settings, options.resume, |l| case(l).is_some())?;
        let finished = lines.iter().filter_map(|l| case(l));
        Ok(Self {
            file: Some(file),
            finished: finished.map(|c| ((c.cell, c.number), c)).collect(),
        })
    }

    pub fn finished(&self, cell: Cell, number: u64) -> Option<CaseResult> {
        self.finished.get(&(cell, number)).cloned()
    }

    pub fn append(&mut self, result: &CaseResult) -> Result<(), StudyError> {
        if let Some(file) = &mut self.file {
            file.append(&serde_json::to_string(result)?)?;
        }
        Ok(())
    }

    /// Writes all cases in the order of the matrix.
    pub fn close(&mut self, results: &[CaseResult]) -> Result<(), StudyError> {
        let Some(file) = self.file.take() else {
            return Ok(());
        };
        let lines: Vec<String> = results
            .iter()
            .map(serde_json::to_string)
            .collect::<Result<_, _>>()?;
        Ok(file.close(&lines)?)
    }
}

/// A finished case; `None` for a line that was cut off by an interruption.
fn case(line: &str) -> Option<CaseResult> {
    serde_json::from_str(line).ok()
}
