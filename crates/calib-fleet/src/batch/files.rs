//! The files of a fleet: two tables in Parquet, one as CSV, a summary as JSON, and the page.

use std::collections::BTreeMap;
use std::path::PathBuf;

use calib_files::{OutputFile, ResultsFolder};

use super::error::BatchError;
use super::page::Page;
use super::row::{Quantity, Robot};
use super::statistics::Tally;
use super::summary::{Summary, word};
use crate::error::FleetError;
use crate::table::{Cell, Column, Kind, Row, TableFault, TableWriter};

/// What was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Files {
    /// The fleet in numbers.
    pub summary: Summary,
    /// The same as JSON.
    pub json: String,
    /// The files.
    pub written: Vec<PathBuf>,
}

/// Tables that are being made, row by row.
pub(super) struct Writing {
    robots: TableWriter<Vec<u8>>,
    quantities: TableWriter<Vec<u8>>,
    csv: String,
    page: Page,
    tally: Tally,
    summary: BTreeMap<String, u64>,
    failures: BTreeMap<String, u64>,
    count: u64,
}

const ROBOT: &[(&str, Kind)] = &[
    ("name", Kind::Text),
    ("series", Kind::Text),
    ("verdict", Kind::Text),
    ("exit_code", Kind::Integer),
    ("error_id", Kind::Text),
    ("error", Kind::Text),
    ("held_out_rms_m", Kind::Real),
    ("held_out_poses", Kind::Integer),
    ("warnings", Kind::Integer),
    ("drift_p_value", Kind::Real),
    ("drift_joint", Kind::Text),
    ("drift_joint_p_value", Kind::Real),
    ("not_compared", Kind::Text),
];

const QUANTITY: &[(&str, Kind)] = &[
    ("name", Kind::Text),
    ("series", Kind::Text),
    ("joint", Kind::Text),
    ("quantity", Kind::Text),
    ("unit", Kind::Text),
    ("value", Kind::Real),
    ("sigma", Kind::Real),
    ("change", Kind::Real),
    ("p_value", Kind::Real),
];

fn table(columns: &[(&str, Kind)]) -> Result<TableWriter<Vec<u8>>, BatchError> {
    let columns: Vec<Column> = columns.iter().map(|(n, k)| Column::new(n, *k)).collect();
    let table = TableWriter::new(Vec::new(), &columns, BTreeMap::new());
    table.map_err(defect)
}

/// A table in memory cannot fail but by a defect.
fn defect(fault: TableFault) -> BatchError {
    BatchError::Work(FleetError::Table(fault))
}

fn text(value: Option<&str>) -> Cell {
    value.map_or(Cell::Empty, Cell::from)
}

fn count(value: Option<usize>) -> Cell {
    let value = value.and_then(|v| i64::try_from(v).ok());
    value.map_or(Cell::Empty, Cell::Integer)
}

fn cells(robot: &Robot) -> Row {
    let failure = robot.failure.as_ref();
    let most = robot.most_changed();
    let not_compared = robot.not_compared.as_ref().map(|f| &*f.text);
    vec![
        Cell::from(&*robot.name),
        Cell::from(&*robot.series),
        Cell::from(word(robot.verdict)),
        Cell::Integer(robot.exit_code.into()),
        text(failure.map(|f| &*f.id)),
        text(failure.map(|f| &*f.text)),
        Cell::from(robot.held_out_rms_m),
        count(robot.held_out_poses),
        count(Some(robot.warnings)),
        Cell::from(robot.drift.as_ref().map(|d| d.p_value)),
        text(most.map(|joint| &*joint.joint)),
        Cell::from(most.map(|joint| joint.p_value)),
        text(not_compared),
    ]
}

fn of_quantity(robot: &Robot, quantity: &Quantity) -> Row {
    vec![
        Cell::from(&*robot.name),
        Cell::from(&*robot.series),
        text(quantity.joint.as_deref()),
        Cell::from(&*quantity.name),
        Cell::from(quantity.unit.symbol()),
        Cell::from(Some(quantity.value)),
        Cell::from(quantity.sigma),
        Cell::from(quantity.change),
        Cell::from(quantity.p_value),
    ]
}

/// A line of the CSV: quoted where it must be, line breaks as blanks.
fn line(cells: impl Iterator<Item = String>) -> String {
    let quoted = |cell: String| {
        let cell = cell.split_whitespace().collect::<Vec<_>>().join(" ");
        match cell.contains([',', '"']) {
            true => format!("\"{}\"", cell.replace('"', "\"\"")),
            false => cell,
        }
    };
    cells.map(quoted).collect::<Vec<_>>().join(",") + "\n"
}

fn shown(cell: &Cell) -> String {
    match cell {
        Cell::Empty => String::new(),
        Cell::Text(text) => text.clone(),
        Cell::Integer(value) => value.to_string(),
        // The shortest that reads back as the same number.
        Cell::Real(value) => format!("{value:e}"),
        Cell::Boolean(value) => value.to_string(),
    }
}

impl Writing {
    pub fn new() -> Result<Self, BatchError> {
        Ok(Self {
            robots: table(ROBOT)?,
            quantities: table(QUANTITY)?,
            csv: line(ROBOT.iter().map(|(name, _)| (*name).to_owned())),
            page: Page::default(),
            tally: Tally::default(),
            summary: BTreeMap::new(),
            failures: BTreeMap::new(),
            count: 0,
        })
    }

    /// Adds a robot to all of them.
    pub fn add(&mut self, robot: &Robot) -> Result<(), BatchError> {
        let cells = cells(robot);
        self.csv += &line(cells.iter().map(shown));
        self.robots.push(cells).map_err(defect)?;
        for quantity in &robot.quantities {
            let cells = of_quantity(robot, quantity);
            self.quantities.push(cells).map_err(defect)?;
        }
        self.page.add(robot);
        self.tally.add(robot);
        let verdict = word(robot.verdict).to_owned();
        *self.summary.entry(verdict).or_default() += 1;
        if let Some(failure) = &robot.failure {
            *self.failures.entry(failure.id.clone()).or_default() += 1;
        }
        self.count += 1;
        Ok(())
    }

    /// Writes all of them, or none.
    pub fn write(self, folder: ResultsFolder) -> Result<Files, BatchError> {
        let summary = Summary {
            calib_fleet: 1,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            robots: self.count,
            verdicts: self.summary,
            failures: self.failures,
            drift: self.tally.statistics(),
        };
        let parquet = |name: &str, table: TableWriter<Vec<u8>>| {
            let bytes = table.bytes().map_err(defect)?;
            Ok::<_, BatchError>(OutputFile {
                name: name.to_owned(),
                bytes,
            })
        };
        let json = serde_json::to_string_pretty(&summary)? + "\n";
        let files = [
            parquet("fleet.parquet", self.robots)?,
            parquet("fleet-quantities.parquet", self.quantities)?,
            OutputFile::text("fleet.csv", self.csv),
            OutputFile::text("fleet.html", self.page.html(&summary)?),
            OutputFile::text("fleet.json", json.clone()),
        ];
        let written = folder.write(&files)?;
        Ok(Files {
            summary,
            json,
            written,
        })
    }
}
