//! Finished trials on disk: one line of JSON each, below a line with the settings.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use calib_files::{FileError, StateFile};
use serde::{Deserialize, Serialize};

use crate::error::TwinError;
use crate::trial::{Injected, Trial};
use crate::words;

/// Name of the file of finished trials.
pub const STATE: &str = "twin.state.jsonl";

/// What must be the same for trials to be kept. The number of trials is not: more trials go on from fewer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Version of the lines: 1.
    pub calib_twin: u32,
    /// Version of the program.
    pub version: String,
    /// SHA-256 of everything that the session was read from, by name.
    pub inputs: BTreeMap<String, String>,
    /// Seed.
    pub seed: u64,
    /// Where true robots are drawn, and what the noise is multiplied by.
    pub how: String,
}

impl Settings {
    /// What differs from the settings of a file's first line.
    fn unlike(&self, found: &str) -> Vec<String> {
        let Ok(other) = serde_json::from_str::<Self>(found) else {
            return vec![words::VERSION.to_owned()];
        };
        let names: BTreeSet<&String> = self.inputs.keys().chain(other.inputs.keys()).collect();
        let differs = |name: &&String| self.inputs.get(*name) != other.inputs.get(*name);
        let mut what: Vec<String> = names.into_iter().filter(differs).cloned().collect();
        let same = [
            (self.seed == other.seed, words::SEED),
            (self.how == other.how, words::HOW),
            (self.version == other.version, words::VERSION),
        ];
        what.extend(same.iter().filter(|s| !s.0).map(|s| s.1.to_owned()));
        what
    }
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Trial(Box<Trial>),
    Injected(Injected),
}

/// Finished trials, in memory and in the file where there is one.
#[derive(Debug)]
pub struct State {
    file: Option<StateFile>,
    trials: BTreeMap<u64, Trial>,
    injected: BTreeMap<u64, Injected>,
}

impl State {
    /// Opens the file in a folder; without a folder nothing is kept.
    ///
    /// # Errors
    /// [`TwinError::State`] where it has other settings, or cannot be written.
    pub fn open(
        folder: Option<&Path>,
        settings: &Settings,
        resume: bool,
    ) -> Result<Self, TwinError> {
        let mut state = Self {
            file: None,
            trials: BTreeMap::new(),
            injected: BTreeMap::new(),
        };
        let Some(folder) = folder else {
            return Ok(state);
        };
        let text = serde_json::to_string(settings)?;
        let is_whole = |line: &str| serde_json::from_str::<Line>(line).is_ok();
        let opened = StateFile::open(&folder.join(STATE), &text, resume, is_whole);
        let (file, lines) = opened.map_err(|error| match error {
            FileError::OtherState { path, found, .. } => TwinError::OtherSession {
                file: path.display().to_string(),
                what: settings.unlike(&found),
            },
            error => error.into(),
        })?;
        state.file = Some(file);
        for line in lines.iter().filter_map(|l| serde_json::from_str(l).ok()) {
            match line {
                Line::Trial(trial) => {
                    state.trials.insert(trial.number, *trial);
                }
                Line::Injected(injected) => {
                    state.injected.insert(injected.number, injected);
                }
            }
        }
        Ok(state)
    }

    /// Takes trials that were made elsewhere for finished ones.
    pub fn take(&mut self, trials: Vec<Trial>) {
        let numbered = trials.into_iter().map(|trial| (trial.number, trial));
        self.trials.extend(numbered);
    }

    /// A trial that is finished.
    #[must_use]
    pub fn trial(&self, number: u64) -> Option<Trial> {
        self.trials.get(&number).cloned()
    }

    /// A trial with this fault that is finished.
    #[must_use]
    pub fn injected(&self, number: u64, what: &str, size: f64) -> Option<Injected> {
        let found = self.injected.get(&number)?;
        (found.what == what && found.size == size).then(|| found.clone())
    }

    /// Keeps a trial.
    ///
    /// # Errors
    /// [`TwinError::State`].
    pub fn append(&mut self, trial: &Trial) -> Result<(), TwinError> {
        self.line(&Line::Trial(Box::new(trial.clone())))
    }

    /// Keeps a trial with a fault.
    ///
    /// # Errors
    /// [`TwinError::State`].
    pub fn append_injected(&mut self, injected: &Injected) -> Result<(), TwinError> {
        self.line(&Line::Injected(injected.clone()))
    }

    fn line(&mut self, line: &Line) -> Result<(), TwinError> {
        if let Some(file) = &mut self.file {
            file.append(&serde_json::to_string(line)?)?;
        }
        Ok(())
    }

    /// Writes all lines in order: an interrupted twin leaves the same bytes as one that was not interrupted.
    ///
    /// # Errors
    /// [`TwinError::State`].
    pub fn close(self, trials: &[Trial], injected: &[Injected]) -> Result<(), TwinError> {
        let Some(file) = self.file else {
            return Ok(());
        };
        let of_trials = trials.iter().map(|t| Line::Trial(Box::new(t.clone())));
        let all = of_trials.chain(injected.iter().cloned().map(Line::Injected));
        let lines: Result<Vec<String>, _> = all.map(|l| serde_json::to_string(&l)).collect();
        Ok(file.close(&lines?)?)
    }
}
