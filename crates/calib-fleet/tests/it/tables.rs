//! Tables: what is written is read, the same rows are the same bytes, and no damage passes.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use calib_fleet::table::{
    Cell, Column, GROUP_BYTES, GROUP_ROWS, Kind, Row, TableFault, TableReader, TableWriter,
};

fn columns() -> Vec<Column> {
    vec![
        Column::new("name", Kind::Text),
        Column::new("count", Kind::Integer),
        Column::new("error_m", Kind::Real),
        Column::new("accepted", Kind::Boolean),
    ]
}

/// Every kind, empty cells in every column, edges of the numbers.
fn rows(count: usize) -> Vec<Row> {
    let row = |i: usize| -> Row {
        let known = |every: usize, cell: Cell| match i % every {
            0 => Cell::Empty,
            _ => cell,
        };
        let real = [0.1, -0.0, f64::MIN_POSITIVE, f64::MAX, 1.0 / 3.0][i % 5];
        vec![
            known(7, Cell::Text(format!("robot é {i}"))),
            known(5, Cell::Integer(i64::MIN + i as i64)),
            known(3, Cell::Real(real)),
            known(2, Cell::Boolean(i % 4 == 1)),
        ]
    };
    (0..count).map(row).collect()
}

fn write(path: &Path, columns: &[Column], rows: &[Row]) {
    let facts = BTreeMap::from([("calib.kind".to_owned(), "test".to_owned())]);
    let file = File::create(path).expect("a file");
    let mut table = TableWriter::new(file, columns, facts).expect("a table");
    for row in rows {
        table.push(row.clone()).expect("a row");
    }
    table.finish().expect("a footer");
}

fn read(path: &Path) -> Result<Vec<Vec<Row>>, TableFault> {
    let mut table = TableReader::new(File::open(path).expect("a file"))?;
    let mut groups = Vec::new();
    while let Some(group) = table.group()? {
        groups.push(group);
    }
    Ok(groups)
}

#[test]
fn what_is_written_is_read_and_has_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    for count in [0, 1, GROUP_ROWS, GROUP_ROWS + 1, 3 * GROUP_ROWS - 1] {
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        let rows = rows(count);
        write(&a, &columns(), &rows);
        write(&b, &columns(), &rows);
        assert_eq!(std::fs::read(&a).unwrap(), std::fs::read(&b).unwrap());
        let groups = read(&a).expect("whole");
        assert_eq!(groups.len(), count.div_ceil(GROUP_ROWS));
        assert!(groups.concat() == rows, "{count} rows");
        let table = TableReader::new(File::open(&a).unwrap()).expect("whole");
        assert_eq!(table.columns(), columns());
        assert_eq!(
            (table.rows(), &*table.facts()["calib.kind"]),
            (count as u64, "test")
        );
    }
}

#[test]
fn long_rows_make_small_groups() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a");
    let column = [Column::new("text", Kind::Text)];
    let long: Vec<Row> = (0..5)
        .map(|i| {
            vec![Cell::Text(
                char::from(b'a' + i)
                    .to_string()
                    .repeat(GROUP_BYTES / 2 - 10),
            )]
        })
        .collect();
    write(&path, &column, &long);
    let groups = read(&path).expect("whole");
    let lengths: Vec<usize> = groups.iter().map(Vec::len).collect();
    assert_eq!(lengths, [2, 2, 1]);
    assert!(groups.concat() == long);
}

#[test]
fn a_row_that_does_not_fit_is_refused() {
    let sink: Vec<u8> = Vec::new();
    let mut table = TableWriter::new(sink, &columns(), BTreeMap::new()).expect("a table");
    let row = vec![Cell::Empty, Cell::Real(1.0), Cell::Empty, Cell::Empty];
    let refused = table.push(row).expect_err("a real among integers");
    assert_eq!(refused.to_string(), "a row does not fit the column `count`");
    let refused = table.push(vec![Cell::Empty; 3]).expect_err("too short");
    assert_eq!(
        refused.to_string(),
        "a row does not fit the column `accepted`"
    );
}

/// Every length that a torn file can have, and every byte changed.
#[test]
fn no_damage_passes() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a");
    let rows = rows(12);
    write(&path, &columns(), &rows);
    let whole = std::fs::read(&path).expect("bytes");
    let damaged = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("a file");
        read(&path)
    };
    for length in 0..whole.len() {
        assert!(damaged(&whole[..length]).is_err(), "torn at {length}");
    }
    for place in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[place] ^= 0x55;
        // The footer states more than the cells: what is read must be what was written.
        if let Ok(groups) = damaged(&bytes) {
            assert!(groups.concat() == rows, "byte {place} changed cells");
        }
    }
}

/// Another program reads the same.
#[test]
fn pyarrow_reads_the_same() {
    let Some(python) = skipped_tests::checker("pyarrow") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.parquet");
    let rows = rows(GROUP_ROWS + 10);
    write(&path, &columns(), &rows);
    let script = "import json, sys, pyarrow.parquet as pq\n\
        file = pq.ParquetFile(sys.argv[1])\n\
        print(json.dumps([str(f.type) for f in file.schema_arrow]))\n\
        print(file.num_row_groups, file.metadata.metadata[b'calib.kind'].decode())\n\
        for row in file.read().to_pylist():\n    print(json.dumps(list(row.values())))\n";
    let ran = std::process::Command::new(python)
        .args(["-c", script])
        .arg(&path)
        .output()
        .expect("python starts");
    assert!(ran.status.success(), "{ran:?}");
    let said = String::from_utf8(ran.stdout).expect("text");
    let mut lines = said.lines();
    assert_eq!(
        lines.next(),
        Some(r#"["string", "int64", "double", "bool"]"#)
    );
    assert_eq!(lines.next(), Some("2 test"));
    let value = |cell: &Cell| match cell {
        Cell::Empty => serde_json::Value::Null,
        Cell::Text(text) => text.as_str().into(),
        Cell::Integer(value) => (*value).into(),
        Cell::Real(value) => (*value).into(),
        Cell::Boolean(value) => (*value).into(),
    };
    let mut compared = 0;
    for (line, row) in lines.zip(&rows) {
        let found: Vec<serde_json::Value> = serde_json::from_str(line).expect("JSON");
        let expected: Vec<serde_json::Value> = row.iter().map(value).collect();
        assert_eq!(found, expected);
        compared += 1;
    }
    assert_eq!(compared, rows.len());
}
