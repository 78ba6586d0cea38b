//! Joint values of a motion that are older than the markers of their row: of all joints, and of one whose values a filter or another bus
//! delays.

use crate::scratch;

use std::collections::BTreeMap;

use calib_pipeline::prepare::load::load_robot;
use calib_recording::{Poses, WriteOptions, write_poses};
use calib_sim::{Motion, StreamPlan, simulate_streams};
use scratch::{Ran, Scratch, root};
use serde_json::Value;

const PROFILE: &str = "robots/ripley.yaml";
const POSES: &str = "robots/ripley/arm_poses.csv";
const CHECKS: &str = "robots/ripley/checks.csv";
const SPEC: &str = "arm_poses: {file: ripley/arm_poses.csv, use: static}";
const HELD_OUT: &str = "checks: {file: ripley/checks.csv, use: validation}";

/// Rows of a motion at 0.4 rad/s for 30 s, ten a second, whose joint values are older than the markers by what `late` says of the joint, s: the first 20 s
/// and the rest.
fn motion(late: impl Fn(&str) -> f64) -> [String; 2] {
    motion_of(|_| true, late)
}

/// The same where only some joints move; the others stand in the middle of their range.
fn motion_of(moves: impl Fn(&str) -> bool, late: impl Fn(&str) -> f64) -> [String; 2] {
    let robot = load_robot(&root().join(PROFILE)).expect("shipped");
    let ranges: [(&str, f64, f64); 5] = [
        ("waist", -70.0, 170.0),
        ("shoulder", -100.0, 20.0),
        ("elbow", -20.0, 120.0),
        ("wrist_pitch", -90.0, 90.0),
        ("wrist_roll", -100.0, 100.0),
    ];
    let plan = StreamPlan {
        motion: Motion::Continuous,
        ranges: ranges
            .into_iter()
            .map(|(joint, low, high)| {
                let id = robot.model.joint_id(joint).expect("of the robot");
                let middle = 0.5 * (low + high);
                let (low, high) = match moves(joint) {
                    true => (low, high),
                    false => (middle - 0.01, middle + 0.01),
                };
                (id, (low.to_radians(), high.to_radians()))
            })
            .collect(),
        bodies: robot.profile.bodies.keys().cloned().collect(),
        duration: 30.0,
        tracker_hz: 10.0,
        robot_hz: 500.0,
        offset: 0.0,
        drift: 0.0,
    };
    let streams = simulate_streams(&robot.profile, &robot.model, &plan, 17).expect("a section");
    let mut table: Poses = streams.tracker;
    let (at, old) = (
        table.t.clone().expect("timed"),
        streams.robot.t.as_ref().expect("timed"),
    );
    let mut joints = BTreeMap::new();
    for (name, values) in &streams.robot.joints {
        let column = at.iter().map(|t| {
            let t = t - late(name);
            let after = old.partition_point(|o| *o <= t).clamp(1, old.len() - 1);
            let share = (t - old[after - 1]) / (old[after] - old[after - 1]);
            let (a, b) = (values[after - 1]?, values[after]?);
            Some(a + share * (b - a))
        });
        joints.insert(name.clone(), column.collect());
    }
    table.joint_units = streams.robot.joint_units.clone();
    table.joints = joints;
    let rows = |part: std::ops::Range<usize>| {
        let part = table.select(&part.collect::<Vec<_>>());
        write_poses(&part, &WriteOptions::micro()).expect("plain names")
    };
    [rows(0..200), rows(200..table.len())]
}

/// The shipped robot with a motion of 20 s instead of the arm's poses; `late` as for [`motion`].
pub fn lagging(late: impl Fn(&str) -> f64) -> Scratch {
    let [fitted, _] = motion(late);
    Scratch::new().brief("ripley").file(POSES, fitted)
}

/// The same with the checks from a motion, too, and with `timing`: the fit estimates by how much all joints are late. What is `stated` of joints, ms,
/// is in the profile.
fn continuous(late: impl Fn(&str) -> f64, stated: &[(&str, f64)]) -> Scratch {
    let [fitted, held_out] = motion(late);
    let of_joints = stated.iter().map(|(joint, ms)| format!("{joint}: {ms:.1}"));
    let of_joints: Vec<String> = of_joints.collect();
    let stated = match of_joints.join(", ") {
        none if none.is_empty() => none,
        joints => format!(", late_ms: {{{joints}}}"),
    };
    let timing = format!("timing: {{poses: continuous{stated}}}}}");
    let with = |spec: &str| spec.replace('}', &format!(", {timing}"));
    let dir = Scratch::new().brief("ripley");
    dir.file(POSES, fitted)
        .file(CHECKS, held_out)
        .edit(PROFILE, SPEC, &with(SPEC))
        .edit(PROFILE, HELD_OUT, &with(HELD_OUT))
}

fn run(dir: &Scratch) -> (Ran, Value) {
    let ran = dir.calib(["run", PROFILE, "--out", "out"]);
    let report = dir.json("out/report.json");
    (ran, report)
}

fn findings<'a>(report: &'a Value, id: &str) -> Vec<&'a Value> {
    let all = report["findings"].as_array().expect("a list").iter();
    all.filter(|f| f["id"] == id).collect()
}

/// Late values of one joint, ms, as the finding tells them, of the joint that it names.
fn told(report: &Value) -> Option<(String, f64)> {
    let named = findings(report, "clock-lag").into_iter();
    let missing = findings(report, "missing-physics").into_iter();
    let mut facts = named.chain(missing).map(|f| &f["facts"]);
    facts.find_map(|facts| {
        let late = facts["late"]["value"].as_f64()?;
        Some((facts["joint"].as_str()?.to_owned(), 1e3 * late))
    })
}

/// Nothing else is blamed.
fn nothing_else_is_blamed(report: &Value) {
    for id in ["joint-coupling", "joint-gain", "changed-while-recording"] {
        assert!(findings(report, id).is_empty(), "{:#}", report["findings"]);
    }
    let missing = findings(report, "missing-physics");
    let of_late = |f: &&Value| f["facts"]["kind"] == "latency";
    assert!(missing.iter().all(of_late), "{missing:#?}");
}

#[test]
fn a_joint_whose_values_are_late_is_named_with_its_time_and_stating_it_mends_the_result() {
    if !skipped_tests::thorough() {
        return;
    }
    for (joint, late) in [("waist", -0.015), ("wrist_roll", 0.05)] {
        let of = |name: &str| if name == joint { late } else { 0.0 };
        let (_, report) = run(&continuous(of, &[]));
        // Beside the roll axis the tracker sees little of it.
        let expected = match joint {
            "wrist_roll" => "accepted_with_warnings",
            _ => "rejected",
        };
        assert_eq!(report["verdict"], expected, "{joint}");
        let (named, ms) = told(&report).expect("named");
        assert_eq!(named, joint);
        assert!((ms - 1e3 * late).abs() < 2.0, "{joint}: {ms}");
        nothing_else_is_blamed(&report);
        let diagnosis = report["diagnosis"]["evidence"].as_str();
        let late = ["clock-lag", "missing-physics"];
        assert!(
            diagnosis.is_none_or(|d| late.contains(&d)),
            "{joint}: {diagnosis:?}"
        );
        // As the remedy says.
        let (ran, report) = run(&continuous(of, &[(joint, ms)]));
        assert_eq!(ran.code, 0, "{joint}: {}", ran.stderr);
        assert!(told(&report).is_none(), "{joint}: {:#}", report["findings"]);
    }
}

/// A forearm with a controller of its own, whose log is late or early.
#[test]
fn joints_that_are_late_together_are_named_together_and_stating_it_mends_the_result() {
    if !skipped_tests::thorough() {
        return;
    }
    let wrist = ["elbow", "wrist_pitch", "wrist_roll"];
    for late in [0.03, -0.02] {
        let of = |name: &str| if wrist.contains(&name) { late } else { 0.0 };
        let (_, report) = run(&continuous(of, &[]));
        assert_eq!(report["verdict"], "rejected", "{late}");
        assert_eq!(report["diagnosis"]["evidence"], "clock-lag", "{late}");
        let named = findings(&report, "clock-lag");
        let facts = &named.first().expect("named")["facts"];
        assert_eq!(facts["joints"], serde_json::json!(wrist), "{named:#?}");
        let ms = 1e3 * facts["late"]["value"].as_f64().expect("s");
        assert!((ms - 1e3 * late).abs() < 2.0, "{ms}");
        assert!(findings(&report, "missing-physics").is_empty(), "{late}");
        let changed = findings(&report, "changed-while-recording");
        let explained =
            |f: &&Value| f["facts"]["physics"] == "elbow+wrist_pitch+wrist_roll.latency";
        assert!(changed.iter().all(explained), "{changed:#?}");
        let (ran, report) = run(&continuous(of, &wrist.map(|joint| (joint, ms))));
        assert_eq!(ran.code, 0, "{late}: {}", ran.stdout);
        assert!(told(&report).is_none(), "{late}: {:#}", report["findings"]);
    }
}

/// What the profile states is a part of what it has to state.
#[test]
fn a_time_that_is_stated_too_small_is_completed() {
    if !skipped_tests::thorough() {
        return;
    }
    let of = |name: &str| if name == "elbow" { 0.03 } else { 0.0 };
    let (_, report) = run(&continuous(of, &[("elbow", 10.0)]));
    let (named, ms) = told(&report).expect("named");
    assert_eq!(named, "elbow");
    assert!((ms - 30.0).abs() < 2.0, "{ms}");
}

/// In a sweep of one joint the offset of all joints is that of this one: beside the other sweeps it shows.
#[test]
fn a_late_joint_that_moves_alone_in_its_sweep_is_named() {
    if !skipped_tests::thorough() {
        return;
    }
    let only = |joint: &'static str| move |name: &str| name == joint;
    let late = |name: &str| if name == "elbow" { 0.03 } else { 0.0 };
    let swept = |late_ms: &str| {
        let timing = format!("timing: {{poses: continuous{late_ms}}}");
        let mut dir = Scratch::new().brief("ripley");
        let mut specs = format!("  {SPEC}\n");
        for joint in ["waist", "shoulder", "elbow", "wrist_pitch", "wrist_roll"] {
            let [rows, _] = motion_of(only(joint), late);
            dir = dir.file(&format!("robots/ripley/{joint}.csv"), rows);
            specs +=
                &format!("  {joint}_sweep: {{file: ripley/{joint}.csv, use: static, {timing}}}\n");
        }
        let [_, held_out] = motion(late);
        let checks = HELD_OUT.replace('}', &format!(", {timing}}}"));
        dir.file(CHECKS, held_out)
            .edit(PROFILE, &format!("  {SPEC}\n"), &specs)
            .edit(PROFILE, HELD_OUT, &checks)
    };
    let (_, report) = run(&swept(""));
    let named = findings(&report, "clock-lag");
    let facts = &named.first().expect("named")["facts"];
    assert_eq!(facts["kind"], "sweep_behind", "{named:#?}");
    assert_eq!(facts["joint"], "elbow");
    let ms = 1e3 * facts["late"]["value"].as_f64().expect("s");
    assert!((ms - 30.0).abs() < 2.0, "{ms}");
    assert_eq!(report["verdict"], "rejected");
    assert_eq!(report["diagnosis"]["evidence"], "clock-lag");
    let (ran, report) = run(&swept(&format!(", late_ms: {{elbow: {ms:.1}}}")));
    assert_eq!(ran.code, 0, "{}", ran.stdout);
    assert!(told(&report).is_none(), "{:#}", report["findings"]);
}

#[test]
fn a_joint_that_is_late_in_rows_without_timing_is_named() {
    if !skipped_tests::thorough() {
        return;
    }
    let (_, report) = run(&lagging(|name| if name == "elbow" { 0.02 } else { 0.0 }));
    let (named, ms) = told(&report).expect("named");
    assert_eq!(named, "elbow");
    assert!((ms - 20.0).abs() < 2.0, "{ms}");
    nothing_else_is_blamed(&report);
}

/// What all joints have in common is the clock's.
#[test]
fn joints_that_are_all_late_are_not_called_late_one_by_one() {
    if !skipped_tests::thorough() {
        return;
    }
    // A tenth of a second and more: the motion of a whole row.
    for late in [0.0, 0.03, 0.12, 0.3] {
        let (ran, report) = run(&continuous(|_| late, &[]));
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        assert!(told(&report).is_none(), "{:#}", report["findings"]);
        nothing_else_is_blamed(&report);
    }
}

/// The tracker's cells of every `times`-th row, also in the rows after it; the joints' are their own.
fn repeated(table: &str, times: usize) -> String {
    let (comments, lines): (Vec<&str>, Vec<&str>) =
        table.lines().partition(|line| line.starts_with('#'));
    let of_tracker: Vec<bool> = lines[0].split(',').map(|c| c.ends_with("_m")).collect();
    let cells = |k: usize| lines[1 + k].split(',').collect::<Vec<&str>>();
    let rows = (0..lines.len() - 1).map(|k| {
        let (own, held) = (cells(k), cells(k / times * times));
        let pairs = own.into_iter().zip(held).zip(&of_tracker);
        let row = pairs.map(|((own, held), tracked)| if *tracked { held } else { own });
        row.collect::<Vec<&str>>().join(",")
    });
    let all = comments.into_iter().chain([lines[0]]).map(str::to_owned);
    all.chain(rows).collect::<Vec<String>>().join("\n") + "\n"
}

/// A log of the robot's rate that writes the tracker's last frame again: its rows are no measurements.
#[test]
fn frames_that_a_faster_table_repeats_count_once() {
    for times in [2, 3] {
        let dir = continuous(|_| 0.0, &[]);
        let [poses, checks] = [POSES, CHECKS].map(|file| repeated(&dir.read(file), times));
        let rows = poses.lines().filter(|l| !l.starts_with('#')).count() - 1;
        let (ran, report) = run(&dir.file(POSES, poses).file(CHECKS, checks));
        assert_eq!(ran.code, 0, "{times}: {}", ran.stdout);
        let named = findings(&report, "frames-repeated");
        assert_eq!(named.len(), 2, "{times}: {:#}", report["findings"]);
        let of_poses = named
            .iter()
            .find(|f| f["about"]["recordings"][0] == "arm_poses");
        let facts = &of_poses.expect("named")["facts"];
        assert_eq!(facts["repeated"], rows - rows.div_ceil(times));
        assert_eq!(facts["longest"], times);
    }
}

#[test]
fn late_values_of_a_joint_that_is_not_there_are_refused() {
    let refused = |joint: &str, code: i32| {
        let dir = continuous(|_| 0.0, &[(joint, 5.0)]);
        let text = dir.read(POSES).replace("wrist_roll_rad", "note");
        let ran = dir.file(POSES, text).calib(["check", PROFILE]);
        let ran = ran.expect(code);
        ran.stderr.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let said = refused("elbow_2", 2);
    assert!(said.contains("the URDF has no joint `elbow_2`"), "{said}");
    let said = refused("wrist_roll", 3);
    let expected = "`late_ms` names joint `wrist_roll`, which the recording does not have";
    assert!(said.contains(expected), "{said}");
}
