//! The files of a fleet: two tables in Parquet, one as CSV, a summary as JSON, and the page.

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};

use calib_files::{FileError, GrowingFile, OutputFile, ResultsFolder};
use calib_finding::cell as safe;

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

/// Names of the tables.
const ROBOTS: &str = "fleet.parquet";
const QUANTITIES: &str = "fleet-quantities.parquet";
const CSV: &str = "fleet.csv";
const PAGE: &str = "fleet.html";

/// Tables that are being made, row by row. All of them and the page grow on the disk: memory is that of one group of rows.
pub(super) struct Writing {
    robots: TableWriter<GrowingFile>,
    quantities: TableWriter<GrowingFile>,
    csv: BufWriter<GrowingFile>,
    page: Page,
    tally: Tally,
    summary: BTreeMap<String, u64>,
    failures: BTreeMap<String, u64>,
    count: u64,
    // Dropped last: a folder that was made is removed if it is empty.
    folder: ResultsFolder,
    out: PathBuf,
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

/// Rows of a group: a fleet of hundreds needs as much memory as one of ten thousands.
const GROUP: usize = 512;

fn table(
    folder: &ResultsFolder,
    out: &Path,
    (name, columns): (&str, &[(&str, Kind)]),
) -> Result<TableWriter<GrowingFile>, BatchError> {
    let columns: Vec<Column> = columns.iter().map(|(n, k)| Column::new(n, *k)).collect();
    let table = TableWriter::new(folder.grow(name)?, &columns, BTreeMap::new());
    let table = table.map_err(|fault| failed(out, name, fault))?;
    Ok(table.in_groups_of(GROUP))
}

/// What the system says of the file; anything else is a defect.
fn failed(out: &Path, name: &str, fault: TableFault) -> BatchError {
    BatchError::Work(match fault {
        TableFault::Unwritable(source) => FleetError::File(FileError::Write {
            path: out.join(name),
            source,
        }),
        fault => FleetError::Table(fault),
    })
}

/// A file that cannot be written.
fn unwritten(out: &Path, name: &str) -> impl FnOnce(io::Error) -> BatchError {
    let path = out.join(name);
    |source| BatchError::Work(FleetError::File(FileError::Write { path, source }))
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
        Cell::Text(text) => safe(text).into_owned(),
        Cell::Integer(value) => value.to_string(),
        // The shortest that reads back as the same number.
        Cell::Real(value) => format!("{value:e}"),
        Cell::Boolean(value) => value.to_string(),
    }
}

impl Writing {
    /// Starts the tables in the folder `out`, which is locked.
    pub fn new(folder: ResultsFolder, out: &Path) -> Result<Self, BatchError> {
        let head = line(ROBOT.iter().map(|(name, _)| (*name).to_owned()));
        let mut csv = BufWriter::new(folder.grow(CSV)?);
        csv.write_all(head.as_bytes())
            .map_err(unwritten(out, CSV))?;
        let page = Page::new(folder.grow(PAGE)?);
        Ok(Self {
            robots: table(&folder, out, (ROBOTS, ROBOT))?,
            quantities: table(&folder, out, (QUANTITIES, QUANTITY))?,
            csv,
            page: page.map_err(unwritten(out, PAGE))?,
            tally: Tally::default(),
            summary: BTreeMap::new(),
            failures: BTreeMap::new(),
            count: 0,
            folder,
            out: out.to_path_buf(),
        })
    }

    /// Adds a robot to all of them.
    pub fn add(&mut self, robot: &Robot) -> Result<(), BatchError> {
        let cells = cells(robot);
        let text = line(cells.iter().map(shown));
        let written = self.csv.write_all(text.as_bytes());
        written.map_err(unwritten(&self.out, CSV))?;
        let of_robots = |fault| failed(&self.out, ROBOTS, fault);
        self.robots.push(cells).map_err(of_robots)?;
        for quantity in &robot.quantities {
            let cells = of_quantity(robot, quantity);
            let of_quantities = |fault| failed(&self.out, QUANTITIES, fault);
            self.quantities.push(cells).map_err(of_quantities)?;
        }
        let added = self.page.add(robot);
        added.map_err(unwritten(&self.out, PAGE))?;
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
    pub fn write(self) -> Result<Files, BatchError> {
        let summary = Summary {
            calib_fleet: 1,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            robots: self.count,
            verdicts: self.summary,
            failures: self.failures,
            drift: self.tally.statistics(),
        };
        let json = serde_json::to_string_pretty(&summary)? + "\n";
        let finished = |name: &str, table: TableWriter<GrowingFile>| {
            let finished = table.finish();
            finished.map_err(|fault| failed(&self.out, name, fault))
        };
        let csv = self
            .csv
            .into_inner()
            .map_err(io::IntoInnerError::into_error);
        let grown = vec![
            finished(ROBOTS, self.robots)?,
            finished(QUANTITIES, self.quantities)?,
            csv.map_err(unwritten(&self.out, CSV))?,
            self.page
                .end(&summary)
                .map_err(unwritten(&self.out, PAGE))?,
        ];
        let files = [OutputFile::text("fleet.json", json.clone())];
        let written = self.folder.write_with(grown, &files)?;
        Ok(Files {
            summary,
            json,
            written,
        })
    }
}
