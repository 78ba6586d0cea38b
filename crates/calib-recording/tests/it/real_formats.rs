//! Real files of the formats, where they are at hand.

use crate::real_tables::real_data;
use calib_recording::{Filled, MarkerSample, ReadOptions, Recording, read_path};

fn read(path: &str) -> Option<Recording> {
    let path = real_data()?.join("formats").join(path);
    Some(read_path(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}")))
}

fn lost(recording: &Recording) -> usize {
    recording
        .markers
        .iter()
        .map(calib_recording::MarkerStream::lost)
        .sum()
}

#[test]
fn nexus_csv_and_c3d_of_one_trial_agree() {
    let Some(csv) = read("vicon_csv/pyomeca_nexus_trajectories_markers.csv") else {
        return;
    };
    let c3d = read("c3d/pyomeca_markers_analogs.c3d").expect("present");
    assert_eq!(
        (csv.meta.format.as_str(), c3d.meta.format.as_str()),
        ("vicon_csv", "c3d")
    );
    assert_eq!((lost(&csv), lost(&c3d)), (305, 305));
    assert_eq!(csv.timelines[0].len(), c3d.timelines[0].len());
    let (mut compared, mut worst) = (0, 0.0f64);
    for marker in &csv.markers {
        let same = c3d
            .markers
            .iter()
            .find(|other| marker.name.ends_with(&other.name));
        let same = same.unwrap_or_else(|| panic!("{} is not in the C3D", marker.name));
        for (a, b) in marker.samples.iter().zip(&same.samples) {
            let (a, b) = (a.point(Filled::Include), b.point(Filled::Include));
            assert_eq!(a.is_some(), b.is_some());
            if let (Some(a), Some(b)) = (a, b) {
                compared += 1;
                worst = worst.max((a - b).abs().max());
            }
        }
    }
    assert_eq!(compared, 29_275);
    assert!(worst <= 5e-6, "{worst} m");
}

#[test]
fn the_six_encodings_are_one_trial() {
    let Some(reference) = read("c3d/c3d_test_suite__Sample02__pc_real.c3d") else {
        return;
    };
    let lsb = 0.2813e-3;
    for encoding in [
        "dec_int", "dec_real", "pc_int", "sgi_int", "sgi_real", "pc_real",
    ] {
        let other =
            read(&format!("c3d/c3d_test_suite__Sample02__{encoding}.c3d")).expect("present");
        assert_eq!(lost(&other), 228, "{encoding}");
        assert_eq!(
            (other.markers.len(), other.timelines[0].len()),
            (36, 89),
            "{encoding}"
        );
        assert_eq!(other.meta.up_axis, reference.meta.up_axis);
        for (a, b) in reference.markers.iter().zip(&other.markers) {
            assert_eq!(a.name, b.name);
            for (a, b) in a.samples.iter().zip(&b.samples) {
                match (a.point(Filled::Include), b.point(Filled::Include)) {
                    (Some(a), Some(b)) => {
                        assert!((a - b).abs().max() <= lsb, "{encoding}: {a} {b}")
                    }
                    (None, None) => {}
                    _ => panic!("{encoding}: lost in one of them"),
                }
            }
        }
    }
}

#[test]
fn pycgm_files_are_read_in_both_forms() {
    let Some(movement) = read("vicon_csv/cadop_pyCGM_Movement_trial.csv") else {
        return;
    };
    println!("{:?}", movement.meta.conversions);
    assert!(movement.markers.is_empty() && !movement.bodies.is_empty());
    let old = read("vicon_csv/cadop_pyCGM_Sample_Static_first60.csv").expect("present");
    assert!(old.markers.len() > 40);
    assert_eq!(old.timelines[0].len(), 60 - 11);
    let c3d = read("c3d/cadop_pyCGM_Movement_trial.c3d").expect("present");
    assert!(c3d.markers.len() > 40, "{}", c3d.markers.len());
}

#[test]
fn motive_files_of_two_versions() {
    let Some(bodies) = read("optitrack_csv/cmuphyscomp_hmv-s16_v1.21_rigidbody_quat.csv") else {
        return;
    };
    assert_eq!(bodies.meta.format, "motive_csv");
    assert_eq!(
        (
            bodies.bodies.len(),
            bodies.markers.len(),
            bodies.timelines[0].len()
        ),
        (1, 9, 250)
    );
    let filled = |recording: &Recording| {
        recording
            .markers
            .iter()
            .flat_map(|m| &m.samples)
            .filter(|s| matches!(s, MarkerSample::Filled(_)))
            .count()
    };
    // Those that Motive computed stand beside the measured ones of the same body.
    assert_eq!(filled(&bodies), 0);
    assert_eq!(
        bodies
            .markers
            .iter()
            .filter(|marker| marker.unlabeled)
            .count(),
        6
    );
    let markers = read("optitrack_csv/ha5dzs_test_markers_enabled.csv").expect("present");
    assert_eq!(
        (
            markers.bodies.len(),
            markers.markers.len(),
            markers.timelines[0].len()
        ),
        (0, 18, 1353)
    );
    assert!(markers.markers.iter().all(|marker| marker.unlabeled));
}

#[test]
fn trc_with_commas_and_robot_logs() {
    let Some(trc) = read("trc/pyomeca_markers.trc") else {
        return;
    };
    assert_eq!((trc.meta.format.as_str(), trc.markers.len()), ("trc", 51));
    let ur = read("robot_logs/ur_rtde_generated_by_official_CSVWriter.csv").expect("present");
    assert_eq!(
        (
            ur.meta.format.as_str(),
            ur.joints.len(),
            ur.timelines[0].len()
        ),
        ("ur_rtde", 6, 250)
    );
    let franka = read("robot_logs/franka_generated_by_libfranka_logToCSV.csv").expect("present");
    assert_eq!(
        (
            franka.meta.format.as_str(),
            franka.joints.len(),
            franka.timelines[0].len()
        ),
        ("franka", 7, 200)
    );
}

/// What the vendor's own listener prints for one frame: bodies, flysticks and markers with a quality ≥ 0.
struct SdkFrame {
    frame: u64,
    time: f64,
    poses: Vec<(String, [f64; 3], [f64; 9])>,
    markers: Vec<(String, [f64; 3])>,
}

fn sdk_frames(text: &str) -> Vec<SdkFrame> {
    let mut frames: Vec<SdkFrame> = Vec::new();
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |i: usize| {
            words
                .get(i)
                .and_then(|word| word.parse::<f64>().ok())
                .unwrap_or(f64::NAN)
        };
        match (words.first().copied(), words.get(2).copied()) {
            (Some("frame"), _) => {
                frames.push(SdkFrame {
                    frame: number(1) as u64,
                    time: number(3),
                    poses: Vec::new(),
                    markers: Vec::new(),
                });
            }
            (Some(kind @ ("bod" | "flystick" | "mar")), Some("qu")) if number(3) >= 0.0 => {
                let frame = frames.last_mut().expect("a frame line first");
                let place = [5, 6, 7].map(number);
                match kind {
                    "bod" => frame.poses.push((
                        format!("body_{}", words[1]),
                        place,
                        std::array::from_fn(|i| number(9 + i)),
                    )),
                    "flystick" => frame.poses.push((
                        format!("flystick_{}", words[1]),
                        place,
                        std::array::from_fn(|i| number(9 + i)),
                    )),
                    _ => frame.markers.push((format!("marker_{}", words[1]), place)),
                }
            }
            _ => {}
        }
    }
    frames
}

#[test]
fn dtrack_logs_are_read_as_the_vendors_own_listener_does() {
    let Some(data) = real_data() else { return };
    // In the manual's frames 2 and 3 the listener repeats the pose of frame 1: there is no `6d` line in them.
    for (name, stale_after) in [
        ("manual_examples", 1),
        ("captured_quoted_in_public_code", 99),
        ("synthetic_2bodies_dropout_midnight", 1000),
    ] {
        let recording = read(&format!("dtrack/{name}.dtrack")).expect("present");
        assert_eq!(recording.meta.format, "dtrack");
        let text =
            std::fs::read_to_string(data.join(format!("formats/dtrack/{name}.dtracksdk_out.txt")))
                .expect("present");
        let sdk = sdk_frames(&text);
        let timeline = &recording.timelines[0];
        assert_eq!(
            timeline.rows,
            sdk.iter().map(|frame| frame.frame).collect::<Vec<_>>(),
            "{name}"
        );
        let mut poses = 0;
        for (i, expected) in sdk.iter().enumerate().take(stale_after) {
            if let Some(t) = &timeline.t {
                assert!((t[i] % 86_400.0 - expected.time).abs() < 1e-3, "{name} {i}");
            }
            let tracked: Vec<&str> = recording
                .bodies
                .iter()
                .filter(|b| b.tracker_from_body[i].is_some() && !b.name.starts_with("tool"))
                .map(|b| b.name.as_str())
                .collect();
            assert_eq!(
                tracked,
                expected
                    .poses
                    .iter()
                    .map(|pose| pose.0.as_str())
                    .collect::<Vec<_>>(),
                "{name} frame {i}"
            );
            for (body, place, matrix) in &expected.poses {
                poses += 1;
                let stream = recording
                    .bodies
                    .iter()
                    .find(|b| b.name == *body)
                    .expect("compared above");
                let pose = stream.tracker_from_body[i].expect("compared above");
                let rotation = pose.rotation.to_rotation_matrix();
                for k in 0..3 {
                    assert!(
                        (pose.translation.vector[k] * 1e3 - place[k]).abs() < 6e-4,
                        "{name} {i} {body}"
                    );
                }
                for (ours, theirs) in rotation.matrix().iter().zip(matrix) {
                    assert!((ours - theirs).abs() < 6e-4, "{name} {i} {body}");
                }
            }
            for (marker, place) in &expected.markers {
                let stream = recording
                    .markers
                    .iter()
                    .find(|m| m.name == *marker)
                    // The only one of a frame loses its number.
                    .or_else(|| recording.markers.iter().find(|m| m.name == "marker"))
                    .expect("read");
                let point = stream.samples[i].point(Filled::Exclude).expect("seen");
                assert!(
                    (point.coords * 1e3 - nalgebra::Vector3::from(*place))
                        .abs()
                        .max()
                        < 6e-4
                );
            }
        }
        assert!(poses >= 1, "{name}");
        println!("{name}: {} frames, {poses} poses as the SDK", sdk.len());
    }
    let manual = read("dtrack/manual_examples.dtrack").expect("present");
    let body = manual
        .bodies
        .iter()
        .find(|b| b.name == "body_0")
        .expect("in frame 1");
    assert_eq!(
        body.tracker_from_body
            .iter()
            .map(Option::is_some)
            .collect::<Vec<_>>(),
        [true, false, false]
    );
    let synthetic = read("dtrack/synthetic_2bodies_dropout_midnight.dtrack").expect("present");
    let t = synthetic.timelines[0]
        .t
        .as_ref()
        .expect("all frames have a time");
    assert!(t.windows(2).all(|w| w[1] >= w[0]) && t.last().is_some_and(|&t| t > 86_400.0));
}

#[test]
fn both_forms_of_one_ros_bag_say_the_same() {
    let Some(mcap) = read("ros/rosbags-rs_0.3.4/test_bag_mcap/test_bag_mcap.mcap") else {
        return;
    };
    let sqlite =
        read("ros/rosbags-rs_0.3.4/test_bag_sqlite3/test_bag_sqlite3.db3").expect("present");
    assert_eq!(
        (mcap.meta.format.as_str(), sqlite.meta.format.as_str()),
        ("ros2_mcap", "ros2_sqlite")
    );
    // Two messages each of JointState, PoseStamped, TransformStamped and TFMessage.
    assert_eq!(mcap.timelines.len(), 4);
    assert!(mcap.timelines.iter().all(|timeline| timeline.len() == 2));
    assert_eq!(mcap.bodies.len(), 3);
    assert!(!mcap.joints.is_empty());
    assert_eq!(
        (&mcap.joints, &mcap.bodies),
        (&sqlite.joints, &sqlite.bodies)
    );
}
