//! What a reader says when it cannot go on: the file, the place, what stood there, what was expected, what to do.

use crate::map_fault::MapFault;
use std::fmt;

/// Where in a file something stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum At {
    /// The file as a whole.
    File,
    /// A line of text, counted from 1 as editors do.
    Line(u64),
    /// A cell of a table: line from 1, and the column's name as the header writes it.
    Cell {
        /// Line from 1.
        line: u64,
        /// Column name, or `#7` where the header has no name for it.
        column: String,
    },
    /// A byte of a binary file, from 0.
    Byte(u64),
}

/// A file could not be read: place and problem.
#[derive(Debug)]
pub struct Error {
    /// The file as the caller named it.
    pub file: String,
    /// The place in it.
    pub at: At,
    /// What is wrong there.
    pub problem: Box<Problem>,
}

/// What is wrong at the place. Every variant holds what was found and what was expected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// The operating system refused.
    #[error("cannot be read: {0}")]
    Io(#[source] std::io::Error),
    /// No bytes at all.
    #[error("the file is empty; expected a header line and one row per pose or sample")]
    Empty,
    /// More bytes than the caller allows.
    #[error("the file has {bytes} bytes, the limit is {limit}")]
    TooLarge {
        /// Size of the file.
        bytes: u64,
        /// The limit that was set.
        limit: u64,
    },
    /// Text that is not UTF-8.
    #[error("byte {byte} of this line is not UTF-8")]
    NotUtf8 {
        /// Offset within the line, from 0.
        byte: usize,
    },
    /// Text that begins as UTF-16 and is not.
    #[error("the file begins as UTF-16 text, and this byte is not UTF-16")]
    NotUtf16,
    /// A first line `sep=…` with something that separates no cells.
    #[error("the line states that `{}` separates the cells", excerpt(.found, 20))]
    SeparatorLine {
        /// What it states.
        found: String,
    },
    /// A cell of a row of units that is no unit.
    #[error("this row states units, and `{found}` is not one of those that are known")]
    UnknownUnit {
        /// What stands there.
        found: String,
    },
    /// A row of units against something else that states the unit.
    #[error("this row states the unit `{found}`, but {against}")]
    UnitAgainst {
        /// What stands there.
        found: String,
        /// What states another one.
        against: Against,
    },
    /// A line longer than any table has.
    #[error("the line is longer than {limit} bytes")]
    LineTooLong {
        /// The limit.
        limit: usize,
    },
    /// A header but nothing below it.
    #[error("no data rows below the header")]
    NoRows,
    /// Rows of empty cells only.
    #[error("all {rows} rows below the header are empty: nothing but separators")]
    EmptyRows {
        /// How many.
        rows: usize,
    },
    /// Two columns of the same name.
    #[error("column `{name}` occurs twice (columns {first} and {second})")]
    DuplicateColumn {
        /// The name.
        name: String,
        /// Position of the first, from 1.
        first: usize,
        /// Position of the second, from 1.
        second: usize,
    },
    /// A column whose name has no meaning here.
    #[error("column `{name}` has no unit or is unknown; expected {expected}{}", did_you_mean(.nearest))]
    UnknownColumn {
        /// The name in the header.
        name: String,
        /// What names are understood.
        expected: String,
        /// The nearest name that would be understood.
        nearest: Option<String>,
    },
    /// A body or marker lacks some of its columns.
    #[error("{entity} `{name}` lacks column `{missing}`; it has {present}")]
    IncompleteEntity {
        /// `marker` or `body`.
        entity: &'static str,
        /// Its name.
        name: String,
        /// The first missing column.
        missing: String,
        /// The columns that are there.
        present: String,
    },
    /// A column that a column map names is not in the file.
    #[error("{what} needs column `{column}`, which the header does not have{}", did_you_mean(.nearest))]
    MissingColumn {
        /// Who needs it.
        what: String,
        /// The column's name.
        column: String,
        /// The nearest name in the header.
        nearest: Option<String>,
    },
    /// A column map contradicts itself.
    #[error("{0}")]
    ColumnMap(#[source] MapFault),
    /// Rows of different length.
    #[error("{found} cells, the header has {expected}{}", split_number(.decimal_comma))]
    Ragged {
        /// Cells in this row.
        found: usize,
        /// Cells in the header.
        expected: usize,
        /// Two cells too many that may be one number with a decimal comma.
        decimal_comma: Option<String>,
    },
    /// A cell or token that is not what it should be.
    #[error("{}, expected {expected}", quoted(.found))]
    Unexpected {
        /// What stands there.
        found: String,
        /// What should stand there.
        expected: String,
    },
    /// Parts that do not fit together.
    #[error("{found}; expected {expected}")]
    Misfit {
        /// What is there, as a clause.
        found: String,
        /// What should be.
        expected: String,
    },
    /// A text where a time is expected.
    #[error("found `{found}`, which is no time that can be read")]
    TimeText {
        /// What stands there.
        found: String,
    },
    /// A time that other rows state otherwise.
    #[error("found `{found}`, and the rows before have {before}")]
    OtherTime {
        /// What stands there.
        found: String,
        /// How the times of the rows before are written.
        before: &'static str,
    },
    /// Infinity.
    #[error("found `{found}`: not finite")]
    NotFinite {
        /// What stands there.
        found: String,
    },
    /// Some coordinates of one sample are given and others are not.
    #[error("{entity} `{name}` is given in part: {given} of {needed} coordinates")]
    PartlyLost {
        /// `marker` or `body`.
        entity: &'static str,
        /// Its name.
        name: String,
        /// Coordinates present.
        given: usize,
        /// Coordinates of a complete sample.
        needed: usize,
    },
    /// Time goes backwards.
    #[error("time goes back from {previous} s to {found} s")]
    TimeBackwards {
        /// Time of the row before.
        previous: f64,
        /// Time of this row.
        found: f64,
    },
    /// The frame number goes back.
    #[error("frame goes back from {previous} to {found}")]
    FrameBackwards {
        /// Frame of the row before.
        previous: i64,
        /// Frame of this row.
        found: i64,
    },
    /// The same entity occurs twice at one time.
    #[error("{entity} `{name}` occurs twice in frame {frame}")]
    RepeatedSample {
        /// `marker` or `body`.
        entity: &'static str,
        /// Its name.
        name: String,
        /// The frame.
        frame: i64,
    },
    /// Two poses of a long table have one name.
    #[error(
        "pose `{pose}` has another value of joint `{joint}` in line {first}: two poses have one name"
    )]
    PoseTwice {
        /// The name.
        pose: String,
        /// The joint.
        joint: String,
        /// The first line of that name.
        first: u64,
    },
    /// A point occurs twice in one pose.
    #[error("`{name}` was measured in pose `{pose}` already, in line {first}")]
    PointTwice {
        /// The point.
        name: String,
        /// The pose.
        pose: String,
        /// Where it was first.
        first: u64,
    },
    /// A quaternion, or the axis of a rotation, that has not the length 1.
    #[error("body `{body}`: the {what} has length {norm:.6}, expected 1 within {tolerance}")]
    NotUnit {
        /// The body.
        body: String,
        /// What has a length.
        what: &'static str,
        /// The length found.
        norm: f64,
        /// The tolerance.
        tolerance: f64,
    },
    /// A 3 × 3 matrix that is no rotation.
    #[error(
        "body `{body}`: the matrix is no rotation (determinant {determinant:.4}, largest departure from orthonormal {departure:.2e}, tolerance {tolerance:.0e})"
    )]
    NotRotation {
        /// The body.
        body: String,
        /// Its determinant; −1 for a mirrored frame.
        determinant: f64,
        /// Largest entry of |RᵀR − I|.
        departure: f64,
        /// The tolerance.
        tolerance: f64,
    },
    /// A binary file ends before what it promises.
    #[error("the file ends here: {needed} more bytes are needed for {what}")]
    Truncated {
        /// What was being read.
        what: String,
        /// Bytes that are missing.
        needed: u64,
    },
    /// So many names and frames, so few samples, that the table would be almost empty.
    #[error("{entities} names × {frames} frames, but only {samples} samples")]
    TooSparse {
        /// Distinct markers or bodies.
        entities: usize,
        /// Frames.
        frames: usize,
        /// Samples given.
        samples: usize,
    },
    /// No reader recognizes the file.
    #[error("no reader recognizes this file; known are {known}")]
    UnknownFormat {
        /// Names of the readers.
        known: String,
    },
    /// A format was asked for by a name that does not exist.
    #[error("there is no reader `{id}`; known are {known}{}", did_you_mean(.nearest))]
    UnknownReader {
        /// The id asked for.
        id: String,
        /// All ids.
        known: String,
        /// The nearest id.
        nearest: Option<String>,
    },
    /// Something is to get a name that something else has and keeps.
    #[error("`{from}` is to be called `{name}`, and the recording has another `{name}`")]
    NameTaken {
        /// The new name.
        name: String,
        /// The name in the recording.
        from: String,
    },
    /// No body and no marker has the name that is to be another.
    #[error("no body and no marker is called `{name}`{}", did_you_mean(.nearest))]
    NoSuchName {
        /// The name that was asked for.
        name: String,
        /// The nearest one.
        nearest: Option<String>,
        /// All names of the recording.
        known: Vec<String>,
    },
    /// The format is known, this dialect of it is not supported.
    #[error("{what} is not supported")]
    Unsupported {
        /// What was found.
        what: String,
        /// What the person can do.
        remedy: String,
    },
}

fn quoted(found: &str) -> String {
    if found.is_empty() {
        "empty".to_string()
    } else {
        format!("found `{found}`")
    }
}

fn split_number(number: &Option<String>) -> String {
    number
        .as_ref()
        .map(|number| format!("; `{number}` may be a number with a decimal comma"))
        .unwrap_or_default()
}

fn did_you_mean(nearest: &Option<String>) -> String {
    nearest
        .as_ref()
        .map(|word| format!("; did you mean `{word}`?"))
        .unwrap_or_default()
}

/// What a row of units contradicts.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Against {
    /// The name of the column.
    #[error("the column's name states `{0}`")]
    Name(&'static str),
    /// The column map.
    #[error("the column map states `{key}: {unit}`")]
    Map {
        /// The key.
        key: &'static str,
        /// Its value.
        unit: &'static str,
    },
    /// What the column is read as.
    #[error("the column is read as {0}")]
    Quantity(&'static str),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.at {
            At::File => write!(f, "{}: {}", self.file, self.problem),
            At::Line(line) => write!(f, "{}:{line}: {}", self.file, self.problem),
            At::Cell { line, column } => {
                write!(
                    f,
                    "{}:{line}: column `{column}`: {}",
                    self.file, self.problem
                )
            }
            At::Byte(byte) => write!(f, "{}: byte {byte}: {}", self.file, self.problem),
        }?;
        write!(f, "\n  help: {}", self.problem.remedy())
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self.problem.as_ref() {
            Problem::Io(source) => Some(source),
            _ => None,
        }
    }
}

/// What a reader returns inside: a place and a problem; the file's name is added at the crate's edge.
pub(crate) type Placed<T> = Result<T, (At, Problem)>;

/// Adds the file's name.
pub(crate) fn in_file<T>(file: &str, result: Placed<T>) -> Result<T, Error> {
    result.map_err(|(at, problem)| Error {
        file: file.to_string(),
        at,
        problem: Box::new(problem),
    })
}

/// At most `limit` characters of what was found, so that a message stays readable.
pub(crate) fn excerpt(found: &str, limit: usize) -> String {
    let clean: String = found
        .chars()
        .map(|c| if c.is_control() { '·' } else { c })
        .collect();
    if clean.chars().count() <= limit {
        return clean;
    }
    clean.chars().take(limit).chain("…".chars()).collect()
}
