//! The state file of a study: one line for its settings, one for each finished scene.
//!
//! Lines are appended as scenes finish, in any order; a half-written last line is dropped when the study is resumed.
//! At the end the file is written anew in the order of the plan: an interrupted study leaves the same bytes as an undisturbed one.

use std::{
    collections::BTreeMap,
    fs::{self, File, OpenOptions},
    io::Write,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use crate::{
    cell::Cell,
    run::{Study, StudyError, StudyOptions},
};

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Header {
    calib_study: u32,
    version: String,
    study: Study,
    trials: u64,
    seed: u64,
}

#[derive(Serialize, Deserialize)]
struct Line<C> {
    scene: String,
    cells: C,
}

/// Finished scenes, in memory and in the file where there is one.
pub(crate) struct State {
    header: Header,
    finished: BTreeMap<String, Vec<Cell>>,
    file: Option<(PathBuf, File)>,
}

impl State {
    pub fn open(study: Study, options: &StudyOptions) -> Result<Self, StudyError> {
        let header = Header {
            calib_study: 1,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            study,
            trials: options.trials,
            seed: options.seed,
        };
        let mut state = Self {
            header,
            finished: BTreeMap::new(),
            file: None,
        };
        let Some(folder) = &options.out else {
            return Ok(state);
        };
        fs::create_dir_all(folder).map_err(failed(folder, "create the folder"))?;
        let path = folder.join(format!("{}.state.jsonl", study.word()));
        if options.resume && path.exists() {
            let text = fs::read_to_string(&path).map_err(failed(&path, "read"))?;
            state.finished = read(&text, &state.header, &path)?;
        }
        let kept: Vec<(&str, &Vec<Cell>)> = state
            .finished
            .iter()
            .map(|(k, v)| (k.as_str(), v))
            .collect();
        replace(&path, &state.header, &kept)?;
        let file = OpenOptions::new()
            .append(true)
            .open(&path)
            .map_err(failed(&path, "open"))?;
        state.file = Some((path, file));
        Ok(state)
    }

    pub fn finished(&self, scene: &str) -> Option<Vec<Cell>> {
        self.finished.get(scene).cloned()
    }

    pub fn append(&mut self, scene: &str, cells: &[Cell]) -> Result<(), StudyError> {
        if let Some((path, file)) = &mut self.file {
            let line = line(scene, cells, path)?;
            file.write_all(line.as_bytes())
                .map_err(failed(path, "append to it"))?;
        }
        Ok(())
    }

    /// Writes all scenes in the order of the plan.
    pub fn close(&mut self, order: &[String], cells: &[Vec<Cell>]) -> Result<(), StudyError> {
        match self.file.take() {
            Some((path, _)) => {
                let all: Vec<(&str, &Vec<Cell>)> =
                    order.iter().map(String::as_str).zip(cells).collect();
                replace(&path, &self.header, &all)
            }
            None => Ok(()),
        }
    }
}

fn read(
    text: &str,
    header: &Header,
    path: &Path,
) -> Result<BTreeMap<String, Vec<Cell>>, StudyError> {
    let mut lines = text.lines();
    let first = lines.next().unwrap_or_default();
    match serde_json::from_str::<Header>(first) {
        Ok(found) if found == *header => {}
        found => {
            return Err(StudyError::OtherState {
                path: path.to_owned(),
                found: found.map_or_else(|_| "no settings of a study".to_owned(), |h| h.words()),
                expected: header.words(),
            });
        }
    }
    // What does not parse was being written when the study was interrupted.
    Ok(lines
        .filter_map(|line| serde_json::from_str::<Line<Vec<Cell>>>(line).ok())
        .map(|line| (line.scene, line.cells))
        .collect())
}

impl Header {
    fn words(&self) -> String {
        format!(
            "`{}` with {} trials and seed {} (version {})",
            self.study.word(),
            self.trials,
            self.seed,
            self.version
        )
    }
}

fn line(scene: &str, cells: &[Cell], path: &Path) -> Result<String, StudyError> {
    let line = Line {
        scene: scene.to_owned(),
        cells,
    };
    let mut text = json(&line, path)?;
    text.push('\n');
    Ok(text)
}

fn json<T: Serialize>(value: &T, path: &Path) -> Result<String, StudyError> {
    serde_json::to_string(value).map_err(|e| failed(path, "write")(e.into()))
}

/// Written beside, then renamed: never half a file.
fn replace(path: &Path, header: &Header, scenes: &[(&str, &Vec<Cell>)]) -> Result<(), StudyError> {
    let mut text = json(header, path)?;
    text.push('\n');
    for (scene, cells) in scenes {
        text.push_str(&line(scene, cells, path)?);
    }
    write_whole(path, &text)
}

/// Writes a file beside its place and renames it.
pub(crate) fn write_whole(path: &Path, text: &str) -> Result<(), StudyError> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    let beside = PathBuf::from(beside);
    fs::write(&beside, text).map_err(failed(&beside, "write"))?;
    fs::rename(&beside, path).map_err(failed(path, "replace"))
}

/// Turns an I/O error into one that names the file.
pub(crate) fn failed(
    path: &Path,
    action: &'static str,
) -> impl FnOnce(std::io::Error) -> StudyError + use<> {
    let path = path.to_owned();
    move |source| StudyError::File {
        path,
        action,
        source,
    }
}
