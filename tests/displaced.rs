//! Something that moved between the fitted recordings and the validation, by less than three times the errors of one posture.

use crate::scratch;
use crate::two_arms;

use calib_urdf::RobotModel;
use scratch::Scratch;
use serde_json::Value;
use two_arms::{Special, table_with, torso, torso_with};

/// σ of the readings, rad: at the wrists 0.5 mm.
const READINGS: f64 = 8e-4;

const PROFILE: &str = "calib: 1
robot: {name: torso, urdf: torso.urdf}
tracker: {frame: tracker}
bodies:
  chest: {link: waist_link, pose: true}
  lw: {link: left_6_link, pose: true}
  rw: {link: right_6_link, pose: true}
recordings:
  poses: {file: poses.csv, use: static}
  checks: {file: checks.csv, use: validation}
solve:
  free: [bodies, tracker, joint_offsets, joint_axes]
";

/// A run of the torso whose checks differ by `changed` and by `moved` of a joint's origin.
fn run(limits: &str, seed: u64, changed: &Special<'_>, moved: (&str, [f64; 3])) -> Value {
    const ERROR: f64 = 4e-3;
    let robot = |text: String| RobotModel::from_urdf_text(&text, "torso").expect("a robot");
    let before = Special {
        joint_noise: READINGS,
        ..Special::NOTHING
    };
    let poses = table_with(&robot(torso(ERROR, seed)), &before, 50, seed + 10);
    let after = robot(torso_with(ERROR, seed, moved));
    let dir = Scratch::new()
        .file("torso.urdf", torso(0.0, 0))
        .file("poses.csv", poses)
        .file("checks.csv", table_with(&after, changed, 20, seed + 20))
        .file("torso.yaml", format!("{PROFILE}{limits}"));
    dir.calib(["run", "torso.yaml", "--out", "out"]);
    dir.json("out/report.json")
}

fn warnings(report: &Value) -> Vec<&Value> {
    let all = report["findings"].as_array().expect("findings").iter();
    all.filter(|f| f["severity"] != "info").collect()
}

/// Within four σ of what was done, and what is left agrees with what the fit states.
fn assert_sized(one: &Value, key: &str, truth: f64) {
    let value = |key: &str| one["facts"][key]["value"].as_f64().expect("a number");
    let off = value(key).abs() - truth.abs();
    assert!(off.abs() < 4.0 * value("sigma"), "{one:#}");
    assert!(
        value("after") < 1.5 && value("after") < value("before"),
        "{one:#}"
    );
    assert_eq!(one["about"]["recordings"], serde_json::json!(["checks"]));
}

#[test]
fn small_motions_before_the_validation_are_named_with_their_size() {
    let noisy = Special {
        joint_noise: READINGS,
        ..Special::NOTHING
    };
    let at_rest = ("", [0.0; 3]);
    let cases = [
        (
            noisy,
            ("right_1", [1e-3, -1e-3, 1e-3]),
            ("joint-origin-moved", "right_1"),
            ("distance", 3.0_f64.sqrt() * 1e-3),
        ),
        (
            Special {
                body: ("rw", 1.3e-3),
                ..noisy
            },
            at_rest,
            ("body-remounted", "rw"),
            ("distance", 1.3e-3),
        ),
        (
            Special {
                zero: ("left_2", 2.5e-3),
                ..noisy
            },
            at_rest,
            ("joint-zero-changed", "left_2"),
            ("step", 2.5e-3),
        ),
        (
            Special {
                tracker: 1.2e-3,
                ..noisy
            },
            at_rest,
            ("tracker-moved", ""),
            ("distance", 1.2e-3),
        ),
    ];
    for (seed, (changed, moved, (id, name), (key, truth))) in (1..).zip(cases) {
        let report = run("  limits: {held_out_rms_mm: 0.8}\n", seed, &changed, moved);
        let found = warnings(&report);
        let [one] = found[..] else {
            panic!("{id}: {found:#?}");
        };
        assert_eq!(one["id"], id, "{one:#}");
        assert_eq!(
            one["about"]["name"].as_str().unwrap_or_default(),
            name,
            "{one:#}"
        );
        assert_eq!(one["severity"], "error", "{one:#}");
        assert_sized(one, key, truth);
        let verdict = report["verdict"].as_str().expect("a verdict");
        assert!(
            ["rejected", "not_evaluated"].contains(&verdict),
            "{id}: {verdict}"
        );
    }
}

/// Where the errors stay below the limit, the motion is a warning.
#[test]
fn a_motion_that_a_limit_allows_warns() {
    let changed = Special {
        joint_noise: READINGS,
        tracker: 1.2e-3,
        ..Special::NOTHING
    };
    let report = run(
        "  limits: {held_out_rms_mm: 3}\n",
        7,
        &changed,
        ("", [0.0; 3]),
    );
    let found = warnings(&report);
    let [one] = found[..] else {
        panic!("{found:#?}");
    };
    assert_eq!(
        (&one["id"], &one["severity"]),
        (&"tracker-moved".into(), &"warning".into())
    );
    assert_eq!(report["verdict"], "accepted_with_warnings", "{report:#}");
}

/// Where nothing moved, nothing is said; the chance of it is one in a hundred thousand.
#[test]
fn nothing_is_named_where_nothing_moved() {
    for seed in 30..36 {
        let noisy = Special {
            joint_noise: READINGS,
            ..Special::NOTHING
        };
        let report = run(
            "  limits: {held_out_rms_mm: 2}\n",
            seed,
            &noisy,
            ("", [0.0; 3]),
        );
        let moved = [
            "joint-origin-moved",
            "body-remounted",
            "joint-zero-changed",
            "tracker-moved",
        ];
        let mut found = warnings(&report).into_iter();
        let named = found.find(|f| moved.iter().any(|id| f["id"] == *id));
        assert_eq!(named, None, "{seed}");
        let verdict = report["verdict"].as_str().expect("a verdict");
        assert!(verdict.starts_with("accepted"), "{seed}: {verdict}");
    }
}

/// All bodies together meet a limit that one of them does not: the result is left open, and the body is named.
#[test]
fn one_body_above_the_limit_is_named() {
    let changed = Special {
        joint_noise: READINGS,
        body: ("rw", 2.2e-3),
        ..Special::NOTHING
    };
    let report = run(
        "  limits: {held_out_rms_mm: 1.6}\n",
        40,
        &changed,
        ("", [0.0; 3]),
    );
    let reasons = report["reason_facts"].as_array().expect("reasons").iter();
    let above: Vec<&Value> = reasons.filter(|r| r["id"] == "body-above-limit").collect();
    let [one] = above[..] else {
        panic!("{:#}", report["reason_facts"]);
    };
    assert_eq!(one["values"]["body"], "rw", "{one:#}");
    assert_eq!(one["effect"], "leaves_open", "{one:#}");
    assert_eq!(report["verdict"], "not_evaluated");
}
