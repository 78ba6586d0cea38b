//! Reading and writing of our own tables.

use calib_recording::{
    ColumnMap, Filled, JointUnit, MarkerSample, Poses, ReadOptions, Recording, WriteOptions,
    read_bytes, write_poses, write_recording,
};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use std::collections::BTreeMap;

fn read(text: &str) -> Recording {
    read_bytes("poses.csv", text.as_bytes(), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}"))
}

fn poses(text: &str) -> Poses {
    read(text).poses(Filled::Exclude).expect("one table")
}

#[test]
fn a_wide_table_is_read_in_si() {
    let poses = poses(
        "# made by hand\npose,trial,elbow_deg,lift_mm,elbow_nm,m1.x_mm,m1.y_mm,m1.z_mm,hand.x_m,hand.y_m,hand.z_m,hand.qx,hand.qy,hand.qz,hand.qw\n\
         0,a,180,250,1.5,1000,2000,3000,0.1,0.2,0.3,0,0,0,1\n\
         1,b,-90,,,,,,,,,,,,\n",
    );
    assert_eq!(poses.rows, [3, 4]);
    assert_eq!(
        poses.joints["elbow"],
        [
            Some(std::f64::consts::PI),
            Some(-std::f64::consts::FRAC_PI_2)
        ]
    );
    assert_eq!(poses.joints["lift"], [Some(0.25), None]);
    assert_eq!(poses.joint_units["elbow"], JointUnit::Angle);
    assert_eq!(poses.joint_units["lift"], JointUnit::Length);
    assert_eq!(poses.torques["elbow"], [Some(1.5), None]);
    assert_eq!(
        poses.markers["m1"],
        [Some(Point3::new(1.0, 2.0, 3.0)), None]
    );
    assert_eq!(
        poses.bodies["hand"],
        [Some(Isometry3::translation(0.1, 0.2, 0.3)), None]
    );
    assert_eq!(poses.labels["trial"], ["a", "b"]);
    assert!(poses.t.is_none());
}

#[test]
fn the_header_comment_is_kept() {
    let recording =
        read("# made by calib simulate --seed 7\n#truth beside it\nq_rad\n0.5\n# later\n0.6\n");
    assert_eq!(
        recording.meta.comments,
        [
            "made by calib simulate --seed 7",
            "truth beside it",
            "later"
        ]
    );
    assert_eq!(recording.meta.source, "poses.csv");
    assert_eq!(recording.meta.format, "csv");
    assert_eq!(recording.timelines[0].rows, [4, 6]);
}

#[test]
fn underscores_make_markers_where_three_axes_are_given_and_joints_where_one_is() {
    let table = poses("frame,RGT_x_m,RGT_y_m,RGT_z_m,gantry_x_m,wrist_x_deg\n300,1,2,3,0.5,90\n");
    assert_eq!(table.markers.keys().collect::<Vec<_>>(), ["RGT"]);
    assert_eq!(
        table.joints.keys().collect::<Vec<_>>(),
        ["gantry_x", "wrist_x"]
    );
    assert_eq!(table.joint_units["gantry_x"], JointUnit::Length);
    assert_eq!(table.joint_units["wrist_x"], JointUnit::Angle);
}

#[test]
fn a_table_of_one_body_or_one_marker_needs_no_name() {
    let body = poses(
        "frame,x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,4.29,-128.91,-1025.49,0.114906,-0.700638,0.19231,0.677436\n",
    );
    let pose = body.bodies["body"][0].expect("measured");
    assert!((pose.translation.vector - Vector3::new(0.00429, -0.12891, -1.02549)).norm() < 1e-15);
    assert!((pose.rotation.coords.norm() - 1.0).abs() < 1e-15);
    let marker = poses("x_m,y_m,z_m\n1,2,3\n");
    assert_eq!(marker.markers["marker"], [Some(Point3::new(1.0, 2.0, 3.0))]);
}

#[test]
fn a_long_table_is_one_stream_per_marker_and_absence_is_lost() {
    let poses =
        poses("frame,marker,x_mm,y_mm,z_mm\n5,b,1,2,3\n5,a,4,5,6\n7,a,7,8,9\n8,c,,,\n8,b,1,1,1\n");
    assert_eq!(poses.rows, [2, 4, 5]);
    assert_eq!(
        poses.markers["a"][0],
        Some(Point3::new(0.004, 0.005, 0.006))
    );
    assert_eq!(poses.markers["a"][2], None);
    assert_eq!(
        poses.markers["b"]
            .iter()
            .map(Option::is_some)
            .collect::<Vec<_>>(),
        [true, false, true]
    );
    assert_eq!(poses.markers["c"], [None, None, None]);
}

#[test]
fn a_long_table_of_bodies_with_time() {
    let poses = poses(
        "t_s,body,x_m,y_m,z_m,qx,qy,qz,qw\n0.5,hand,1,2,3,0,0,0,1\n0.6,hand,1,2,4,0,0,1,0\n0.6,base,0,0,1,0,0,0,1\n",
    );
    assert_eq!(poses.t.as_deref(), Some([0.5, 0.6].as_slice()));
    assert_eq!(
        poses.bodies["base"]
            .iter()
            .map(Option::is_some)
            .collect::<Vec<_>>(),
        [false, true]
    );
}

/// Points of poses as laser trackers measure them: pose after pose, or point after point over all poses.
#[test]
fn rows_of_points_are_put_together_by_the_name_of_their_pose() {
    let text = "pose,j1_deg,lift_mm,point,x_mm,y_mm,z_mm\n\
        P1,10,5,A,1,2,3\nP2,20,6,A,4,5,6\nP10,30,7,A,,,\nP1,10.01,5,B,7,8,9\nP10,,,B,1,1,1\n";
    let wide = poses(text);
    assert_eq!(wide.rows, [2, 3, 4]);
    let near = |found: Option<f64>, wanted: f64| (found.expect("given") - wanted).abs() < 1e-12;
    let j1 = &wide.joints["j1"];
    assert!((0..3).all(|i| near(j1[i], [10f64, 20.0, 30.0][i].to_radians())));
    assert!((0..3).all(|i| near(wide.joints["lift"][i], [0.005, 0.006, 0.007][i])));
    let seen = |name: &str| {
        wide.markers[name]
            .iter()
            .map(Option::is_some)
            .collect::<Vec<_>>()
    };
    assert_eq!(seen("A"), [true, true, false]);
    assert_eq!(seen("B"), [true, false, true]);
    assert_eq!(wide.markers["B"][0], Some(Point3::new(0.007, 0.008, 0.009)));
}

/// One table in every order of its rows, with commas or with semicolons and decimal commas: the same poses.
#[test]
fn the_order_and_the_separators_of_a_table_of_points_change_nothing() {
    let mut state = 7_u64;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize
    };
    let mut rows = Vec::new();
    for pose in 0..9 {
        for point in ["A", "B", "C"] {
            let (q, t) = (random() % 1800, random() % 500);
            if random() % 4 > 0 {
                rows.push((pose, pose * 100, point, q, t));
            }
        }
    }
    let by_name = |text: &str, options: &ReadOptions| {
        let read = read_bytes("t.csv", text.as_bytes(), options).expect("a table");
        let wide = read.poses(Filled::Exclude).expect("one table");
        let keys = wide.joints["j1"]
            .iter()
            .map(|q| q.expect("given").to_bits())
            .collect::<Vec<_>>();
        let markers = wide.markers.into_iter();
        let of = |(name, track): (String, Vec<Option<Point3<f64>>>)| {
            let mut track: Vec<_> = keys.iter().copied().zip(track).collect();
            track.sort_by_key(|(q, _)| *q);
            (name, track)
        };
        markers
            .map(of)
            .collect::<std::collections::BTreeMap<_, _>>()
    };
    let map = ColumnMap {
        decimal_comma: true,
        ..ColumnMap::default()
    };
    let european = ReadOptions {
        columns: Some(map),
        ..ReadOptions::default()
    };
    let mut wanted = None;
    for _ in 0..20 {
        for i in (1..rows.len()).rev() {
            rows.swap(i, random() % (i + 1));
        }
        let write = |comma: char, point: &str| {
            let mut text = "pose,j1_deg,point,x_mm,y_mm,z_mm\n".replace(',', &comma.to_string());
            for (pose, j, name, x, y) in &rows {
                text += &format!(
                    "P{pose}{comma}{j}{point}5{comma}{name}{comma}{x}{point}25{comma}{y}{comma}1\n"
                );
            }
            text
        };
        let plain = by_name(&write(',', "."), &ReadOptions::default());
        assert_eq!(plain, by_name(&write(';', ","), &european));
        assert_eq!(*wanted.get_or_insert(plain.clone()), plain);
    }
}

#[test]
fn a_column_that_counts_the_other_way_is_negated_by_the_map() {
    let text = "q1,elbow_deg,tip.x_m,tip.y_m,tip.z_m\n0.5,90,1,2,3\n";
    let read = |reversed: &[&str]| {
        let columns = ColumnMap {
            joints: [("wrist", "q1"), ("elbow", "elbow_deg")]
                .map(|(joint, column)| (joint.to_owned(), column.to_owned()))
                .into(),
            reversed: reversed.iter().map(|r| (*r).to_owned()).collect(),
            ..ColumnMap::default()
        };
        let options = ReadOptions {
            columns: Some(columns),
            ..ReadOptions::default()
        };
        read_bytes("t.csv", text.as_bytes(), &options)
    };
    let joints = |reversed: &[&str]| {
        let poses = read(reversed).expect("a table").poses(Filled::Exclude);
        let joints = poses.expect("one table").joints;
        [joints["wrist"][0], joints["elbow"][0]]
    };
    let half_pi = std::f64::consts::FRAC_PI_2;
    assert_eq!(joints(&[]), [Some(0.5), Some(half_pi)]);
    assert_eq!(joints(&["wrist", "elbow"]), [Some(-0.5), Some(-half_pi)]);
    let wrong = read(&["hand"])
        .expect_err("not a joint of the map")
        .to_string();
    assert!(wrong.contains("`reversed` names `hand`"), "{wrong}");
}

#[test]
fn zeros_and_nan_are_lost_with_a_finding() {
    let recording = read(
        "m.x_m,m.y_m,m.z_m,n.x_m,n.y_m,n.z_m\n0,0,0,1,2,3\n1,1,1,nan,NaN,NULL\n0.0,-0,0,1,2,3\n",
    );
    assert_eq!(recording.markers[0].lost(), 2);
    assert_eq!(recording.markers[1].lost(), 1);
    let found: Vec<_> = recording
        .meta
        .findings
        .iter()
        .map(|f| (f.id.as_str(), f.subject.to_string(), f.rows.clone()))
        .collect();
    assert_eq!(found[0], ("all-zero-triplet", "m".to_owned(), vec![2, 4]));
    assert_eq!(found.len(), 2, "one finding for all three columns");
    assert_eq!(found[1], ("not-a-number", "recording".to_owned(), vec![3]));
}

#[test]
fn filled_samples_are_kept_apart() {
    let recording = read("m.x_m,m.y_m,m.z_m,m.state\n1,1,1,measured\n2,2,2,filled\n3,3,3,lost\n");
    assert_eq!(
        recording.markers[0].samples[1],
        MarkerSample::Filled(Point3::new(2.0, 2.0, 2.0))
    );
    let counted = |filled| {
        recording.poses(filled).expect("one table").markers["m"]
            .iter()
            .flatten()
            .count()
    };
    assert_eq!((counted(Filled::Exclude), counted(Filled::Include)), (1, 2));
}

#[test]
fn separators_bom_and_line_ends_do_not_matter() {
    let expected = poses("q_rad,m.x_m,m.y_m,m.z_m\n0.5,1,2,3\n");
    for text in [
        "\u{feff}q_rad,m.x_m,m.y_m,m.z_m\r\n0.5,1,2,3\r\n",
        "q_rad;m.x_m;m.y_m;m.z_m\n0.5;1;2;3",
        "q_rad\tm.x_m\tm.y_m\tm.z_m\n0.5\t1\t2\t3\n",
        "q_rad m.x_m m.y_m m.z_m\n 0.5  1 2 3\n",
        "q_rad,m.x_m,m.y_m,m.z_m,\n0.5, 1 ,\"2\",3,\n\n",
    ] {
        assert_eq!(poses(text), expected, "{text:?}");
    }
}

fn map(map: ColumnMap) -> ReadOptions {
    ReadOptions {
        columns: Some(map),
        ..ReadOptions::default()
    }
}

#[test]
fn a_column_map_reads_names_without_units() {
    let text = "x1,y1,z1,torso_lift_joint,arm_1_joint,shipped_row\n380.2,480.8,335.9,237,90,0\n";
    let three = |i: usize| [format!("x{i}"), format!("y{i}"), format!("z{i}")];
    let columns = ColumnMap {
        angles: calib_recording::AngleUnit::Deg,
        lengths: calib_recording::LengthUnit::Mm,
        joint_columns: vec!["arm_1_joint".into()],
        prismatic: BTreeMap::from([(
            "torso_lift_joint".to_string(),
            "torso_lift_joint".to_string(),
        )]),
        markers: BTreeMap::from([("BL".to_string(), three(1))]),
        ..ColumnMap::default()
    };
    let recording = read_bytes("tiago.csv", text.as_bytes(), &map(columns)).expect("readable");
    let poses = recording.poses(Filled::Exclude).expect("one table");
    assert_eq!(
        poses.joints["arm_1_joint"],
        [Some(std::f64::consts::FRAC_PI_2)]
    );
    assert_eq!(poses.joints["torso_lift_joint"], [Some(0.237)]);
    assert!(
        (poses.markers["BL"][0].expect("seen") - Point3::new(0.3802, 0.4808, 0.3359)).norm()
            < 1e-15
    );
    assert!(
        recording
            .meta
            .conversions
            .iter()
            .any(|c| c.contains("shipped_row"))
    );
}

#[test]
fn presets_read_logs_of_their_kind() {
    let ur = "timestamp actual_q_0 actual_q_1 actual_q_2 actual_q_3 actual_q_4 actual_q_5 runtime_state\r\n81234.536 0.0 0.25 0.27 0.04 -0.22 -0.28 2\r\n81234.544 0.1 0.25 0.27 0.04 -0.22 -0.28 2\r\n";
    let preset = |name: &str| {
        map(ColumnMap {
            preset: Some(name.into()),
            ..ColumnMap::default()
        })
    };
    let poses = read_bytes("ur.csv", ur.as_bytes(), &preset("ur_rtde"))
        .expect("readable")
        .poses(Filled::Exclude)
        .expect("one");
    assert_eq!(poses.joints["shoulder_pan_joint"], [Some(0.0), Some(0.1)]);
    assert_eq!(poses.t.as_deref(), Some([81234.536, 81234.544].as_slice()));

    let ndi = "Frame#,ToolHandle,Face,TransformStatus,q0,qx,qy,qz,tx,ty,tz,error,#markers\n1,02,0,Enabled,0,1,0,0,10,20,30,0.1,4\n1,03,0,Missing,,,,,,,,,0\n2,03,0,Enabled,1,0,0,0,1,2,3,0.1,4\n2,02,0,Missing,Missing,,,,,,,,0\n";
    let poses = read_bytes("ndi.csv", ndi.as_bytes(), &preset("ndi"))
        .expect("readable")
        .poses(Filled::Exclude)
        .expect("one");
    let pose = poses.bodies["02"][0].expect("seen");
    assert!((pose.translation.vector - Vector3::new(0.01, 0.02, 0.03)).norm() < 1e-15);
    assert!((pose.rotation.angle() - std::f64::consts::PI).abs() < 1e-12);
    assert!(poses.bodies["02"][1].is_none() && poses.bodies["03"][1].is_some());

    let vive = "x,y,z,A,B,C,button,T,delta\n100,200,300,0.1,0.2,0.3,0,1600000000123,11\n";
    let recording = read_bytes("vive.csv", vive.as_bytes(), &preset("vive")).expect("readable");
    let expected = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
    let pose = recording.bodies[0].tracker_from_body[0].expect("seen");
    assert!(pose.rotation.angle_to(&expected) < 1e-12);
    assert!(
        recording
            .meta
            .conversions
            .iter()
            .any(|c| c.contains("fixed x, y, z"))
    );

    let franka = "time,success_rate,state.q[0],state.q[1],state.q[2],state.q[3],state.q[4],state.q[5],state.q[6]\n1234567,1,0.1,0.2,0.3,0.4,0.5,0.6,0.7\n";
    let poses = read_bytes("franka.csv", franka.as_bytes(), &preset("franka"))
        .expect("readable")
        .poses(Filled::Exclude)
        .expect("one");
    assert_eq!(poses.joints["panda_joint7"], [Some(0.7)]);
}

fn a_pose() -> impl Strategy<Value = Option<Isometry3<f64>>> {
    proptest::option::weighted(
        0.8,
        (
            prop::array::uniform3(-2.0..2.0),
            prop::array::uniform3(-3.0..3.0),
        ),
    )
    .prop_map(|pose| {
        pose.map(|(t, r): ([f64; 3], [f64; 3])| {
            Isometry3::from_parts(
                Translation3::from(Vector3::from(t)),
                UnitQuaternion::from_scaled_axis(Vector3::from(r)),
            )
        })
    })
}

prop_compose! {
    fn some_poses()(rows in prop::collection::vec(
        (proptest::option::of(-3.0..3.0), proptest::option::of(prop::array::uniform3(0.1..9.0)), a_pose(), proptest::option::of(-50.0..50.0), "[a-c]{1,3}"), 1..12), timed: bool) -> Poses {
        let n = rows.len();
        Poses {
            rows: (0..n as u64).collect(),
            t: timed.then(|| (0..n).map(|i| i as f64 * 0.01).collect()),
            received: timed.then(|| (0..n).map(|i| 1.7e9 + i as f64 * 0.0101).collect()),
            joints: BTreeMap::from([("q".to_string(), rows.iter().map(|r| r.0).collect())]),
            joint_units: BTreeMap::from([("q".to_string(), JointUnit::Angle)]),
            torques: BTreeMap::from([("q".to_string(), rows.iter().map(|r| r.3).collect())]),
            temperatures: BTreeMap::from([
                ("q".to_string(), rows.iter().map(|r| r.3).collect()),
                (calib_recording::WHOLE_ROBOT.to_string(), rows.iter().map(|r| r.0).collect()),
            ]),
            bodies: BTreeMap::from([("hand".to_string(), rows.iter().map(|r| r.2).collect())]),
            markers: BTreeMap::from([("m_1".to_string(), rows.iter().map(|r| r.1.map(Point3::from)).collect())]),
            labels: BTreeMap::from([("trial".to_string(), rows.iter().map(|r| r.4.clone()).collect())]),
        }
    }
}

proptest! {
    #![proptest_config(crate::fixed_seed())]
    #[test]
    fn what_is_written_is_read_back(poses in some_poses()) {
        let text = write_poses(&poses, &WriteOptions::default()).expect("finite");
        let back = read_bytes("x.csv", text.as_bytes(), &ReadOptions::default()).expect("own table").poses(Filled::Exclude).expect("one");
        prop_assert_eq!(&back.joints, &poses.joints);
        prop_assert_eq!(&back.torques, &poses.torques);
        prop_assert_eq!(&back.temperatures, &poses.temperatures);
        prop_assert_eq!(&back.markers, &poses.markers);
        prop_assert_eq!(&back.labels, &poses.labels);
        prop_assert_eq!(&back.t, &poses.t);
        prop_assert_eq!(&back.received, &poses.received);
        for (a, b) in back.bodies["hand"].iter().zip(&poses.bodies["hand"]) {
            prop_assert_eq!(a.is_some(), b.is_some());
            if let (Some(a), Some(b)) = (a, b) {
                prop_assert_eq!(a.translation, b.translation);
                prop_assert!(a.rotation.angle_to(&b.rotation) < 1e-15);
            }
        }
    }

    #[test]
    fn micrometers_stay_micrometers(poses in some_poses()) {
        let text = write_poses(&poses, &WriteOptions::micro()).expect("finite");
        let back = read_bytes("x.csv", text.as_bytes(), &ReadOptions::default()).expect("own table").poses(Filled::Exclude).expect("one");
        for (a, b) in back.markers["m_1"].iter().flatten().zip(poses.markers["m_1"].iter().flatten()) {
            prop_assert!((a - b).norm() < 1e-6);
        }
        for (a, b) in back.bodies["hand"].iter().flatten().zip(poses.bodies["hand"].iter().flatten()) {
            prop_assert!(a.rotation.angle_to(&b.rotation) < 3e-9);
        }
    }
}

#[test]
fn the_written_table_looks_like_this() {
    let poses = poses(
        "t_s,trial,b_deg,m.x_mm,m.y_mm,m.z_mm,h.x_m,h.y_m,h.z_m,h.qx,h.qy,h.qz,h.qw\n0.01,up,90,1,2,3,0.1,0.2,0.3,0,0,0.6,-0.8\n0.02,up,,,,,,,,,,,\n",
    );
    let options = WriteOptions {
        comments: vec!["two rows".into()],
        ..WriteOptions::micro()
    };
    assert_eq!(
        write_poses(&poses, &options).expect("finite"),
        "# two rows\ntrial,t_s,b_rad,h.x_m,h.y_m,h.z_m,h.qx,h.qy,h.qz,h.qw,m.x_m,m.y_m,m.z_m\n\
         up,0.01,1.570796,0.1,0.2,0.3,0,0,-0.6,0.8,0.001,0.002,0.003\nup,0.02,,,,,,,,,,,\n"
    );
}

#[test]
fn a_table_that_would_not_read_back_is_not_written() {
    let mut poses = poses("trial,q_rad\na,1\n");
    poses.labels.insert("trial".into(), vec!["a,b".into()]);
    assert!(write_poses(&poses, &WriteOptions::default()).is_err());
    poses.labels.insert("trial".into(), vec!["a".into()]);
    poses.joints.insert("q".into(), vec![Some(f64::NAN)]);
    assert!(write_poses(&poses, &WriteOptions::default()).is_err());
    poses.joints.insert("q".into(), vec![]);
    assert!(write_poses(&poses, &WriteOptions::default()).is_err());
}

#[test]
fn rows_can_be_chosen_and_grouped() {
    let table = poses("trial,q_rad,m.x_m,m.y_m,m.z_m\nb,1,1,1,1\na,2,2,2,2\nb,3,3,3,3\n");
    assert_eq!(
        table.groups("trial"),
        [("b".to_string(), vec![0, 2]), ("a".to_string(), vec![1])]
    );
    let chosen = table.select(&[2, 0, 99]);
    assert_eq!(chosen.joints["q"], [Some(3.0), Some(1.0)]);
    assert_eq!(chosen.rows, [4, 2]);
    assert_eq!(table.groups("nothing").len(), 1);
    assert_eq!(
        table
            .clone()
            .into_recording()
            .poses(Filled::Exclude)
            .expect("one"),
        table
    );
}

#[test]
fn joints_that_read_as_something_else_are_stated_to_be_joints() {
    let lists: [&[&str]; 7] = [
        &["gantry_x", "gantry_y", "gantry_z"],
        &["x", "y", "z"],
        &["x", "y", "yaw"],
        &["a.x", "a.y", "a.z", "b"],
        &["gantry_x", "lift"],
        &["joint:a", "t", "pose"],
        &["point_x", "point_y", "point_z", "x"],
    ];
    for names in lists {
        for unit in [JointUnit::Length, JointUnit::Angle] {
            let units = names.iter().map(|name| (name.to_string(), unit));
            let poses = Poses {
                rows: vec![2, 3],
                joints: names
                    .iter()
                    .enumerate()
                    .map(|(i, name)| (name.to_string(), vec![Some(0.5 * i as f64), Some(1.0)]))
                    .collect(),
                joint_units: units.collect(),
                markers: [("m".to_owned(), vec![Some(Point3::new(1.0, 2.0, 3.0)), None])].into(),
                ..Poses::default()
            };
            let text = write_poses(&poses, &WriteOptions::default())
                .unwrap_or_else(|e| panic!("{names:?} {unit:?}: {e}"));
            let back = read(&text).poses(Filled::Exclude).expect("one table");
            assert_eq!(back, poses, "{text}");
            // Names that say it alone stay as they are.
            assert!(!text.contains("joint:b_"), "{text}");
            assert!(!text.contains("joint:lift_"), "{text}");
        }
    }
}

#[test]
fn a_single_joint_is_written_with_a_counter() {
    // One lost joint alone: the counter keeps its row from being a blank line.
    let one = Poses {
        rows: vec![0, 1],
        joints: [("a".to_string(), vec![None, Some(1.0)])].into(),
        ..Poses::default()
    };
    let text = write_poses(
        &one,
        &WriteOptions {
            count: false,
            ..WriteOptions::default()
        },
    )
    .expect("writable");
    assert_eq!(read(&text).joints[0].q, [None, Some(1.0)]);
}

#[test]
fn a_recording_is_written_with_its_states_and_one_table_per_clock() {
    let mut recording =
        read("t_s,m.x_m,m.y_m,m.z_m,m.state\n0,1,1,1,measured\n1,2,2,2,filled\n2,,,,\n");
    let tables = write_recording(&recording, &WriteOptions::default()).expect("writable");
    assert_eq!(tables.len(), 1);
    assert_eq!(read(&tables[0].1).markers, recording.markers);
    let mut joints = read("t_s,q_rad\n0.5,1\n");
    recording.timelines.append(&mut joints.timelines);
    joints.joints[0].timeline = 1;
    recording.joints.append(&mut joints.joints);
    assert!(recording.poses(Filled::Exclude).is_err());
    let tables = write_recording(&recording, &WriteOptions::default()).expect("writable");
    assert_eq!(
        tables
            .iter()
            .map(|(_, text)| text.lines().count())
            .collect::<Vec<_>>(),
        [4, 2]
    );
}

#[test]
fn a_label_of_any_name_is_written_and_read_when_named() {
    let mut table = poses("trial,q_rad\n1: up,1\n");
    let texts = table.labels.remove("trial").expect("read");
    table.labels.insert("torso".to_string(), texts);
    let text = write_poses(&table, &WriteOptions::default()).expect("writable");
    let options = map(ColumnMap {
        labels: vec!["torso".into()],
        ..ColumnMap::default()
    });
    let back = read_bytes("x.csv", text.as_bytes(), &options)
        .expect("named")
        .poses(Filled::Exclude)
        .expect("one table");
    assert_eq!(back.labels["torso"], ["1: up"]);
}

/// Joints that are called like coordinates are joints where the robot is known.
#[test]
fn columns_of_the_robot_s_joints_are_no_markers() {
    let read = |header: &str, joints: &[&str], of_robot: bool| {
        let cells = header.split(',').count();
        let text = format!("{header}\n{}\n", vec!["1"; cells].join(","));
        let options = ReadOptions {
            joints: joints.iter().map(|&j| j.to_owned()).collect(),
            of_robot,
            ..ReadOptions::default()
        };
        let recording = read_bytes("t.csv", text.as_bytes(), &options).expect("a table");
        let joints: Vec<String> = recording.joints.iter().map(|j| j.name.clone()).collect();
        let markers = recording.markers.iter().map(|m| m.name.clone());
        (joints.join(" "), markers.collect::<Vec<_>>().join(" "))
    };
    let said = |joints: &str, markers: &str| (joints.to_owned(), markers.to_owned());
    let gantry = ["x", "y", "z"];
    let tracked = "x_mm,y_mm,z_mm,h_1.x_m,h_1.y_m,h_1.z_m";
    assert_eq!(read(tracked, &gantry, false), said("x y z", "h_1"));
    assert_eq!(read(tracked, &[], false), said("", "marker h_1"));
    // A joint that was forgotten.
    let without = "y_mm,z_mm,h_1.x_m,h_1.y_m,h_1.z_m";
    assert_eq!(read(without, &gantry, false), said("y z", "h_1"));
    // A marker beside joints `x` and `y` alone; of three coordinates a joint is none.
    assert_eq!(read(tracked, &["x", "y"], false), said("", "marker h_1"));
    assert_eq!(
        read("x_mm,y_mm,z_mm,a_deg", &gantry, false),
        said("a", "marker")
    );
    assert_eq!(
        read("x_mm,y_mm,z_mm,a_deg", &gantry, true),
        said("x y z a", "")
    );
    // Names with an ending.
    let base = "base_x_m,base_y_m,base_z_m,h_1.x_m,h_1.y_m,h_1.z_m";
    let joints = ["base_x", "base_y", "base_z"];
    assert_eq!(
        read(base, &joints, false),
        said("base_x base_y base_z", "h_1")
    );
    assert_eq!(read(base, &joints[..2], false), said("", "base h_1"));
    // In a long table they are the coordinates of what the row names.
    let long = "x_mm,y_mm,z_mm,marker,t_s";
    assert!(read(long, &gantry, false).0.is_empty());
}

/// Where commas are decimal signs, a point before three digits separates thousands: `2.428` is no 2.4, and no number is made of it.
#[test]
fn points_between_thousands_are_no_decimal_points_beside_decimal_commas() {
    let map = ColumnMap {
        decimal_comma: true,
        ..ColumnMap::default()
    };
    let read = |cell: &str, map: Option<&ColumnMap>| {
        let text = format!("t_s;q1_deg;tip.x_mm;tip.y_mm;tip.z_mm\n0.125;1;{cell};-398;3\n");
        let options = ReadOptions {
            columns: map.cloned(),
            ..ReadOptions::default()
        };
        read_bytes("table.csv", text.as_bytes(), &options)
    };
    for cell in ["2.428", "-12.345", "1.234.567", "2.427,541", "2'427,541"] {
        let refused = read(cell, Some(&map)).expect_err(cell).to_string();
        assert!(
            refused.contains("no separators of thousands"),
            "{cell}: {refused}"
        );
    }
    for (cell, value) in [
        ("2,428", 2.428e-3),
        ("0.428", 0.428e-3),
        ("24.5", 0.0245),
        ("2428", 2.428),
    ] {
        let recording = read(cell, Some(&map)).expect(cell);
        let point = recording.markers[0].samples[0].point(Filled::Include);
        assert!((point.expect("measured").x - value).abs() < 1e-12, "{cell}");
    }
    assert!(read("2.428", None).is_ok());
}
