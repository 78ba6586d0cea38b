//! Reads a table, group by group.

use std::collections::BTreeMap;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};

use parquet::basic::{LogicalType, Type as Physical};
use parquet::column::reader::ColumnReader;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::schema::types::Type;
use sha2::{Digest as _, Sha256};

use super::fault::TableFault;
use super::{CONTENT, Cell, Column, GROUP_ROWS, Kind, Row, hex};

/// A table that is being read.
pub struct TableReader {
    file: SerializedFileReader<File>,
    columns: Vec<Column>,
    facts: BTreeMap<String, String>,
    next: usize,
    sum: Sha256,
}

fn fault(error: ParquetError) -> TableFault {
    TableFault::Parquet(error.to_string())
}

/// Bytes of a damaged file may lead a decoder anywhere: a panic there is a damaged file too.
fn guarded<T>(read: impl FnOnce() -> Result<T, TableFault>) -> Result<T, TableFault> {
    let caught = catch_unwind(AssertUnwindSafe(read));
    caught.unwrap_or_else(|_| {
        Err(TableFault::Parquet(
            "its pages cannot be decoded".to_owned(),
        ))
    })
}

fn kind(field: &Type) -> Option<Kind> {
    if !field.is_primitive() {
        return None;
    }
    match field.get_physical_type() {
        Physical::BYTE_ARRAY => {
            let text = field.get_basic_info().logical_type_ref() == Some(&LogicalType::String);
            text.then_some(Kind::Text)
        }
        Physical::INT64 => Some(Kind::Integer),
        Physical::DOUBLE => Some(Kind::Real),
        Physical::BOOLEAN => Some(Kind::Boolean),
        _ => None,
    }
}

impl TableReader {
    /// Reads the footer.
    ///
    /// # Errors
    /// [`TableFault`] for what is no whole Parquet file, or has columns of other kinds.
    pub fn new(file: File) -> Result<Self, TableFault> {
        guarded(|| {
            let file = SerializedFileReader::new(file).map_err(fault)?;
            let footer = file.metadata().file_metadata();
            let fields = footer.schema_descr().root_schema().get_fields();
            let columns = fields.iter().map(|field| {
                let foreign = || TableFault::ForeignColumn(field.name().to_owned());
                let optional = field.get_basic_info().has_repetition() && field.is_optional();
                let kind = kind(field).filter(|_| optional).ok_or_else(foreign)?;
                Ok(Column::new(field.name(), kind))
            });
            let columns: Vec<Column> = columns.collect::<Result<_, TableFault>>()?;
            let facts = footer.key_value_metadata().into_iter().flatten();
            let facts = facts.filter_map(|f| Some((f.key.clone(), f.value.clone()?)));
            let facts = facts.collect();
            Ok(Self {
                file,
                columns,
                facts,
                next: 0,
                sum: Sha256::new(),
            })
        })
    }

    /// The columns.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// What the footer states besides.
    #[must_use]
    pub fn facts(&self) -> &BTreeMap<String, String> {
        &self.facts
    }

    /// How many rows there are.
    #[must_use]
    pub fn rows(&self) -> u64 {
        let rows = self.file.metadata().file_metadata().num_rows();
        u64::try_from(rows).unwrap_or(0)
    }

    /// The rows of the next group; `None` after the last, once the checksum of all cells was compared.
    ///
    /// # Errors
    /// [`TableFault`] for pages that cannot be decoded, and [`TableFault::Changed`].
    pub fn group(&mut self) -> Result<Option<Vec<Row>>, TableFault> {
        if self.next == self.file.num_row_groups() {
            let stated = self.facts.get(CONTENT);
            let stated = stated.ok_or(TableFault::NoFact(CONTENT))?;
            let same = *stated == hex(self.sum.clone());
            return same.then_some(None).ok_or(TableFault::Changed);
        }
        let (file, columns, next) = (&self.file, &self.columns, self.next);
        let rows = guarded(|| group(file, columns, next))?;
        self.next += 1;
        for cell in rows.iter().flatten() {
            cell.digest(&mut self.sum);
        }
        Ok(Some(rows))
    }
}

fn group(
    file: &SerializedFileReader<File>,
    columns: &[Column],
    place: usize,
) -> Result<Vec<Row>, TableFault> {
    let group = file.get_row_group(place).map_err(fault)?;
    let rows = group.metadata().num_rows();
    let large = || TableFault::LargeGroup {
        rows,
        most: GROUP_ROWS,
    };
    let count = usize::try_from(rows).map_err(|_| large())?;
    if count > GROUP_ROWS {
        return Err(large());
    }
    let mut all = vec![Row::with_capacity(columns.len()); count];
    for place in 0..columns.len() {
        let reader = group.get_column_reader(place).map_err(fault)?;
        let cells = column(reader, count).map_err(fault)?;
        if cells.len() != count {
            return Err(TableFault::Parquet("a column is cut off".to_owned()));
        }
        for (row, cell) in all.iter_mut().zip(cells) {
            row.push(cell);
        }
    }
    Ok(all)
}

fn column(reader: ColumnReader, count: usize) -> Result<Vec<Cell>, ParquetError> {
    let mut there = Vec::new();
    macro_rules! cells {
        ($reader:ident, $cell:expr) => {{
            let mut values = Vec::new();
            let mut reader = $reader;
            reader.read_records(count, Some(&mut there), None, &mut values)?;
            let mut values = values.into_iter();
            let cell = |level: &i16| match level {
                0 => Ok(Cell::Empty),
                _ => values.next().map_or(Ok(Cell::Empty), $cell),
            };
            there.iter().map(cell).collect()
        }};
    }
    match reader {
        ColumnReader::ByteArrayColumnReader(reader) => {
            cells!(reader, |bytes: parquet::data_type::ByteArray| {
                let text = bytes.as_utf8()?;
                Ok(Cell::Text(text.to_owned()))
            })
        }
        ColumnReader::Int64ColumnReader(reader) => cells!(reader, |v| Ok(Cell::Integer(v))),
        ColumnReader::DoubleColumnReader(reader) => cells!(reader, |v| Ok(Cell::Real(v))),
        ColumnReader::BoolColumnReader(reader) => cells!(reader, |v| Ok(Cell::Boolean(v))),
        _ => Err(ParquetError::General("a column of another kind".to_owned())),
    }
}
