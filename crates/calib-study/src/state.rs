//! The state file of a study: one line for its settings, one for each finished scene.
//!
//! Lines are appended as scenes finish, in any order; a half-written last line is dropped when the study is resumed.
//! At the end the file is rewritten in the order of the plan: an interrupted study leaves the same bytes as an undisturbed one.

use std::collections::BTreeMap;

use calib_files::{FileError, StateFile};
use serde::{Deserialize, Serialize};

use crate::{
    cell::Cell,
    settings::{Study, StudyError, StudyOptions},
    tried::Tried,
};

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Header {
    calib_study: u32,
    version: String,
    study: Study,
    trials: u64,
    seed: u64,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    plugins: Vec<String>,
}

#[derive(Serialize, Deserialize)]
struct Line<C> {
    scene: String,
    cells: C,
}

/// Finished scenes, in memory and in the file where there is one.
pub(crate) struct State {
    finished: BTreeMap<String, Vec<Cell>>,
    file: Option<StateFile>,
}

impl State {
    pub fn open(study: Study, tried: &Tried, options: &StudyOptions) -> Result<Self, StudyError> {
        // The file of a part of the scenes would pass for the file of all.
        let Some(folder) = options.out.as_ref().filter(|_| options.only.is_empty()) else {
            return Ok(Self {
                finished: BTreeMap::new(),
                file: None,
            });
        };
        let header = Header {
            calib_study: 1,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            study,
            trials: options.trials,
            seed: options.seed,
            plugins: tried.names(),
        };
        let path = folder.join(format!("{}.state.jsonl", study.word()));
        let settings = serde_json::to_string(&header)?;
        let opened = StateFile::open(&path, &settings, options.resume, |l| parsed(l).is_some());
        let (file, lines) = opened.map_err(|error| match error {
            FileError::OtherState { path, found, .. } => StudyError::OtherState {
                path,
                found: serde_json::from_str::<Header>(&found)
                    .map_or_else(|_| "no settings of a study".to_owned(), |h| h.words()),
                expected: header.words(),
            },
            other => other.into(),
        })?;
        let finished = lines.iter().filter_map(|l| parsed(l));
        Ok(Self {
            finished: finished.map(|l| (l.scene, l.cells)).collect(),
            file: Some(file),
        })
    }

    pub fn finished(&self, scene: &str) -> Option<Vec<Cell>> {
        self.finished.get(scene).cloned()
    }

    pub fn append(&mut self, scene: &str, cells: &[Cell]) -> Result<(), StudyError> {
        if let Some(file) = &mut self.file {
            file.append(&line(scene, cells)?)?;
        }
        Ok(())
    }

    /// Writes all scenes in the order of the plan.
    pub fn close(&mut self, order: &[String], cells: &[Vec<Cell>]) -> Result<(), StudyError> {
        let Some(file) = self.file.take() else {
            return Ok(());
        };
        let all = order.iter().zip(cells);
        let lines: Vec<String> = all
            .map(|(scene, cells)| line(scene, cells))
            .collect::<Result<_, _>>()?;
        Ok(file.close(&lines)?)
    }
}

/// A finished scene; `None` for a line that was being written when the study was interrupted.
fn parsed(line: &str) -> Option<Line<Vec<Cell>>> {
    serde_json::from_str(line).ok()
}

impl Header {
    fn words(&self) -> String {
        let with = match self.plugins.as_slice() {
            [] => String::new(),
            names => format!(" and {}", names.join(", ")),
        };
        format!(
            "`{}` with {} trials, seed {}{with} (version {})",
            self.study.word(),
            self.trials,
            self.seed,
            self.version
        )
    }
}

fn line(scene: &str, cells: &[Cell]) -> Result<String, StudyError> {
    let scene = scene.to_owned();
    Ok(serde_json::to_string(&Line { scene, cells })?)
}
