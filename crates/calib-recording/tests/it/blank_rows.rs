//! Rows of separators only, and rows with too many cells.

use calib_recording::{ReadOptions, Recording, read_bytes};

fn read(text: &str) -> Result<Recording, String> {
    read_bytes("t.csv", text.as_bytes(), &ReadOptions::default()).map_err(|e| e.to_string())
}

fn lines(text: &str) -> Vec<u64> {
    let recording = read(text).unwrap_or_else(|e| panic!("{e}"));
    recording.timelines[0].rows.clone()
}

#[test]
fn rows_of_separators_are_blank() {
    let poses = "elbow_deg;m.x_mm;m.y_mm;m.z_mm\n1;1;2;3\n;;;\n2;;;\n; ; ;\n;;;\n";
    assert_eq!(lines(poses), [2, 4], "a row without a marker is one");
    assert_eq!(lines("t_s,elbow_deg\n0,1\n,\n1,2\n,\n"), [2, 4]);
    assert_eq!(lines(";;\n\nt_s;elbow_deg;\n0;1;\n;;\n"), [4]);
    assert_eq!(lines("frame\telbow_deg\n1\t1\n\t\n2\t2\n"), [2, 4]);
    let none = read("elbow_deg,m.x_m,m.y_m,m.z_m\n,,,\n").expect_err("no pose");
    assert!(none.contains("no data rows"), "{none}");
}

#[test]
fn a_lost_row_of_a_tracker_that_only_its_place_numbers_is_kept() {
    let text = "m.x_mm,m.y_mm,m.z_mm\n1,2,3\n,,\n4,5,6\n,,\n,,\n";
    assert_eq!(lines(text), [2, 3, 4]);
}

#[test]
fn a_row_that_is_too_long_is_shortened_and_not_completed() {
    let header = "pose,elbow_deg,m.x_mm,m.y_mm,m.z_mm";
    for (row, cells, said, not) in [
        (
            "0,1.5,2.5,3.5,4.5,9.5",
            6,
            "help: delete the extra cells",
            "comma",
        ),
        ("0,12,5,20,30,40", 6, "decimal comma", "complete"),
        (
            "0,12,5,-100,25,200,1,300,0",
            9,
            "`300,0` may be",
            "complete",
        ),
        ("0,1,2", 3, "help: complete the line", "delete"),
    ] {
        let found = read(&format!("{header}\n{row}\n")).expect_err(row);
        let begins = format!("t.csv:2: {cells} cells, the header has 5");
        assert!(found.starts_with(&begins), "{found}");
        assert!(
            found.contains(said) && !found.contains(not),
            "{row}: {found}"
        );
    }
}
