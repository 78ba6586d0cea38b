//! Seeds of the fuzz targets of live streams: what the senders of these tests send.

use crate::senders::{dtrack, greeting, message, report};
use nalgebra::Isometry3;

#[test]
fn seeds_of_live_streams() {
    let pose = Isometry3::translation(0.1, 0.2, 0.3);
    let mut stream = greeting("Head");
    stream.extend(message((5, 6), 1, 9, &[1, 2, 3]));
    stream.extend(report((10, 250_000), 0, &pose));
    stream.extend(report((10, 250_000), 2, &pose));
    stream.extend(message((0, 0), 0, -5, &[]));
    let seeds = [
        (
            "live_dtrack",
            dtrack(1, Some(86_399.5), &[(0, pose), (3, pose)]),
        ),
        (
            "live_dtrack",
            b"fr 2\r\nts2 1700000000 5 900\r\n3d 1 [7 1.000][1 2 3]\r\n\0".to_vec(),
        ),
        (
            "live_dtrack",
            b"waist_deg=40.5 lift_mm=12,elbow_rad=-1e-1".to_vec(),
        ),
        ("live_vrpn", [vec![255], stream.clone()].concat()),
        ("live_vrpn", [vec![1], stream].concat()),
    ];
    // `CALIB_FUZZ_SEEDS` names where they go, else they are only made.
    let kept = tempfile::tempdir().expect("folder");
    let folder =
        std::env::var_os("CALIB_FUZZ_SEEDS").map_or(kept.path().into(), std::path::PathBuf::from);
    for (i, (target, bytes)) in seeds.iter().enumerate() {
        std::fs::create_dir_all(folder.join(target)).expect("made");
        std::fs::write(folder.join(target).join(format!("seed-{i}")), bytes).expect("written");
    }
    let targets = std::fs::read_to_string(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../fuzz/Cargo.toml"
    ));
    let targets = targets.expect("fuzz/Cargo.toml");
    for (target, _) in &seeds {
        assert!(
            targets.contains(&format!("name = \"{target}\"")),
            "{target}"
        );
    }
}
