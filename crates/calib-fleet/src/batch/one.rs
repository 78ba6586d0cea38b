//! One robot: calibrated, compared with last time, and kept in a folder of its own.
//!
//! ```text
//! OUT/robots/NAME/row.json       the row, written last with everything it belongs to
//!                report.json     for the next comparison; with `Keep::All` every file of `calib run`
//! ```

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use calib_drift::{DriftError, Evidence, compare};
use calib_files::{OutputFile, ResultsFolder, folder_of, input, is_unfinished};
use calib_pipeline::PipelineError;
use calib_pipeline::options::RunOptions;
use calib_pipeline::run::run;
use calib_report::{REPORT, Report, read_report, report_path};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::error::BatchError;
use super::members::Member;
use super::row::{Failure, Robot};

/// Name of the file of a robot's row.
const ROW: &str = "row.json";
/// A file of inputs that is larger is not read again to see whether it changed: the robot is calibrated again.
const LARGEST_INPUT: u64 = 1 << 32;
/// Rows have some hundred quantities.
const LARGEST_ROW: u64 = 1 << 26;
/// The exit code of a program that panicked.
const PANICKED: u8 = 101;

/// Which files of each robot are kept.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Keep {
    /// `report.json`, which the next batch compares with.
    #[default]
    Report,
    /// Everything that `calib run` writes.
    All,
}

/// How robots are calibrated.
pub struct How<'a> {
    /// As `calib run` takes them.
    pub run: RunOptions,
    /// Which files are kept.
    pub keep: Keep,
    /// Calibrate robots that are calibrated already again.
    pub restart: bool,
    /// The stable id of an error.
    pub id: &'a (dyn Fn(&PipelineError) -> &'static str + Sync),
}

/// A row, and what it depends on.
#[derive(Debug, Serialize, Deserialize)]
struct Kept {
    calib_row: u32,
    version: String,
    keep: Keep,
    options: String,
    earlier_sha256: Option<String>,
    robot: Robot,
}

impl How<'_> {
    /// Everything that rows depend on besides their files, as one text.
    pub(super) fn settings(&self) -> String {
        let RunOptions {
            method,
            force,
            strict,
            select,
            plugins,
            ..
        } = &self.run;
        format!("{method:?} force {force} strict {strict} select {select} {plugins:?}")
    }

    /// Calibrates a robot, unless its row is there and nothing it depends on has changed. What stops the robot is in the row.
    ///
    /// # Errors
    /// [`BatchError`] where its folder cannot be written, or another process writes there.
    pub(super) fn robot(&self, member: &Member, folder: &Path) -> Result<(), BatchError> {
        let results = ResultsFolder::open(folder)?;
        let earlier_sha256 = member.earlier.as_deref().map(report_path);
        let earlier_sha256 = earlier_sha256.and_then(|path| sha256_of(&path));
        if !self.restart && self.is_current(member, folder, earlier_sha256.as_deref()) {
            return Ok(());
        }
        let caught = catch_unwind(AssertUnwindSafe(|| self.calibrated(member)));
        let (robot, mut files) = caught.unwrap_or_else(|_| {
            let failure = Failure {
                id: "panic".to_owned(),
                text:
                    "the calibration stopped at a defect of the program; report it with the profile"
                        .to_owned(),
            };
            let series = member.series.as_deref().unwrap_or_default();
            (
                Robot::failed(&member.name, series, PANICKED, failure),
                Vec::new(),
            )
        });
        let kept = Kept {
            calib_row: 1,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            keep: self.keep,
            options: self.settings(),
            earlier_sha256,
            robot,
        };
        files.push(OutputFile::text(ROW, serde_json::to_string(&kept)? + "\n"));
        results.write(&files)?;
        Ok(())
    }

    /// Whether the row was made from the files as they are now. A robot without a result is tried again.
    fn is_current(&self, member: &Member, folder: &Path, earlier: Option<&str>) -> bool {
        if is_unfinished(folder) {
            return false;
        }
        let Some(kept) = kept(folder) else {
            return false;
        };
        let own = kept.robot.name == *member.name
            && kept.version == env!("CARGO_PKG_VERSION")
            && kept.keep == self.keep
            && kept.options == self.settings()
            && kept.earlier_sha256.as_deref() == earlier
            && kept.robot.failure.is_none()
            && member
                .series
                .as_deref()
                .is_none_or(|s| s == kept.robot.series);
        let beside = folder_of(&member.profile);
        let same = |input: &calib_report::Input| {
            sha256_of(&beside.join(&input.path)).as_deref() == Some(&*input.sha256)
        };
        own && !kept.robot.inputs.is_empty() && kept.robot.inputs.iter().all(same)
    }

    fn calibrated(&self, member: &Member) -> (Robot, Vec<OutputFile>) {
        let series = member.series.as_deref();
        let output = match run(&member.profile, &self.run, &mut |_| {}) {
            Ok(output) => output,
            Err(error) => {
                let failure = Failure {
                    id: (self.id)(&error).to_owned(),
                    text: error.to_string(),
                };
                let series = series.unwrap_or_default();
                let code = error.exit_code() as u8;
                return (
                    Robot::failed(&member.name, series, code, failure),
                    Vec::new(),
                );
            }
        };
        let report = &output.report;
        let mut robot = Robot::of(&member.name, series, report, output.exit as u8);
        if let Some(earlier) = &member.earlier {
            let drift = since(earlier, report);
            robot = robot.compared(report, drift);
        }
        let mut files = output.files;
        if self.keep == Keep::Report {
            files.retain(|file| file.name == REPORT);
        }
        (robot, files)
    }
}

/// What changed since an earlier result.
fn since(earlier: &Path, report: &Report) -> Result<calib_drift::Drift, DriftError> {
    let old = read_report(earlier)?;
    let old = Evidence::of(&old, &report_path(earlier).display().to_string())?;
    compare(&old, &Evidence::of(report, REPORT)?)
}

fn kept(folder: &Path) -> Option<Kept> {
    let text = input::read_text(&folder.join(ROW), LARGEST_ROW).ok()?;
    serde_json::from_str(&text).ok()
}

/// The row of a robot that was calibrated.
pub(super) fn row(folder: &Path) -> Option<Robot> {
    Some(kept(folder)?.robot)
}

/// The folder of a robot.
pub(super) fn folder(out: &Path, member: &Member) -> PathBuf {
    out.join(super::ROBOTS).join(&*member.name)
}

/// The first file that is there and is another one than the row was made from.
pub(super) fn changed(member: &Member, robot: &Robot) -> Option<PathBuf> {
    let beside = folder_of(&member.profile);
    let files = robot.inputs.iter().map(|input| {
        let path = beside.join(&input.path);
        (sha256_of(&path).filter(|own| *own != input.sha256), path)
    });
    let mut changed = files.filter_map(|(other, path)| other.map(|_| path));
    changed.next()
}

/// SHA-256 of a file; none where it cannot be read.
pub(super) fn sha256_of(path: &Path) -> Option<String> {
    let bytes = input::read(path, LARGEST_INPUT).ok()?;
    let digest = Sha256::digest(&bytes);
    Some(digest.iter().map(|byte| format!("{byte:02x}")).collect())
}
