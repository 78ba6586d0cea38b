//! Column maps that say nothing of columns, and those that contradict themselves.

use calib_finding::catalog;
use calib_recording::{
    ColumnMap, Filled, MapFault, ReadOptions, Recording, StatedUnits, read_bytes,
};
use nalgebra::Point3;

fn map(json: &str) -> ColumnMap {
    serde_json::from_str(json).unwrap_or_else(|e| panic!("{e}: {json}"))
}

fn read(text: &str, json: &str) -> Result<Recording, String> {
    let options = ReadOptions {
        columns: Some(map(json)),
        ..ReadOptions::default()
    };
    read_bytes("poses", text.as_bytes(), &options).map_err(|e| e.to_string())
}

const QTM: &str =
    "NO_OF_FRAMES\t2\nNO_OF_MARKERS\t1\nFREQUENCY\t100\nMARKER_NAMES\ttip\n0\t0\t0\n1\t2\t3\n";
const TRC: &str = "PathFileType\t4\t(X/Y/Z)\tt.trc\nDataRate\tNumFrames\tUnits\n100\t2\tmm\nFrame#\tTime\ttip\n\t\tX1\tY1\tZ1\n1\t0\t0\t0\t0\n2\t0.01\t1\t2\t3\n";
const MOTIVE: &str = "Format Version,1.23,Length Units,Millimeters\n\n,,Marker,Marker,Marker\n,,tip,tip,tip\n,,Position,Position,Position\nFrame,Time (Seconds),X,Y,Z\n0,0,0,0,0\n1,0.01,1,2,3\n";
const NEXUS: &str =
    "Trajectories\n100\n,,tip,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n1,0,0,0,0\n2,0,1,2,3\n";

#[test]
fn a_flag_leaves_a_file_its_own_format() {
    for (format, text) in [
        ("qualisys_tsv", QTM),
        ("trc", TRC),
        ("motive_csv", MOTIVE),
        ("vicon_csv", NEXUS),
        ("csv", "tip.x_mm,tip.y_mm,tip.z_mm\n0,0,0\n1,2,3\n"),
    ] {
        for (json, lost) in [("{}", 1), (r#"{"zero_is_a_point": true}"#, 0)] {
            let recording = read(text, json).unwrap_or_else(|e| panic!("{format}: {e}"));
            assert_eq!(recording.meta.format, format);
            let [tip] = recording.markers.as_slice() else {
                panic!("{format}: {} markers", recording.markers.len());
            };
            assert_eq!((tip.samples.len(), tip.lost()), (2, lost), "{format}");
            if lost == 0 {
                let first = tip.samples[0].point(Filled::Include);
                assert_eq!(first, Some(Point3::origin()), "{format}");
            }
            let mut findings = recording.meta.findings.iter();
            let told = findings.any(|f| f.id == catalog::ALL_ZERO_TRIPLET);
            assert_eq!(told, lost == 1, "{format}: {json}");
        }
    }
}

#[test]
fn what_a_format_states_itself_is_not_stated_again() {
    for (json, said) in [
        (r#"{"lengths": "cm"}"#, "remove `lengths` from the profile"),
        (r#"{"lost": ["x"]}"#, "remove `lost` from the profile"),
        (r#"{"labels": ["trial"]}"#, "a label needs column `trial`"),
    ] {
        let found = read(QTM, json).expect_err(json);
        assert!(found.contains(said), "{json}: {found}");
    }
}

#[test]
fn a_log_with_a_preset_takes_what_else_the_map_says() {
    let text = "timestamp actual_q_0 actual_q_1 actual_q_2 actual_q_3 actual_q_4 actual_q_5\n0 0 0 180 0 0 0\n";
    let recording = read(text, r#"{"angles": "deg"}"#).expect("a UR log");
    let elbow = recording.joints.iter().find(|j| j.name == "elbow_joint");
    let elbow = elbow.expect("named by the preset");
    assert_eq!(elbow.q, [Some(std::f64::consts::PI)]);
}

/// A map, keys that lead to its fault, and what is said.
const FAULTY: &[(&str, &str, &str)] = &[
    (
        r#"{"joints": {"a": "A1_deg", "b": "A2_deg"}, "angles": "rad"}"#,
        "angles",
        "`angles: rad` in the column map contradicts the name of column `A1_deg` and of 1 other",
    ),
    (
        r#"{"joints": {"a": "A1_rad"}, "angles": "deg"}"#,
        "angles",
        "`angles: deg` in the column map contradicts the name of column `A1_rad`",
    ),
    (
        r#"{"prismatic": {"a": "s_mm"}, "lengths": "cm"}"#,
        "lengths",
        "contradicts the name of column `s_mm`",
    ),
    (
        r#"{"joints": {"a": "A", "b": "A"}}"#,
        "joints.b",
        "uses column `A` twice: at `joints.a` and at `joints.b`",
    ),
    (
        r#"{"joints": {"elbow": "A"}, "reversed": ["elbov"]}"#,
        "reversed.0",
        "`reversed` names `elbov`",
    ),
    (
        r#"{"bodies": {"hand": {"position": ["x", "y", "z"]}}}"#,
        "bodies.hand",
        "`bodies.hand` of the column map has 0 rotations",
    ),
    (
        r#"{"long": {"name": "n", "frame": "f"}}"#,
        "long",
        "`long` of the column map has 0 kinds",
    ),
];

#[test]
fn a_map_that_contradicts_itself_names_the_place_in_the_map() {
    let stated = StatedUnits {
        angles: true,
        lengths: true,
    };
    for (json, path, said) in FAULTY {
        let faults = map(json).faults(stated);
        let [fault] = faults.as_slice() else {
            panic!("{json}: {faults:?}");
        };
        assert_eq!(fault.path().join("."), *path);
        assert!(fault.to_string().contains(said), "{fault}");
        let remedy = fault.remedy();
        assert!(!remedy.contains("export"), "{remedy}");
        assert_eq!(
            matches!(fault, MapFault::NotReversible { .. }),
            remedy.contains("did you mean `elbow`?")
        );
    }
    let default = r#"{"joints": {"a": "A1_deg"}, "prismatic": {"b": "s_mm"}}"#;
    assert_eq!(map(default).faults(StatedUnits::default()), []);
}
