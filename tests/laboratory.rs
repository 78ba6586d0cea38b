//! What laboratories do to recordings without meaning to, through the program: rows written twice, noise with a memory,
//! joint values that lag behind.

use crate::late_joints::lagging;
use crate::scratch;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::{Ran, Scratch};
use serde_json::Value;

const PROFILE: &str = "robots/ripley.yaml";
const POSES: &str = "robots/ripley/arm_poses.csv";

fn run(dir: &Scratch) -> (Ran, Value) {
    let ran = dir.calib(["run", PROFILE, "--out", "out"]);
    let report = dir.json("out/report.json");
    (ran, report)
}

fn finding<'a>(report: &'a Value, id: &str) -> Option<&'a Value> {
    let mut all = report["findings"].as_array().expect("a list").iter();
    all.find(|f| f["id"] == id)
}

/// Standard deviations of everything that was estimated.
fn sigmas(report: &Value) -> Vec<f64> {
    let all = report["parameters"].as_array().expect("a list").iter();
    let sigma = all.filter_map(|p| p["sigma"].as_f64());
    sigma.filter(|s| *s > 0.0).collect()
}

/// The table of the arm's poses, line by line: comments and header first.
fn lines(dir: &Scratch) -> (Vec<String>, Vec<String>) {
    let text = dir.read(POSES);
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let header = lines.iter().position(|l| !l.starts_with('#'));
    let rows = lines.split_off(header.expect("a header") + 1);
    (lines, rows)
}

#[test]
fn rows_that_are_written_twice_count_once() {
    let dir = Scratch::new().brief("ripley");
    let (head, rows) = lines(&dir);
    let twice: Vec<String> = rows.iter().flat_map(|r| [r.clone(), r.clone()]).collect();
    let text = [head, twice].concat().join("\n") + "\n";
    let (_, plain) = run(&dir);
    let (_, report) = run(&dir.file(POSES, text));
    let (a, b) = (sigmas(&plain), sigmas(&report));
    assert!(a.len() > 10 && a.len() == b.len());
    for (a, b) in a.iter().zip(&b) {
        assert!((b / a - 1.0).abs() < 0.02, "{b} with copies, {a} without");
    }
    let said = finding(&report, "frames-merged").expect("said");
    assert_eq!(said["facts"]["poses"], rows.len());
}

/// Marker errors of 0.5 mm that keep nine tenths of the error of the row before.
#[test]
fn noise_with_a_memory_is_said_and_widens_the_uncertainty() {
    let dir = Scratch::new().brief("ripley");
    let (head, rows) = lines(&dir);
    let header: Vec<&str> = head[head.len() - 1].split(',').collect();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut kept = vec![0.0; header.len()];
    let mut with_memory = |row: &String| -> String {
        let cells = row.split(',').zip(&header).enumerate();
        let cells = cells.map(|(k, (cell, name))| {
            let fresh: f64 = StandardNormal.sample(&mut rng);
            kept[k] = 0.9 * kept[k] + 5e-4 * (1.0_f64 - 0.81).sqrt() * fresh;
            match cell.parse::<f64>() {
                Ok(x) if name.ends_with("_m") => format!("{:.6}", x + kept[k]),
                _ => cell.to_owned(),
            }
        });
        cells.collect::<Vec<_>>().join(",")
    };
    let slow: Vec<String> = rows.iter().map(&mut with_memory).collect();
    let text = [head, slow].concat().join("\n") + "\n";
    let (_, report) = run(&dir.file(POSES, text));
    let said = finding(&report, "noise-has-memory").expect("said");
    assert!(
        said["facts"]["factor"]["value"].as_f64().expect("a factor") > 1.2,
        "{said:#}"
    );
    assert_ne!(report["verdict"], "accepted");
}

#[test]
fn joint_values_that_lag_behind_in_one_file_are_named() {
    if !skipped_tests::thorough() {
        return;
    }
    let (_, clean) = run(&lagging(|_| 0.0));
    for id in [
        "clock-lag",
        "joint-coupling",
        "joint-gain",
        "changed-while-recording",
    ] {
        assert!(finding(&clean, id).is_none(), "{:#}", clean["findings"]);
    }
    let (_, report) = run(&lagging(|_| 0.008));
    assert_ne!(report["verdict"], "accepted");
    let lag = finding(&report, "clock-lag").expect("named");
    assert_eq!(lag["facts"]["recording"], "arm_poses", "{lag:#}");
    assert_eq!(lag["facts"]["kind"], "behind", "{lag:#}");
    let offset = lag["facts"]["offset"]["value"].as_f64().expect("s");
    assert!((offset - 0.008).abs() < 1e-3, "{lag:#}");
    // The trace of the lag is not blamed on a transmission.
    for id in ["joint-coupling", "joint-gain"] {
        assert!(finding(&report, id).is_none(), "{:#}", report["findings"]);
    }
    let missing = finding(&report, "missing-physics").expect("after the fit, too");
    assert_eq!(
        missing["facts"]["parameter"], "arm_poses.clock_offset",
        "{missing:#}"
    );
}

/// The uncertainty that does not trust the noise model agrees where the model is right.
#[test]
fn cluster_robust_deviations_agree_where_the_noise_model_is_right() {
    for robot in ["ripley", "justin"] {
        let report = &scratch::finished(robot, "ml").report;
        let ratio = report["fit"]["cluster_robust_ratio"]
            .as_f64()
            .expect("a ratio");
        assert!((0.8..1.25).contains(&ratio), "{robot}: {ratio}");
        let all = report["parameters"].as_array().expect("a list").iter();
        let both = |p: &Value| p["sigma"].is_null() == p["sigma_cluster_robust"].is_null();
        assert!(all.clone().count() > 10 && all.clone().all(both), "{robot}");
    }
}

/// Justin's recordings as the tracker's own software writes them, with its names of the bodies.
fn with_the_tracker_s_names() -> Scratch {
    let mut dir = Scratch::new().brief("justin");
    for file in ["head_sweep", "hand_sweep", "arm_poses", "torso_tests"] {
        let file = format!("robots/justin/{file}.csv");
        let text = dir
            .read(&file)
            .replace("heT.", "body_0.")
            .replace("haT.", "body_1.");
        dir = dir.file(&file, text);
    }
    dir
}

#[test]
fn bodies_that_the_tracker_calls_otherwise_are_named_and_mapped() {
    let profile = "robots/justin.yaml";
    let said = |dir: &Scratch| dir.calib(["check", profile]).expect(3).stderr;
    let dir = with_the_tracker_s_names();
    let told = said(&dir);
    for part in [
        "no recording that is fitted shows body `haT`; the recordings have `body_0`, `body_1`",
        "`names: {haT: body_0}`",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let mapped = |dir: Scratch| {
        let names = "names: {heT: body_0, haT: body_1}\nrecordings:\n";
        dir.edit(profile, "recordings:\n", names)
    };
    mapped(dir).calib(["check", profile]).expect(0);
    let dir = with_the_tracker_s_names();
    dir.calib([
        "convert",
        "robots/justin/arm_poses.csv",
        "arm.csv",
        "--map",
        "haT=body_1",
    ])
    .expect(0);
    assert!(dir.read("arm.csv").contains(",haT.x_m,"));

    // The other reasons for which a body is not there.
    let all = |dir: Scratch, change: &dyn Fn(&str, String) -> String| {
        let files = ["head_sweep", "hand_sweep", "arm_poses", "torso_tests"];
        files.iter().fold(dir, |dir, name| {
            let file = format!("robots/justin/{name}.csv");
            let text = change(name, dir.read(&file));
            dir.file(&file, text)
        })
    };
    let justin = || Scratch::new().brief("justin");
    let held_out = all(justin(), &|name, text| match name {
        "torso_tests" => text,
        _ => text.replace("haT.", "other."),
    });
    let told = said(&held_out);
    assert!(
        told.contains("only `torso_tests` shows it, which is held out"),
        "{told}"
    );
    let lost = ["head_sweep", "hand_sweep", "arm_poses", "torso_tests"].iter();
    let lost = lost.fold(justin(), |dir, name| {
        dir.cells(&format!("robots/justin/{name}.csv"), |_, column, cell| {
            let cell = if column.starts_with("haT.") { "" } else { cell };
            cell.to_owned()
        })
    });
    let told = said(&lost);
    assert!(
        told.contains("shows body `haT`: it is lost in every row"),
        "{told}"
    );
}

/// A column that was shifted in a spreadsheet is of no kind that a hypothesis knows; the joint is named all the same.
#[test]
fn a_joint_whose_column_was_shifted_is_named() {
    let table = "robots/ripley/arm_poses.csv";
    let dir = Scratch::new().robot("ripley");
    let text = dir.read(table);
    let (comments, rows): (Vec<&str>, Vec<&str>) = text.lines().partition(|l| l.starts_with('#'));
    let mut rows: Vec<Vec<String>> = rows
        .iter()
        .map(|row| row.split(',').map(str::to_owned).collect())
        .collect();
    let elbow = rows[0]
        .iter()
        .position(|c| c == "elbow_deg")
        .expect("a column");
    for i in (2..rows.len()).rev() {
        rows[i][elbow] = rows[i - 1][elbow].clone();
    }
    let rows = rows.iter().map(|row| row.join(","));
    let all: Vec<String> = comments
        .into_iter()
        .map(str::to_owned)
        .chain(rows)
        .collect();
    let dir = dir.file(table, all.join("\n") + "\n");
    let ran = dir.calib(["check", "robots/ripley.yaml"]);
    assert_ne!(ran.code, 0);
    let said = format!("{}{}", ran.stdout, ran.stderr);
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in [
        "Without the readings of joint `elbow` in `arm_poses`",
        "What belongs to a row stands 1 row later in this column.",
    ] {
        assert!(said.contains(part), "{part}:\n{said}");
    }
}

/// The table of the arm's poses with the tracker's cells of some rows changed: all of one marker, or of all (an empty name).
fn tracked(dir: &Scratch, marker: &str, change: impl Fn(usize, f64) -> Option<f64>) -> String {
    let (head, rows) = lines(dir);
    let header: Vec<&str> = head.last().expect("a header").split(',').collect();
    let row = |(k, row): (usize, &String)| {
        let cells = row.split(',').zip(&header).map(|(cell, name)| {
            let own = name.ends_with("_m") && name.starts_with(marker);
            match cell.parse().ok().filter(|_| own) {
                Some(x) => change(k, x).map_or(cell.to_owned(), |x| format!("{x:.6}")),
                None => cell.to_owned(),
            }
        });
        cells.collect::<Vec<_>>().join(",")
    };
    let rows: Vec<String> = rows.iter().enumerate().map(row).collect();
    [head, rows].concat().join("\n") + "\n"
}

#[test]
fn a_number_that_stands_for_a_lost_sample_is_lost() {
    let dir = Scratch::new().robot("ripley");
    let text = tracked(&dir, "gripM_1", |k, _| (k % 7 == 0).then_some(-9999.0));
    let dir = dir.file(POSES, text);
    let (ran, report) = run(&dir);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let said = finding(&report, "placeholder-triplet").expect("said");
    assert_eq!(said["facts"]["samples"], 6, "{said:#}");
}

/// Few rows in which the tracker's frame was off: the robust fit gets them right, and they do not stop the run.
#[test]
fn rows_in_which_the_tracker_was_off_do_not_stop_a_run() {
    let dir = Scratch::new().robot("ripley");
    let text = tracked(&dir, "", |k, x| (k % 20 == 3).then_some(x + 0.04));
    let dir = dir.file(POSES, text);
    let (ran, report) = run(&dir);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let said = finding(&report, "row-outlier").expect("said");
    assert_eq!(said["severity"], "warning", "{said:#}");
}

/// A column that never moved in the checks: no unit that was mistaken, although that explains a little.
#[test]
fn a_joint_that_is_stuck_in_the_checks_is_named() {
    let table = "robots/ripley/checks.csv";
    let dir = Scratch::new().robot("ripley");
    let text = dir.read(table);
    let mut column: Option<usize> = None;
    let mut first: Option<String> = None;
    let out: Vec<String> = text
        .lines()
        .map(|line| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            match column {
                Some(c) => {
                    let held = first.get_or_insert_with(|| cells[c].clone());
                    cells[c].clone_from(held);
                }
                None => column = cells.iter().position(|c| c == "wrist_roll_deg"),
            }
            cells.join(",")
        })
        .collect();
    let dir = dir.file(table, out.join("\n") + "\n");
    let ran = dir.calib(["check", PROFILE, "--json"]);
    let said: Value = serde_json::from_str(&ran.stdout).expect("JSON");
    let said = said.to_string();
    assert!(
        said.contains("joint-column-missing") && !said.contains("unit-mismatch"),
        "{said}"
    );
}

/// A tracker's other names in one recording: its rows would not be used, and the others would pass.
#[test]
fn bodies_with_other_names_in_one_recording_are_named() {
    for (robot, sweep, renamed, kind) in [
        (
            "ripley",
            "wrist_sweep",
            &["table_", "linkM_", "gripM_"][..],
            "all",
        ),
        ("ripley", "wrist_sweep", &["gripM_"], "swept"),
        ("justin", "hand_sweep", &["heT.", "haT."], "all"),
        ("justin", "hand_sweep", &["haT."], "swept"),
        ("ripley", "arm_poses", &["gripM_"], "renamed"),
        ("justin", "torso_tests", &["haT."], "renamed"),
    ] {
        let dir = Scratch::new().robot(robot);
        let file = format!("robots/{robot}/{sweep}.csv");
        let mut text = dir.read(&file);
        for name in renamed {
            text = text.replace(name, &format!("q_{name}"));
        }
        let dir = dir.file(&file, text);
        let profile = format!("robots/{robot}.yaml");
        let ran = dir.calib(["check", &profile, "--json"]);
        // A body of nearly the same name may be another one.
        let code = if kind == "renamed" { 0 } else { 3 };
        assert_eq!(
            ran.code, code,
            "{robot} {kind}: {}{}",
            ran.stdout, ran.stderr
        );
        let said: Value = serde_json::from_str(&ran.stdout).expect("JSON");
        let missing = finding(&said, "missing-body").expect("said");
        assert_eq!(missing["facts"]["kind"], kind, "{missing}");
        assert!(ran.stdout.contains("q_"), "{}", ran.stdout);
        // As the remedy says, for one tracker's names.
        let map: Vec<String> = match robot {
            "ripley" => ["table", "linkM", "gripM"]
                .iter()
                .flat_map(|body| (1..=4).map(move |k| format!("{body}_{k}: q_{body}_{k}")))
                .collect(),
            _ => ["haT", "heT"]
                .map(|body| format!("{body}: q_{body}"))
                .into(),
        };
        let profile_text = dir.read(&profile) + &format!("\nnames: {{{}}}\n", map.join(", "));
        let dir = dir.file(&profile, profile_text);
        let ran = dir.calib(["check", &profile, "--json"]);
        assert_eq!(ran.code, 0, "{robot} {kind}: {}{}", ran.stdout, ran.stderr);
        let said: Value = serde_json::from_str(&ran.stdout).expect("JSON");
        assert!(finding(&said, "missing-body").is_none(), "{said}");
    }
}
