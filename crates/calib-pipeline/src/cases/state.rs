//! Finished robots on disk: one line of JSON each, below a line with the settings.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{CaseOptions, RobotResult, usage};
use crate::error::PipelineError;
use crate::prepare::load::RobotProfile;

/// What must be the same for robots to be kept. The number of robots is not: a longer study continues a shorter one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Settings {
    calib_case_study: u32,
    study: String,
    /// Digests of profile and robot description.
    inputs: Vec<String>,
    version: String,
}

pub(super) struct State {
    file: Option<(PathBuf, File)>,
    finished: BTreeMap<u64, Vec<RobotResult>>,
}

impl State {
    pub fn open(options: &CaseOptions, robot: &RobotProfile) -> Result<Self, PipelineError> {
        let Some(folder) = &options.out else {
            return Ok(Self {
                file: None,
                finished: BTreeMap::new(),
            });
        };
        let settings = Settings {
            calib_case_study: 1,
            study: options.name.clone(),
            inputs: robot.digests.iter().map(|d| d.sha256.clone()).collect(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        let path = folder.join(format!("{}.state.jsonl", options.name));
        let failed = |action: &str, e: &dyn std::fmt::Display| {
            usage(
                &format!("{}: cannot {action}: {e}", path.display()),
                "choose another folder with --out, or begin anew with --restart",
            )
        };
        std::fs::create_dir_all(folder).map_err(|e| failed("make its folder", &e))?;
        let mut finished: BTreeMap<u64, Vec<RobotResult>> = BTreeMap::new();
        if options.resume && path.exists() {
            let text = std::fs::read_to_string(&path).map_err(|e| failed("read", &e))?;
            let mut lines = text.lines();
            let found: Option<Settings> = lines
                .next()
                .and_then(|line| serde_json::from_str(line).ok());
            if found.as_ref() != Some(&settings) {
                return Err(failed(
                    "continue",
                    &"it belongs to another robot or version",
                ));
            }
            // A line that was cut off by the interruption is done again.
            for both in lines.filter_map(|l| serde_json::from_str::<Vec<RobotResult>>(l).ok()) {
                if let Some(first) = both.first() {
                    finished.insert(first.seed, both);
                }
            }
        }
        let mut file = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(true)
            .open(&path)
            .map_err(|e| failed("write", &e))?;
        let mut text = line(&settings)?;
        for both in finished.values() {
            text.push_str(&line(both)?);
        }
        file.write_all(text.as_bytes())
            .map_err(|e| failed("write", &e))?;
        Ok(Self {
            file: Some((path, file)),
            finished,
        })
    }

    pub fn finished(&self, seed: u64) -> Option<Vec<RobotResult>> {
        self.finished.get(&seed).cloned()
    }

    pub fn append(&mut self, both: &[RobotResult]) -> Result<(), PipelineError> {
        let Some((path, file)) = &mut self.file else {
            return Ok(());
        };
        file.write_all(line(&both)?.as_bytes()).map_err(|e| {
            usage(
                &format!("{}: cannot write: {e}", path.display()),
                "make room, or choose another folder with --out",
            )
        })
    }
}

fn line(value: &impl Serialize) -> Result<String, PipelineError> {
    let mut text = serde_json::to_string(value).map_err(|e| {
        usage(
            &format!("a result cannot be written: {e}"),
            "report this as a defect",
        )
    })?;
    text.push('\n');
    Ok(text)
}
