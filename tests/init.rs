//! `calib init`: the profile that it writes runs, on simulated robots and on those of other laboratories.

use crate::scratch;

use std::path::PathBuf;
use std::time::Instant;

use scratch::{Scratch, root};
use serde_json::Value;

/// What was written, and what a run of it, unchanged, ended with.
struct Written {
    json: Value,
    code: i32,
    seconds: f64,
    run: i32,
    held_out_mm: Option<f64>,
    dir: Scratch,
}

impl Written {
    fn link(&self, body: &str) -> String {
        let place = format!("bodies.{body}");
        let facts = self.json["facts"].as_array().expect("a list");
        let of = |f: &&Value| f["place"] == place.as_str() && f["link"].is_string();
        let fact = facts
            .iter()
            .find(of)
            .unwrap_or_else(|| panic!("no link of {body}: {facts:?}"));
        fact["link"].as_str().expect("a name").to_owned()
    }

    fn has(&self, fact: &str) -> bool {
        let facts = self.json["facts"].as_array().expect("a list");
        facts.iter().any(|f| f["fact"] == fact)
    }

    fn to_check(&self) -> usize {
        let facts = self.json["facts"].as_array().expect("a list");
        facts.iter().filter(|f| f["check"] == true).count()
    }
}

impl Written {
    /// A row of the table of the book's page.
    fn row(&self, name: &str, bodies: &[(&str, &str)]) -> String {
        let links: Vec<String> = bodies.iter().map(|(body, _)| self.link(body)).collect();
        let held = self
            .held_out_mm
            .map_or("-".to_owned(), |mm| format!("{mm:.2}"));
        format!(
            "| {name} | 0 | {} | {} | {:.1} | {held} |",
            self.to_check(),
            links.join(", "),
            self.seconds
        )
    }
}

/// `calib init URDF FILES --out robots/it.yaml`, then a run of what it wrote.
fn written(dir: Scratch, urdf: &str, files: &[&str]) -> Written {
    let start = Instant::now();
    let mut call = vec!["init", urdf];
    call.extend(files);
    call.extend(["--out", "robots/it.yaml", "--json"]);
    let made = dir.calib_with(&call);
    let seconds = start.elapsed().as_secs_f64();
    let json = serde_json::from_str(&made.stdout)
        .unwrap_or_else(|e| panic!("{e}: {}{}", made.stdout, made.stderr));
    let ran = dir.calib_with(&["run", "robots/it.yaml", "--out", "out"]);
    assert!(
        ran.code < 2,
        "{}{}\n{}",
        ran.stdout,
        ran.stderr,
        dir.read("robots/it.yaml")
    );
    let report = dir.json("out/report.json");
    let rms = report["verification"]["held_out"]["calibrated"]["rms_m"].as_f64();
    Written {
        json,
        code: made.code,
        seconds,
        run: ran.code,
        held_out_mm: rms.map(|rms| rms * 1e3),
        dir,
    }
}

#[test]
fn the_export_of_the_tutorial_needs_no_line_of_a_profile() {
    let mut dir = Scratch::new();
    for name in [
        "arm.urdf",
        "2026-05-fit-vicon.csv",
        "2026-05-fit-robot.csv",
        "2026-05-check-vicon.csv",
        "2026-05-check-robot.csv",
    ] {
        let bytes = std::fs::read(root().join("book/src/tutorial").join(name)).expect("committed");
        dir = dir.file(name, bytes);
    }
    let made = written(
        dir,
        "arm.urdf",
        &[
            "2026-05-fit-vicon.csv",
            "2026-05-fit-robot.csv",
            "2026-05-check-vicon.csv",
            "2026-05-check-robot.csv",
        ],
    );
    assert_eq!(made.code, 0, "{}", made.json);
    assert_eq!(made.link("Plate"), "link_6");
    assert!(
        made.held_out_mm.is_some_and(|mm| mm < 0.6),
        "{:?}",
        made.held_out_mm
    );
    println!(
        "{}",
        made.row("the tutorial's arm, two clocks", &[("Plate", "")])
    );
    // Nothing is written over.
    let again = made
        .dir
        .calib_with(&["init", "arm.urdf", "--out", "robots/it.yaml"]);
    assert_eq!(again.code, 7);
    assert!(again.stderr.contains("exists already"), "{}", again.stderr);
}

/// The tutorial's arm with a simulated recording of 40 postures in meters, and what follows `simulate:` of it.
fn simulated_arm() -> (Scratch, String) {
    let urdf = std::fs::read(root().join("book/src/tutorial/arm.urdf")).expect("committed");
    let dir = Scratch::new().file("arm.urdf", urdf);
    let made = dir.calib_with(&["init", "arm.urdf", "--out", "robots/arm.yaml"]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let made = dir.calib_with(&["simulate", "robots/arm.yaml", "--out", "robots/arm"]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let table = dir.read("robots/arm/poses.csv");
    let table = table.lines().filter(|l| !l.starts_with('#'));
    let table: Vec<String> = table.map(|line| line.to_owned() + "\n").collect();
    (dir, table.concat())
}

#[test]
fn two_files_of_postures_and_a_wrong_unit_of_length_are_told() {
    let (dir, table) = simulated_arm();
    // Columns of joints and of markers, each in a file of its own.
    let names: Vec<&str> = table.lines().next().expect("a header").split(',').collect();
    let part = |keep: &dyn Fn(&str) -> bool| -> String {
        let cells = |line: &str| {
            let of = line.split(',').zip(&names).filter(|(_, n)| keep(n));
            of.map(|(cell, _)| cell).collect::<Vec<_>>().join(",") + "\n"
        };
        table.lines().map(cells).collect()
    };
    let dir = dir
        .file("tracker.csv", part(&|n| n.contains('.')).into_bytes())
        .file("robot.csv", part(&|n| n.starts_with("joint")).into_bytes());
    let made = written(dir, "arm.urdf", &["tracker.csv", "robot.csv"]);
    assert_eq!((made.code, made.run), (0, 0), "{}", made.json);
    assert!(made.held_out_mm.is_some_and(|mm| mm < 1.0));
    let profile = made.dir.read("robots/it.yaml");
    assert!(profile.contains("rows: same"), "{profile}");
    // Rows that were deleted in one of them.
    let robot = made.dir.read("robot.csv");
    let short: Vec<&str> = robot.lines().collect();
    let dir = made
        .dir
        .file("robot.csv", short[..20].join("\n").into_bytes());
    let ran = dir.calib_with(&["run", "robots/it.yaml", "--out", "again"]);
    assert!(ran.code > 1, "{}", ran.stdout);
    assert!(
        ran.stderr.contains("40 rows, the robot's log 19"),
        "{}",
        ran.stderr
    );
    // Lengths that the names call millimeters, and are centimeters: scaled by 10, wherever the names say it.
    let (dir, table) = simulated_arm();
    let (unit, scale) = match table.contains("_mm") {
        true => ("_mm", 0.1),
        false => ("_m", 100.0),
    };
    let names: Vec<String> = table
        .lines()
        .next()
        .expect("a header")
        .split(',')
        .map(str::to_owned)
        .collect();
    let scaled: Vec<String> = table
        .lines()
        .skip(1)
        .map(|line| {
            let cell = |(cell, name): (&str, &String)| match name.ends_with(unit) {
                true => cell
                    .parse::<f64>()
                    .map_or_else(|_| cell.to_owned(), |x| (x * scale).to_string()),
                false => cell.to_owned(),
            };
            line.split(',')
                .zip(&names)
                .map(cell)
                .collect::<Vec<_>>()
                .join(",")
                + "\n"
        })
        .collect();
    let header = names.join(",").replace(unit, "_mm") + "\n";
    let dir = dir.file(
        "robots/arm/poses.csv",
        (header + &scaled.concat()).into_bytes(),
    );
    let checked = dir.calib_with(&["check", "robots/arm.yaml"]);
    assert!(checked.code > 1, "{}", checked.stdout);
    let said = checked.stdout.replace("\n", " ");
    let words: Vec<&str> = said.split_whitespace().collect();
    let said = words.join(" ");
    assert!(said.contains("10 times larger"), "{said}");
}

#[test]
fn simulated_streams_and_logs_are_read_by_the_profile_that_asks_for_them() {
    let urdf = std::fs::read(root().join("book/src/tutorial/arm.urdf")).expect("committed");
    let dir = Scratch::new().file("arm.urdf", urdf);
    let made = dir.calib_with(&["init", "arm.urdf", "--out", "robots/arm.yaml"]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let profile = dir.read("robots/arm.yaml");
    let settle = "timing: {poses: settle}";
    for (name, poses) in [
        ("one", format!("use: static\n    {settle}")),
        (
            "two",
            format!("use: static\n    {settle}\n    robot_log: {{file: arm/joints.csv}}"),
        ),
        (
            "rows",
            "use: static\n    robot_log: {file: arm/joints.csv, rows: same}".to_owned(),
        ),
        (
            "motion",
            "use: static\n    timing: {poses: continuous}".to_owned(),
        ),
        // Names, units and separators of another table: the map reads them.
        (
            "mapped",
            "use: static\n    columns: {joints: {joint_1: A1, joint_2: A2}, reversed: [joint_2], angles: deg, delimiter: semicolon, decimal_comma: true}".to_owned(),
        ),
    ] {
        // The recording of random postures, as the profile would have it.
        let timed = profile.replacen("use: static", &poses, 1);
        assert_ne!(timed, profile);
        let folder = format!("cells/{name}");
        let at = format!("{folder}/arm.yaml");
        let timed = timed.replace("../arm.urdf", "../../arm.urdf");
        std::fs::create_dir_all(dir.path(&folder)).expect("a folder");
        std::fs::write(dir.path(&at), timed).expect("a file");
        let simulated = dir.calib_with(&["simulate", &at, "--out", &format!("{folder}/arm")]);
        assert_eq!(simulated.code, 0, "{name}: {}", simulated.stderr);
        if name == "mapped" {
            let table = dir.read(&format!("{folder}/arm/poses.csv"));
            assert!(table.lines().any(|line| line.starts_with("A1;A2;")), "{table}");
        }
        let out = format!("results/{name}");
        let ran = dir.calib_with(&["run", &at, "--out", &out]);
        assert!(ran.code < 2, "{name}: {}{}", ran.stdout, ran.stderr);
        let report = dir.json(&format!("{out}/report.json"));
        let rms = report["verification"]["held_out"]["calibrated"]["rms_m"].as_f64();
        assert!(rms.is_some_and(|rms| rms < 1.5e-3), "{name}: {rms:?}");
        if name == "one" {
            // The twin of these results finds the profile, which lies in a folder of another name.
            let twin = dir.calib_with(&["twin", &out, "--trials", "1", "--out", "twin"]);
            assert_eq!(twin.code, 0, "{}", twin.stderr);
        }
    }
}

#[test]
fn limits_in_degrees_are_warned_of_and_not_planned() {
    let urdf =
        std::fs::read_to_string(root().join("book/src/tutorial/arm.urdf")).expect("committed");
    let mut degrees = String::new();
    for (i, part) in urdf.split("er=\"").enumerate() {
        match (i, part.split_once('"')) {
            (0, _) => degrees += part,
            (_, Some((number, rest))) if number.parse::<f64>().is_ok() => {
                let degree = number.parse::<f64>().expect("a number").to_degrees();
                degrees += &format!("er=\"{degree:.0}\"{rest}");
            }
            _ => degrees += &format!("er=\"{part}"),
        }
    }
    let dir = Scratch::new().file("arm.urdf", degrees.into_bytes());
    let made = dir.calib_with(&["init", "arm.urdf", "--out", "robots/arm.yaml"]);
    assert!(made.stdout.contains("probably degrees"), "{}", made.stdout);
    // Its own ranges are planned.
    let planned = dir.calib_with(&["plan", "robots/arm.yaml", "--poses", "12", "--out", "plan"]);
    assert_eq!(planned.code, 0, "{}", planned.stderr);
    let profile = dir.read("robots/arm.yaml");
    let without: Vec<&str> = profile
        .lines()
        .filter(|l| *l != "plan:" && !l.starts_with("  joints: {"))
        .collect();
    let dir = dir.file("robots/arm.yaml", without.join("\n").into_bytes());
    let planned = dir.calib_with(&["plan", "robots/arm.yaml", "--poses", "12", "--out", "again"]);
    assert_ne!(planned.code, 0, "{}", planned.stdout);
    assert!(
        planned.stderr.contains("probably degrees"),
        "{}",
        planned.stderr
    );
    let simulated = dir.calib_with(&["simulate", "robots/arm.yaml", "--out", "robots/arm"]);
    assert_eq!(simulated.code, 0, "{}", simulated.stderr);
    let checked = dir.calib_with(&["check", "robots/arm.yaml"]);
    assert!(checked.stdout.contains("probably"), "{}", checked.stdout);
}

#[test]
fn the_shipped_robots_are_found_again_from_their_tables() {
    if !skipped_tests::thorough() {
        return;
    }
    for (robot, urdf, files, links) in [
        (
            "ripley",
            "robots/ripley/r17.urdf",
            ["base_sweep", "wrist_sweep", "arm_poses", "checks"],
            [
                ("linkM", "upper_arm"),
                ("gripM", "gripper"),
                ("table_markers", "table"),
            ]
            .as_slice(),
        ),
        (
            "justin",
            "robots/justin/justin.urdf",
            ["head_sweep", "hand_sweep", "arm_poses", "torso_tests"],
            [("heT", "head"), ("haT", "hand")].as_slice(),
        ),
    ] {
        let files = files.map(|f| format!("robots/{robot}/{f}.csv"));
        let files: Vec<&str> = files.iter().map(String::as_str).collect();
        let made = written(Scratch::new().brief(robot), urdf, &files);
        assert_eq!(made.code, 0, "{robot}: {}", made.json);
        let model = std::fs::read_to_string(root().join(urdf)).expect("committed");
        for (body, link) in links {
            assert!(
                rigid(&model, &made.link(body), link),
                "{robot} {body}: {}",
                made.link(body)
            );
        }
        assert!(made.json["errors"].as_array().is_some_and(Vec::is_empty));
        println!("{}", made.row(&format!("`{robot}`, shipped"), links));
    }
}

/// Two links between which no joint moves.
fn rigid(urdf: &str, a: &str, b: &str) -> bool {
    let model = calib_urdf::RobotModel::from_urdf_text(urdf, "robot.urdf").expect("a robot");
    let group = |name: &str| calib_init::robot::group(&model, model.link_id(name).expect("a link"));
    group(a) == group(b)
}

/// A plan of few postures.
fn small_plan(profile: &str) -> [&str; 8] {
    let [poses, candidates, out] = ["--poses", "--candidates", "--out"];
    ["plan", profile, poses, "8", candidates, "128", out, "plan"]
}

#[test]
fn from_a_urdf_alone_to_a_plan_and_a_run() {
    let urdf = std::fs::read(root().join("robots/ripley/r17.urdf")).expect("committed");
    let dir = Scratch::new().file("r17.urdf", urdf);
    let made = dir.calib(["init", "r17.urdf", "--markers-on", "gripper"]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let profile = "robots/ripley.yaml";
    assert!(
        made.stdout.starts_with(&format!("Wrote {profile}\n")),
        "{}",
        made.stdout
    );
    let plan = dir.calib(small_plan(profile));
    assert_eq!(plan.code, 0, "{}", plan.stderr);
    let simulated = dir.calib(["simulate", profile, "--out", "robots/ripley"]);
    assert_eq!(simulated.code, 0, "{}", simulated.stderr);
    let ran = dir.calib(["run", profile, "--out", "out"]);
    assert!(ran.code < 2, "{}{}", ran.stdout, ran.stderr);
}

/// The profile calls no frame as a link is called: reading it would refuse that.
#[test]
fn the_frame_of_the_tracker_has_a_name_of_its_own() {
    let urdf = std::fs::read_to_string(root().join("robots/ripley/r17.urdf")).expect("committed");
    let urdf = urdf.replace("\"gripper\"", "\"tracker\"");
    let dir = Scratch::new().file("r17.urdf", urdf);
    let made = dir.calib(["init", "r17.urdf", "--markers-on", "tracker"]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let written = dir.read("robots/ripley.yaml");
    assert!(written.contains("frame: tracker_frame"), "{written}");
    let profile = "robots/ripley.yaml";
    let simulated = dir.calib(["simulate", profile, "--out", "robots/ripley"]);
    assert_eq!(simulated.code, 0, "{}", simulated.stderr);
}

/// An arm beside which another one is bent at 0, and that slides where 0 is out of reach.
#[test]
fn postures_that_nothing_asks_for_are_within_all_limits() {
    let joint = |name: &str, kind: &str, parent: &str, axis: &str, limits: [f64; 2]| {
        format!(
            "<link name=\"{name}_l\"/><joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{name}_l\"/>\
             <origin xyz=\"0.1 0 0.3\"/><axis xyz=\"{axis}\"/><limit lower=\"{}\" upper=\"{}\" effort=\"9\" velocity=\"1\"/></joint>",
            limits[0], limits[1]
        )
    };
    let urdf = [
        "<robot name=\"cell\"><link name=\"base\"/>".to_owned(),
        joint("lift", "prismatic", "base", "0 0 1", [0.2, 0.9]),
        joint("a1", "revolute", "lift_l", "0 0 1", [-2.0, 2.0]),
        joint("a2", "revolute", "a1_l", "0 1 0", [-1.5, 1.5]),
        joint("a3", "revolute", "a2_l", "1 0 0", [-2.0, 2.0]),
        joint("elbow", "revolute", "base", "0 1 0", [-2.3, -0.5]),
        "</robot>".to_owned(),
    ]
    .concat();
    let dir = Scratch::new().file("cell.urdf", urdf);
    let done = |call: &[&str]| {
        let ran = dir.calib_with(call);
        assert!(ran.code < 2, "{call:?}: {}{}", ran.stdout, ran.stderr);
        format!("{}{}", ran.stdout, ran.stderr)
    };
    let profile = "robots/cell.yaml";
    done(&["init", "cell.urdf", "--markers-on", "a3_l"]);
    done(&small_plan(profile));
    for plan in [None, Some("plan/plan.yaml")] {
        let mut call = vec!["simulate", profile, "--out", "robots/cell"];
        call.extend(plan.iter().flat_map(|plan| ["--plan", plan]));
        done(&call);
        let table = dir.read("robots/cell/poses.csv");
        assert!(table.contains("elbow"), "{table}");
        let said = done(&["check", profile, "--json"]);
        assert!(!said.contains("joint-outside-limits"), "{plan:?}: {said}");
    }
}

/// Poses of a flange and of a tracked body, and no joints.
const PAIRS: &str = "flange_x,flange_y,flange_z,flange_qx,flange_qy,flange_qz,flange_qw,meas_x,meas_y,meas_z,meas_qx,meas_qy,meas_qz,meas_qw
1,2,3,0,0,0,1,1,2,3,0,0,0,1
1.1,2,3,0,0,0,1,1,2.1,3,0,0,0,1
";

/// A URDF with a fault is to be corrected, and no command helps.
#[test]
fn a_faulty_urdf_has_a_remedy_that_fits() {
    let dir = Scratch::new();
    let good = std::fs::read_to_string(root().join("book/src/tutorial/arm.urdf")).expect("a URDF");
    for number in ["nan", "0,05"] {
        let joint = good.find("<joint").expect("a joint");
        let at = joint + good[joint..].find("xyz=\"").expect("an origin") + 5;
        let end = at + good[at..].find(' ').expect("a blank");
        let bad = format!("{}{number}{}", &good[..at], &good[end..]);
        std::fs::write(dir.path("bad.urdf"), bad).expect("written");
        let ran = dir.calib(["init", "bad.urdf", "--out", "it.yaml"]);
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        assert!(ran.stderr.contains("correct it there"), "{}", ran.stderr);
        assert!(!ran.stderr.contains("shows the commands"), "{}", ran.stderr);
    }
}

#[test]
fn bad_calls_are_refused_and_write_nothing() {
    let urdf = std::fs::read(root().join("book/src/tutorial/arm.urdf")).expect("committed");
    let dir = Scratch::new()
        .file("arm.urdf", urdf)
        .file("empty.csv", "")
        .file("joints.csv", "pose,joint_1_deg\n0,1\n1,2\n")
        .file("trial.c3d", [&[2, 80][..], &[7; 1024]].concat())
        .file("bytes.bin", [&[200, 1, 0, 3][..], &[0; 64]].concat())
        .file("notes.txt", "The arm was recorded in May.\n")
        .file("pairs.csv", PAIRS)
        .file("open.urdf", "<robot name=\"a\"><link name=\"b\"></robot>")
        .file("latin.urdf", &b"<robot name=\"caf\xe9\"/>"[..]);
    for (call, code, said) in [
        (["init", "no.urdf"].as_slice(), 2, "no.urdf"),
        (&["init", "arm.urdf", "no.csv"], 2, "no.csv"),
        (&["init", "arm.urdf", "empty.csv"], 3, "empty"),
        (
            &["init", "arm.urdf", "joints.csv"],
            3,
            "nothing was tracked",
        ),
        (&["init", "empty.csv"], 2, "empty.csv"),
        (
            &["init", "joints.csv"],
            2,
            "this is a recording (a table with the columns `pose`, `joint_1_deg`), not a URDF",
        ),
        (
            &["init", "joints.csv", "arm.urdf"],
            2,
            "`calib init robot.urdf joints.csv`",
        ),
        (&["init", "trial.c3d"], 2, "this is a recording (C3D)"),
        (
            &["init", "bytes.bin"],
            2,
            "this is a binary file, not a URDF",
        ),
        (&["init", "notes.txt"], 2, "this is text that is not XML"),
        (
            &["init", "pairs.csv"],
            2,
            "calib fit handeye pairs.csv --robot flange --measured meas",
        ),
        // A URDF with a fault stays one.
        (&["init", "open.urdf"], 2, "not well-formed XML"),
        (&["init", "latin.urdf"], 2, "is not UTF-8"),
        (
            &["init", "arm.urdf", "--markers-on", "flansh"],
            2,
            "did you mean `flange`?",
        ),
    ] {
        let ran = dir.calib_with(call);
        assert_eq!(ran.code, code, "{call:?}: {}", ran.stderr);
        assert!(ran.stderr.contains(said), "{call:?}: {}", ran.stderr);
    }
    assert!(!dir.path("robots").exists(), "nothing is written");
}

/// Folder of the measurements of other laboratories.
fn data() -> Option<PathBuf> {
    skipped_tests::real_data("tiago_frozen")?
        .parent()
        .map(Into::into)
}

/// A robot of another laboratory: URDF, files, and a link of each body's rigid group.
struct Real {
    name: &'static str,
    urdf: &'static str,
    files: &'static [&'static str],
    links: &'static [(&'static str, &'static str)],
}

const REAL: [Real; 3] = [
    Real {
        name: "tiago_frozen",
        urdf: "tiago_qualisys/tiago_48_schunk.urdf",
        files: &["tiago_frozen/train.csv", "tiago_frozen/validation.csv"],
        links: &[("body", "wrist_ft_tool_link")],
    },
    Real {
        name: "tiago_qualisys",
        urdf: "tiago_qualisys/tiago_48_schunk.urdf",
        files: &["tiago_qualisys/qualysis_base_hand_calibration.csv"],
        links: &[("body", "wrist_ft_tool_link")],
    },
    Real {
        name: "agile_justin",
        urdf: "agile_justin/agile_justin_nominal.urdf",
        files: &["agile_justin/postures.csv"],
        links: &[
            ("right_marker", "link_right_6"),
            ("left_marker", "link_left_6"),
        ],
    },
];

/// Writes and runs the profiles of all real robots; of long tables every n-th posture.
fn real_robots(every: usize) {
    let Some(data) = data() else { return };
    for real in &REAL {
        let read = |path: &str| std::fs::read(data.join(path)).expect("part of the data");
        let mut dir = Scratch::new().file("robot.urdf", read(real.urdf));
        let mut names = Vec::new();
        for file in real.files {
            let name = file.rsplit('/').next().expect("a file");
            let text = String::from_utf8(read(file)).expect("a table is text");
            let every = if text.lines().count() > 100 { every } else { 1 };
            let rows = text.lines().enumerate();
            let kept = rows.filter(|(row, _)| *row == 0 || row % every == 0);
            let kept: String = kept.map(|(_, line)| format!("{line}\n")).collect();
            dir = dir.file(name, kept);
            names.push(name);
        }
        let made = written(dir, "robot.urdf", &names);
        let model = String::from_utf8(read(real.urdf)).expect("text");
        for (body, link) in real.links {
            assert!(
                rigid(&model, &made.link(body), link),
                "{}: {body} on {}",
                real.name,
                made.link(body)
            );
        }
        println!("{}", made.row(&format!("`{}`", real.name), real.links));
        assert!(made.run < 2);
        if real.name == "tiago_qualisys" {
            assert!(made.has("duplicate"), "the fourth marker repeats the third");
        }
    }
}

#[test]
fn real_robots_run_without_an_edit() {
    if !skipped_tests::thorough() {
        return;
    }
    real_robots(6);
}

/// With the other rows of the book's table: `cargo test -p calib-cli --test suite init:: -- --include-ignored --nocapture`.
#[test]
#[ignore = "study: a run of 350 postures"]
fn study_of_real_robots_with_all_postures() {
    real_robots(1);
}

/// Poses of a flange and of a tracked body, and no joints: the command that is named solves it.
#[test]
fn pairs_of_poses_lead_to_the_hand_eye_solver() {
    let Some(data) = data() else { return };
    let table = std::fs::read(data.join("ur10_handeye/ur10_axzb.csv")).expect("part of the data");
    let urdf = std::fs::read(root().join("book/src/tutorial/arm.urdf")).expect("committed");
    let dir = Scratch::new()
        .file("arm.urdf", urdf)
        .file("pairs.csv", table);
    let refused = dir.calib(["init", "arm.urdf", "pairs.csv"]);
    assert_eq!(refused.code, 3);
    let named = "calib fit handeye pairs.csv --robot flange --measured meas";
    assert!(refused.stderr.contains(named), "{}", refused.stderr);
    // Nor is a URDF needed.
    let alone = dir.calib(["init", "pairs.csv"]);
    assert_eq!(alone.code, 2);
    assert!(alone.stderr.contains(named), "{}", alone.stderr);
    let call: Vec<&str> = named.split(' ').skip(1).collect();
    let solved = dir.calib_with(&call);
    assert_eq!(solved.code, 0, "{}{}", solved.stdout, solved.stderr);
}
