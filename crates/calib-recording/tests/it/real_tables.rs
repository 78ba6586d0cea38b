//! Tables of other laboratories, where they are at hand.

use calib_recording::{ColumnMap, Filled, Poses, ReadOptions, read_path};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The folder of real measurements, or `None` (said on stderr).
pub fn real_data() -> Option<PathBuf> {
    let folder = std::env::var_os("CALIB_REAL_DATA")
        .map(PathBuf::from)
        .unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"));
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("skipped: no real data (CALIB_REAL_DATA)");
    None
}

fn table(path: &str, columns: Option<ColumnMap>) -> Option<Poses> {
    let path = real_data()?.join(path);
    let options = ReadOptions {
        columns,
        ..ReadOptions::default()
    };
    let recording = read_path(&path, &options).unwrap_or_else(|e| panic!("{e}"));
    Some(recording.poses(Filled::Exclude).expect("one table"))
}

#[test]
fn pivot_hinge_and_knee_are_our_own_tables() {
    let Some(pivot) = table("pivot/pivot_clean.csv", None) else {
        return;
    };
    assert_eq!(
        (pivot.len(), pivot.bodies["body"].iter().flatten().count()),
        (481, 481)
    );
    let hinge = table("hinge/hinge_markers.csv", None).expect("present");
    assert_eq!(hinge.markers.len(), 12);
    assert!(hinge.t.is_some());
    let knee = table("functional_knee/knee.csv", None).expect("present");
    assert_eq!(knee.markers.len(), 10);
    let cis = table("cis/pa1-debug-a/em_markers.csv", None).expect("present");
    assert!(cis.markers.len() >= 3 && cis.len() > 1);
}

#[test]
fn figaroh_and_justin_tables_need_a_column_map() {
    let arm = |i: usize| format!("arm_{i}_joint");
    let tiago = ColumnMap {
        joint_columns: (1..=7).map(arm).collect(),
        prismatic: BTreeMap::from([(
            "torso_lift_joint".to_string(),
            "torso_lift_joint".to_string(),
        )]),
        markers: (1..=4)
            .map(|i| {
                (
                    format!("m{i}"),
                    [format!("x{i}"), format!("y{i}"), format!("z{i}")],
                )
            })
            .collect(),
        ..ColumnMap::default()
    };
    let Some(bad) = table(
        "tiago_qualisys/qualysis_base_hand_calibration.csv",
        Some(tiago.clone()),
    ) else {
        return;
    };
    assert_eq!((bad.len(), bad.markers.len(), bad.joints.len()), (34, 4, 8));
    assert_eq!(bad.markers["m3"], bad.markers["m4"]);
    assert_eq!(
        table("tiago_frozen/train.csv", Some(tiago))
            .expect("present")
            .len(),
        37
    );
    let justin = ColumnMap {
        joint_columns: ["torso_0".to_string()]
            .into_iter()
            .chain((0..7).map(|i| format!("right_{i}")))
            .collect(),
        ..ColumnMap::default()
    };
    let justin = table("agile_justin/postures.csv", Some(justin)).expect("present");
    assert_eq!(
        (justin.len(), justin.markers.len(), justin.joints.len()),
        (350, 2, 8)
    );
}
