//! The file of a shard: a row for each unit of work.
//!
//! ```text
//! unit   number of the unit in the whole work, from 0
//! name   what it is: a part of a scene, a case, a trial, a robot
//! result its result as JSON
//! ```

use std::path::{Path, PathBuf};

use calib_files::{FileError, input, write_pieces};

use serde::{Deserialize, Serialize};

use crate::error::{FleetError, ShardError, ShardFault};
use crate::shard::{Identity, Shard};
use crate::table::{Cell, Column, Kind, Row, TableFault, TableReader, TableWriter};

/// The result of one unit of work.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finished {
    /// Its number in the whole work, from 0.
    pub unit: u64,
    /// What it is.
    pub name: String,
    /// Its result as JSON.
    pub result: String,
}

/// `cor-3-of-64.parquet`
#[must_use]
pub fn file_name(kind: &str, shard: Shard) -> String {
    format!("{kind}-{}-of-{}.parquet", shard.index, shard.of)
}

fn columns() -> Vec<Column> {
    vec![
        Column::new("unit", Kind::Integer),
        Column::new("name", Kind::Text),
        Column::new("result", Kind::Text),
    ]
}

fn row(finished: Finished) -> Row {
    let unit = i64::try_from(finished.unit).unwrap_or(i64::MAX);
    vec![
        Cell::Integer(unit),
        Cell::Text(finished.name),
        Cell::Text(finished.result),
    ]
}

/// Writes the file of a shard, whole or not at all, from units in their order.
///
/// # Errors
/// What `units` says, and [`FileError`].
pub fn write_shard(
    path: &Path,
    (identity, shard): (&Identity, Shard),
    units: impl Iterator<Item = Result<Finished, FleetError>>,
) -> Result<(), FleetError> {
    let unwritable = |fault| match fault {
        TableFault::Unwritable(source) => FleetError::File(FileError::Write {
            path: path.to_path_buf(),
            source,
        }),
        fault => FleetError::unusable(path, ShardFault::Table(fault)),
    };
    write_pieces(path, |sink| {
        let table = TableWriter::new(sink, &columns(), identity.facts(shard));
        let mut table = table.map_err(unwritable)?;
        for finished in units {
            table.push(row(finished?)).map_err(unwritable)?;
        }
        table.finish().map(drop).map_err(unwritable)
    })
}

/// The file of a shard, its footer read.
pub struct ShardFile {
    /// The file.
    pub path: PathBuf,
    /// The work.
    pub identity: Identity,
    /// Which part of it.
    pub shard: Shard,
    table: TableReader,
    /// Rows that were read and not yet given.
    ready: std::vec::IntoIter<Row>,
    /// The unit of the next row.
    next: u64,
    ended: bool,
}

impl ShardFile {
    /// Opens a shard and reads its footer.
    ///
    /// # Errors
    /// [`ShardFault::Table`] for a file that is torn or none of this program's, [`ShardFault::Rows`].
    pub fn open(path: &Path) -> Result<Self, ShardError> {
        let failed = |fault| ShardError::new(path, fault);
        let table = |fault| failed(ShardFault::Table(fault));
        let file = input::open(path).map_err(|e| table(TableFault::Unreadable(e)))?;
        let reader = TableReader::new(file).map_err(table)?;
        let known = Identity::of(reader.facts());
        let (identity, shard) = known.map_err(|fact| table(TableFault::NoFact(fact)))?;
        if reader.columns() != columns() {
            return Err(failed(ShardFault::Columns));
        }
        let range = shard.range(identity.units);
        let (expected, found) = (range.end - range.start, reader.rows());
        if expected != found {
            return Err(failed(ShardFault::Rows { expected, found }));
        }
        Ok(Self {
            path: path.to_path_buf(),
            identity,
            shard,
            table: reader,
            ready: Vec::new().into_iter(),
            next: range.start,
            ended: false,
        })
    }

    fn failed(&self, fault: ShardFault) -> ShardError {
        ShardError::new(&self.path, fault)
    }

    fn read(&mut self) -> Result<Option<Finished>, ShardError> {
        loop {
            if let Some(row) = self.ready.next() {
                return self.unit(row).map(Some);
            }
            let group = self.table.group();
            let group = group.map_err(|fault| self.failed(ShardFault::Table(fault)))?;
            let Some(rows) = group else {
                return Ok(None);
            };
            self.ready = rows.into_iter();
        }
    }

    fn unit(&mut self, row: Row) -> Result<Finished, ShardError> {
        let expected = self.next;
        let mut cells = row.into_iter();
        match (cells.next(), cells.next(), cells.next()) {
            (Some(Cell::Integer(unit)), Some(Cell::Text(name)), Some(Cell::Text(result)))
                if u64::try_from(unit) == Ok(expected) =>
            {
                self.next += 1;
                Ok(Finished {
                    unit: expected,
                    name,
                    result,
                })
            }
            _ => Err(self.failed(ShardFault::Order { unit: expected })),
        }
    }
}

/// The units in their order; the last step compares the checksum of all.
impl Iterator for ShardFile {
    type Item = Result<Finished, ShardError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let read = self.read().transpose();
        self.ended = !matches!(read, Some(Ok(_)));
        read
    }
}
