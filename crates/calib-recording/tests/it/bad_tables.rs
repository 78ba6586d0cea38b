//! What is wrong with a table is said with a place: the messages are what a person reads.

use calib_recording::{
    AngleUnit, BodyColumns, ColumnMap, Error, Filled, LengthUnit, ReadOptions, read_bytes,
    read_path, read_path_with,
};

fn error(text: impl AsRef<[u8]>) -> String {
    read_bytes("poses.csv", text.as_ref(), &ReadOptions::default())
        .map(|_| ())
        .map_err(|e| e.to_string())
        .expect_err("bad table")
}

#[test]
fn every_bad_table_has_its_message() {
    let wide = "pose,elbow_rad,m.x_m,m.y_m,m.z_m";
    let cases: &[(&str, String)] = &[
        ("empty file", String::new()),
        ("only comments", "# nothing\n".into()),
        ("no rows", format!("{wide}\n")),
        (
            "duplicated column",
            "elbow_rad,m.x_m,elbow_rad\n1,2,3\n".into(),
        ),
        (
            "same joint in two units",
            "elbow_rad,elbow_deg\n1,2\n".into(),
        ),
        ("missing unit", "pose,elbow\n0,1\n".into()),
        ("misspelt unit", "pose,elbow_dge\n0,1\n".into()),
        ("misspelt word", "trail,elbow_deg\n0,1\n".into()),
        ("marker without z", "m.x_m,m.y_m\n0,1\n".into()),
        (
            "body without qw",
            "b.x_m,b.y_m,b.z_m,b.qx,b.qy,b.qz\n1,2,3,0,0,0\n".into(),
        ),
        (
            "one axis in two units",
            "m.x_m,m.x_mm,m.y_m,m.z_m\n1,1,1,1\n".into(),
        ),
        ("ragged row", format!("{wide}\n0,1,2,3,4\n1,1,2,3\n")),
        ("row too long", format!("{wide}\n0,1,2,3,4,5\n")),
        (
            "not a number",
            format!("{wide}\n0,1,2,3,4\n1,1,2,three,4\n"),
        ),
        ("decimal comma", "elbow_rad;lift_m\n1,5;2\n".into()),
        ("infinite", format!("{wide}\n0,1,2,inf,4\n")),
        ("joint is NaN", format!("{wide}\n0,NaN,2,3,4\n")),
        ("partly lost marker", format!("{wide}\n0,1,2,,4\n")),
        (
            "partly lost body",
            "x_m,y_m,z_m,qx,qy,qz,qw\n1,2,3,0,0,,1\n".into(),
        ),
        (
            "quaternion of length 2",
            "x_m,y_m,z_m,qx,qy,qz,qw\n1,2,3,0,0,0,2\n".into(),
        ),
        (
            "time goes back",
            "t_s,elbow_rad\n0.1,1\n0.3,1\n0.2,1\n".into(),
        ),
        ("row without time", "t_s,elbow_rad\n,1\n".into()),
        (
            "frame goes back",
            "frame,marker,x_m,y_m,z_m\n2,a,1,1,1\n1,a,1,1,1\n".into(),
        ),
        (
            "marker twice in a frame",
            "frame,marker,x_m,y_m,z_m\n2,a,1,1,1\n2,a,1,1,1\n".into(),
        ),
        (
            "marker without name",
            "frame,marker,x_m,y_m,z_m\n2,,1,1,1\n".into(),
        ),
        (
            "long table with named markers",
            "frame,point,elbow_rad,x_m,y_m,z_m,b.x_m,b.y_m,b.z_m\n2,a,1,1,1,1,1,1,1\n".into(),
        ),
        (
            "two poses of one name",
            "pose,elbow_deg,point,x_m,y_m,z_m\nP1,10,a,1,1,1\nP2,10,a,1,1,1\nP1,11,b,1,1,1\n"
                .into(),
        ),
        (
            "point twice in a pose",
            "pose,elbow_deg,point,x_m,y_m,z_m\nP1,10,a,1,1,1\nP2,10,a,1,1,1\nP1,10,a,1,1,1\n"
                .into(),
        ),
        (
            "point without pose",
            "pose,elbow_deg,point,x_m,y_m,z_m\n,10,a,1,1,1\n".into(),
        ),
        (
            "joint of a pose not a number",
            "pose,elbow_deg,point,x_m,y_m,z_m\nP1,nan,a,1,1,1\n".into(),
        ),
        (
            "decimal commas without a map",
            "pose;elbow_deg;point;x_mm;y_mm;z_mm\nP1;10,5;a;1,5;1;1\n".into(),
        ),
        (
            "long table without frames",
            "marker,x_m,y_m,z_m\na,1,1,1\n".into(),
        ),
        ("no quantities", "pose,trial\n0,a\n".into()),
        ("a sentence", "this is no table\n".into()),
        (
            "unknown state",
            "m.x_m,m.y_m,m.z_m,m.state\n1,1,1,guessed\n".into(),
        ),
    ];
    let messages: Vec<String> = cases
        .iter()
        .map(|(what, text)| format!("{what}\n    {}\n", error(text)))
        .collect();
    insta::assert_snapshot!(messages.join(""));
}

#[test]
fn what_is_no_text_is_refused() {
    assert_eq!(
        error(b"q_rad\n1\n\xff\xfe\n"),
        "poses.csv:3: byte 0 of this line is not UTF-8\n  help: save the file as UTF-8"
    );
    assert!(
        error([0u8; 600]).contains("no reader recognizes"),
        "{}",
        error([0u8; 600])
    );
}

#[test]
fn missing_and_huge_files_are_refused_without_reading_them() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let missing =
        read_path(&dir.path().join("none.csv"), &ReadOptions::default()).expect_err("missing");
    assert!(
        missing.to_string().contains("none.csv: cannot be read"),
        "{missing}"
    );
    assert!(std::error::Error::source(&missing).is_some());
    let huge = dir.path().join("huge.csv");
    let file = std::fs::File::create(&huge).expect("writable");
    file.set_len(1 << 40).expect("sparse file");
    let error = read_path(&huge, &ReadOptions::default()).expect_err("huge");
    assert!(error.to_string().contains("limit"), "{error}");
    let folder = read_path(dir.path(), &ReadOptions::default()).expect_err("a folder");
    assert!(folder.to_string().contains("cannot be read"), "{folder}");
}

#[test]
fn a_name_column_that_is_no_name_does_not_fill_memory() {
    let mut text = String::from("frame,marker,x_m,y_m,z_m\n");
    for i in 0..60_000 {
        text.push_str(&format!("{i},m{i},1,2,3\n"));
    }
    assert!(
        error(&text).contains("is the name column right"),
        "{}",
        error(&text)
    );
}

fn mapped(map: ColumnMap, text: &str) -> Result<(), Error> {
    read_bytes(
        "log.csv",
        text.as_bytes(),
        &ReadOptions {
            columns: Some(map),
            ..ReadOptions::default()
        },
    )
    .map(|_| ())
}

#[test]
fn a_mapped_column_that_ends_in_a_unit_has_that_unit() {
    let read = |angles, lengths| {
        let map = ColumnMap {
            angles,
            lengths,
            joints: [("a".to_owned(), "b_deg".to_owned())].into(),
            prismatic: [("s".to_owned(), "t_mm".to_owned())].into(),
            ..ColumnMap::default()
        };
        let options = ReadOptions {
            columns: Some(map),
            ..ReadOptions::default()
        };
        let recording = read_bytes("log.csv", b"b_deg,t_mm\n90,250\n", &options)?;
        let poses = recording.poses(Filled::Exclude).expect("one table");
        let value = |joint: &str| poses.joints[joint][0].expect("a value");
        Ok::<_, Error>((value("a"), value("s")))
    };
    for angles in [AngleUnit::Rad, AngleUnit::Deg] {
        let (angle, length) = read(angles, LengthUnit::M).expect("units are in the names");
        assert!((angle - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert_eq!(length, 0.25);
    }
    let message = read(AngleUnit::Rad, LengthUnit::Cm).expect_err("two units");
    assert!(
        message
            .to_string()
            .contains("`lengths: cm` in the column map contradicts the name of column `t_mm`"),
        "{message}"
    );
}

#[test]
fn units_of_length_at_the_end_of_names_count_with_and_without_a_map() {
    for unit in LengthUnit::ALL {
        let value = 0.25 * unit.per_meter();
        let [x, y, z] = ["x", "y", "z"].map(|axis| format!("P_{axis}_{}", unit.name()));
        let text = format!("{x},{y},{z}\n{value},{value},{value}\n");
        let read = |columns: Option<ColumnMap>| {
            let options = ReadOptions {
                columns,
                ..ReadOptions::default()
            };
            read_bytes("tracker.csv", text.as_bytes(), &options)
        };
        let map = |lengths: LengthUnit| ColumnMap {
            lengths,
            markers: [("P".to_owned(), [x.clone(), y.clone(), z.clone()])].into(),
            ..ColumnMap::default()
        };
        for columns in [None, Some(map(LengthUnit::M)), Some(map(unit))] {
            let poses = read(columns).map(|r| r.poses(Filled::Exclude).expect("one table"));
            let poses = poses.unwrap_or_else(|e| panic!("{unit:?}: {e}"));
            let p = poses.markers["P"][0].expect("a place");
            assert!((p.x - 0.25).abs() < 1e-12, "{unit:?}: {p}");
        }
        // A map that says another unit contradicts the names.
        let other = if unit == LengthUnit::Cm {
            LengthUnit::Mm
        } else {
            LengthUnit::Cm
        };
        let said = read(Some(map(other))).expect_err("two units").to_string();
        assert!(
            said.contains(&format!("`lengths: {}`", other.name())),
            "{said}"
        );
    }
    // Words that are units as well are units behind a coordinate only.
    let options = ReadOptions::default();
    let plug = read_bytes("log.csv", b"a_deg,plug_in\n1,2\n", &options);
    assert!(plug.is_err() || plug.is_ok_and(|r| r.joints.iter().all(|j| j.name != "plug")));
}

#[test]
fn a_column_map_that_does_not_fit_says_which_column() {
    let joints = |column: &str| ColumnMap {
        joint_columns: vec![column.into()],
        ..ColumnMap::default()
    };
    let message = mapped(joints("arm_1_jonit"), "arm_1_joint\n1\n")
        .expect_err("misspelt")
        .to_string();
    assert_eq!(
        message,
        "log.csv:1: joint `arm_1_jonit` needs column `arm_1_jonit`, which the header does not have; did you mean `arm_1_joint`?\n  help: correct the name, or map the columns with a column map (`columns` in the profile)"
    );
    let preset = ColumnMap {
        preset: Some("ur_rdte".into()),
        ..ColumnMap::default()
    };
    let message = mapped(preset, "a b\n1 2\n")
        .expect_err("no such preset")
        .to_string();
    assert!(message.contains("did you mean `ur_rtde`?"), "{message}");
    let columns = ["x", "y", "z"].map(String::from);
    let body = BodyColumns {
        position: columns,
        ..BodyColumns::default()
    };
    let map = ColumnMap {
        bodies: [("b".to_string(), body)].into(),
        ..ColumnMap::default()
    };
    let message = mapped(map, "x,y,z\n1,2,3\n")
        .expect_err("no rotation")
        .to_string();
    assert!(message.contains("quaternion_xyzw"), "{message}");
    let twice = ColumnMap {
        joint_columns: vec!["a".into(), "a".into()],
        ..ColumnMap::default()
    };
    assert!(mapped(twice, "a\n1\n").is_err());
}

#[test]
fn a_reader_that_does_not_exist_is_named() {
    let options = ReadOptions {
        format: Some("cvs".into()),
        ..ReadOptions::default()
    };
    let message = read_bytes("a.csv", b"q_rad\n1\n", &options)
        .expect_err("no such reader")
        .to_string();
    assert!(message.contains("did you mean `csv`?"), "{message}");
}

#[test]
fn progress_is_told_to_the_end() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join("long.csv");
    let text: String = std::iter::once("q_rad\n".to_string())
        .chain((0..400_000).map(|i| format!("{}.5\n", i % 9)))
        .collect();
    std::fs::write(&path, &text).expect("writable");
    let mut told = Vec::new();
    let recording = read_path_with(&path, &ReadOptions::default(), &mut |done, all| {
        told.push((done, all))
    })
    .expect("a table");
    assert_eq!(recording.joints[0].q.len(), 400_000);
    let bytes = text.len() as u64;
    assert!(
        told.len() >= 2 && told.iter().all(|&(done, all)| done <= all && all == bytes),
        "{told:?}"
    );
    assert_eq!(told.last(), Some(&(bytes, bytes)));
}
