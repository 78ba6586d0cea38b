//! The calibrated robot at work: from recordings of a robot with known truth to corrected commands, and what the commands say.

use crate::scratch;

use std::collections::BTreeMap;
use std::fmt::Write as _;

use calib_export::{Robot, Target, export};
use calib_model::file::{
    ModelEffect, ModelJoint, ModelLink, ModelMotion, ModelPose, RobotModelFile,
};
use calib_model::{LinkId, Model, Pose, Under};
use nalgebra::{Isometry3, Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;

/// σ of one marker coordinate, m.
const MARKER: f64 = 5e-5;

/// Origin in the link before, m, axis, mass, kg, and its center, m.
type Row = ([f64; 3], [f64; 3], f64, [f64; 3]);
/// Three joints with an upper and a lower arm, and a wrist of three.
const JOINTS: [Row; 6] = [
    ([0.0, 0.0, 0.3], [0.0, 0.0, 1.0], 6.0, [0.02, 0.0, 0.1]),
    ([0.05, 0.0, 0.1], [0.0, 1.0, 0.0], 8.0, [0.0, 0.0, 0.25]),
    ([0.0, 0.0, 0.5], [0.0, 1.0, 0.0], 5.0, [0.2, 0.0, 0.03]),
    ([0.4, 0.0, 0.03], [1.0, 0.0, 0.0], 2.0, [0.05, 0.0, 0.0]),
    ([0.1, 0.0, 0.0], [0.0, 1.0, 0.0], 1.5, [0.02, 0.0, 0.0]),
    ([0.08, 0.0, 0.0], [1.0, 0.0, 0.0], 1.0, [0.05, 0.01, 0.0]),
];

/// The true arm: zero offsets, compliance, eccentricity and a coupling; its nominal model has none of them.
fn truth() -> RobotModelFile {
    let mut file = RobotModelFile {
        robot: "arm".to_owned(),
        root: "l0".to_owned(),
        gravity_m_s2: [0.0, 0.0, -9.81],
        links: vec![ModelLink {
            name: "l0".to_owned(),
            ..ModelLink::default()
        }],
        ..RobotModelFile::default()
    };
    for (i, (xyz_m, axis, mass_kg, center)) in JOINTS.into_iter().enumerate() {
        let origin = ModelPose {
            xyz_m,
            ..ModelPose::default()
        };
        let mut joint = ModelJoint {
            name: format!("j{}", i + 1),
            parent: format!("l{i}"),
            child: format!("l{}", i + 1),
            motion: ModelMotion::Revolute,
            parent_from_joint: origin,
            load_origin: origin,
            axis: Some(axis),
            limits: Some([-3.0, 3.0]),
            ..ModelJoint::default()
        };
        let mut effect = |kind: &str, value: f64, other: Option<&str>| {
            joint.effects.push(ModelEffect {
                kind: kind.to_owned(),
                value,
                other: other.map(str::to_owned),
                ..ModelEffect::default()
            });
        };
        effect(
            "offset",
            [0.004, -0.006, 0.005, 0.003, -0.004, 0.002][i],
            None,
        );
        effect(
            "eccentricity_cos",
            [1e-3, 0.0, 1.5e-3, 0.0, 1e-3, 0.0][i],
            None,
        );
        effect(
            "eccentricity_sin",
            [0.0, -2e-3, 1e-3, 1.5e-3, 0.0, 0.0][i],
            None,
        );
        effect("compliance", [0.0, 8e-5, 1.5e-4, 0.0, 0.0, 0.0][i], None);
        if i == 2 {
            effect("coupling", 0.01, Some("j2"));
        }
        file.joints.push(joint);
        file.links.push(ModelLink {
            name: format!("l{}", i + 1),
            mass_kg,
            first_moment_kg_m: center.map(|c| c * mass_kg),
        });
    }
    file
}

fn at(model: &Model, link: LinkId, q: &[f64]) -> Pose {
    let mut work = model.work();
    model
        .forward(q, &Under::default(), &mut work)
        .expect("poses");
    work.root_from_link(link)
}

fn postures(n: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let range = [2.0, 1.2, 1.4, 2.0, 1.6, 2.0];
    let mut of = || range.map(|r| rng.random_range(-r..r)).to_vec();
    (0..n).map(|_| of()).collect()
}

/// Markers of foot and hand by the true arm, with noise.
fn recording(truth: &Model, n: usize, seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(100 + seed);
    let tracker_from_root = Pose::of(&Isometry3::new(
        Vector3::new(0.9, 0.3, 0.1),
        Vector3::new(0.0, 0.0, 0.7),
    ));
    let foot = [
        [-0.12, -0.1, 0.0],
        [0.13, -0.09, 0.0],
        [0.11, 0.1, 0.02],
        [-0.1, 0.12, 0.06],
    ];
    let hand = [
        [0.1, 0.05, 0.0],
        [0.12, -0.06, 0.02],
        [0.06, 0.0, 0.07],
        [0.15, 0.03, -0.05],
    ];
    let mut text = (1..=6)
        .map(|k| format!("j{k}_rad"))
        .collect::<Vec<_>>()
        .join(",");
    for body in ["b", "f"] {
        for k in 1..=4 {
            let _ = write!(text, ",{body}{k}_x_mm,{body}{k}_y_mm,{body}{k}_z_mm");
        }
    }
    text.push('\n');
    for q in postures(n, seed) {
        text += &q
            .iter()
            .map(|v| format!("{v:.12}"))
            .collect::<Vec<_>>()
            .join(",");
        for (link, points) in [("l0", &foot), ("l6", &hand)] {
            let link = truth.link(link).expect("there");
            let pose = tracker_from_root.then(&at(truth, link, &q));
            for p in points {
                let seen = pose.r * Point3::from(*p).coords + pose.t;
                for x in seen.iter() {
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    let _ = write!(text, ",{:.6}", (x + MARKER * noise) * 1e3);
                }
            }
        }
        text.push('\n');
    }
    text
}

const PROFILE: &str = r#"calib: 1
robot: {name: arm, urdf: arm/arm.urdf}
tracker: {frame: lab, marker_sigma_mm: 0.05}
bodies:
  foot: {link: l0, markers: [b1, b2, b3, b4], mount: {}, template_mm: {b1: [-120, -100, 0], b2: [130, -90, 0], b3: [110, 100, 20], b4: [-100, 120, 60]}}
  hand: {link: l6, markers: [f1, f2, f3, f4], mount: {}, template_mm: {f1: [100, 50, 0], f2: [120, -60, 20], f3: [60, 0, 70], f4: [150, 30, -50]}}
recordings:
  poses: {file: arm/poses.csv, use: static}
  checks: {file: arm/checks.csv, use: validation}
solve:
  free: [tracker, joint_offsets, compliance, eccentricity]
  joints: {j3: {coupled_to: [j2]}}
"#;

#[test]
fn a_corrected_command_brings_the_true_tool_to_where_it_was_wanted() {
    let file = truth();
    let truth = Model::new(&file).expect("a model");
    let nominal = {
        let mut nominal = file.clone();
        nominal.joints.iter_mut().for_each(|j| j.effects.clear());
        Robot {
            model: Model::new(&nominal).expect("a model"),
            file: nominal,
        }
    };
    let urdf = export(&nominal, Target::Urdf, None, None).expect("a URDF");
    let dir = Scratch::new()
        .file("arm/arm.urdf", urdf.text)
        .file("arm.yaml", PROFILE)
        .file("arm/poses.csv", recording(&truth, 60, 1))
        .file("arm/checks.csv", recording(&truth, 15, 2));
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    assert!(ran.code < 2, "{}{}", ran.stdout, ran.stderr);
    let wanted = postures(40, 3);
    let mut program = (1..=6)
        .map(|k| format!("j{k}_rad"))
        .collect::<Vec<_>>()
        .join(",")
        + "\n";
    for q in &wanted {
        program += &(q.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n");
    }
    let dir = dir.file("program.csv", program);
    let model = "out/arm.calibrated.model.json";
    let done = dir.calib([
        "correct",
        model,
        "program.csv",
        "--tool",
        "l6",
        "--out",
        "corrected.csv",
    ]);
    assert!(done.code < 2, "{}", done.stderr);
    let found = Robot::from_json(dir.read(model).as_bytes()).expect("a model");
    let tool = truth.link("l6").expect("there");
    let own = found.model.link("l6").expect("there");
    let text = dir.read("corrected.csv");
    let names: Vec<&str> = text.lines().next().expect("a header").split(',').collect();
    let (mut before, mut after, mut predicted, mut reached) = (0.0, 0.0, 0.0, 0);
    for (line, q) in text.lines().skip(1).zip(&wanted) {
        let cells: BTreeMap<&str, &str> = names.iter().copied().zip(line.split(',')).collect();
        if cells["outcome"] != "reached" {
            continue;
        }
        reached += 1;
        let command = (1..=6).map(|k| cells[format!("j{k}_deg").as_str()].parse::<f64>());
        let command: Vec<f64> = command.map(|c| c.expect("a number").to_radians()).collect();
        let there = at(&nominal.model, tool, q).t;
        let true_tool = at(&truth, tool, &command).t;
        before += (at(&truth, tool, q).t - there).norm_squared();
        after += (true_tool - there).norm_squared();
        predicted += (at(&found.model, own, &command).t - true_tool).norm_squared();
    }
    let rms = |sum: f64| 1e3 * (sum / f64::from(reached)).sqrt();
    let (before, after, predicted) = (rms(before), rms(after), rms(predicted));
    println!(
        "{reached} of 40: {before:.3} mm before, {after:.3} mm after, {predicted:.3} mm of the prediction"
    );
    assert!(reached >= 30, "{text}");
    assert!(
        after <= 1.2 * predicted && 5.0 * after <= before,
        "{before} {after} {predicted}"
    );
}

#[test]
fn the_commands_use_what_a_run_wrote() {
    let dir = Scratch::new().brief("ripley");
    dir.calib(["run", "robots/ripley.yaml", "--out", "out"]);
    let model = "out/ripley.calibrated.model.json";
    // The report names the file with its digest, the file what it was shown to be good for, and it is read back bit for bit.
    let report = dir.json("out/report.json");
    let outputs = report["outputs"].as_array().expect("a list");
    let listed = outputs
        .iter()
        .find(|o| o["path"] == "ripley.calibrated.model.json");
    let digest = calib_urdf::sha256_hex(dir.read(model).as_bytes());
    assert_eq!(listed.expect("listed")["sha256"], digest);
    let text = dir.read(model);
    let robot = Robot::from_json(text.as_bytes()).expect("a model");
    let again = serde_json::to_value(&robot.file).expect("JSON");
    assert_eq!(
        again,
        serde_json::from_str::<serde_json::Value>(&text).expect("JSON")
    );
    let validity = robot.file.validity.as_ref().expect("stated");
    assert_eq!(report["verdict"], validity.verdict);
    assert!(robot.model.has_uncertainty());

    let table = "robots/ripley/checks.csv";
    let predicted = dir
        .calib(["predict", model, table, "--in", "tracker"])
        .expect(0);
    assert!(
        predicted.stdout.starts_with("line,scope,"),
        "{}",
        predicted.stdout
    );
    let rows = predicted.stdout.lines().count();
    assert_eq!(
        rows,
        1 + dir
            .read(table)
            .lines()
            .filter(|l| l.starts_with(|c: char| c.is_ascii_digit()))
            .count()
    );
    let corrected = dir.calib(["correct", model, table, "--position-only"]);
    assert!(corrected.code < 2, "{}", corrected.stderr);
    for to in ["urdf", "urdf-best", "dh", "hayati", "poe", "mjcf", "sdf"] {
        let done = dir.calib(["export", model, "--to", to]).expect(0);
        assert!(done.stdout.len() > 500, "{to}");
    }
    // What cannot be used is refused with its place and its code.
    let dir = dir.file(
        "bad.json",
        text.replacen("\"calib_model\": 1", "\"calib_model\": 7", 1),
    );
    for (arguments, code, says) in [
        (["predict", "bad.json", table, "--quiet"], 3, "version 7"),
        (
            ["predict", "none.json", table, "--quiet"],
            3,
            "none.json: cannot be read",
        ),
        (
            ["predict", model, "robots/ripley/r17.urdf", "--quiet"],
            3,
            "r17.urdf",
        ),
        (
            ["predict", model, table, "--of=claw"],
            2,
            "claw is not a link",
        ),
        (
            ["export", model, "--to=ur", "--quiet"],
            2,
            "of the six joints of a UR arm",
        ),
        (
            ["export", model, "--to=dh", "--tool=claw"],
            2,
            "claw is not a link or point",
        ),
        (
            ["correct", model, table, "--largest-deg=0"],
            2,
            "0 is not a bound",
        ),
    ] {
        let refused = dir.calib(arguments).expect(code);
        assert!(refused.stderr.contains(says), "{}", refused.stderr);
    }
}

/// A controller's table: its own names, a text column, decimal commas; the profile has a map for tables like it.
#[test]
fn a_controllers_table_is_read_by_the_map_of_a_profile() {
    let done = crate::scratch::finished("ripley", "ml");
    let folder = done.dir.path("out").display().to_string();
    let model = format!("{folder}/ripley.calibrated.model.json");
    let profile = "calib: 1
robot: {name: ripley, urdf: r17.urdf}
tracker: {frame: lab}
bodies: {}
recordings:
  one:
    file: one.csv
    use: static
    columns: &map
      decimal_comma: true
      angles: deg
      joints: {waist: A1, shoulder: A2, elbow: A3, wrist_pitch: A4, wrist_roll: A5}
  two: {file: two.csv, use: static, robot_log: {file: two_log.csv, columns: *map}}
  three: {file: three.csv, use: static}
";
    let own = "name,waist_deg,shoulder_deg,elbow_deg,wrist_pitch_deg,wrist_roll_deg\n\
               home,1.5,-20.25,30,40,50\nplace,-10,-30,20,10.5,0\n";
    let foreign =
        "Mode;A1;A2;A3;A4;A5;Gripper\nAUTO;1,5;-20,25;30;40;50;3,5\nAUTO;-10;-30;20;10,5;0;3,5\n";
    // A joint that the recording holds, and a map that also has what a program has not.
    let held = profile
        .replace("file: one.csv\n    use: static\n", "file: one.csv\n    use: static\n    hold: {wrist_roll_deg: 50}\n")
        .replace(", wrist_roll: A5", "")
        .replace("angles: deg\n", "angles: deg\n      time: {column: Stamp, unit: ms}\n      markers: {m: [MX, MY, MZ]}\n");
    let dir = Scratch::new()
        .file("r.yaml", profile)
        .file("held.yaml", held)
        .file(
            "r2.yaml",
            profile.replace("*map", "{angles: rad, joints: {waist: A1}}"),
        )
        .file("own.csv", own)
        .file("log.csv", foreign);
    let wanted = dir.calib_with(&["predict", &model, "own.csv"]).expect(0);
    let like = |file: &str, more: &[&str]| {
        let base = ["predict", &model, "log.csv", "--profile", file];
        dir.calib_with(&[&base, more].concat())
    };
    for more in [&[][..], &["--recording", "one"], &["--recording", "two"]] {
        assert_eq!(
            like("r.yaml", more).expect(0).stdout,
            wanted.stdout,
            "{more:?}"
        );
    }
    let refused = dir.calib_with(&["predict", &model, "log.csv"]).expect(3);
    assert!(refused.stderr.contains("column `A1`"), "{}", refused.stderr);
    for (file, more, says) in [
        (
            "r.yaml",
            &["--recording", "three"][..],
            "recording `three` has no column map",
        ),
        (
            "r.yaml",
            &["--recording", "four"],
            "there are one, three, two",
        ),
        ("r2.yaml", &[], "2 different column maps"),
        ("none.yaml", &[], "none.yaml: cannot be read"),
    ] {
        let ran = like(file, more);
        assert!(ran.code > 1 && ran.stderr.contains(says), "{}", ran.stderr);
    }
    let ran = like("held.yaml", &["--recording", "one"]);
    let first = |text: &str| text.lines().nth(1).map(str::to_owned);
    assert_eq!(first(&ran.expect(0).stdout), first(&wanted.stdout));
    let ran = like("held.yaml", &["--recording", "two"]);
    assert!(
        ran.stderr.contains("count as 0: wrist_roll"),
        "{}",
        ran.stderr
    );
    let converted = ["convert", "log.csv", "out.csv", "--profile", "r.yaml"];
    dir.calib_with(&converted).expect(0);
    let wanted = wanted.stdout;
    let again = dir
        .calib_with(&["predict", &model, "out.csv"])
        .expect(0)
        .stdout;
    let values = |text: &str| -> Vec<String> {
        let rows = text.lines().skip(1);
        rows.map(|row| row.split_once(',').expect("cells").1.to_owned())
            .collect()
    };
    assert_eq!(values(&again), values(&wanted));
}
