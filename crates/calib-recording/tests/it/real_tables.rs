//! Tables of other laboratories, where they are at hand.

use calib_recording::{
    BodyColumns, ColumnMap, Filled, LengthUnit, Poses, ReadOptions, read_bytes, read_path,
};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The folder of real measurements; `None`, counted as skipped, where there is none.
pub fn real_data() -> Option<PathBuf> {
    skipped_tests::real_data("")
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

fn tiago() -> ColumnMap {
    let arm = |i: usize| format!("arm_{i}_joint");
    ColumnMap {
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
    }
}

#[test]
fn figaroh_and_justin_tables_need_a_column_map() {
    let Some(bad) = table(
        "tiago_qualisys/qualysis_base_hand_calibration.csv",
        Some(tiago()),
    ) else {
        return;
    };
    assert_eq!((bad.len(), bad.markers.len(), bad.joints.len()), (34, 4, 8));
    assert_eq!(bad.markers["m3"], bad.markers["m4"]);
    assert_eq!(
        table("tiago_frozen/train.csv", Some(tiago()))
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

#[test]
fn tables_of_other_makers_through_a_column_map() {
    let text = |names: [&str; 3]| names.map(String::from);
    let body = |c: &str| BodyColumns {
        position: [format!("X{c}"), format!("Y{c}"), format!("Z{c}")],
        quaternion_wxyz: Some([
            format!("qo{c}"),
            format!("qx{c}"),
            format!("qy{c}"),
            format!("qz{c}"),
        ]),
        ..BodyColumns::default()
    };
    let aurora = ColumnMap {
        skip_lines: 4,
        lengths: LengthUnit::Mm,
        bodies: ["a", "b", "c", "d"]
            .iter()
            .map(|c| (c.to_string(), body(c)))
            .collect(),
        ..ColumnMap::default()
    };
    let Some(data) = real_data() else { return };
    let text_of = std::fs::read_to_string(data.join("formats/ndi/andrewraz_NDIdata_aurora.csv"))
        .expect("present");
    let options = ReadOptions {
        columns: Some(aurora),
        ..ReadOptions::default()
    };
    // The file was cut in its last line; that is said, and without the line it is read.
    let cut = read_bytes("aurora.csv", text_of.as_bytes(), &options)
        .expect_err("cut")
        .to_string();
    assert_eq!(
        cut,
        "aurora.csv:164: 6 cells, the header has 33\n  help: complete the line; a lost sample has empty cells"
    );
    let whole = text_of.rsplit_once('\n').map_or("", |(whole, _)| whole);
    let recording = read_bytes("aurora.csv", whole.as_bytes(), &options).expect("readable");
    let aurora = recording.poses(Filled::Exclude).expect("one table");
    assert_eq!(aurora.len(), 158);
    let seen: Vec<usize> = aurora
        .bodies
        .values()
        .map(|track| track.iter().flatten().count())
        .collect();
    // Lost tools are written as zeros; the counts are those of a spreadsheet.
    assert_eq!(seen, [156, 154, 149, 157]);

    let quaternion = |p: &str| Some(["qx", "qy", "qz", "qw"].map(|q| format!("{p}_{q}")));
    let ur10 = ColumnMap {
        bodies: [
            ("flange", text(["flange_x", "flange_y", "flange_z"])),
            ("meas", text(["meas_x", "meas_y", "meas_z"])),
        ]
        .into_iter()
        .map(|(name, position)| {
            (
                name.to_string(),
                BodyColumns {
                    position,
                    quaternion_xyzw: quaternion(name),
                    ..BodyColumns::default()
                },
            )
        })
        .collect(),
        ..ColumnMap::default()
    };
    let ur10 = table("ur10_handeye/ur10_axzb.csv", Some(ur10)).expect("present");
    assert_eq!(
        (ur10.len(), ur10.bodies["meas"].iter().flatten().count()),
        (23, 23)
    );
}
