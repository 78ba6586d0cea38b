//! A file that was given: its bytes, its column map where it needs one, and what the reader makes of it.

use std::collections::BTreeMap;

use calib_finding::{Fact, catalog};
use calib_recording::{BodyColumns, ColumnMap, ReadOptions, Recording, read_bytes};
use calib_urdf::RobotModel;

use crate::columns;
use crate::error::{InitError, NoRecording};
use crate::fact::About;
use crate::guess::Guess;
use crate::header::header;
use crate::instead::{HEAD, is_profile};

/// A file as the caller has it.
#[derive(Debug, Clone)]
pub struct File {
    /// As the caller named it, for messages and for the recording's name.
    pub shown: String,
    /// As the profile names it: relative to the profile.
    pub path: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// A file that was read.
#[derive(Debug, Clone)]
pub struct Source {
    /// The file.
    pub file: File,
    /// How to read it; `None`: by the readers' own rules.
    pub columns: Option<ColumnMap>,
    /// What it holds; joints that the robot does not have are left out.
    pub recording: Recording,
    /// What was found of its columns.
    pub facts: Vec<About>,
    /// Names of its columns or streams, for messages.
    pub names: Vec<String>,
    /// Bodies whose orientation may be read in other ways, by their names in the file.
    pub other_turns: BTreeMap<String, Vec<BodyColumns>>,
    /// The tracker's names of bodies and markers that the profile calls otherwise, by the profile's.
    renamed: BTreeMap<String, String>,
}

impl Source {
    /// Reads a file: by the readers' own rules where these give joints of this robot or a tracker's data, else by a map of its columns. `renamed`: the
    /// tracker's names of bodies and markers that the profile calls otherwise, by the profile's.
    ///
    /// # Errors
    /// [`InitError::NotARecording`] for a robot or a profile, [`InitError::Recording`] where neither reads it, or a name in it is taken.
    pub fn read(
        model: &RobotModel,
        file: &File,
        renamed: &BTreeMap<String, String>,
    ) -> Result<Self, InitError> {
        if let Some(found) = no_recording(&file.bytes) {
            return Err(InitError::NotARecording {
                file: file.shown.clone(),
                found,
            });
        }
        let own = read_bytes(&file.shown, &file.bytes, &of_robot(model));
        let table = header(&file.bytes);
        let guess = table.as_ref().map(|table| columns::guess(model, table));
        match (own, guess) {
            (Ok(recording), guess) if suffices(model, &recording, guess.as_ref()) => {
                let count = recording.joints.len();
                let mut facts = Vec::new();
                if count > 0 {
                    facts.push(About::JointsByName { count });
                }
                Self::new(model, file, None, recording, facts, renamed)
            }
            (_, Some(guess)) if !guess.joints.is_empty() || has_tracked(&guess.map) => {
                let recording = mapped(file, &guess.map)?;
                let facts = guess.facts;
                let read = Self::new(model, file, Some(guess.map), recording, facts, renamed)?;
                Ok(Self {
                    other_turns: guess.other_turns,
                    ..read
                })
            }
            (own, _) => Self::new(model, file, None, own?, Vec::new(), renamed),
        }
    }

    /// The readers' own rules find joints of this robot and what a tracker saw: nothing more is needed to read it. `label`: a column of texts.
    #[must_use]
    pub fn reads(model: &RobotModel, file: &File, label: Option<&String>) -> bool {
        let labeled = |label: &String| ColumnMap {
            labels: vec![label.clone()],
            ..ColumnMap::default()
        };
        let options = ReadOptions {
            columns: label.map(labeled),
            ..of_robot(model)
        };
        let own = read_bytes(&file.shown, &file.bytes, &options);
        own.is_ok_and(|recording| {
            let mut joints = recording.joints.iter();
            let tracked = recording.markers.len() + recording.bodies.len();
            joints.any(|s| model.joint_id(&s.name).is_ok()) && tracked > 0
        })
    }

    fn new(
        model: &RobotModel,
        file: &File,
        columns: Option<ColumnMap>,
        mut recording: Recording,
        facts: Vec<About>,
        renamed: &BTreeMap<String, String>,
    ) -> Result<Self, InitError> {
        recording.rename(renamed)?;
        let joints = recording.joints.iter().map(|s| &s.name);
        let markers = recording.markers.iter().map(|s| &s.name);
        let bodies = recording.bodies.iter().map(|s| &s.name);
        let mut names: Vec<String> = joints.chain(markers).chain(bodies).cloned().collect();
        if let (Some(_), Some(table)) = (&columns, header(&file.bytes)) {
            names = table.names;
        }
        recording.joints.retain(|s| model.joint_id(&s.name).is_ok());
        let mut facts = facts;
        facts.retain(|about| !matches!(about, About::LostByNumber { .. }));
        facts.extend(lost_by_number(&recording));
        Ok(Self {
            file: file.clone(),
            columns,
            recording,
            facts,
            names,
            other_turns: BTreeMap::new(),
            renamed: renamed.clone(),
        })
    }

    /// The same file by another map.
    ///
    /// # Errors
    /// As [`Source::read`].
    pub fn with_columns(&self, model: &RobotModel, columns: ColumnMap) -> Result<Self, InitError> {
        let recording = mapped(&self.file, &columns)?;
        let facts = self.facts.clone();
        let file = &self.file;
        let read = Self::new(model, file, Some(columns), recording, facts, &self.renamed)?;
        Ok(Self {
            other_turns: self.other_turns.clone(),
            ..read
        })
    }

    /// The error about columns that seem to hold times and could not be read.
    #[must_use]
    pub fn times_not_read(&self) -> Option<InitError> {
        let columns = self.facts.iter().find_map(|about| match about {
            About::Ignored { times, parts, .. } => {
                let parts = parts.iter().flat_map(|(whole, part)| [whole, part]);
                Some(times.iter().chain(parts).cloned().collect())
            }
            _ => None,
        });
        let columns: Vec<String> = columns.unwrap_or_default();
        (!columns.is_empty()).then(|| InitError::TimesNotRead {
            file: self.file.shown.clone(),
            columns,
        })
    }

    /// What the file calls a body or marker of the profile.
    #[must_use]
    pub fn name_in_file<'n>(&'n self, name: &'n str) -> &'n str {
        self.renamed.get(name).map_or(name, String::as_str)
    }

    /// It has joints of this robot.
    #[must_use]
    pub fn has_joints(&self) -> bool {
        !self.recording.joints.is_empty()
    }

    /// It has markers or bodies.
    #[must_use]
    pub fn has_tracked(&self) -> bool {
        !self.recording.markers.is_empty() || !self.recording.bodies.is_empty()
    }

    /// The file's name without folder and ending.
    #[must_use]
    pub fn stem(&self) -> &str {
        let name = self
            .file
            .path
            .rsplit(['/', '\\'])
            .next()
            .unwrap_or_default();
        name.split_once('.').map_or(name, |(stem, _)| stem)
    }
}

/// Whether some bytes are a robot or a profile.
fn no_recording(bytes: &[u8]) -> Option<NoRecording> {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(HEAD)]);
    let text = head.trim_start_matches('\u{feff}').trim_start();
    if text.starts_with('<') {
        return text.contains("<robot").then_some(NoRecording::Robot);
    }
    is_profile(text).then_some(NoRecording::Profile)
}

/// Numbers that the reader took for lost samples because they repeat.
fn lost_by_number(recording: &Recording) -> Vec<About> {
    let mut samples: BTreeMap<u64, usize> = BTreeMap::new();
    let findings = recording.meta.findings.iter();
    for finding in findings.filter(|f| f.id == catalog::PLACEHOLDER_TRIPLET) {
        if let Some(value) = finding.facts.get("value").and_then(Fact::value) {
            *samples.entry(value.to_bits()).or_default() += finding.rows.len();
        }
    }
    let of = |(value, samples)| About::LostByNumber {
        value: f64::from_bits(value),
        samples,
    };
    samples.into_iter().map(of).collect()
}

/// Columns `X_m`, `Y_m` and `Z_m` are those of a gantry's joints of these names.
fn of_robot(model: &RobotModel) -> ReadOptions {
    let joints = model.independent_joints();
    ReadOptions {
        joints: joints.map(|j| model.joint(j).name.clone()).collect(),
        ..ReadOptions::default()
    }
}

fn mapped(file: &File, map: &ColumnMap) -> Result<Recording, InitError> {
    let options = ReadOptions {
        columns: Some(map.clone()),
        ..ReadOptions::default()
    };
    Ok(read_bytes(&file.shown, &file.bytes, &options)?)
}

fn has_tracked(map: &ColumnMap) -> bool {
    !map.markers.is_empty() || !map.bodies.is_empty()
}

/// The readers' own rules find all that a map finds: every joint is one of the robot, and no fewer than a map would have.
fn suffices(model: &RobotModel, recording: &Recording, guess: Option<&Guess>) -> bool {
    let known = recording
        .joints
        .iter()
        .filter(|s| model.joint_id(&s.name).is_ok())
        .count();
    let tracked = recording.markers.len() + recording.bodies.len();
    let (joints, things) = guess.map_or((0, 0), |g| {
        (g.joints.len(), g.map.markers.len() + g.map.bodies.len())
    });
    // Three angles beside a position that is a marker by itself.
    let turns = guess.map_or(0, |g| g.map.bodies.len());
    // A device's own format has its names in several lines, of which a map would see one.
    let of_device = recording.meta.format != "csv";
    let all_known = known == recording.joints.len();
    // Three joints that are called like coordinates are no marker.
    let finds_all = tracked >= things || known >= joints + 3 * (things - tracked);
    all_known
        && (of_device || (known >= joints && finds_all && recording.bodies.len() >= turns))
        && known + tracked > 0
}
