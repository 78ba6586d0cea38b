//! Two bodies that have each other's names in some rows: put right where their shapes tell, named where only the robot's motion does.

use crate::scratch;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;
use serde_json::Value;

/// σ of one marker coordinate, m.
const MARKER: f64 = 1e-4;
/// The markers of a body on its link, m; those of the other lie up to 2 mm elsewhere, so that a tracker takes one for the other.
const BODY: [[f64; 3]; 4] = [
    [0.05, 0.0, 0.1],
    [0.12, 0.01, 0.06],
    [0.02, 0.08, 0.08],
    [0.0, 0.03, 0.14],
];
const OTHER: [[f64; 3]; 4] = [
    [0.051, 0.001, 0.098],
    [0.118, 0.012, 0.061],
    [0.021, 0.078, 0.081],
    [-0.001, 0.031, 0.142],
];

/// Kind, axis and origin, m, of each joint.
type Joint = (&'static str, &'static str, [f64; 3]);

const ARM: &[Joint] = &[
    ("revolute", "0 0 1", [0.0, 0.0, 0.32]),
    ("revolute", "0 1 0", [0.05, 0.07, 0.1]),
    ("revolute", "0 1 0", [0.0, -0.03, 0.45]),
    ("revolute", "0 0 1", [0.04, 0.0, 0.25]),
    ("revolute", "0 1 0", [0.0, 0.0, 0.22]),
    ("revolute", "0 0 1", [0.0, 0.0, 0.09]),
];

/// An arm on a base that slides.
const MOBILE: &[Joint] = &[
    ("prismatic", "1 0 0", [0.0, 0.0, 0.2]),
    ("prismatic", "0 1 0", [0.0, 0.0, 0.0]),
    ("revolute", "0 0 1", [0.0, 0.0, 0.1]),
    ("revolute", "0 1 0", [0.1, 0.0, 0.3]),
    ("revolute", "0 1 0", [0.0, 0.0, 0.4]),
    ("revolute", "1 0 0", [0.3, 0.0, 0.05]),
];

/// The robot with every origin off by a vector of this size, m, and its axes by as many rad.
fn urdf(joints: &[Joint], error: f64, seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut text = "<robot name=\"arm\">\n  <link name=\"l0\"/>\n".to_owned();
    for (i, (kind, axis, origin)) in joints.iter().enumerate() {
        let mut off = || -> f64 { error * rng.random_range(-1.0..1.0) };
        let [x, y, z] = origin.map(|c| c + off());
        let [r, p, w] = [off(), off(), off()];
        text += &format!(
            "  <link name=\"l{n}\"/>\n  <joint name=\"j{n}\" type=\"{kind}\">\n    <parent link=\"l{i}\"/>\n    <child link=\"l{n}\"/>\n    \
             <origin xyz=\"{x} {y} {z}\" rpy=\"{r} {p} {w}\"/>\n    <axis xyz=\"{axis}\"/>\n    <limit lower=\"-3\" upper=\"3\" effort=\"50\" velocity=\"2\"/>\n  </joint>\n",
            n = i + 1
        );
    }
    text + "</robot>\n"
}

/// How the robot was moved.
#[derive(Clone, Copy, PartialEq)]
enum Design {
    Random,
    /// One joint after the other, eight rows each.
    Sweeps,
    /// Many random rows, of which no single one weighs.
    Many,
}

/// What the tracker writes.
#[derive(Clone, Copy, PartialEq)]
enum Written {
    Markers,
    Poses,
    /// So many markers of each body, one or two, which show no pose.
    Points(usize),
}

/// What is exchanged in a row.
#[derive(Clone, Copy, PartialEq)]
enum Exchange {
    Nothing,
    Bodies,
    /// Marker 2 of the one and marker 3 of the other.
    OneMarker,
    /// Nothing, but the tracker took something else for the hand's first marker.
    Ghost,
}

/// Joint positions, rad or m.
fn motions(joints: &[Joint], design: Design, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    let reach = |k: usize| if joints[k].0 == "prismatic" { 0.8 } else { 1.6 };
    let n = joints.len();
    let mut random = || -> Vec<f64> {
        (0..n)
            .map(|k| reach(k) * rng.random_range(-1.0..1.0))
            .collect()
    };
    match design {
        Design::Random => (0..40).map(|_| random()).collect(),
        Design::Many => (0..500).map(|_| random()).collect(),
        Design::Sweeps => {
            let home = random();
            let row = |row: usize| {
                let mut q = home.clone();
                q[row / 8] = reach(row / 8) * ((row % 8) as f64 / 3.5 - 1.0);
                q
            };
            (0..8 * n).map(row).collect()
        }
    }
}

/// Markers of a body that are written.
fn count(written: Written) -> usize {
    match written {
        Written::Points(count) => count,
        _ => 4,
    }
}

fn markers_of(body: &str, written: Written) -> Vec<String> {
    let numbers = 1..=count(written);
    numbers.map(|k| format!("{body}_{k}")).collect()
}

fn table(
    robot: &RobotModel,
    motions: &[Vec<f64>],
    written: Written,
    exchange: impl Fn(usize) -> Exchange,
    seed: u64,
) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let tracker_from_root = Isometry3::from_parts(
        Translation3::new(0.9, 0.3, 0.1),
        UnitQuaternion::from_euler_angles(0.02, -0.03, 0.7),
    );
    let n = motions[0].len();
    let bodies = [
        ("hand", format!("l{n}"), BODY),
        ("elbow", "l3".to_owned(), OTHER),
    ];
    let slides = |k: usize| !robot.joints()[k].kind.turns();
    let mut names: Vec<String> = (0..n)
        .map(|k| format!("j{}_{}", k + 1, if slides(k) { "m" } else { "rad" }))
        .collect();
    for (name, ..) in &bodies {
        match written {
            Written::Markers | Written::Points(_) => names.extend(
                markers_of(name, written)
                    .iter()
                    .flat_map(|m| ["x", "y", "z"].map(|c| format!("{m}.{c}_m"))),
            ),
            Written::Poses => names.extend(
                ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"].map(|c| format!("{name}.{c}")),
            ),
        }
    }
    let mut text = names.join(",") + "\n";
    for (row, q) in motions.iter().enumerate() {
        let mut seen = bodies.each_ref().map(|(_, link, markers)| {
            let tracker_from_link =
                tracker_from_root * robot.root_from_link(q, robot.link_id(link).expect("there"));
            markers.map(|marker| {
                let noise = Vector3::from_fn(|_, _| {
                    let n: f64 = StandardNormal.sample(&mut rng);
                    MARKER * n
                });
                (tracker_from_link * Point3::from(marker)).coords + noise
            })
        });
        match exchange(row) {
            Exchange::Nothing => {}
            Exchange::Ghost => seen[0][0].y += 0.03,
            Exchange::Bodies => seen.swap(0, 1),
            Exchange::OneMarker => {
                let [first, second] = &mut seen;
                std::mem::swap(&mut first[1], &mut second[2]);
            }
        }
        let mut cells: Vec<String> = q.iter().map(|q| format!("{q:.6}")).collect();
        for markers in seen {
            match written {
                Written::Markers | Written::Points(_) => cells.extend(
                    markers[..count(written)]
                        .iter()
                        .flat_map(|m| m.iter().map(|v| format!("{v:.7}"))),
                ),
                Written::Poses => {
                    let turned = UnitQuaternion::face_towards(
                        &(markers[1] - markers[0]),
                        &(markers[2] - markers[0]),
                    );
                    let middle = markers.iter().sum::<Vector3<f64>>() / 4.0;
                    let values = middle.iter().chain(turned.coords.iter());
                    cells.extend(values.map(|v| format!("{v:.7}")));
                }
            }
        }
        text += &(cells.join(",") + "\n");
    }
    text
}

/// Rows of the validation, which was recorded after the others.
const CHECKS: usize = 1000;

fn session(
    joints: &[Joint],
    design: Design,
    written: Written,
    exchange: impl Fn(usize) -> Exchange,
    seed: u64,
) -> Scratch {
    let robot = RobotModel::from_urdf_text(&urdf(joints, 2e-3, seed), "arm").expect("a robot");
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 50);
    let poses = table(
        &robot,
        &motions(joints, design, &mut rng),
        written,
        &exchange,
        seed,
    );
    let random = motions(joints, Design::Random, &mut rng);
    let checks = table(
        &robot,
        &random[..12],
        written,
        |row| exchange(CHECKS + row),
        seed + 100,
    );
    let body = |name: &str| match written {
        Written::Markers | Written::Points(_) => {
            format!("markers: [{}]", markers_of(name, written).join(", "))
        }
        Written::Poses => "pose: true".to_owned(),
    };
    let profile = format!(
        "calib: 1\nrobot: {{name: arm, urdf: arm.urdf}}\ntracker: {{frame: lab}}\nbodies:\n  hand: {{link: l{}, {}}}\n  elbow: {{link: l3, {}}}\n\
         recordings:\n  poses: {{file: poses.csv, use: static}}\n  checks: {{file: checks.csv, use: validation}}\n\
         solve:\n  free: [bodies, tracker, joint_offsets, joint_axes]\n  limits: {{held_out_rms_mm: 1}}\n",
        joints.len(),
        body("hand"),
        body("elbow"),
    );
    Scratch::new()
        .file("arm.urdf", urdf(joints, 0.0, 0))
        .file("poses.csv", poses)
        .file("checks.csv", checks)
        .file("arm.yaml", profile)
}

fn report(dir: &Scratch) -> Value {
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    dir.json("out/report.json")
}

fn findings(report: &Value) -> Vec<&Value> {
    report["findings"]
        .as_array()
        .expect("a list")
        .iter()
        .collect()
}

/// From the middle on, up to there, and in three rows.
fn late(row: usize) -> bool {
    row >= 20
}
fn early(row: usize) -> bool {
    !late(row)
}
fn few(row: usize) -> bool {
    [4, 11, 12].contains(&row)
}

#[test]
fn bodies_whose_shapes_differ_are_put_right() {
    for (joints, design, seed) in [
        (ARM, Design::Random, 1),
        (ARM, Design::Sweeps, 2),
        (MOBILE, Design::Random, 3),
    ] {
        let clean = report(&session(
            joints,
            design,
            Written::Markers,
            |_| Exchange::Nothing,
            seed,
        ));
        for (exchange, kind) in [
            (Exchange::Bodies, "bodies_in_rows"),
            (Exchange::OneMarker, "markers_in_rows"),
        ] {
            for wrong in [late, early, few] {
                let of_row = |row| {
                    if wrong(row) {
                        exchange
                    } else {
                        Exchange::Nothing
                    }
                };
                let mended = report(&session(joints, design, Written::Markers, of_row, seed));
                let found = findings(&mended)
                    .into_iter()
                    .filter(|f| f["id"] == "marker-swap-repaired");
                let found: Vec<&Value> = found.collect();
                // One marker of each in a whole recording is found otherwise, without rows.
                let in_rows = found.iter().filter(|f| f["facts"]["kind"] == kind);
                let rows = if design == Design::Sweeps { 48 } else { 40 };
                let tables = [(0, rows), (CHECKS, 12)].map(|(first, count)| -> Vec<usize> {
                    let rows = (0..count).filter(|row| wrong(first + row));
                    rows.map(|row| row + 2).collect()
                });
                let whole = |rows: &Vec<usize>| rows.len() == 12 && exchange == Exchange::OneMarker;
                let expected = tables
                    .iter()
                    .filter(|rows| !rows.is_empty() && !whole(rows));
                let expected: Vec<_> = expected.collect();
                let found: Vec<&Value> = in_rows.map(|f| &f["rows"]).collect();
                let found = serde_json::json!(found);
                assert_eq!(found, serde_json::json!(expected), "{seed} {kind}");
                assert_eq!(mended["transforms"], clean["transforms"]);
            }
        }
    }
}

#[test]
fn bodies_of_which_only_poses_are_known_are_named() {
    for (joints, design, seed) in [
        (ARM, Design::Random, 1),
        (ARM, Design::Sweeps, 2),
        (MOBILE, Design::Random, 3),
    ] {
        let checked = |wrong: fn(usize) -> bool| {
            let of_row = |row| {
                if wrong(row) {
                    Exchange::Bodies
                } else {
                    Exchange::Nothing
                }
            };
            session(joints, design, Written::Poses, of_row, seed).calib(["check", "arm.yaml"])
        };
        let from = checked(late);
        assert_eq!(from.code, 3, "{}", from.stdout);
        let words = from.words();
        assert!(
            words.contains("Bodies `elbow` and `hand` have each other's names from row 22 on"),
            "{words}"
        );
        let to = checked(early);
        assert!(
            to.words().contains("have each other's names up to row 21"),
            "{}",
            to.stdout
        );
        let some = checked(few);
        assert_eq!(some.code, 0, "{}", some.stdout);
        let words = some.words();
        assert!(
            words.contains("In 3 rows bodies `elbow` and `hand` have each other's names"),
            "{words}"
        );
        assert!(!words.contains("disagree"), "{words}");
    }
}

/// Three rows in ten are too many for a registration of all rows, which single rows could be judged by.
#[test]
fn bodies_of_which_only_poses_are_known_are_named_in_scattered_rows() {
    for (joints, design, seed) in [
        (ARM, Design::Random, 1),
        (ARM, Design::Sweeps, 2),
        (MOBILE, Design::Random, 3),
        (ARM, Design::Many, 4),
    ] {
        let often = |row: usize| row < CHECKS && row % 10 % 4 == 1;
        let of_row = |row| match often(row) {
            true => Exchange::Bodies,
            false => Exchange::Nothing,
        };
        let dir = session(joints, design, Written::Poses, of_row, seed);
        let said = dir.calib(["check", "arm.yaml", "--json"]);
        assert_eq!(said.code, 3, "{}", said.stdout);
        let said: Value = serde_json::from_str(&said.stdout).expect("JSON");
        let found = findings(&said);
        let errors: Vec<&Value> = found
            .into_iter()
            .filter(|f| f["severity"] == "error")
            .collect();
        let [only] = errors[..] else {
            panic!("{errors:?}");
        };
        assert_eq!(only["id"], "row-outlier", "{only}");
        assert_eq!(only["facts"]["kind"], "exchanged");
        let rows = match design {
            Design::Random => 40,
            Design::Sweeps => 48,
            Design::Many => 500,
        };
        let rows: Vec<usize> = (0..rows).filter(|r| often(*r)).map(|r| r + 2).collect();
        assert_eq!(only["rows"], serde_json::json!(rows), "{seed}");
    }
}

/// One or two markers show no pose, and are judged beside the fit.
#[test]
fn rows_of_bodies_without_a_pose_are_named() {
    for (design, markers) in [
        (Design::Random, 1),
        (Design::Random, 2),
        (Design::Sweeps, 1),
        (Design::Sweeps, 2),
    ] {
        let of = |wrong: Exchange| {
            let of_row = move |row| match few(row) {
                true => wrong,
                false => Exchange::Nothing,
            };
            let dir = session(ARM, design, Written::Points(markers), of_row, 1);
            let said = dir.calib(["check", "arm.yaml"]).words();
            let report = report(&dir);
            let found: Vec<Value> = findings(&report)
                .into_iter()
                .filter(|f| f["id"] == "row-outlier")
                .cloned()
                .collect();
            (found, said)
        };
        let (none, said) = of(Exchange::Nothing);
        assert!(none.is_empty() && said.contains("no findings"), "{said}");

        let (found, said) = of(Exchange::Bodies);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0]["facts"]["kind"], "exchanged_few");
        assert_eq!(found[0]["rows"], serde_json::json!([6, 13, 14]));
        assert!(
            said.contains("In 3 rows bodies `elbow` and `hand` have each other's names"),
            "{said}"
        );

        let (found, said) = of(Exchange::Ghost);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0]["rows"], serde_json::json!([6, 13, 14]));
        assert!(
            said.contains("In 3 rows the body deviates by up to"),
            "{said}"
        );
    }
}

/// A body that moves little in most rows, as in sweeps of a base that slides, is not wrong where it moves far.
#[test]
fn rows_far_along_a_slide_are_not_named() {
    for seed in 0..6 {
        for written in [Written::Markers, Written::Poses] {
            let dir = session(MOBILE, Design::Sweeps, written, |_| Exchange::Nothing, seed);
            let said = dir.calib(["check", "arm.yaml"]);
            assert_eq!(said.code, 0, "{}", said.stdout);
            assert!(
                said.words().contains("no findings"),
                "{seed}: {}",
                said.stdout
            );
        }
    }
}
