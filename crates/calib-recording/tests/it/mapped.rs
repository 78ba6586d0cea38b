//! Tables that are written for a column map: the map reads back what was written, or the reason is stated.

use std::f64::consts::FRAC_PI_2;

use calib_recording::{
    ColumnMap, Filled, Poses, ReadOptions, WriteOptions, read_bytes, write_mapped,
};
use nalgebra::{UnitQuaternion, Vector3};

fn poses() -> Poses {
    let text = "elbow_deg,lift_mm,wrist_deg,elbow_nm,m1.x_mm,m1.y_mm,m1.z_mm,m2.x_mm,m2.y_mm,m2.z_mm,hand.x_m,hand.y_m,hand.z_m,hand.qx,hand.qy,hand.qz,hand.qw\n\
                10,250,-20,1.5,1000,2000,3000,5,6,7,0.1,0.2,0.3,0.5,0.5,0.5,0.5\n\
                -90,1,30,-2,,,,5,6,8,0.4,0.2,0.3,0,0,0,1\n";
    let read = read_bytes("poses.csv", text.as_bytes(), &ReadOptions::default());
    let read = read.unwrap_or_else(|e| panic!("{e}"));
    read.poses(Filled::Exclude).expect("one table")
}

fn map(json: &str) -> ColumnMap {
    serde_json::from_str(json).unwrap_or_else(|e| panic!("{e}: {json}"))
}

fn options() -> WriteOptions {
    WriteOptions {
        comments: vec!["simulated".to_owned()],
        degrees: true,
        ..WriteOptions::micro()
    }
}

/// Joints that are called like coordinates stay joints beside a body that the map names.
#[test]
fn joints_x_y_and_z_beside_a_mapped_body_are_no_marker() {
    let text = "x_mm,y_mm,z_mm,hx_mm,hy_mm,hz_mm,a_deg,b_deg,c_deg\n100,200,-50,1,2,3,10,20,30\n";
    let body = r#"{"bodies": {"hand": {"position": ["hx_mm", "hy_mm", "hz_mm"], "fixed_xyz": ["a_deg", "b_deg", "c_deg"]}}, "angles": "deg"}"#;
    let options = ReadOptions {
        columns: Some(map(body)),
        joints: ["x", "y", "z"].map(str::to_owned).to_vec(),
        ..ReadOptions::default()
    };
    let read = read_bytes("t.csv", text.as_bytes(), &options);
    let read = read.unwrap_or_else(|e| panic!("{e}"));
    let read = read.poses(Filled::Exclude).expect("one table");
    assert!(read.markers.is_empty(), "{:?}", read.markers);
    let of = |joint: &str| read.joints[joint][0].expect("given");
    assert_eq!([of("x"), of("y"), of("z")], [0.1, 0.2, -0.05]);
}

/// Matrices and axes with angles: a quarter turn about z, written by hand; what is no rotation is refused with its row.
#[test]
fn matrices_and_axes_with_angles_must_be_rotations() {
    let read = |turn: &str, names: &str, numbers: &str| {
        let names: Vec<String> = names.split(',').map(|name| format!("{name:?}")).collect();
        let body = format!(
            r#"{{"bodies": {{"hand": {{"position": ["x", "y", "z"], "{turn}": [{}]}}}}}}"#,
            names.join(",")
        );
        let options = ReadOptions {
            columns: Some(map(&body)),
            ..ReadOptions::default()
        };
        let names = names.join(",").replace('"', "");
        let text = format!(
            "x,y,z,{names}\n0,0,0,{}\n1,2,3,{numbers}\n",
            "0,".repeat(names.split(',').count() - 1) + "0"
        );
        let read = read_bytes("t.csv", text.as_bytes(), &options).map_err(|e| e.to_string())?;
        let read = read.poses(Filled::Exclude).expect("one table");
        Ok::<_, String>(read.bodies["hand"].clone())
    };
    let nine = "a,b,c,d,e,f,g,h,i";
    let four = "a,b,c,d_deg";
    let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2);
    for (turn, names, numbers) in [
        ("rotation_matrix", nine, "0,-1,0,1,0,0,0,0,1"),
        ("axis_angle", four, "0,0,1,90"),
        ("axis_angle", four, "0,0,-1,-90"),
    ] {
        let read = read(turn, names, numbers).unwrap_or_else(|e| panic!("{e}"));
        let pose = read[1].expect("given");
        assert!(pose.rotation.angle_to(&quarter) < 1e-12, "{turn}: {pose}");
        assert_eq!(pose.translation.vector, Vector3::new(1.0, 2.0, 3.0));
    }
    // A row of zeros is a body that was lost.
    let lost = read("rotation_matrix", nine, "1,0,0,0,1,0,0,0,1").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(lost[0], None);
    for (turn, names, numbers, says) in [
        (
            "rotation_matrix",
            nine,
            "0,1,0,1,0,0,0,0,1",
            "determinant -1.0000",
        ),
        (
            "rotation_matrix",
            nine,
            "0,-1.1,0,1,0,0,0,0,1",
            "the matrix is no rotation",
        ),
        ("rotation_matrix", nine, "0,-1,0,1,0,0,0,,1", "11 of 12"),
        (
            "axis_angle",
            four,
            "0,0,2,90",
            "the axis of rotation has length 2.000000",
        ),
    ] {
        let error = read(turn, names, numbers).expect_err(says);
        assert!(error.contains(says) && error.contains("t.csv:3"), "{error}");
    }
}

/// Angles of a body in another unit than joints, about axes that turn, and a pose of the tracker in the body: by hand, 90° about z, then 90° about the new x.
#[test]
fn angles_about_turning_axes_are_read_as_they_say() {
    let text = "j,x,y,z,a,b,c\n0.5,1,2,3,90,90,0\n";
    let read = |inverted: bool| {
        let body = format!(
            r#"{{"joint_columns": ["j"], "bodies": {{"hand": {{"position": ["x", "y", "z"],
            "euler": {{"axes": "zxy", "columns": ["a", "b", "c"]}}, "inverted": {inverted}}}}}, "body_angles": "deg"}}"#
        );
        let options = ReadOptions {
            columns: Some(map(&body)),
            ..ReadOptions::default()
        };
        let read = read_bytes("t.csv", text.as_bytes(), &options);
        let read = read.unwrap_or_else(|e| panic!("{e}"));
        read.poses(Filled::Exclude).expect("one table")
    };
    let straight = read(false);
    assert_eq!(straight.joints["j"][0], Some(0.5));
    let pose = straight.bodies["hand"][0].expect("given");
    // The body's y is the tracker's z, its z the tracker's x.
    let turned = pose * nalgebra::Vector3::new(0.0, 1.0, 0.0);
    assert!((turned - nalgebra::Vector3::z()).norm() < 1e-12);
    let turned = pose * nalgebra::Vector3::new(0.0, 0.0, 1.0);
    assert!((turned - nalgebra::Vector3::x()).norm() < 1e-12);
    let back = read(true).bodies["hand"][0].expect("given") * pose;
    assert!(back.translation.vector.norm() < 1e-12 && back.rotation.angle() < 1e-12);
}

/// Zeros, and zeros with the quaternion of no rotation, are lost poses in any notation; a reference that stays at the origin is none.
#[test]
fn poses_of_nothing_are_lost() {
    let read = |text: &str, map_of: Option<&str>| {
        let options = ReadOptions {
            columns: map_of.map(map),
            ..ReadOptions::default()
        };
        let read = read_bytes("t.csv", text.as_bytes(), &options);
        let read = read.unwrap_or_else(|e| panic!("{e}"));
        let found = read.meta.findings.iter().map(|f| f.rows.clone());
        let found: Vec<Vec<u64>> = found.collect();
        (read.poses(Filled::Exclude).expect("one table"), found)
    };
    let euler = r#"{"bodies": {"b": {"position": ["x", "y", "z"], "fixed_xyz": ["r", "p", "w"]}}, "joint_columns": ["j"]}"#;
    let (poses, found) = read(
        "j,x,y,z,r,p,w\n0,1,2,3,0.1,0.2,0.3\n1,0,0,0,0,0,0\n2,1,2,4,0,0,0\n",
        Some(euler),
    );
    let seen: Vec<bool> = poses.bodies["b"].iter().map(Option::is_some).collect();
    assert_eq!((seen, found), (vec![true, false, true], vec![vec![3]]));
    let own = "j_rad,b.x_m,b.y_m,b.z_m,b.qx,b.qy,b.qz,b.qw\n";
    let (poses, found) = read(&format!("{own}0,1,2,3,0,0,0,1\n1,0,0,0,0,0,0,1\n"), None);
    assert!(poses.bodies["b"][0].is_some() && poses.bodies["b"][1].is_none());
    assert_eq!(found, [[3]]);
    let (poses, found) = read(&format!("{own}0,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,1\n"), None);
    assert!(poses.bodies["b"].iter().all(Option::is_some) && found.is_empty());
}

#[test]
fn a_map_reads_back_what_was_written_for_it() {
    let poses = poses();
    for json in [
        r#"{"joints": {"elbow": "A1", "wrist": "A2"}, "angles": "deg", "reversed": ["wrist"]}"#,
        r#"{"joint_columns": ["elbow"], "prismatic": {"lift": "Z [mm]"}, "lengths": "in"}"#,
        r#"{"markers": {"m1": ["X", "Y", "Z"], "m2": ["X2", "Y2", "Z2"]}, "lengths": "cm", "torques": {"elbow": "T1"}}"#,
        r#"{"bodies": {"hand": {"position": ["x", "y", "z"], "fixed_xyz": ["a", "b", "c"]}}, "angles": "deg", "delimiter": "semicolon"}"#,
        r#"{"bodies": {"hand": {"position": ["x", "y", "z"], "rotation_vector": ["a", "b", "c"]}}, "decimal_comma": true}"#,
        r#"{"bodies": {"hand": {"position": ["x", "y", "z"], "quaternion_wxyz": ["a", "b", "c", "d"]}}, "delimiter": "space", "skip_lines": 3}"#,
        r#"{"bodies": {"hand": {"position": ["x", "y", "z"], "euler": {"axes": "zyz", "columns": ["o", "a", "t"]}}}, "body_angles": "deg"}"#,
        r#"{"bodies": {"hand": {"position": ["x", "y", "z"], "euler": {"axes": "xyz", "columns": ["u", "v", "w"]}, "inverted": true}}}"#,
        r#"{"bodies": {"hand": {"position": ["x", "y", "z"], "rotation_matrix": ["a", "b", "c", "d", "e", "f", "g", "h", "i"]}}}"#,
        r#"{"bodies": {"hand": {"position": ["x", "y", "z"], "axis_angle": ["ux", "uy", "uz", "a_deg"], "inverted": true}}}"#,
        r#"{"joints": {"elbow": "A1"}, "time": {"column": "t", "unit": "ms"}, "delimiter": "tab"}"#,
        r#"{"names": ["e", "l", "w", "x", "y", "z", "u", "v", "s", "p", "q", "r", "a", "b", "c", "d", "n"],
            "joints": {"elbow": "e", "wrist": "w"}, "prismatic": {"lift": "l"}, "torques": {"elbow": "n"},
            "markers": {"m1": ["x", "y", "z"], "m2": ["u", "v", "s"]},
            "bodies": {"hand": {"position": ["p", "q", "r"], "quaternion_xyzw": ["a", "b", "c", "d"]}}}"#,
    ] {
        let map = map(json);
        let text = write_mapped(&poses, &map, &options()).unwrap_or_else(|e| panic!("{json}: {e}"));
        let read = ReadOptions {
            columns: Some(map),
            ..ReadOptions::default()
        };
        let read = read_bytes("t.csv", text.as_bytes(), &read);
        let read = read.unwrap_or_else(|e| panic!("{json}: {e}\n{text}"));
        let read = read.poses(Filled::Exclude).expect("one table");
        for (joint, q) in &poses.joints {
            for (a, b) in q.iter().zip(&read.joints[joint]) {
                let (a, b) = (a.expect("given"), b.expect("given"));
                assert!((a - b).abs() < 1e-6, "{json}: {joint} {a} {b}\n{text}");
            }
        }
        assert_eq!(read.markers["m1"][1], None, "{json}\n{text}");
        let there = |p: &Poses| p.markers["m2"][1].expect("given").z;
        assert!((there(&read) - there(&poses)).abs() < 2e-6, "{text}");
        let off = poses.bodies["hand"][0].expect("given").inverse()
            * read.bodies["hand"][0].expect("given");
        assert!(off.rotation.angle() < 1e-6 && off.translation.vector.norm() < 1e-6);
        let torque = read
            .torques
            .get("elbow")
            .unwrap_or_else(|| panic!("{json}\n{text}"));
        assert!((torque[1].expect("given") + 2.0).abs() < 1e-9);
    }
}

#[test]
fn a_map_that_cannot_read_such_a_table_is_refused_with_the_reason() {
    let poses = poses();
    for (json, said) in [
        (
            r#"{"long": {"name": "n", "frame": "f", "marker": ["x", "y", "z"]}}"#,
            "one row for every body or marker",
        ),
        (
            r#"{"decimal_comma": true, "delimiter": "comma"}"#,
            "decimal_comma",
        ),
        (
            r#"{"joints": {"elbow": "A 1"}, "delimiter": "space"}"#,
            "A 1",
        ),
        // Nothing of this table is among the names.
        (
            r#"{"names": ["a", "b"], "joints": {"elbow": "a"}}"#,
            "`lift`",
        ),
        // A name that says another unit than the map.
        (
            r#"{"joints": {"wrist": "A2_rad"}, "angles": "deg"}"#,
            "A2_rad",
        ),
    ] {
        let refused = write_mapped(&poses, &map(json), &options());
        let why = refused.err().map(|e| e.to_string()).unwrap_or_default();
        assert!(why.contains(said), "{json}: {why}");
    }
}
