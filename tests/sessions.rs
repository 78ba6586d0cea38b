//! What a session of a laboratory is beside its rows: the order of its recordings, what the held-out poses show, limbs whose place is open, joints
//! that go round, and a profile that frees nothing of the robot.

use crate::scratch;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;
use serde_json::Value;

/// σ of one marker coordinate, m.
const MARKER: f64 = 1.5e-4;
const TEMPLATE: [[f64; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [0.07, 0.0, 0.0],
    [0.02, 0.06, 0.0],
    [0.04, 0.03, -0.05],
];

/// One joint of a robot: name, type, parent and child link, origin, axis and what follows it.
struct Joint {
    name: String,
    kind: &'static str,
    links: [String; 2],
    xyz: [f64; 3],
    axis: &'static str,
    limits: [f64; 2],
    mimic: String,
}

fn joint(
    name: &str,
    kind: &'static str,
    links: [&str; 2],
    xyz: [f64; 3],
    axis: &'static str,
) -> Joint {
    Joint {
        name: name.to_owned(),
        kind,
        links: links.map(str::to_owned),
        xyz,
        axis,
        limits: [-2.0, 2.0],
        mimic: String::new(),
    }
}

/// An arm of six joints on a link, its names with a letter before them.
fn arm(letter: &str, base: &str) -> Vec<Joint> {
    let at = [
        ([0.0, 0.0, 0.3], "0 0 1"),
        ([0.1, 0.0, 0.2], "0 1 0"),
        ([0.0, 0.0, 0.4], "0 1 0"),
        ([0.1, 0.0, 0.1], "1 0 0"),
        ([0.3, 0.0, 0.0], "0 1 0"),
        ([0.1, 0.0, 0.0], "1 0 0"),
    ];
    let link = |k: usize| match k {
        0 => base.to_owned(),
        _ => format!("{letter}link{k}"),
    };
    let of = |(k, (xyz, axis)): (usize, ([f64; 3], &'static str))| {
        let links = [link(k), link(k + 1)];
        joint(
            &format!("{letter}{}", k + 1),
            "revolute",
            [&links[0], &links[1]],
            xyz,
            axis,
        )
    };
    at.into_iter().enumerate().map(of).collect()
}

/// The robot with origins off by up to `error` m.
fn urdf(joints: &[Joint], error: f64, seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut text = "<robot name=\"r\">\n  <link name=\"root\"/>\n".to_owned();
    for j in joints {
        let [x, y, z] = j.xyz.map(|c| c + error * rng.random_range(-1.0..1.0));
        let moves = match j.kind {
            "fixed" => String::new(),
            "continuous" => format!("<axis xyz=\"{}\"/>", j.axis),
            _ => format!(
                "<axis xyz=\"{}\"/><limit lower=\"{}\" upper=\"{}\" effort=\"9\" velocity=\"9\"/>",
                j.axis, j.limits[0], j.limits[1]
            ),
        };
        let [parent, child] = &j.links;
        text += &format!(
            "  <link name=\"{child}\"/>\n  <joint name=\"{}\" type=\"{}\"><parent link=\"{parent}\"/><child link=\"{child}\"/><origin xyz=\"{x} {y} {z}\"/>{moves}{}</joint>\n",
            j.name, j.kind, j.mimic
        );
    }
    text + "</robot>\n"
}

/// What is recorded of a robot: bodies of four markers by name and link, and where each is mounted.
struct Cell<'a> {
    robot: &'a RobotModel,
    bodies: &'a [(&'a str, &'a str, [f64; 3])],
    /// Range of each joint's readings.
    range: &'a dyn Fn(&str) -> (f64, f64),
}

impl Cell<'_> {
    fn table(&self, rows: usize, seed: u64) -> String {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let tracker = Isometry3::new(Vector3::new(1.5, -0.6, 0.8), Vector3::new(0.1, -0.3, 0.9));
        let joints: Vec<_> = self.robot.independent_joints().collect();
        let unit = |id: &calib_urdf::JointId| match self.robot.joint(*id).kind.turns() {
            true => "rad",
            false => "m",
        };
        let name = |id: &calib_urdf::JointId| self.robot.joint(*id).name.clone();
        let mut header: Vec<String> = joints
            .iter()
            .map(|id| format!("{}_{}", name(id), unit(id)))
            .collect();
        for (body, ..) in self.bodies {
            for k in 1..=4 {
                header.extend(["x", "y", "z"].map(|c| format!("{body}_{k}.{c}_m")));
            }
        }
        let mut text = header.join(",") + "\n";
        for _ in 0..rows {
            let mut q = self.robot.zero_positions();
            for id in &joints {
                let (low, high) = (self.range)(&name(id));
                q[id.index()] = rng.random_range(low..high);
            }
            let mut cells: Vec<String> = joints
                .iter()
                .map(|id| format!("{:.7}", q[id.index()]))
                .collect();
            for (_, link, mount) in self.bodies {
                let link = self.robot.link_id(link).expect("there");
                let turn = UnitQuaternion::from_euler_angles(0.2, -0.4, 0.7);
                let mount = Isometry3::from_parts(Vector3::from(*mount).into(), turn);
                let pose = tracker * self.robot.root_from_link(&q, link) * mount;
                for marker in TEMPLATE {
                    let seen = pose * Point3::from(marker);
                    cells.extend(seen.iter().map(|c| {
                        let noise: f64 = StandardNormal.sample(&mut rng);
                        format!("{:.7}", c + MARKER * noise)
                    }));
                }
            }
            text += &(cells.join(",") + "\n");
        }
        text
    }
}

fn profile(bodies: &[(&str, &str, [f64; 3])], recordings: &[(&str, &str)], solve: &str) -> String {
    let mut text = "calib: 1\nrobot: {name: r, urdf: r.urdf}\ntracker: {frame: room, marker_sigma_mm: 0.15}\nbodies:\n".to_owned();
    for (body, link, _) in bodies {
        let markers: Vec<String> = (1..=4).map(|k| format!("{body}_{k}")).collect();
        text += &format!(
            "  {body}: {{link: {link}, markers: [{}]}}\n",
            markers.join(", ")
        );
    }
    text += "recordings:\n";
    for (name, usage) in recordings {
        text += &format!("  {name}: {{file: {name}.csv, use: {usage}}}\n");
    }
    text + "solve:\n  limits: {held_out_rms_mm: 1.0, held_out_max_mm: 3}\n" + solve
}

/// One recording to fit and one to verify.
const TWO: [(&str, &str); 2] = [("poses", "static"), ("checks", "validation")];

/// A folder with the drawing of a robot, its profile, and as many rows of each of [`TWO`].
fn session(
    drawing: &[Joint],
    profile: String,
    cell: &Cell<'_>,
    rows: [usize; 2],
    seed: u64,
) -> Scratch {
    Scratch::new()
        .file("r.urdf", urdf(drawing, 0.0, 0))
        .file("r.yaml", profile)
        .file("poses.csv", cell.table(rows[0], seed))
        .file("checks.csv", cell.table(rows[1], seed + 1))
}

const FREE: &str = "  free: [bodies, tracker, joint_offsets, joint_axes]\n";
const TOOL: [(&str, &str, [f64; 3]); 1] = [("tool", "alink6", [0.05, 0.0, 0.02])];

fn report(dir: &Scratch, profile: &str) -> Value {
    let ran = dir.calib(["run", profile, "--out", "out"]);
    assert!(ran.code < 2, "{}{}", ran.stdout, ran.stderr);
    dir.json("out/report.json")
}

fn ids(report: &Value, of: &str) -> Vec<String> {
    let all = report[of].as_array().expect("a list").iter();
    all.filter_map(|f| f.as_str().or(f["id"].as_str()).map(str::to_owned))
        .collect()
}

fn wide(_: &str) -> (f64, f64) {
    (-1.3, 1.3)
}

fn robot(joints: &[Joint], error: f64, seed: u64) -> RobotModel {
    RobotModel::from_urdf_text(&urdf(joints, error, seed), "r").expect("a robot")
}

/// A body that was fastened again between the second and the third recording; their names are in another order than they were made.
#[test]
fn recordings_are_taken_in_the_order_of_the_profile() {
    let joints = arm("a", "root");
    let moved = [("tool", "alink6", [0.0518, 0.0008, 0.02])];
    for (seed, names) in [(1, ["monday", "friday", "checks"]), (2, ["b", "a", "0"])] {
        let robot = robot(&joints, 1e-3, seed);
        let table = |bodies, rows, seed| {
            let cell = Cell {
                robot: &robot,
                bodies,
                range: &wide,
            };
            cell.table(rows, seed)
        };
        let recordings = [
            (names[0], "static"),
            (names[1], "static"),
            (names[2], "validation"),
        ];
        let dir = Scratch::new()
            .file("r.urdf", urdf(&joints, 0.0, 0))
            .file("r.yaml", profile(&TOOL, &recordings, FREE))
            .file(&format!("{}.csv", names[0]), table(&TOOL, 24, 10 * seed))
            .file(
                &format!("{}.csv", names[1]),
                table(&moved, 24, 10 * seed + 1),
            )
            .file(
                &format!("{}.csv", names[2]),
                table(&moved, 16, 10 * seed + 2),
            );
        let rejected = report(&dir, "r.yaml");
        let split = format!(
            "split: {{recording: {}, at_row: 2, before: [{}]}}",
            names[1], names[0]
        );
        let page = dir.read("out/report.md");
        assert!(page.contains(&split), "{}\n{page}", rejected["diagnosis"]);
        // What the remedy says makes the result right.
        let text = dir
            .read("r.yaml")
            .replace("tool_4]}", &format!("tool_4], {split}}}"));
        let dir = dir.file("split.yaml", text.as_str());
        let accepted = report(&dir, "split.yaml");
        assert_eq!(accepted["verdict"], "accepted", "{}", accepted["reasons"]);
        // As if the validation had been made before: the mount that is published is verified by nothing.
        let before = format!("before: [{}]", names[0]);
        let both = format!("before: [{}, {}]", names[0], names[2]);
        let dir = dir.file("before.yaml", text.replace(&before, &both));
        let open = report(&dir, "before.yaml");
        assert_ne!(open["verdict"], "accepted", "{}", open["reasons"]);
    }
}

#[test]
fn a_body_that_no_held_out_pose_shows_leaves_the_verdict_open() {
    let joints = arm("a", "root");
    let bodies = [
        ("elbow", "alink3", [0.05, 0.06, 0.1]),
        ("tool", "alink6", [0.05, 0.0, 0.02]),
    ];
    let robot = robot(&joints, 1e-3, 3);
    let cell = |bodies| Cell {
        robot: &robot,
        bodies,
        range: &wide,
    };
    for (shown, verdict, unverified) in [
        (&bodies[..], "accepted", Some(&[][..])),
        (&bodies[..1], "not_evaluated", Some(&["a4", "a5", "a6"][..])),
        // What the tool shows of the joints verifies them; the mount at the elbow is verified by nothing.
        (&bodies[1..], "accepted_with_warnings", None),
    ] {
        let dir = Scratch::new()
            .file("r.urdf", urdf(&joints, 0.0, 0))
            .file("r.yaml", profile(&bodies, &TWO, FREE))
            .file("poses.csv", cell(&bodies).table(40, 31))
            .file("checks.csv", cell(shown).table(20, 32));
        let report = report(&dir, "r.yaml");
        assert_eq!(report["verdict"], verdict, "{}", report["reasons"]);
        let facts = report["reason_facts"].as_array().expect("a list").iter();
        let unseen: Vec<_> = facts.filter(|r| r["id"] == "body-not-verified").collect();
        assert_eq!(unseen.len(), usize::from(shown.len() == 1), "{unseen:?}");
        if let (Some(joints), Some(unseen)) = (unverified, unseen.first()) {
            assert_eq!(unseen["values"]["joints"], serde_json::json!(joints));
        }
    }
}

/// Meters under a name that says millimeters, and the other way round.
#[test]
fn a_stated_noise_in_another_unit_is_named_by_a_check() {
    let joints = arm("a", "root");
    let robot = robot(&joints, 1e-3, 9);
    let cell = Cell {
        robot: &robot,
        bodies: &TOOL,
        range: &wide,
    };
    for (stated, kind) in [
        ("0.15", None),
        ("0.00015", Some("above")),
        ("150", Some("below")),
    ] {
        let text = profile(&TOOL, &TWO, FREE);
        let text = text.replace(
            "marker_sigma_mm: 0.15",
            &format!("marker_sigma_mm: {stated}"),
        );
        let dir = session(&joints, text, &cell, [30, 12], 91);
        let ran = dir.calib(["check", "r.yaml", "--json"]);
        let said: Value = serde_json::from_str(&ran.stdout).expect("JSON");
        let findings = said["findings"].as_array().expect("a list").iter();
        let found: Vec<_> = findings.filter(|f| f["id"] == "noise-stated").collect();
        assert_eq!(
            found.first().and_then(|f| f["facts"]["kind"].as_str()),
            kind,
            "{said:#}"
        );
    }
}

/// A turntable that went round twice, and counts its turns.
#[test]
fn a_joint_without_limits_may_go_round() {
    let mut joints = arm("a", "root");
    joints.push(joint(
        "turn",
        "continuous",
        ["root", "plate"],
        [0.7, 0.3, 0.2],
        "0 0 1",
    ));
    let bodies = [TOOL[0], ("work", "plate", [0.1, 0.05, 0.02])];
    let robot = robot(&joints, 1e-3, 4);
    let range = |name: &str| match name {
        "turn" => (-12.5, 12.5),
        _ => wide(name),
    };
    let cell = Cell {
        robot: &robot,
        bodies: &bodies,
        range: &range,
    };
    let text = profile(&bodies, &TWO, FREE);
    let dir = session(&joints, text, &cell, [40, 20], 41);
    assert_eq!(report(&dir, "r.yaml")["verdict"], "accepted");
    // Degrees under a name that says radians are found by how the bodies moved.
    let degrees = |text: String| {
        let scaled = text.lines().enumerate().map(|(row, line)| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            let at = 6;
            if row > 0 {
                let q: f64 = cells[at].parse().expect("a number");
                cells[at] = q.to_degrees().to_string();
            } else {
                assert_eq!(cells[at], "turn_rad");
            }
            cells.join(",") + "\n"
        });
        scaled.collect::<String>()
    };
    let small = |name: &str| match name {
        "turn" => (-0.6, 0.6),
        _ => wide(name),
    };
    let cell = Cell {
        range: &small,
        ..cell
    };
    let dir = dir
        .file("poses.csv", degrees(cell.table(40, 43)))
        .file("checks.csv", degrees(cell.table(20, 44)));
    let ran = dir.calib(["check", "r.yaml", "--json"]);
    let said: Value = serde_json::from_str(&ran.stdout).expect("JSON");
    let findings = said["findings"].as_array().expect("a list").iter();
    let errors: Vec<_> = findings.filter(|f| f["severity"] == "error").collect();
    let all = |f: &&Value| f["id"] == "unit-mismatch" && f["about"]["name"] == "turn";
    assert!(!errors.is_empty() && errors.iter().all(all), "{errors:#?}");
}

/// Two jaws that slide, the second by the first's readings times what the URDF says, and in truth by 6 % more.
#[test]
fn a_jaw_that_follows_by_another_ratio_is_named() {
    let jaws = |ratio: f64| {
        let mut joints = arm("a", "root");
        let jaw = |name: &str, axis| Joint {
            limits: [0.0, 0.05],
            ..joint(
                name,
                "prismatic",
                ["alink6", &format!("{name}_link")],
                [0.15, 0.0, 0.0],
                axis,
            )
        };
        joints.push(jaw("left", "0 1 0"));
        joints.push(Joint {
            mimic: format!("<mimic joint=\"left\" multiplier=\"{ratio}\"/>"),
            ..jaw("right", "0 -1 0")
        });
        joints
    };
    let bodies = [
        ("fl", "left_link", [0.02, 0.01, 0.0]),
        ("fr", "right_link", [0.02, -0.03, 0.0]),
    ];
    let range = |name: &str| match name {
        "left" => (0.0, 0.05),
        _ => wide(name),
    };
    for (ratio, named) in [(1.0, false), (1.06, true)] {
        let robot = robot(&jaws(ratio), 5e-4, 5);
        let cell = Cell {
            robot: &robot,
            bodies: &bodies,
            range: &range,
        };
        let text = profile(&bodies, &TWO, FREE);
        let dir = session(&jaws(1.0), text, &cell, [40, 16], 51);
        let found = report(&dir, "r.yaml");
        let ratios = found["findings"].as_array().expect("a list").iter();
        let ratios: Vec<_> = ratios.filter(|f| f["id"] == "mimic-ratio").collect();
        assert_eq!(
            ratios.iter().any(|f| f["severity"] == "error"),
            named,
            "{ratios:?}"
        );
        assert_eq!(
            found["verdict"] == "accepted",
            !named,
            "{}",
            found["reasons"]
        );
        if named {
            let remedy =
                "  joints: {right: {free: [offset, axis, gain]}}\n  prior: {gain_percent: 25}\n";
            let text = profile(&bodies, &TWO, &format!("{FREE}{remedy}"));
            let dir = dir.file("gain.yaml", text);
            let mended = report(&dir, "gain.yaml");
            assert!(
                mended["verdict"] == "accepted" || mended["verdict"] == "accepted_with_warnings",
                "{}",
                mended["reasons"]
            );
        }
    }
}

/// Two arms of a cell whose second stand is 300 mm from its drawing, as the profile says it may be.
#[test]
fn a_stand_whose_place_is_free_may_be_elsewhere() {
    let cell_of = |off: f64| {
        let mut joints = arm("a", "root");
        joints.push(joint(
            "stand",
            "fixed",
            ["root", "stand_link"],
            [0.9 + off, 0.2 - off, 0.1],
            "",
        ));
        joints.extend(arm("b", "stand_link"));
        joints
    };
    let bodies = [TOOL[0], ("other", "blink6", [0.04, 0.01, 0.02])];
    let robot = robot(&cell_of(0.2), 1e-3, 6);
    let cell = Cell {
        robot: &robot,
        bodies: &bodies,
        range: &wide,
    };
    let placed =
        format!("{FREE}  joints: {{stand: {{free: [origin], sigma_mm: 300, sigma_deg: 5}}}}\n");
    let text = profile(&bodies, &TWO, &placed);
    let dir = session(&cell_of(0.0), text, &cell, [40, 16], 61)
        .file("held.yaml", profile(&bodies, &TWO, FREE));
    let accepted = report(&dir, "r.yaml");
    assert_eq!(accepted["verdict"], "accepted", "{}", accepted["reasons"]);
    // Where the profile holds the stand, that the arms are not seen in one frame is an error as before.
    assert_eq!(dir.calib(["check", "held.yaml"]).code, 3);
}

/// The robot is off by several millimeters, and the profile frees nothing of it. Its postures follow each other as in a scan, so that its errors look
/// like a change on the way.
#[test]
fn a_profile_that_frees_no_joint_is_told_so() {
    let joints = arm("a", "root");
    let held = "  free: [bodies, tracker]\n";
    let scanned = |table: &str| {
        let (header, rows) = table.split_once('\n').expect("a header");
        let mut rows: Vec<&str> = rows.lines().collect();
        let first = |row: &&str| row.split(',').next().and_then(|q| q.parse::<f64>().ok());
        rows.sort_by(|a, b| first(a).partial_cmp(&first(b)).expect("numbers"));
        format!("{header}\n{}\n", rows.join("\n"))
    };
    for (error, named) in [(3e-3, true), (0.0, false)] {
        for seed in 0..4 {
            let robot = robot(&joints, error, 7 + seed);
            let cell = Cell {
                robot: &robot,
                bodies: &TOOL,
                range: &wide,
            };
            let text = profile(&TOOL, &TWO, held);
            let dir = session(&joints, text, &cell, [60, 20], 100 + 10 * seed);
            let poses = scanned(&dir.read("poses.csv"));
            let dir = dir.file("poses.csv", poses);
            let found = report(&dir, "r.yaml");
            let findings = ids(&found, "findings");
            let changed = |id: &String| id.contains("changed") || id.contains("missing");
            assert!(!findings.iter().any(changed), "{error}: {findings:?}");
            let verdict = &found["verdict"];
            assert_eq!(verdict == "rejected", named, "{}", found["reasons"]);
            let said = found["diagnosis"]["evidence"] == "joints-held";
            assert_eq!(said, named, "{error}, {seed}: {}", found["diagnosis"]);
        }
    }
}
