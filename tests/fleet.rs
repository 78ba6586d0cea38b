//! Fleets and shards through the program: rows, drift of a joint, interruptions, and work that is divided and merged.

use std::path::Path;
use std::process::Command;

use calib_pipeline::prepare::load::load_robot;
use calib_recording::{WriteOptions, write_poses};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha12Rng;
use serde_json::Value;

use crate::scratch::{Files, Scratch};

/// Joints of a small arm: name, origin and axis by design.
const JOINTS: [(&str, &str, &str); 4] = [
    ("base", "0 0 0.2", "0 0 1"),
    ("shoulder", "0.05 0 0.1", "0 1 0"),
    ("elbow", "0.3 0 0", "0 1 0"),
    ("wrist", "0.25 0 0.02", "1 0 0"),
];

/// The arm with rotations of its joints about their own axes, rad.
fn urdf(offsets: [f64; 4]) -> String {
    let mut text = String::from("<robot name=\"arm\">\n<link name=\"l0\"/>\n");
    for (i, ((name, xyz, axis), offset)) in JOINTS.iter().zip(offsets).enumerate() {
        let rpy: Vec<String> = axis
            .split(' ')
            .map(|a| (a.parse::<f64>().expect("a number") * offset).to_string())
            .collect();
        text += &format!(
            "<link name=\"l{}\"/>\n<joint name=\"{name}\" type=\"revolute\"><parent link=\"l{i}\"/><child link=\"l{}\"/>\
            <origin xyz=\"{xyz}\" rpy=\"{}\"/><axis xyz=\"{axis}\"/><limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>\n",
            i + 1,
            i + 1,
            rpy.join(" "),
        );
    }
    text + "</robot>\n"
}

/// The profile of a robot; with `simulate` the one that its recordings are made with.
fn profile(urdf: &str, simulate: bool) -> String {
    let section = "simulate:
  seed: 1
  tracker_from_root: {xyz_mm: [900, 300, 700], rpy_deg: [2, 5, 30]}
  mounts:
    foot: {xyz_mm: [-80, 60, 20]}
    tool: {xyz_mm: [20, 0, 30], rpy_deg: [0, 0, 90]}
  noise: {body_mm: 0.1, body_deg: 0.02}
  recordings:
    holds: {random: {base_deg: [-150, 150], shoulder_deg: [-80, 80], elbow_deg: [-120, 120], wrist_deg: [-150, 150]}, poses: 15}
    checks: {random: {base_deg: [-150, 150], shoulder_deg: [-80, 80], elbow_deg: [-120, 120], wrist_deg: [-150, 150]}, poses: 5}
";
    format!(
        "calib: 1
robot: {{name: arm, urdf: {urdf}}}
tracker: {{frame: hall, body_sigma_mm: 0.1, body_sigma_deg: 0.02}}
bodies:
  foot: {{link: l0, pose: true, mount: {{xyz_mm: [-80, 60, 20]}}}}
  tool: {{link: l4, pose: true, mount: {{xyz_mm: [20, 0, 30], rpy_deg: [0, 0, 90]}}}}
recordings:
  holds: {{file: holds.csv, use: static}}
  checks: {{file: checks.csv, use: validation}}
solve: {{free: [bodies, tracker, joint_offsets], noise: {{model: white}}, limits: {{held_out_rms_mm: 1}}}}
outputs: {{urdf: arm.calibrated.urdf}}
{}",
        if simulate { section } else { "" }
    )
}

/// σ of the offsets of unchanged robots, and the change that is planted, deg.
const SPREAD_DEG: f64 = 0.2;
const DRIFT_DEG: f64 = 0.3;

/// Robots `visit/r000` and so on as they are recorded at a visit; the elbow of those in `drifted` moved before it.
pub(crate) fn fleet(dir: &Scratch, visit: &str, count: usize, drifted: &[usize]) {
    let write = |path: String, text: &str| {
        let path = dir.path(&path);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, text).expect("written");
    };
    for k in 0..count {
        // The same robot at each visit, with other noise.
        let mut rng = ChaCha12Rng::seed_from_u64(k as u64);
        let spread = SPREAD_DEG.to_radians();
        let mut offsets = JOINTS.map(|_| rng.random_range(-spread..spread));
        if drifted.contains(&k) {
            offsets[2] += DRIFT_DEG.to_radians();
        }
        let at = |file: &str| format!("{visit}/r{k:03}/{file}");
        write(at("true.urdf"), &urdf(offsets));
        write(at("true.yaml"), &profile("true.urdf", true));
        let robot = load_robot(&dir.path(&at("true.yaml"))).expect("a robot");
        let seed = 2 * rng.random_range(0..1 << 40) + visit.len() as u64 % 2;
        let simulated = calib_sim::simulate(&robot.profile, &robot.model, Some(seed));
        for (name, poses) in &simulated.expect("a section").recordings {
            let text = write_poses(poses, &WriteOptions::micro()).expect("plain names");
            write(at(&format!("{name}.csv")), &text);
        }
        write(at("arm.urdf"), &urdf([0.0; 4]));
        write(at("r.yaml"), &profile("arm.urdf", false));
    }
}

/// Files of a fleet that must not depend on how it was made.
pub(crate) fn results(dir: &Scratch, folder: &str) -> Files {
    let mut files = dir.files(folder);
    files.retain(|name, _| !name.starts_with("batch-"));
    files
}

#[track_caller]
pub(crate) fn same(a: &Files, b: &Files) {
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in a {
        assert!(b[name] == *bytes, "{name} differs");
    }
}

fn rows(dir: &Scratch, folder: &str) -> Vec<std::collections::BTreeMap<String, String>> {
    let mut reader =
        csv::Reader::from_path(dir.path(&format!("{folder}/fleet.csv"))).expect("a table");
    reader
        .deserialize()
        .map(|row| row.expect("a row"))
        .collect()
}

/// Names that a spreadsheet would compute are texts in the table.
#[test]
fn names_of_a_fleet_are_no_formulas() {
    let dir = Scratch::new();
    fleet(&dir, "old", 1, &[]);
    let list = "calib_fleet: 1\nrobots:\n  - {name: \"+1+1\", series: \"@s\", profile: old/r000/r.yaml}\n  - {name: \"=HYPERLINK(x)\", profile: absent.yaml}\n";
    let dir = dir.file("list.yaml", list);
    dir.calib(["batch", "list.yaml", "--out", "out"]);
    let rows = rows(&dir, "out");
    let names: Vec<&str> = rows.iter().map(|row| row["name"].as_str()).collect();
    assert_eq!(names, ["'+1+1", "'=HYPERLINK(x)"]);
    assert_eq!(rows[0]["series"], "'@s");
    let cells = rows.iter().flat_map(|row| row.values());
    for text in cells.filter(|text| text.parse::<f64>().is_err()) {
        assert!(!text.starts_with(['=', '+', '-', '@']), "{text}");
    }
}

/// One elbow that drifted is found, a robot that cannot be calibrated is a row, and nothing depends on how the work is divided.
#[test]
fn a_fleet_is_calibrated_and_compared_with_last_time() {
    let dir = Scratch::new();
    fleet(&dir, "old", 6, &[]);
    fleet(&dir, "now", 6, &[3]);
    dir.calib(["batch", "old/*/r.yaml", "--out", "last"])
        .expect(0);
    let dir = dir
        .file("now/r004/r.yaml", "calib: 1\nrobots: {}\n")
        .file("now/r005/holds.csv", "no table\n");
    let batch = ["batch", "now/*/r.yaml", "--earlier", "last", "--out"];
    let mistyped = [
        "batch",
        "now/*/r.yaml",
        "--earlier",
        "lost",
        "--out",
        "none",
    ];
    let refused = dir.calib_with(&mistyped).expect(2);
    assert!(
        refused
            .stderr
            .contains("lost: is no folder of an earlier batch"),
        "{}",
        refused.stderr
    );
    let ran = dir
        .calib_with(&[&batch[..], &["tonight", "--jobs", "2"]].concat())
        .expect(0);
    assert!(
        ran.stdout.contains("6 robots: 4 accepted, 2 failed"),
        "{}",
        ran.stdout
    );
    let found = rows(&dir, "tonight");
    let column = |name: &str| -> Vec<&str> { found.iter().map(|row| &*row[name]).collect() };
    assert_eq!(
        column("name"),
        ["r000", "r001", "r002", "r003", "r004", "r005"]
    );
    assert_eq!(column("exit_code"), ["0", "0", "0", "0", "2", "3"]);
    assert_eq!(column("error_id"), ["", "", "", "", "profile", "recording"]);
    assert_eq!(column("series"), ["arm", "arm", "arm", "arm", "", ""]);
    let p: Vec<Option<f64>> = column("drift_p_value")
        .iter()
        .map(|p| p.parse().ok())
        .collect();
    assert!(
        p[3].is_some_and(|p| p < 1e-6) && column("drift_joint")[3] == "elbow",
        "{found:?}"
    );
    assert!(p[..3].iter().all(|p| p.is_some_and(|p| p > 1e-3)), "{p:?}");
    for row in &found[..4] {
        let error: f64 = row["held_out_rms_m"].parse().expect("a number");
        assert!(error > 1e-5 && error < 5e-4, "{error}");
    }
    let summary = dir.json("tonight/fleet.json");
    assert_eq!(summary["drift"]["compared"], 4);
    assert_eq!(summary["drift"]["alarms"][0]["name"], "r003");
    assert_eq!(summary["drift"]["alarms"][0]["familywise"], true);

    // Who failed last time cannot be compared, and is named.
    let mended = [
        "batch",
        "old/*/r.yaml",
        "--earlier",
        "tonight",
        "--out",
        "mended",
    ];
    dir.calib_with(&mended).expect(0);
    let not_compared = &dir.json("mended/fleet.json")["drift"]["not_compared"];
    assert_eq!(*not_compared, serde_json::json!(["r004", "r005"]));

    // With and without a comparison.
    for page in ["last/fleet.html", "tonight/fleet.html"] {
        for checker in ["html", "axe"] {
            let faults = crate::outputs::faults(checker, &dir.path(page)).unwrap_or_default();
            assert!(faults.is_empty(), "{page}, {checker}: {faults:#?}");
        }
    }
    // Once more: finished robots are not calibrated again, and every byte stays.
    let first = results(&dir, "tonight");
    let row = dir.path("tonight/robots/r000/row.json");
    let written = || {
        std::fs::metadata(&row)
            .expect("a row")
            .modified()
            .expect("a time")
    };
    let before = written();
    dir.calib_with(&[&batch[..], &["tonight"]].concat())
        .expect(0);
    assert_eq!(written(), before, "it was calibrated again");
    same(&first, &results(&dir, "tonight"));

    // Divided, merged, and put together elsewhere.
    let mut whole = None;
    for of in [1, 2, 7] {
        let out = format!("divided-{of}");
        let mut merge = vec![
            "merge".to_owned(),
            "--out".to_owned(),
            format!("{out}.parquet"),
        ];
        for i in 1..=of {
            let shard = format!("{i}/{of}");
            let ran = dir
                .calib_with(&[&batch[..], &[&out, "--shard", &shard]].concat())
                .expect(0);
            merge.push(ran.stdout.trim().to_owned());
        }
        let merge: Vec<&str> = merge.iter().map(String::as_str).collect();
        dir.calib_with(&merge).expect(0);
        let bytes = std::fs::read(dir.path(&format!("{out}.parquet"))).expect("merged");
        assert!(
            *whole.get_or_insert_with(|| bytes.clone()) == bytes,
            "{of} shards"
        );
        let from = format!("{out}.parquet");
        dir.calib_with(&[&batch[..], &[&out, "--from", &from]].concat())
            .expect(0);
        same(&first, &results(&dir, &out));
    }

    // A recording that is another one by now.
    let recording = "now/r002/checks.csv";
    let text = dir.read(recording);
    let (_, but_the_last) = text
        .trim_end()
        .rsplit_once('\n')
        .map(|(a, b)| (b, a))
        .expect("rows");
    std::fs::write(dir.path(recording), format!("{but_the_last}\n")).expect("written");
    let from = ["divided-2", "--from", "divided-2.parquet"];
    let refused = dir.calib_with(&[&batch[..], &from].concat()).expect(3);
    let said = "now/r002/checks.csv: the shard with robot `r002` was made from another version of this file";
    assert!(refused.stderr.contains(said), "{}", refused.stderr);
    // Its shard is made again, the other is kept, and both belong together.
    let mut merge = vec!["merge", "--out", "again.parquet"];
    let shards = ["1/2", "2/2"].map(|shard| {
        let ran = dir.calib_with(&[&batch[..], &["divided-2", "--shard", shard]].concat());
        ran.expect(0).stdout.trim().to_owned()
    });
    merge.extend(shards.iter().map(String::as_str));
    dir.calib_with(&merge).expect(0);
    let from = ["divided-2", "--from", "again.parquet"];
    dir.calib_with(&[&batch[..], &from].concat()).expect(0);
    let row = dir.json("divided-2/fleet.json");
    assert_eq!(row["robots"], 6, "{row:#}");
}

/// Robots that were calibrated on machines without a common disk: the bytes of the batch on one.
#[cfg(all(unix, feature = "object-store"))]
#[test]
fn a_batch_by_way_of_a_store_is_that_of_one_machine() {
    let dir = Scratch::new();
    fleet(&dir, "old", 5, &[]);
    let batch = ["batch", "old/*/r.yaml", "--out"];
    dir.calib_with(&[&batch[..], &["quiet"]].concat()).expect(0);
    let url = format!("file://{}", dir.path("store").display());
    for i in 1..=2 {
        let (out, shard) = (format!("machine-{i}"), format!("{i}/2"));
        let more = [&out[..], "--shard", &shard, "--store", &url];
        dir.calib_with(&[&batch[..], &more].concat()).expect(0);
        std::fs::remove_dir_all(dir.path(&out)).expect("the machine is gone");
    }
    dir.calib(["merge", "--store", &url, "--out", "all/all.parquet"])
        .expect(0);
    let from = ["again", "--from", "all/all.parquet"];
    dir.calib_with(&[&batch[..], &from].concat()).expect(0);
    let mut quiet = results(&dir, "quiet");
    quiet.retain(|name, _| !name.starts_with("robots/"));
    same(&quiet, &results(&dir, "again"));
    // What was fetched is gone, and errors name where it came from.
    assert_eq!(dir.files("all").len(), 1);
    let store = dir.path("store");
    std::fs::copy(
        store.join("batch-1-of-2.parquet"),
        store.join("copy.parquet"),
    )
    .expect("copied");
    let ran = dir.calib(["merge", "--store", &url, "--out", "all/twice.parquet"]);
    let ran = ran.expect(3);
    let said = format!("{url}/copy.parquet: is shard 1/2, and so is {url}/batch-1-of-2.parquet");
    assert!(ran.stderr.contains(&said), "{}", ran.stderr);
    assert_eq!(dir.files("all").len(), 1);
}

#[test]
fn a_second_batch_into_a_folder_ends_with_seven() {
    let dir = Scratch::new();
    fleet(&dir, "old", 1, &[]);
    for (locked, more) in [("out", &[][..]), ("out/batch-1-of-2", &["--shard", "1/2"])] {
        let held = calib_files::ResultsFolder::open(&dir.path(locked)).expect("a free folder");
        let ran = dir.calib_with(&[&["batch", "old/*/r.yaml", "--out", "out"], more].concat());
        let ran = ran.expect(7);
        assert!(
            ran.stderr
                .contains("another run of this program is writing there"),
            "{}",
            ran.stderr
        );
        drop(held);
    }
}

#[test]
fn a_fleet_that_is_none_is_refused() {
    let dir = Scratch::new().file("one.yaml", "calib: 1\n").file("a/r.yaml", "").file("b/a.yaml", "").file(
        "twice.yaml",
        "calib_fleet: 1\nrobots: [{profile: a/r.yaml, name: x}, {profile: b/a.yaml, name: X}]\n",
    ).file("name.yaml", "calib_fleet: 1\nrobots: [{profile: a/r.yaml, name: a/b}]\n");
    for (fleet, said) in [
        ("none/*.yaml", "names no robot"),
        ("none.yaml", "cannot be read"),
        ("one.yaml", "is not a list of robots"),
        ("twice.yaml", "two robots are called `X`"),
        ("name.yaml", "no folder can be called \"a/b\""),
    ] {
        let ran = dir.calib(["batch", fleet, "--out", "out"]).expect(2);
        assert!(
            ran.stderr.contains(said) && ran.stderr.contains("  help: "),
            "{}",
            ran.stderr
        );
        assert!(!dir.path("out").exists());
    }
}

/// Drift of the elbow in 1 % of the robots: found, with the false alarms that are stated.
#[test]
fn drift_of_one_joint_in_a_hundredth_of_a_fleet() {
    if !skipped_tests::thorough() {
        return;
    }
    let count: usize = match std::env::var("CALIB_FLEET") {
        Ok(count) => count.parse().expect("a number of robots"),
        Err(_) => 300,
    };
    let drifted: Vec<usize> = (0..count)
        .step_by(100)
        .map(|k| k + 42)
        .filter(|k| *k < count)
        .collect();
    let dir = Scratch::new();
    fleet(&dir, "old", count, &[]);
    fleet(&dir, "tonight", count, &drifted);
    dir.calib(["batch", "old/*/r.yaml", "--out", "last"])
        .expect(0);
    let started = std::time::Instant::now();
    dir.calib([
        "batch",
        "tonight/*/r.yaml",
        "--earlier",
        "last",
        "--out",
        "out",
    ])
    .expect(0);
    let rate = count as f64 / started.elapsed().as_secs_f64();
    let summary = dir.json("out/fleet.json");
    let alarms = summary["drift"]["alarms"].as_array().expect("a list");
    let planted = |alarm: &&Value| {
        let name = alarm["name"].as_str().expect("a name");
        drifted.iter().any(|k| name == format!("r{k:03}"))
    };
    let found = alarms
        .iter()
        .filter(planted)
        .filter(|a| a["joint"] == "elbow")
        .count();
    let familywise = |alarm: &&Value| alarm["familywise"] == true;
    let all = alarms.iter().filter(familywise).filter(planted).count();
    let false_alarms = alarms.len() - alarms.iter().filter(planted).count();
    let false_familywise = alarms.iter().filter(familywise).count() - all;
    println!(
        "{found} of {} found, {all} familywise; false alarms: {false_alarms} of {}, {false_familywise} familywise; {rate:.1} robots/s",
        drifted.len(),
        count - drifted.len()
    );
    assert_eq!(
        (found, all, false_familywise),
        (drifted.len(), drifted.len(), 0)
    );
    // More than 1 % by four standard deviations of a binomial count: the rate that is stated is not kept.
    let expected = 0.01 * count as f64;
    assert!((false_alarms as f64) < expected + 4.0 * expected.sqrt() + 1.0);
    let size = std::fs::metadata(dir.path("out/fleet.html"))
        .expect("a page")
        .len();
    assert!(size < 500 * count as u64 + 20_000, "{size} bytes");
}

/// All shards of a study, merged; the file and what `--from` makes of it.
fn divided(dir: &Scratch, study: &[&str], of: u64) -> (Vec<u8>, Files) {
    let out = format!("shards-{of}");
    let mut merge = vec![
        "merge".to_owned(),
        "--out".to_owned(),
        format!("{out}.parquet"),
    ];
    for i in (1..=of).rev() {
        let shard = format!("{i}/{of}");
        let ran = dir
            .calib_with(&[study, &["--shard", &shard, "--out", &out]].concat())
            .expect(0);
        merge.push(ran.stdout.trim().to_owned());
    }
    let merge: Vec<&str> = merge.iter().map(String::as_str).collect();
    dir.calib_with(&merge).expect(0);
    let (file, from) = (format!("{out}.parquet"), format!("from-{of}"));
    dir.calib_with(&[study, &["--from", &file, "--out", &from]].concat())
        .expect(0);
    (
        std::fs::read(dir.path(&file)).expect("merged"),
        dir.files(&from),
    )
}

/// The work divided is the work done at once, bit for bit.
fn check_divided(dir: &Scratch, study: &[&str], numbers: &[u64]) {
    dir.calib_with(&[study, &["--out", "whole"]].concat())
        .expect(0);
    let mut expected = dir.files("whole");
    // What is finished is kept by the work that was not divided only.
    let (whole, _) = divided(dir, study, 1);
    for &of in numbers {
        let (merged, mut from) = divided(dir, study, of);
        assert!(merged == whole, "{study:?}: {of} shards");
        for files in [&mut expected, &mut from] {
            files.retain(|name, _| !name.ends_with(".state.jsonl"));
        }
        same(&expected, &from);
    }
}

#[test]
fn a_divided_study_is_the_study() {
    let numbers: &[u64] = if skipped_tests::thorough() {
        &[2, 7, 64]
    } else {
        &[7]
    };
    check_divided(&Scratch::new(), &["study", "aor", "--trials", "1"], numbers);
}

#[test]
fn studies_and_twins_are_the_same_divided() {
    if !skipped_tests::thorough() {
        return;
    }
    check_divided(
        &Scratch::new(),
        &["study", "cor", "--trials", "1"],
        &[2, 7, 64],
    );
    let dir = Scratch::new().brief("ripley");
    check_divided(&dir, &["twin", "robots/ripley.yaml", "--trials", "7"], &[7]);
    check_divided(
        &Scratch::new().robot("ripley"),
        &["study", "ripley", "--trials", "3"],
        &[7],
    );
}

#[test]
fn what_is_no_shard_is_refused() {
    let dir = Scratch::new()
        .file("torn.parquet", "PAR1")
        .file("text.csv", "a,b\n");
    for (arguments, code, said) in [
        (
            &["merge", "torn.parquet", "--out", "x"][..],
            3,
            "torn.parquet: is not a whole Parquet file",
        ),
        (
            &["merge", "text.csv", "--out", "x"],
            3,
            "run that shard again",
        ),
        (
            &["merge", "none.parquet", "--out", "x"],
            3,
            "none.parquet: cannot be read",
        ),
        (&["study", "aor", "--shard", "0/3"], 2, "expected i/n"),
        (
            &["study", "aor", "--from", "torn.parquet"],
            3,
            "is not a whole Parquet file",
        ),
    ] {
        let ran = dir.calib_with(arguments).expect(code);
        assert!(ran.stderr.contains(said), "{arguments:?}: {}", ran.stderr);
    }
}

/// The program stands in a folder of its own on the path; `calib` there may be a stand-in.
#[cfg(unix)]
fn shell(dir: &Scratch, calib: &Path, script: &[&str], variables: &[(&str, &str)]) -> String {
    let bin = dir.path("bin");
    std::fs::create_dir_all(&bin).expect("a folder");
    let _ = std::fs::remove_file(bin.join("calib"));
    std::os::unix::fs::symlink(calib, bin.join("calib")).expect("a link");
    let path = format!(
        "{}:{}",
        bin.display(),
        std::env::var("PATH").unwrap_or_default()
    );
    let ran = Command::new(script[0])
        .args(&script[1..])
        .current_dir(dir.path(""))
        .env("PATH", path)
        .envs(variables.iter().copied())
        .output()
        .expect("a shell");
    assert!(ran.status.success(), "{ran:?}");
    String::from_utf8(ran.stdout).expect("text")
}

/// The script of the array makes the shards that its comment merges.
#[cfg(unix)]
#[test]
fn the_slurm_script_makes_shards() {
    let dir = Scratch::new();
    let script = crate::scratch::root()
        .join("examples/slurm/study.sh")
        .display()
        .to_string();
    let words = ["bash", &script, "aor", "--trials", "1"];
    for task in ["1", "2"] {
        let variables = [
            ("SLURM_ARRAY_TASK_ID", task),
            ("SLURM_ARRAY_TASK_COUNT", "2"),
        ];
        shell(
            &dir,
            Path::new(env!("CARGO_BIN_EXE_calib")),
            &words,
            &variables,
        );
    }
    let shard = |i| format!("shards/aor-{i}-of-2/aor-{i}-of-2.parquet");
    dir.calib(["merge", &shard(1), &shard(2), "--out", "aor.parquet"])
        .expect(0);
}

/// A real controller and a node run the array; its results are those of the undivided study. `local.sh` compares them.
#[cfg(unix)]
#[test]
fn a_slurm_controller_runs_the_array() {
    let there = |program: &str| {
        let path = std::env::var("PATH").unwrap_or_default() + ":/usr/sbin";
        std::env::split_paths(&path).any(|folder| folder.join(program).is_file())
    };
    if !["slurmctld", "slurmd", "munged", "sbatch", "python3"]
        .iter()
        .all(|program| there(program))
    {
        return skipped_tests::skip("no Slurm (slurmctld, slurmd, munge)");
    }
    if !skipped_tests::thorough() {
        return;
    }
    let dir = Scratch::new();
    let script = crate::scratch::root().join("examples/slurm/local.sh");
    let script = script.display().to_string();
    let calib = Path::new(env!("CARGO_BIN_EXE_calib"));
    let said = shell(&dir, calib, &["bash", &script, "slurm"], &[]);
    assert!(said.contains("the bytes of the undivided study"), "{said}");
    assert!(dir.path("slurm/work/results/aor.csv").is_file());
}

/// Built without stores, the program says so before it calculates anything.
#[cfg(not(feature = "object-store"))]
#[test]
fn a_store_is_refused_where_the_program_knows_none() {
    let dir = Scratch::new();
    let shard = "study aor --trials 1 --seed 1 --shard 1/3 --out shards --store s3://bucket/run";
    for call in [shard, "merge --store s3://bucket/run --out all.parquet"] {
        let words: Vec<&str> = call.split_whitespace().collect();
        let ran = dir.calib_with(&words);
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        let said = "s3://bucket/run: this program was built without object stores";
        assert!(ran.stderr.contains(said), "{}", ran.stderr);
        let remedy = "--features object-store";
        assert!(ran.stderr.contains(remedy), "{}", ran.stderr);
        assert!(dir.files("").is_empty(), "{call}");
    }
}

/// The pods of both manifests ask for each shard once.
#[cfg(unix)]
#[test]
fn the_kubernetes_manifests_ask_for_every_shard() {
    for name in ["study", "store"] {
        manifest(&format!("examples/kubernetes/{name}.yaml"));
    }
}

#[cfg(unix)]
fn manifest(path: &str) {
    let path = crate::scratch::root().join(path);
    let faults = crate::outputs::faults("kubernetes", &path).unwrap_or_default();
    assert!(faults.is_empty(), "{faults:#?}");
    let text = std::fs::read_to_string(path).expect("the manifest");
    let job: Value = serde_saphyr::from_str(&text).expect("YAML");
    assert_eq!(
        (&job["apiVersion"], &job["kind"]),
        (&"batch/v1".into(), &"Job".into())
    );
    assert_eq!(job["spec"]["completionMode"], "Indexed");
    let pods = job["spec"]["completions"].as_u64().expect("a number");
    let container = &job["spec"]["template"]["spec"]["containers"][0];
    let command = container["args"][0].as_str().expect("a command");
    let dir = Scratch::new().file("echo.sh", "#!/bin/sh\necho \"$@\"\n");
    let echo = dir.path("echo.sh");
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(&echo, mode).expect("a program");
    for (index, shard) in [(0, 1), (pods - 1, pods)] {
        let index = index.to_string();
        let said = shell(
            &dir,
            &echo,
            &["sh", "-c", command],
            &[("JOB_COMPLETION_INDEX", &index)],
        );
        let words: Vec<&str> = said.split_whitespace().collect();
        let place = words
            .iter()
            .position(|word| *word == "--shard")
            .expect("a shard");
        assert_eq!(words[place + 1], format!("{shard}/{pods}"), "{said}");
    }
}
