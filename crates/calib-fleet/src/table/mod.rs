//! Tables of rows in Parquet: a schema of named columns, a writer and a reader that hold one group of rows in memory.
//!
//! A column has a name that carries its unit, and one of four kinds; any cell may be empty. The bytes of a file depend on its rows and
//! facts only: no clock, no compression, groups of rows that end where the rows say so.
//!
//! ```text
//! group = rows until there are GROUP_ROWS of them, or GROUP_BYTES of cells
//! calib.content = SHA-256 of all cells in the order of the rows
//! ```
//!
//! Parquet itself does not notice a changed byte inside a page; the last line does, once the file has been read to its end.

mod fault;
mod read;
mod write;

pub use fault::TableFault;
pub use read::TableReader;
pub use write::TableWriter;

use sha2::{Digest as _, Sha256};

/// Rows of a group, at the most.
pub const GROUP_ROWS: usize = 4096;
/// Bytes of the cells of a group, at the most, unless a single row has more: what a reader must hold in memory.
pub const GROUP_BYTES: usize = 8 << 20;
/// The fact that holds the checksum of the cells.
pub const CONTENT: &str = "calib.content";

/// What the cells of a column hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// UTF-8 text.
    Text,
    /// A whole number of 64 bits.
    Integer,
    /// A floating-point number of 64 bits.
    Real,
    /// Yes or no.
    Boolean,
}

/// A column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Unique in its table; a number's unit is its last word: `held_out_rms_m`.
    pub name: String,
    /// What its cells hold.
    pub kind: Kind,
}

impl Column {
    /// A column.
    #[must_use]
    pub fn new(name: &str, kind: Kind) -> Self {
        Self {
            name: name.to_owned(),
            kind,
        }
    }
}

/// One value.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Not known.
    Empty,
    /// In a column of text.
    Text(String),
    /// In a column of whole numbers.
    Integer(i64),
    /// In a column of numbers.
    Real(f64),
    /// In a column of yes or no.
    Boolean(bool),
}

impl Cell {
    /// Whether a column of this kind can hold it.
    #[must_use]
    pub fn fits(&self, kind: Kind) -> bool {
        matches!(
            (self, kind),
            (Self::Empty, _)
                | (Self::Text(_), Kind::Text)
                | (Self::Integer(_), Kind::Integer)
                | (Self::Real(_), Kind::Real)
                | (Self::Boolean(_), Kind::Boolean)
        )
    }

    /// What it takes of a group.
    fn bytes(&self) -> usize {
        match self {
            Self::Text(text) => text.len() + 4,
            _ => 8,
        }
    }

    /// Adds it to a checksum: its kind, and its bytes behind their number.
    fn digest(&self, sum: &mut Sha256) {
        let (kind, bytes): (u8, &[u8]) = match self {
            Self::Empty => (0, &[]),
            Self::Text(text) => (1, text.as_bytes()),
            Self::Integer(value) => (2, &value.to_le_bytes()),
            Self::Real(value) => (3, &value.to_le_bytes()),
            Self::Boolean(value) => (4, &[u8::from(*value)]),
        };
        sum.update([kind]);
        sum.update((bytes.len() as u64).to_le_bytes());
        sum.update(bytes);
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<Option<f64>> for Cell {
    /// A number that is not finite is not known.
    fn from(value: Option<f64>) -> Self {
        let finite = value.filter(|v| v.is_finite());
        finite.map_or(Self::Empty, Self::Real)
    }
}

/// The values of a row, in the order of the columns.
pub type Row = Vec<Cell>;

fn hex(sum: Sha256) -> String {
    let bytes = sum.finalize();
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
