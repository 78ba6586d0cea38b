//! Writes a table, group by group.

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterVersion};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};
use sha2::{Digest as _, Sha256};

use super::fault::TableFault;
use super::{CONTENT, Cell, Column, GROUP_BYTES, GROUP_ROWS, Kind, Row, hex};

/// A table that is being written.
pub struct TableWriter<W: Write + Send> {
    file: SerializedFileWriter<W>,
    columns: Vec<Column>,
    facts: BTreeMap<String, String>,
    group: Vec<Row>,
    /// Rows of a group at the most.
    rows: usize,
    bytes: usize,
    sum: Sha256,
}

fn fault(error: ParquetError) -> TableFault {
    match error {
        ParquetError::External(inner) => match inner.downcast::<std::io::Error>() {
            Ok(error) => TableFault::Unwritable(*error),
            Err(other) => TableFault::Parquet(other.to_string()),
        },
        other => TableFault::Parquet(other.to_string()),
    }
}

fn schema(columns: &[Column]) -> Result<TypePtr, ParquetError> {
    let field = |column: &Column| {
        let (physical, logical) = match column.kind {
            Kind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Kind::Integer => (Physical::INT64, None),
            Kind::Real => (Physical::DOUBLE, None),
            Kind::Boolean => (Physical::BOOLEAN, None),
        };
        let built = Type::primitive_type_builder(&column.name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical)
            .build();
        built.map(Arc::new)
    };
    let fields: Result<Vec<_>, _> = columns.iter().map(field).collect();
    let group = Type::group_type_builder("calib").with_fields(fields?);
    group.build().map(Arc::new)
}

impl<W: Write + Send> TableWriter<W> {
    /// Starts a table with these columns and facts.
    ///
    /// # Errors
    /// [`TableFault`] where the first bytes cannot be written.
    pub fn new(
        sink: W,
        columns: &[Column],
        facts: BTreeMap<String, String>,
    ) -> Result<Self, TableFault> {
        let properties = WriterProperties::builder()
            .set_created_by(concat!("calib ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_writer_version(WriterVersion::PARQUET_1_0)
            .set_compression(Compression::UNCOMPRESSED)
            // Results of trials hardly repeat.
            .set_dictionary_enabled(false)
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_offset_index_disabled(true)
            .build();
        let schema = schema(columns).map_err(fault)?;
        let file = SerializedFileWriter::new(sink, schema, Arc::new(properties));
        Ok(Self {
            file: file.map_err(fault)?,
            columns: columns.to_vec(),
            facts,
            group: Vec::new(),
            rows: GROUP_ROWS,
            bytes: 0,
            sum: Sha256::new(),
        })
    }

    /// The same in groups of at most so many rows: fewer need less memory, and more of the file for its index.
    #[must_use]
    pub fn in_groups_of(self, rows: usize) -> Self {
        Self { rows, ..self }
    }

    /// Adds a row.
    ///
    /// # Errors
    /// [`TableFault::Unfit`] for a row with other columns; what the system says of a group that cannot be written.
    pub fn push(&mut self, row: Row) -> Result<(), TableFault> {
        let unfit = self.columns.iter().enumerate();
        let mut unfit = unfit.filter(|(i, c)| !row.get(*i).is_some_and(|cell| cell.fits(c.kind)));
        if let Some((_, column)) = unfit.next() {
            return Err(TableFault::Unfit(column.name.clone()));
        }
        let bytes: usize = row.iter().map(Cell::bytes).sum();
        let full = self.group.len() >= self.rows || self.bytes + bytes > GROUP_BYTES;
        if full && !self.group.is_empty() {
            self.flush()?;
        }
        for cell in &row {
            cell.digest(&mut self.sum);
        }
        self.bytes += bytes;
        self.group.push(row);
        Ok(())
    }

    fn flush(&mut self) -> Result<(), TableFault> {
        let rows = std::mem::take(&mut self.group);
        self.bytes = 0;
        let mut group = self.file.next_row_group().map_err(fault)?;
        for (place, column) in self.columns.iter().enumerate() {
            let cells = || rows.iter().map(|row| &row[place]);
            let written = match column.kind {
                Kind::Text => write::<ByteArrayType>(&mut group, cells(), |cell| match cell {
                    Cell::Text(text) => Some(ByteArray::from(text.as_str())),
                    _ => None,
                }),
                Kind::Integer => write::<Int64Type>(&mut group, cells(), |cell| match cell {
                    Cell::Integer(value) => Some(*value),
                    _ => None,
                }),
                Kind::Real => write::<DoubleType>(&mut group, cells(), |cell| match cell {
                    Cell::Real(value) => Some(*value),
                    _ => None,
                }),
                Kind::Boolean => write::<BoolType>(&mut group, cells(), |cell| match cell {
                    Cell::Boolean(value) => Some(*value),
                    _ => None,
                }),
            };
            written.map_err(fault)?;
        }
        group.close().map(drop).map_err(fault)
    }

    /// Writes the last group and the footer, and returns where they went.
    ///
    /// # Errors
    /// What the system says.
    pub fn finish(mut self) -> Result<W, TableFault> {
        if !self.group.is_empty() {
            self.flush()?;
        }
        self.facts.insert(CONTENT.to_owned(), hex(self.sum));
        for (key, value) in self.facts {
            let fact = KeyValue::new(key, value);
            self.file.append_key_value_metadata(fact);
        }
        self.file.into_inner().map_err(fault)
    }
}

/// One column of a group: the cells that are there, and for each row whether it has one.
fn write<'a, T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, impl Write + Send>,
    cells: impl Iterator<Item = &'a Cell>,
    value: impl Fn(&Cell) -> Option<T::T>,
) -> Result<(), ParquetError> {
    let cells: Vec<Option<T::T>> = cells.map(value).collect();
    let there: Vec<i16> = cells.iter().map(|c| i16::from(c.is_some())).collect();
    let values: Vec<T::T> = cells.into_iter().flatten().collect();
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("a column is missing".to_owned()));
    };
    column
        .typed::<T>()
        .write_batch(&values, Some(&there), None)?;
    column.close()
}
