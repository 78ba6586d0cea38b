//! The file that grows while it is recorded: whole rows, on the disk every second.

use calib_finding::printable_line;
use calib_recording::{Filled, ReadOptions, Recording, WRITTEN_LIVE, read_bytes};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use calib_files::{FileError, cannot_write, input};

use crate::Held;

/// Rows wait at most this long for the disk, s.
const EVERY: f64 = 1.0;

/// Why a recording cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// There is a file already.
    #[error(
        "{path} already exists\n  help: continue it with `--append`, or choose another file with `--out`"
    )]
    Exists {
        /// The file.
        path: String,
    },
    /// There is a file, but it is another recording.
    #[error(
        "{path}: cannot continue this file: {problem}\n  help: choose another file with `--out`"
    )]
    Other {
        /// The file.
        path: String,
        /// What differs.
        problem: String,
    },
    /// The file cannot be started or continued.
    #[error(transparent)]
    File(#[from] FileError),
    /// The operating system refused.
    #[error(
        "{path}: cannot be written: {source}\n  help: {}",
        cannot_write(Path::new(path), source)
    )]
    Io {
        /// The file.
        path: String,
        /// Why.
        source: std::io::Error,
    },
}

impl TableError {
    /// The file.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Exists { path } | Self::Other { path, .. } | Self::Io { path, .. } => {
                Some(Path::new(path))
            }
            Self::File(error) => error.path(),
        }
    }
}

/// A place in the file that it can be cut back to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    length: u64,
    rows: u64,
}

/// What a comment of the file says before it lists the requested poses.
pub const POSES: &str = "poses: ";

/// What a comment of the file says before the joint values (rad, m) of a posture for which another one was recorded.
const EXCHANGED: &str = "exchanged: ";

/// A table being written.
#[derive(Debug)]
pub struct Table {
    file: File,
    path: String,
    pending: String,
    /// Time of the oldest row that waits, s.
    waiting_since: Option<f64>,
    /// Bytes on the disk.
    length: u64,
    /// Rows taken, on the disk or not.
    pub rows: u64,
    /// Device time of the last row of the file that is gone on with, s.
    pub last_time: Option<f64>,
    /// Holds that the file has already.
    pub held: Vec<String>,
    /// What they say, in the same order.
    pub holds: Vec<Held>,
    /// Postures for which others were recorded, by joint, rad or m.
    pub exchanged: Vec<BTreeMap<String, f64>>,
}

impl Table {
    /// Begins a file that must not exist.
    ///
    /// # Errors
    /// [`TableError`].
    pub fn create(path: &Path, comments: &[String], header: &str) -> Result<Table, TableError> {
        let shown = path.display().to_string();
        let mut text = String::new();
        for comment in comments.iter().map(String::as_str).chain([WRITTEN_LIVE]) {
            text.push_str("# ");
            text.push_str(&printable_line(comment));
            text.push('\n');
        }
        text.push_str(header);
        text.push('\n');
        let file = calib_files::start(path, text.as_bytes()).map_err(|error| match error {
            FileError::Exists { .. } => TableError::Exists {
                path: shown.clone(),
            },
            error => error.into(),
        })?;
        Ok(Table {
            file,
            path: shown,
            pending: String::new(),
            waiting_since: None,
            length: text.len() as u64,
            rows: 0,
            last_time: None,
            held: Vec::new(),
            holds: Vec::new(),
            exchanged: Vec::new(),
        })
    }

    /// Goes on with a file of the same header and the same requested poses; a row that a kill cut off is taken away first.
    ///
    /// # Errors
    /// [`TableError`].
    pub fn append(path: &Path, header: &str, poses: Option<&str>) -> Result<Table, TableError> {
        let shown = path.display().to_string();
        let io = |source| TableError::Io {
            path: shown.clone(),
            source,
        };
        let other = |problem: String| TableError::Other {
            path: shown.clone(),
            problem,
        };
        let bytes = input::read(path, u64::MAX).map_err(io)?;
        let whole = bytes.iter().rposition(|&b| b == b'\n').map_or(0, |i| i + 1);
        let text = std::str::from_utf8(&bytes[..whole]).map_err(|e| other(e.to_string()))?;
        let mut lines = text
            .lines()
            .filter(|line| !line.starts_with('#') && !line.trim().is_empty());
        let found = lines.next().unwrap_or("");
        if found != header {
            return Err(other(format!(
                "its columns are `{}`, this recording has `{}`",
                short(found),
                short(header)
            )));
        }
        if !text
            .lines()
            .any(|line| line.strip_prefix("# ") == Some(WRITTEN_LIVE))
        {
            return Err(other("it was not made by `calib record`".to_string()));
        }
        let of_file = text
            .lines()
            .find_map(|l| l.strip_prefix("# ")?.strip_prefix(POSES));
        if let (Some(of_file), Some(poses)) = (of_file, poses)
            && of_file != poses
        {
            return Err(other(format!(
                "its poses are `{of_file}`, this recording asks for `{poses}`"
            )));
        }
        let (mut rows, mut last_time, mut held, mut holds) = (0, None, Vec::new(), Vec::new());
        if lines.next().is_some() {
            let recording = read_bytes(&shown, text.as_bytes(), &ReadOptions::default())
                .map_err(|e| other(e.to_string()))?;
            if let Some(timeline) = recording.timelines.first() {
                rows = timeline.len() as u64;
                last_time = timeline.t.as_ref().and_then(|t| t.last().copied());
                held = timeline.labels.get("hold").cloned().unwrap_or_default();
                holds = of_holds(&recording, &held);
                held.retain(|name| !name.is_empty());
                held.dedup();
            }
        }
        let file = calib_files::resume(path, whole as u64)?;
        Ok(Table {
            file,
            path: shown,
            pending: String::new(),
            waiting_since: None,
            length: whole as u64,
            rows,
            last_time,
            held,
            holds,
            exchanged: exchanged_of(text),
        })
    }

    /// Takes a row (without line break) at this time, s; older rows go to the disk when a second has passed.
    ///
    /// # Errors
    /// [`TableError::Io`].
    pub fn row(&mut self, row: &str, now: f64) -> Result<(), TableError> {
        self.pending.push_str(row);
        self.pending.push('\n');
        self.rows += 1;
        self.waiting_since.get_or_insert(now);
        self.tick(now)
    }

    /// Writes down that another posture is recorded in place of this one, so that it is not asked for when the file is gone on with.
    ///
    /// # Errors
    /// [`TableError::Io`].
    pub fn exchanged(&mut self, joints: &BTreeMap<String, f64>) -> Result<(), TableError> {
        let values: Vec<String> = joints
            .iter()
            .map(|(name, q)| format!("{name}={q}"))
            .collect();
        self.pending
            .push_str(&format!("# {EXCHANGED}{}\n", values.join(" ")));
        self.flush()
    }

    /// Where the file ends now; everything is written.
    ///
    /// # Errors
    /// [`TableError::Io`].
    pub fn mark(&mut self) -> Result<Mark, TableError> {
        self.flush()?;
        Ok(Mark {
            length: self.length,
            rows: self.rows,
        })
    }

    /// Takes the rows after a mark out of the file.
    ///
    /// # Errors
    /// [`TableError::Io`].
    pub fn cut_back(&mut self, mark: Mark) -> Result<(), TableError> {
        self.pending.clear();
        self.waiting_since = None;
        self.file
            .set_len(mark.length)
            .and_then(|()| self.file.seek(SeekFrom::End(0)))
            .and_then(|_| self.file.sync_data())
            .map_err(|source| self.refused(source))?;
        (self.length, self.rows) = (mark.length, mark.rows);
        Ok(())
    }

    fn refused(&self, source: std::io::Error) -> TableError {
        TableError::Io {
            path: self.path.clone(),
            source,
        }
    }

    /// Writes what has waited for a second.
    ///
    /// # Errors
    /// [`TableError::Io`].
    pub fn tick(&mut self, now: f64) -> Result<(), TableError> {
        // A clock that went back must not keep rows from the disk.
        let due = |since: f64| now - since >= EVERY || now < since;
        if self.waiting_since.is_some_and(due) {
            self.flush()?;
        }
        Ok(())
    }

    /// Writes everything now.
    ///
    /// # Errors
    /// [`TableError::Io`].
    pub fn flush(&mut self) -> Result<(), TableError> {
        if self.pending.is_empty() {
            return Ok(());
        }
        self.file
            .write_all(self.pending.as_bytes())
            .and_then(|()| self.file.sync_data())
            .map_err(|source| self.refused(source))?;
        self.length += self.pending.len() as u64;
        self.pending.clear();
        self.waiting_since = None;
        Ok(())
    }
}

impl Drop for Table {
    /// What still waits goes to the disk, as far as it can.
    fn drop(&mut self) {
        let _ = self.flush();
    }
}

/// The postures that [`Table::exchanged`] wrote down; a line that is not of this form is somebody's remark.
fn exchanged_of(text: &str) -> Vec<BTreeMap<String, f64>> {
    let lines = text.lines();
    let listed = lines.filter_map(|l| l.strip_prefix("# ")?.strip_prefix(EXCHANGED));
    let posture = |line: &str| -> Option<BTreeMap<String, f64>> {
        let values = line.split(' ').map(|part| {
            let (name, value) = part.rsplit_once('=')?;
            Some((name.to_owned(), value.parse().ok()?))
        });
        values.collect()
    };
    listed.filter_map(posture).collect()
}

/// What each hold of a recording says; `labels`: the hold of each row, empty between holds.
fn of_holds(recording: &Recording, labels: &[String]) -> Vec<Held> {
    let rows: Vec<usize> = (0..labels.len()).collect();
    let holds = rows.chunk_by(|a, b| labels[*a] == labels[*b]);
    let named = holds.filter(|hold| !labels[hold[0]].is_empty());
    let of = |hold: &[usize]| {
        let mean = |q: &[Option<f64>]| {
            let values: Vec<f64> = hold.iter().filter_map(|row| q[*row]).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let mostly = |seen: &dyn Fn(usize) -> bool| {
            2 * hold.iter().filter(|row| seen(**row)).count() >= hold.len()
        };
        let joints = recording.joints.iter();
        let bodies = recording.bodies.iter();
        let bodies = bodies.filter(|b| mostly(&|row| b.tracker_from_body[row].is_some()));
        let markers = recording.markers.iter();
        let markers =
            markers.filter(|m| mostly(&|row| m.samples[row].point(Filled::Exclude).is_some()));
        Held {
            joints: joints
                .filter_map(|j| Some((j.name.clone(), mean(&j.q)?)))
                .collect(),
            seen: bodies
                .map(|b| b.name.clone())
                .chain(markers.map(|m| m.name.clone()))
                .collect(),
        }
    };
    named.map(of).collect()
}

fn short(text: &str) -> String {
    if text.chars().count() <= 60 {
        return text.to_string();
    }
    text.chars().take(59).chain("…".chars()).collect()
}
