//! A row of units below the header, a first line that states the separator, and texts in UTF-16.

use calib_recording::{
    AngleUnit, ColumnMap, Delimiter, Error, Filled, LengthUnit, Poses, ReadOptions, TimeColumn,
    TimeUnit, read_bytes,
};

fn read(text: impl AsRef<[u8]>, columns: Option<ColumnMap>) -> Result<Poses, Error> {
    let options = ReadOptions {
        columns,
        ..ReadOptions::default()
    };
    let recording = read_bytes("log.csv", text.as_ref(), &options)?;
    Ok(recording.poses(Filled::Exclude).expect("one table"))
}

fn refused(text: impl AsRef<[u8]>, columns: Option<ColumnMap>) -> String {
    match read(text, columns) {
        Ok(_) => "read".to_owned(),
        Err(error) => error.to_string(),
    }
}

/// 180° of `elbow`, 0.25 m of `lift`, the marker `tip` at (1, 2, 3) m, in two rows 0.5 s apart.
fn is_as_stated(poses: &Poses) {
    assert_eq!(poses.joints["elbow"][0], Some(std::f64::consts::PI));
    assert_eq!(poses.joints["lift"][0], Some(0.25));
    let tip = poses.markers["tip"][0].expect("a place");
    assert_eq!((tip.x, tip.y, tip.z), (1.0, 2.0, 3.0));
    assert_eq!(poses.t.as_deref(), Some(&[1.0, 1.5][..]));
}

const ROWS: &str = "1000,180,250,1000,2000,3000,5\n1500,90,0,1000,2000,3000,5\n";

#[test]
fn a_row_of_units_states_the_units_of_names_without_one() {
    for units in [
        "ms,deg,mm,mm,mm,mm,deg/s",
        "[ms],[deg],[mm],[mm],[mm],[mm],[deg/s]",
        "# a remark\n\n(ms),(°),(mm),millimeters,mm,mm,°/s",
    ] {
        let table = format!("time,elbow,lift,tip.x,tip.y,tip.z,elbow_speed\n{units}\n{ROWS}");
        is_as_stated(&read(&table, None).unwrap_or_else(|e| panic!("{units}: {e}")));
        let map = ColumnMap {
            time: Some(TimeColumn {
                column: "time".to_owned(),
                unit: TimeUnit::S,
            }),
            joints: [("elbow".to_owned(), "elbow".to_owned())].into(),
            prismatic: [("lift".to_owned(), "lift".to_owned())].into(),
            markers: [(
                "tip".to_owned(),
                ["tip.x", "tip.y", "tip.z"].map(String::from),
            )]
            .into(),
            ..ColumnMap::default()
        };
        is_as_stated(&read(&table, Some(map)).unwrap_or_else(|e| panic!("{units}: {e}")));
    }
    // Names that state the same, and a map whose names replace the header.
    let same = format!(
        "t_ms,elbow_deg,lift_mm,tip.x_mm,tip.y_mm,tip.z_mm,note\nms,deg,mm,mm,mm,mm,-\n{ROWS}"
    );
    is_as_stated(&read(same, None).expect("the same units"));
    let names = "t_ms,elbow,lift,tip.x,tip.y,tip.z,note"
        .split(',')
        .map(str::to_owned);
    let map = ColumnMap {
        skip_lines: 1,
        names: names.collect(),
        ..ColumnMap::default()
    };
    let table = format!("Zeit,E,L,X,Y,Z,N\nms,deg,mm,mm,mm,mm,\n{ROWS}");
    is_as_stated(&read(table, Some(map)).expect("names of the map"));
}

#[test]
fn a_row_of_units_that_contradicts_something_is_named_with_its_place() {
    let message = refused("elbow_deg,lift_mm\nrad,mm\n1,2\n", None);
    assert_eq!(
        message,
        "log.csv:2: column `elbow_deg`: this row states the unit `rad`, but the column's name states `deg`\n  help: find out which unit the numbers have, and correct the other: the row or the name"
    );
    let map = |angles, lengths| ColumnMap {
        angles,
        lengths,
        joints: [("elbow".to_owned(), "A [rad]".to_owned())].into(),
        prismatic: [("lift".to_owned(), "B".to_owned())].into(),
        ..ColumnMap::default()
    };
    let rad = AngleUnit::Rad;
    let text = "A [rad],B\ndeg,mm\n1,2\n";
    let said = refused(text, Some(map(rad, LengthUnit::M)));
    assert!(
        said.contains("`A [rad]`: this row states the unit `deg`"),
        "{said}"
    );
    let text = "A [rad],B\n,mm\n1,2\n";
    let said = refused(text, Some(map(rad, LengthUnit::Cm)));
    assert!(
        said.contains("but the column map states `lengths: cm`"),
        "{said}"
    );
    let said = refused("A [rad],B\n,deg\n1,2\n", Some(map(rad, LengthUnit::M)));
    assert!(
        said.contains("but the column is read as a length"),
        "{said}"
    );
    let said = refused("elbow,lift\ndeg,ell\n1,2\n", None);
    assert!(
        said.contains("log.csv:2: column `lift`: this row states units, and `ell` is not one"),
        "{said}"
    );
}

#[test]
fn rows_of_data_are_no_units() {
    // A trial called `m`, in which everything was lost; a number decides.
    let poses = read("trial,tip.x_m,tip.y_m,tip.z_m\nm,,,\nb,1,2,3\n", None).expect("a table");
    assert_eq!(poses.rows.len(), 2);
    let said = refused("elbow,lift_mm\ndeg,2\n", None);
    assert!(said.contains("`elbow` has no unit"), "{said}");
    let lost = ColumnMap {
        lost: vec!["m".to_owned()],
        ..ColumnMap::default()
    };
    let poses = read("tip.x_m,tip.y_m,tip.z_m\nm,m,m\n1,2,3\n", Some(lost)).expect("a table");
    assert_eq!(poses.rows, [2, 3]);
    // Units and nothing below them.
    let said = refused("elbow,lift\ndeg,mm\n", None);
    assert!(said.contains("log.csv:2: no data rows"), "{said}");
}

#[test]
fn a_first_line_that_states_the_separator_is_none_of_the_table() {
    for (line, separator) in [
        ("sep=;", ";"),
        ("SEP=,", ","),
        ("\"sep=\t\"", "\t"),
        ("sep=;;;", ";"),
    ] {
        // Commas within a name do not separate.
        let row = |cells: [&str; 3]| cells.join(separator);
        let name = if separator == "," {
            "note"
        } else {
            "a note, long"
        };
        let map = ColumnMap {
            labels: vec![name.to_owned()],
            ..ColumnMap::default()
        };
        let text = format!(
            "{line}\r\n{}\r\n{}\r\n",
            row(["elbow_deg", "lift_mm", name]),
            row(["180", "250", "good"])
        );
        let poses = read(&text, Some(map)).unwrap_or_else(|e| panic!("{line}: {e}"));
        assert_eq!(
            poses.joints["elbow"][0],
            Some(std::f64::consts::PI),
            "{line}"
        );
        assert_eq!(poses.rows, [3], "{line}");
    }
    let text = "sep=|\nelbow_deg|lift_mm\n180|250\n";
    assert_eq!(
        refused(text, None),
        "log.csv:1: the line states that `|` separates the cells\n  help: export with `,`, `;` or tabs between the cells, or delete this line and state `columns: {delimiter: …}`"
    );
    let own = ColumnMap {
        delimiter: Some(Delimiter::Semicolon),
        ..ColumnMap::default()
    };
    let text = "sep=,\nelbow_deg;lift_mm\n180;250\n";
    assert!(read(text, Some(own)).is_ok(), "the map decides");
}

#[test]
fn utf_16_is_read_as_the_same_text() {
    let text = "elbow;°C;lift\r\n°;°C;mm\r\n180;20;250\r\n";
    let text = text.replace("°C;lift", "temperature;lift");
    let units = || text.encode_utf16();
    let little = [
        vec![0xff, 0xfe],
        units().flat_map(u16::to_le_bytes).collect(),
    ]
    .concat();
    let big = [
        vec![0xfe, 0xff],
        units().flat_map(u16::to_be_bytes).collect(),
    ]
    .concat();
    let plain = [b"\xef\xbb\xbf", text.as_bytes()].concat();
    for bytes in [&little, &big, &plain] {
        let poses = read(bytes, None).expect("a table");
        assert_eq!(poses.joints["elbow"][0], Some(std::f64::consts::PI));
        assert_eq!(poses.joints["lift"][0], Some(0.25));
    }
    assert_eq!(
        refused(&little[..little.len() - 1], None),
        format!(
            "log.csv: byte {}: the file begins as UTF-16 text, and this byte is not UTF-16\n  help: copy the file again, or save it as UTF-8",
            little.len() - 2
        )
    );
}

#[test]
fn dates_are_times_in_seconds_since_1970() {
    let seconds = 1_714_564_800.125;
    for (name, first, second) in [
        (
            "t_s",
            "2024-05-01T12:00:00.125Z",
            "2024-05-01T12:00:01.125Z",
        ),
        (
            "t_ms",
            "2024-05-01 14:00:00.125+02:00",
            "2024-05-01 14:00:01.125+02:00",
        ),
        (
            "Timestamp",
            "2024/05/01 12:00:00.125",
            "2024/05/01 12:00:01.125",
        ),
        (
            "rec_time",
            "2024-05-01T12:00:00,125Z",
            "2024-05-01T12:00:01,125Z",
        ),
    ] {
        let text = format!("{name};elbow_deg\n{first};1\n{second};2\n");
        let poses = read(&text, None).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(
            poses.t.as_deref(),
            Some(&[seconds, seconds + 1.0][..]),
            "{name}"
        );
        let map = ColumnMap {
            time: Some(TimeColumn {
                column: name.to_owned(),
                unit: TimeUnit::S,
            }),
            ..ColumnMap::default()
        };
        let poses = read(&text, Some(map)).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(
            poses.t.as_deref(),
            Some(&[seconds, seconds + 1.0][..]),
            "{name}"
        );
    }
    let units = "time;elbow\n;deg\n2024-05-01T12:00:00.125Z;1\n";
    assert_eq!(
        read(units, None).expect("units").t.as_deref(),
        Some(&[seconds][..])
    );
    // Numbers below a date are other times, and the zone is stated always or never.
    for (second, before) in [
        ("2024-05-01T12:00:01", "an offset from UTC"),
        ("01.05.2024 12:00:01", "no time that can be read"),
        ("12:00:01", "no time that can be read"),
    ] {
        let said = refused(
            format!("t_s,a_deg\n2024-05-01T12:00:00Z,1\n{second},2\n"),
            None,
        );
        assert!(
            said.contains("log.csv:3: column `t_s`") && said.contains(before),
            "{said}"
        );
    }
    let said = refused("t_s,a_deg\n0.5,1\n2024-05-01T12:00:00Z,2\n", None);
    assert!(said.contains("the rows before have numbers"), "{said}");
    let said = refused("t_s,a_deg\n12:00:00,1\n", None);
    assert!(said.contains("2024-05-01T12:00:00.123Z"), "{said}");
    let said = refused("timestamp,a_deg\n1,1\n", None);
    assert!(said.contains("did you mean `t_s`?"), "{said}");
    let said = refused("stamp.sec,stamp.nanosec,a_deg\n1,5,1\n", None);
    assert!(!said.contains("did you mean"), "{said}");
}
