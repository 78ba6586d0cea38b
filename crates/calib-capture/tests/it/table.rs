//! The growing file: on the disk every second, readable when cut, gone on with.

use calib_capture::Table;
use calib_recording::{ReadOptions, read_path};
use std::path::Path;

const HEADER: &str = "frame,t_s,host_s,hold,waist_deg,h.x_m,h.y_m,h.z_m,h.qx,h.qy,h.qz,h.qw";

fn row(i: u32) -> String {
    format!(
        "{i},{}.25,{}.5,{},{i},0.1,0.2,0.3,0,0,0,1",
        i,
        1000 + i,
        1 + i / 3
    )
}

fn rows_on_disk(path: &Path) -> usize {
    let text = std::fs::read_to_string(path).expect("readable");
    text.lines().filter(|l| !l.starts_with('#')).count() - 1
}

#[test]
fn rows_wait_at_most_a_second() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("new/sweep.csv");
    let mut table = Table::create(&path, &["a\nb".to_string()], HEADER).expect("made");
    for i in 0..200u32 {
        let now = 100.0 + f64::from(i) * 0.01;
        table.row(&row(i), now).expect("written");
        let waiting = i as usize + 1 - rows_on_disk(&path);
        assert!(waiting <= 100, "{waiting} rows wait at {now}");
    }
    // What waits goes without a further row.
    table.tick(103.0).expect("written");
    assert_eq!(rows_on_disk(&path), 200);
    let error = Table::create(&path, &[], HEADER).expect_err("it exists");
    assert!(error.to_string().contains("already exists"), "{error}");
}

#[test]
fn a_cut_file_is_read_up_to_its_last_whole_row_and_gone_on_with() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("sweep.csv");
    let mut table = Table::create(&path, &[], HEADER).expect("made");
    for i in 0..6 {
        table.row(&row(i), 0.0).expect("written");
    }
    table.flush().expect("written");
    drop(table);
    let whole = std::fs::read(&path).expect("bytes");
    let last = whole[..whole.len() - 1]
        .iter()
        .rposition(|&b| b == b'\n')
        .expect("rows")
        + 1;
    for length in last..whole.len() {
        std::fs::write(&path, &whole[..length]).expect("cut");
        let recording = read_path(&path, &ReadOptions::default()).expect("readable");
        assert_eq!(recording.timelines[0].len(), 5, "{length}");
        let cut = recording
            .meta
            .findings
            .iter()
            .any(|f| f.id == calib_finding::catalog::ROW_CUT_OFF);
        assert_eq!(cut, length > last, "{length}");
        let mut table = Table::append(&path, HEADER, None).expect("gone on with");
        assert_eq!((table.rows, table.last_time), (5, Some(4.25)));
        assert_eq!(table.held, ["1", "2"]);
        table.row(&row(7), 0.0).expect("written");
        table.flush().expect("written");
        let recording = read_path(&path, &ReadOptions::default()).expect("readable");
        assert_eq!(recording.timelines[0].t.as_ref().expect("timed")[5], 7.25);
        assert_eq!(
            recording.timelines[0]
                .received
                .as_ref()
                .expect("both clocks")[5],
            1007.5
        );
    }
}

#[test]
fn another_file_is_left_alone() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("a.csv");
    for (text, expected) in [
        ("", "its columns are"),
        ("x_m,y_m\n1,2\n", "its columns are"),
        ("frame,t_s\n", "its columns are"),
    ] {
        std::fs::write(&path, text).expect("written");
        let error = Table::append(&path, HEADER, None)
            .expect_err("another")
            .to_string();
        assert!(error.contains(expected), "{error}");
        assert_eq!(std::fs::read_to_string(&path).expect("there"), text);
    }
    let own = format!("{HEADER}\n");
    std::fs::write(&path, &own).expect("written");
    let error = Table::append(&path, HEADER, None)
        .expect_err("by hand")
        .to_string();
    assert!(error.contains("not made by `calib record`"), "{error}");
    assert!(Table::append(&folder.path().join("none.csv"), HEADER, None).is_err());
}

#[test]
fn a_table_by_hand_keeps_its_last_row_without_line_break() {
    let text = "t_s,waist_deg\n1,2\n2,3";
    let recording =
        calib_recording::read_bytes("a.csv", text.as_bytes(), &ReadOptions::default()).expect("ok");
    assert_eq!(recording.timelines[0].len(), 2);
}
