//! Seeds of the fuzz targets in `fuzz/`: the same small files that the other tests read.

use crate::{fixtures, mutations};
use calib_recording::readers::readers;
use calib_recording::{
    BodyColumns, ColumnMap, Delimiter, LongColumns, PRESETS, ReadOptions, TimeColumn, TimeUnit,
    read_bytes,
};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Tables that are not ours, each with the map that explains it.
fn mapped_tables() -> Vec<(ColumnMap, String)> {
    let text = |text: &str| text.to_string();
    let three = |names: [&str; 3]| names.map(str::to_string);
    let presets = PRESETS.map(|name| {
        let table = match name {
            "ur_rtde" => "timestamp actual_q_0 actual_q_1 actual_q_2 actual_q_3 actual_q_4 actual_q_5\r\n1.5 0 1 2 3 4 5\r\n1.508 0 1 2 3 4 5\r\n",
            "franka" => "time,success_rate,state.q[0],state.q[1],state.q[2],state.q[3],state.q[4],state.q[5],state.q[6]\n12,1,0.1,0.2,0.3,0.4,0.5,0.6,0.7\n",
            "ndi" => "Frame#,ToolHandle,Face,q0,qx,qy,qz,tx,ty,tz\n1,02,0,0,1,0,0,10,20,30\n1,03,0,Missing,,,,,,\n",
            _ => "x,y,z,A,B,C,button,T,delta\n1,2,3,0.1,0.2,0.3,0,1500000000000,11\n4,5,6,0.1,0.2,0.3,1,1500000000011,11\n",
        };
        let map = ColumnMap { preset: Some(text(name)), ..ColumnMap::default() };
        (map, text(table))
    });
    let wide = ColumnMap {
        delimiter: Some(Delimiter::Semicolon),
        skip_lines: 1,
        decimal_comma: true,
        time: Some(TimeColumn {
            column: text("t"),
            unit: TimeUnit::Ms,
        }),
        joints: BTreeMap::from([(text("elbow"), text("q1"))]),
        joint_columns: vec![text("wrist")],
        prismatic: BTreeMap::from([(text("lift"), text("z0"))]),
        torques: BTreeMap::from([(text("elbow"), text("tau"))]),
        markers: BTreeMap::from([(text("m"), three(["mx", "my", "mz"]))]),
        bodies: BTreeMap::from([(
            text("hand"),
            BodyColumns {
                position: three(["x", "y", "z"]),
                rotation_vector: Some(three(["rx", "ry", "rz"])),
                ..BodyColumns::default()
            },
        )]),
        labels: vec![text("trial")],
        lost: vec![text("-")],
        ..ColumnMap::default()
    };
    let wide_text = "a log\nt;q1;wrist;z0;tau;mx;my;mz;x;y;z;rx;ry;rz;trial\n1,5;0,1;0,2;0,3;4;1;2;3;4;5;6;0,1;0,2;0,3;a\n2,5;0,1;;0,3;4;-;-;-;;;;;;;b\n";
    let long = ColumnMap {
        names: ["f", "id", "x", "y", "z", "qx", "qy", "qz", "qw"]
            .map(str::to_string)
            .to_vec(),
        long: Some(LongColumns {
            name: text("id"),
            frame: text("f"),
            marker: None,
            body: Some(BodyColumns {
                position: three(["x", "y", "z"]),
                quaternion_xyzw: Some(["qx", "qy", "qz", "qw"].map(str::to_string)),
                ..BodyColumns::default()
            }),
        }),
        ..ColumnMap::default()
    };
    let long_text = "1,a,1,2,3,0,0,0,1\n1,b,1,2,3,0,0,1,0\n2,b,,,,,,,\n";
    let mut tables = presets.to_vec();
    tables.push((wide, text(wide_text)));
    tables.push((long, text(long_text)));
    tables
}

/// (target, bytes) of all seeds.
fn seeds() -> Vec<(String, Vec<u8>)> {
    let mut seeds: Vec<(String, Vec<u8>)> = mutations::corpus()
        .into_iter()
        .map(|(id, bytes)| {
            let target = match id {
                "csv" => "table",
                // Presets of the table reader, found by their header.
                "ur_rtde" | "franka" | "ndi" => "table",
                other => other,
            };
            (target.to_string(), bytes)
        })
        .collect();
    seeds.push(("trc".into(), fixtures::TRC.replace('\t', ",").into_bytes()));
    for (map, table) in mapped_tables() {
        let mut bytes = serde_json::to_vec(&map).expect("a map is JSON");
        bytes.push(b'\n');
        bytes.extend(table.bytes());
        seeds.push(("column_map".into(), bytes));
    }
    seeds
}

/// Where the seeds go: `CALIB_FUZZ_SEEDS`, else nowhere that stays.
fn folder() -> (PathBuf, Option<tempfile::TempDir>) {
    match std::env::var_os("CALIB_FUZZ_SEEDS") {
        Some(folder) => (folder.into(), None),
        None => {
            let folder = tempfile::tempdir().expect("a temporary folder");
            (folder.path().to_path_buf(), Some(folder))
        }
    }
}

#[test]
fn seeds_for_every_fuzz_target() {
    let (folder, _kept) = folder();
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for (target, bytes) in seeds() {
        let count = counts.entry(target.clone()).or_default();
        let path = folder.join(&target).join(format!("seed-{count}"));
        *count += 1;
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(&path, &bytes).expect("written");
    }
    let targets = fuzz_targets();
    for target in &targets {
        // Targets of live streams are seeded by the crate that has their decoders, those of robots by `fuzz/seeds.sh`.
        let elsewhere = ["profile", "urdf_round_trip", "change_record", "model_file"];
        let elsewhere = target.starts_with("live_") || elsewhere.contains(&target.as_str());
        let seeded = counts.contains_key(target) || elsewhere;
        assert!(seeded, "{target} has no seed");
    }
    for reader in readers() {
        let target = match reader.id {
            "csv" => "table",
            "ur_rtde" | "franka" | "ndi" => "column_map",
            other => other,
        };
        assert!(targets.contains(target), "{} has no fuzz target", reader.id);
    }
}

#[test]
fn mapped_seeds_are_readable() {
    for (map, table) in mapped_tables() {
        let options = ReadOptions {
            columns: Some(map),
            ..ReadOptions::default()
        };
        let recording = read_bytes("x", table.as_bytes(), &options);
        assert!(recording.is_ok(), "{table}\n{}", recording.unwrap_err());
    }
}

/// Names of the programs in `fuzz/Cargo.toml`.
fn fuzz_targets() -> BTreeSet<String> {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/Cargo.toml");
    let text = std::fs::read_to_string(manifest).expect("fuzz/Cargo.toml");
    text.lines()
        .filter_map(|line| {
            let path = line.strip_prefix("path = \"fuzz_targets/")?;
            Some(path.strip_suffix(".rs\"")?.to_string())
        })
        .collect()
}
