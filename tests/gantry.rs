//! Robots with sliding joints: shares of a sliding joint's motion in that of a turning one and the other way round, and what the first profile makes of their tables.

use crate::scratch;

use std::fmt::Write as _;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;
use serde_json::Value;

/// σ of one marker coordinate, m.
const MARKER: f64 = 2e-4;

/// Name, kind, origin, axis and range (m or rad) of each joint, from the base on.
type Joint = (
    &'static str,
    &'static str,
    &'static str,
    &'static str,
    [f64; 2],
);

const JOINTS: [Joint; 5] = [
    ("gx", "prismatic", "0 0 1.2", "1 0 0", [0.1, 1.4]),
    ("gy", "prismatic", "0 0 0", "0 1 0", [0.1, 0.9]),
    ("gz", "prismatic", "0 0 0", "0 0 -1", [0.1, 0.5]),
    ("gc", "revolute", "0 0 -0.1", "0 0 1", [-2.4, 2.4]),
    ("ga", "revolute", "0 0 -0.15", "1 0 0", [-1.2, 1.2]),
];

const PROFILE: &str = "calib: 1
robot: {name: gantry, urdf: gantry/gantry.urdf}
tracker: {frame: lab, marker_sigma_mm: 0.2}
bodies:
  tool: {link: l5, markers: [t1, t2, t3]}
recordings:
  poses: {file: gantry/poses.csv, use: static}
  checks: {file: gantry/checks.csv, use: validation}
solve:
  free: [bodies, tracker, joint_offsets, joint_axes]
  limits: {held_out_rms_mm: 1}
";

/// A SCARA: symmetric about the planes through its parallel axes, so that its mirror image is the arm with the quill reversed.
const SCARA: [Joint; 4] = [
    ("j1", "revolute", "0 0 0.3", "0 0 1", [-2.0, 2.0]),
    ("j2", "revolute", "0.4 0 0", "0 0 1", [-2.2, 2.2]),
    ("quill", "prismatic", "0.3 0 0", "0 0 -1", [0.02, 0.17]),
    ("j4", "revolute", "0 0 -0.1", "0 0 1", [-2.9, 2.9]),
];

/// An arm on a lift.
const LIFT: [Joint; 5] = [
    ("lift", "prismatic", "0 0 0.4", "0 0 1", [0.05, 0.4]),
    ("turn", "revolute", "0 0 0.3", "0 0 1", [-1.9, 1.9]),
    ("tilt", "revolute", "0.1 0 0.2", "0 1 0", [-1.4, 0.7]),
    ("elbow", "revolute", "0.4 0 0", "0 1 0", [-0.5, 1.9]),
    ("roll", "revolute", "0.3 0 0", "1 0 0", [-1.7, 1.7]),
];

fn urdf() -> String {
    urdf_of(&JOINTS)
}

fn urdf_of(joints: &[Joint]) -> String {
    let mut text = String::from("<robot name=\"gantry\">\n  <link name=\"l0\"/>\n");
    for (i, (name, kind, xyz, axis, _)) in joints.iter().enumerate() {
        let _ = writeln!(
            text,
            "  <link name=\"l{}\"/>\n  <joint name=\"{name}\" type=\"{kind}\">\n    <parent link=\"l{i}\"/>\n    <child link=\"l{}\"/>\n    \
             <origin xyz=\"{xyz}\" rpy=\"0 0 0\"/>\n    <axis xyz=\"{axis}\"/>\n    <limit lower=\"-3\" upper=\"3\" effort=\"50\" velocity=\"2\"/>\n  </joint>",
            i + 1,
            i + 1
        );
    }
    text + "</robot>\n"
}

/// By how much the joint `of` follows the joint `with` (numbers in [`JOINTS`]), m or rad per m or rad.
#[derive(Clone, Copy)]
struct Share {
    of: usize,
    with: usize,
    factor: f64,
}

fn recording(robot: &RobotModel, share: Option<Share>, n: usize, seed: u64) -> String {
    recording_of(robot, &JOINTS, share, n, seed)
}

fn recording_of(
    robot: &RobotModel,
    joints: &[Joint],
    share: Option<Share>,
    n: usize,
    seed: u64,
) -> String {
    scattered(robot, joints, share, [0.0; 2], n, seed)
}

/// With slides and turns that rest off their readings by `scatter` (σ, m and rad), drawn again for every pose.
fn scattered(
    robot: &RobotModel,
    joints: &[Joint],
    share: Option<Share>,
    scatter: [f64; 2],
    n: usize,
    seed: u64,
) -> String {
    let mut drawn = ChaCha8Rng::seed_from_u64(seed + 5000);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let tracker_from_root = Isometry3::from_parts(
        Translation3::new(0.9, 0.3, 0.1),
        UnitQuaternion::from_euler_angles(0.02, -0.03, 0.7),
    );
    let tool = [[0.05, 0.0, 0.1], [0.12, 0.01, 0.06], [0.02, 0.08, 0.08]];
    let column = |(name, kind, ..): &Joint| match *kind {
        "prismatic" => format!("{name}_m"),
        _ => format!("{name}_rad"),
    };
    let mut text = joints.iter().map(column).collect::<Vec<_>>().join(",");
    for k in 1..=3 {
        let _ = write!(text, ",t{k}_x_mm,t{k}_y_mm,t{k}_z_mm");
    }
    text.push('\n');
    let tip = format!("l{}", joints.len());
    let link = robot.link_id(&tip).expect("there");
    for _ in 0..n {
        let ranges = joints.iter().map(|joint| joint.4[0]..joint.4[1]);
        let q: Vec<f64> = ranges.map(|range| rng.random_range(range)).collect();
        // Zeros that the fit finds.
        let mut true_q = q.clone();
        true_q[joints.len() - 2] += 0.004;
        true_q[joints.len() - 1] -= 0.003;
        if let Some(Share { of, with, factor }) = share {
            true_q[of] += factor * q[with];
        }
        for (true_q, joint) in true_q.iter_mut().zip(joints) {
            let sigma = scatter[usize::from(joint.1 != "prismatic")];
            let n: f64 = StandardNormal.sample(&mut drawn);
            *true_q += sigma * n;
        }
        let tracker_from_link = tracker_from_root * robot.root_from_link(&true_q, link);
        let mut cells: Vec<String> = q.iter().map(|v| format!("{v:.9}")).collect();
        for p in tool {
            let noise = Vector3::from_fn(|_, _| {
                let n: f64 = StandardNormal.sample(&mut rng);
                MARKER * n
            });
            let seen = (tracker_from_link * Point3::from(p)).coords + noise;
            cells.extend(seen.iter().map(|v| format!("{:.6}", v * 1e3)));
        }
        text += &(cells.join(",") + "\n");
    }
    text
}

fn gantry(share: Option<Share>, seed: u64) -> Scratch {
    let robot = RobotModel::from_urdf_text(&urdf(), "true").expect("a robot");
    Scratch::new()
        .file("gantry/gantry.urdf", urdf())
        .file("gantry.yaml", PROFILE)
        .file("gantry/poses.csv", recording(&robot, share, 50, seed))
        .file(
            "gantry/checks.csv",
            recording(&robot, share, 15, seed + 1000),
        )
}

fn run(dir: &Scratch) -> Value {
    dir.calib(["run", "gantry.yaml", "--out", "out"]);
    dir.json("out/report.json")
}

/// Findings that are more than information.
fn warnings(report: &Value) -> Vec<&Value> {
    let all = report["findings"].as_array().expect("findings").iter();
    all.filter(|f| f["severity"] != "info").collect()
}

fn held_out(report: &Value) -> f64 {
    let rms = &report["verification"]["held_out"]["calibrated"]["rms_m"];
    rms.as_f64().expect("measured")
}

#[test]
fn a_share_of_a_sliding_joint_in_a_turning_one_is_named_and_verified() {
    // 0.02 rad of `ga` per meter of `gy`; 0.5 mm of `gz` per radian of `gc`.
    for (of, with, factor, names) in [(4, 1, 0.02, ["ga", "gy"]), (2, 3, 5e-4, ["gz", "gc"])] {
        let [of_name, with_name] = names;
        let parameter = format!("{of_name}.coupling.{with_name}");
        for seed in [1, 2, 3] {
            let dir = gantry(Some(Share { of, with, factor }), seed);
            let report = run(&dir);
            let found = warnings(&report);
            let named =
                |f: &&Value| f["id"] == "missing-physics" && f["facts"]["parameter"] == *parameter;
            assert!(found.iter().any(named), "{parameter} {seed}: {found:#?}");
            let coupled =
                format!("solve:\n  joints: {{{of_name}: {{coupled_to: [{with_name}]}}}}\n");
            let dir = dir.edit("gantry.yaml", "solve:\n", &coupled);
            let with_it = run(&dir);
            let better = held_out(&with_it) / held_out(&report);
            assert!(better < 0.9, "{parameter} {seed}: {better}");
            let left = warnings(&with_it);
            let missing = left.iter().any(|f| f["id"] == "missing-physics");
            assert!(!missing, "{parameter} {seed}: {left:#?}");
            let all = with_it["parameters"].as_array().expect("a list");
            let estimate = all.iter().find(|p| p["name"] == *parameter);
            let estimate = estimate.or_else(|| {
                let coupling = format!("{of_name}.coupling");
                all.iter().find(|p| p["name"] == *coupling)
            });
            let estimate = estimate.expect("freed");
            let of = |key: &str| estimate[key].as_f64().expect("a number");
            assert!(
                (of("value") - factor).abs() < 4.0 * of("sigma"),
                "{estimate}"
            );
        }
    }
}

#[test]
fn a_gantry_that_is_in_order_has_no_share() {
    for seed in [11, 12, 13, 14] {
        let report = run(&gantry(None, seed));
        let found = warnings(&report);
        assert!(found.is_empty(), "{seed}: {found:#?}");
        let verdict = report["verdict"].as_str().expect("a word");
        assert!(verdict.starts_with("accepted"), "{seed}: {verdict}");
    }
}

/// A gain of one slide is what a wrong scale of the tracker looks like, unless another slide has none.
#[test]
fn a_gain_that_is_a_scale_as_well_is_said() {
    let gain = Share {
        of: 0,
        with: 0,
        factor: 0.004,
    };
    let said = |free: &str| -> Option<Value> {
        let dir = gantry(Some(gain), 31).edit("gantry.yaml", "solve:\n", free);
        let report = run(&dir);
        let found = warnings(&report);
        let one = found.into_iter().find(|f| f["id"] == "gain-or-scale");
        one.cloned()
    };
    let alone = said("solve:\n  joints: {gx: {free: [offset, axis, gain]}}\n");
    let alone = alone.expect("a finding");
    assert_eq!(alone["facts"]["joint"], "gx", "{alone:#}");
    let excess = alone["facts"]["excess"]["value"].as_f64();
    assert!((excess.expect("a ratio") - 0.004).abs() < 5e-4, "{alone:#}");
    let each = ["gx", "gy", "gz"].map(|joint| format!("{joint}: {{free: [offset, axis, gain]}}"));
    let all = format!("solve:\n  joints: {{{}}}\n", each.join(", "));
    assert_eq!(said(&all), None);
}

/// All slides in centimeters under names that say millimeters: their unit is named, not the tracker's alone, and as it says all is right.
#[test]
fn slides_in_centimeters_are_not_a_tracker_in_another_unit() {
    let mut dir = gantry(None, 6);
    for file in ["gantry/poses.csv", "gantry/checks.csv"] {
        let text = dir.read(file);
        let (head, rows) = text.split_once('\n').expect("a header");
        let head = ["gx", "gy", "gz"]
            .iter()
            .fold(head.to_owned(), |head, joint| {
                head.replace(&format!("{joint}_m"), &format!("{joint}_mm"))
            });
        let in_centimeters = |row: &str| {
            let cells = row.split(',').enumerate().map(|(k, cell)| match k {
                0..3 => (100.0 * cell.parse::<f64>().expect("a number")).to_string(),
                _ => cell.to_owned(),
            });
            cells.collect::<Vec<_>>().join(",")
        };
        let rows: Vec<String> = rows.lines().map(in_centimeters).collect();
        dir = dir.file(file, format!("{head}\n{}\n", rows.join("\n")));
    }
    let said = dir.calib(["check", "gantry.yaml"]).expect(3).stdout;
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    for part in [
        "all prismatic joints read as cm instead of mm",
        "`gx_cm` instead of `gx_mm`",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let mut dir = dir;
    for file in ["gantry/poses.csv", "gantry/checks.csv"] {
        for joint in ["gx", "gy", "gz"] {
            dir = dir.edit(file, &format!("{joint}_mm"), &format!("{joint}_cm"));
        }
    }
    let verdict = run(&dir)["verdict"].to_string();
    assert!(verdict.contains("accepted"), "{verdict}");
}

/// One slide in centimeters under a name that says millimeters, of a robot that turns as well: that is its unit, and no gear.
#[test]
fn one_slide_in_centimeters_is_named() {
    let robot = RobotModel::from_urdf_text(&urdf_of(&LIFT), "lift.urdf").expect("a robot");
    let centimeters = |table: String| {
        let (head, rows) = table.split_once('\n').expect("a header");
        let rows = rows.lines().map(|row| {
            let (lift, rest) = row.split_once(',').expect("cells");
            let lift: f64 = lift.parse().expect("a number");
            format!("{},{rest}\n", 100.0 * lift)
        });
        format!(
            "{}\n{}",
            head.replace("lift_m", "lift_mm"),
            rows.collect::<String>()
        )
    };
    let table = |n, seed| centimeters(recording_of(&robot, &LIFT, None, n, seed));
    let dir = Scratch::new()
        .file("gantry/gantry.urdf", urdf_of(&LIFT))
        .file("gantry.yaml", PROFILE)
        .file("gantry/poses.csv", table(40, 7))
        .file("gantry/checks.csv", table(12, 8));
    let said = dir.calib(["check", "gantry.yaml"]).expect(3).stdout;
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        said.contains("joint `lift` read as cm instead of mm"),
        "{said}"
    );
    assert!(said.contains("column `lift_mm` to `lift_cm`"), "{said}");
}

/// A share between joints of two kinds has a unit; it is no percentage.
#[test]
fn a_large_share_between_unlike_joints_is_said_in_its_unit() {
    for (of, with, factor, unit, shown) in [
        (4, 1, 0.3, "rad/m", "°/m"),
        (2, 3, 0.01, "m/rad", " mm/rad"),
    ] {
        let dir = gantry(Some(Share { of, with, factor }), 21);
        let checked = dir.calib(["check", "gantry.yaml", "--json"]).json();
        let found = warnings(&checked);
        let coupling = found.iter().find(|f| f["id"] == "joint-coupling");
        let coupling = coupling.unwrap_or_else(|| panic!("{of} {with}: {found:#?}"));
        let facts = &coupling["facts"];
        assert_eq!(facts["factor"]["unit"], unit, "{coupling:#}");
        let value = facts["factor"]["value"].as_f64().expect("a number");
        assert!((value - factor).abs() < 0.1 * factor, "{coupling:#}");
        let text = coupling["text"].as_str().expect("a text");
        assert!(text.contains(shown) && !text.contains('%'), "{text}");
    }
}

/// The tables of a robot whose joints are called otherwise, and without the columns of some.
fn recorded(dir: &Scratch, file: &str, without: &str) -> String {
    let text = dir.read(file);
    let mut kept = Vec::new();
    let mut rows = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        if i == 0 {
            kept = (0..cells.len())
                .filter(|k| cells[*k].split('_').next() != Some(without))
                .collect();
        }
        let cells: Vec<&str> = kept.iter().map(|k| cells[*k]).collect();
        rows.push(cells.join(","));
    }
    rows.join("\n") + "\n"
}

/// Of each sliding joint the column was forgotten: it is named, and neither the tracker nor a limit is blamed.
#[test]
fn a_sliding_joint_that_moved_without_a_column_is_named() {
    for joint in ["gx", "gy", "gz"] {
        let mut dir = gantry(None, 3);
        for file in ["gantry/poses.csv", "gantry/checks.csv"] {
            let text = recorded(&dir, file, joint);
            dir = dir.file(file, text);
        }
        let said = dir.calib(["check", "gantry.yaml"]).expect(3).stdout;
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(
            said.contains(&format!("error[joint-column-missing] poses: {joint} ")),
            "{said}"
        );
        assert!(
            said.contains(&format!("if joint `{joint}`, which has no column, moved")),
            "{said}"
        );
    }
}

/// Joints that are called like coordinates: their columns are no marker.
#[test]
fn a_gantry_whose_joints_are_called_x_y_and_z_is_read() {
    let coordinates = |text: &str| {
        ["x", "y", "z"].iter().fold(text.to_owned(), |text, axis| {
            text.replace(&format!("g{axis}_m"), &format!("{axis}_m"))
                .replace(&format!("\"g{axis}\""), &format!("\"{axis}\""))
        })
    };
    let mut dir = gantry(None, 3);
    for file in [
        "gantry/gantry.urdf",
        "gantry/poses.csv",
        "gantry/checks.csv",
    ] {
        let text = coordinates(&dir.read(file));
        dir = dir.file(file, text);
    }
    let report = run(&dir);
    assert_eq!(report["verdict"], "accepted", "{:#}", report["findings"]);
    let named = gantry(None, 3);
    let residual = |report: &Value| report["fit"]["chi2_per_dof"].as_f64().expect("a number");
    assert_eq!(residual(&report), residual(&run(&named)));

    // What uses the result reads them as the run did.
    const MODEL: &str = "out/gantry.calibrated.model.json";
    let [own, other] = [&dir, &named].map(|dir| {
        let ran = dir.calib(["predict", MODEL, "gantry/checks.csv"]);
        assert!(!ran.stderr.contains("without a column"), "{}", ran.stderr);
        ran.stdout
    });
    // Without the scope, which names a joint where a row is outside.
    let rows = |text: &str| -> Vec<String> {
        let cells = text.lines().map(|line| line.splitn(3, ','));
        cells
            .map(|cells| cells.last().unwrap_or_default().to_owned())
            .collect()
    };
    assert!(rows(&own).len() > 5);
    assert_eq!(rows(&own), rows(&other));
    let ran = dir.calib(["correct", MODEL, "gantry/checks.csv"]);
    let header = ran.stdout.lines().next().unwrap_or_default();
    assert!(
        header.starts_with("line,joint:x_m,joint:y_m,joint:z_m,gc_deg"),
        "{header}"
    );
    // A corrected program is a program.
    let corrected = ran.expect(0).stdout;
    let dir = dir.file("corrected.csv", corrected);
    let ran = dir.calib(["predict", MODEL, "corrected.csv"]).expect(0);
    assert_eq!(rows(&ran.stdout).len(), rows(&own).len());
}

/// A wrist whose zero is off by more than the priors allow turns what the slides seem to do: no slide takes a share of another one.
#[test]
fn a_zero_that_is_far_off_is_no_share() {
    let mut shares = Vec::new();
    for seed in 0..8_u64 {
        let mut dir = gantry(None, 40 + seed);
        let off = 0.3 + 0.03 * seed as f64;
        for file in ["gantry/poses.csv", "gantry/checks.csv"] {
            let text = dir.read(file);
            let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
            for line in &mut lines[1..] {
                let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
                let q: f64 = cells[3].parse().expect("a number");
                cells[3] = format!("{:.9}", q + off);
                *line = cells.join(",");
            }
            dir = dir.file(file, lines.join("\n") + "\n");
        }
        // Errors of the drawing beyond the prior are left to the fit.
        let dir = dir.file(
            "gantry.yaml",
            PROFILE.replace("  free: [bodies, tracker, joint_offsets, joint_axes]\n", ""),
        );
        let ran = dir.calib_with(&["check", "gantry.yaml", "--json"]);
        let said: Value = serde_json::from_str(&ran.stdout).expect("JSON");
        let found = said["findings"].as_array().into_iter().flatten();
        let of_share =
            |f: &&Value| matches!(f["id"].as_str(), Some("joint-coupling" | "joint-gain"));
        shares.extend(found.filter(of_share).map(|f| format!("{off}: {f}")));
    }
    assert!(shares.is_empty(), "{shares:#?}");
}

/// The first profile reads joints that are called like coordinates in the robot's own log, and with a word before them.
#[test]
fn init_reads_joints_that_are_called_like_coordinates() {
    let named = |text: &str, before: &str| {
        ["x", "y", "z"].iter().fold(text.to_owned(), |text, axis| {
            let upper = axis.to_uppercase();
            text.replace(&format!("g{axis}_m"), &format!("{before}{upper}_m"))
                .replace(&format!("\"g{axis}\""), &format!("\"{upper}\""))
        })
    };
    let own = gantry(None, 3);
    for before in ["", "actual_"] {
        let dir = Scratch::new()
            .file("gantry.urdf", named(&urdf(), ""))
            .file("poses.csv", named(&own.read("gantry/poses.csv"), before))
            .file("checks.csv", named(&own.read("gantry/checks.csv"), before));
        let call = [
            "init",
            "gantry.urdf",
            "poses.csv",
            "checks.csv",
            "--out",
            "it.yaml",
        ];
        let made = dir.calib_with(&call);
        assert_eq!(made.code, 0, "{before}: {}{}", made.stdout, made.stderr);
        dir.calib(["run", "it.yaml", "--out", "out"]).expect(0);
        assert!(held_out(&dir.json("out/report.json")) < 1e-3, "{before}");
    }
    // The robot's own log alone: the readers know its joints.
    let text = named(&own.read("gantry/poses.csv"), "");
    let (joints, markers): (Vec<String>, Vec<String>) = text
        .lines()
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            (cells[..5].join(","), cells[5..].join(","))
        })
        .unzip();
    let with_time = |rows: &[String], before: f64| {
        let rows = rows.iter().enumerate();
        let rows = rows.map(|(i, row)| match i {
            0 => format!("t_s,{row}"),
            i => format!("{:.2},{row}", before + 5.0 * i as f64),
        });
        rows.collect::<Vec<_>>().join("\n") + "\n"
    };
    let dir = Scratch::new()
        .file("gantry.urdf", named(&urdf(), ""))
        .file("robot.csv", with_time(&joints, 0.0))
        .file("tracker.csv", with_time(&markers, 0.0));
    let made = dir.calib_with(&[
        "init",
        "gantry.urdf",
        "tracker.csv",
        "robot.csv",
        "--out",
        "it.yaml",
    ]);
    assert!(
        !made.stderr.contains("no column is a joint"),
        "{}",
        made.stderr
    );
}

/// A sliding joint in meters beside a tracker in millimeters, without a unit in any name.
#[test]
fn init_finds_two_units_of_length_in_one_table() {
    let robot = RobotModel::from_urdf_text(&urdf_of(&LIFT), "true").expect("a robot");
    let bare = |n: usize, seed: u64| {
        let text = recording_of(&robot, &LIFT, None, n, seed);
        let (header, rows) = text.split_once('\n').expect("a header");
        let stem = |column: &str| column.rsplit_once('_').expect("a unit").0.to_owned();
        let header: Vec<String> = header.split(',').map(stem).collect();
        format!("{}\n{rows}", header.join(","))
    };
    let dir = Scratch::new()
        .file("arm.urdf", urdf_of(&LIFT))
        .file("poses.csv", bare(50, 21))
        .file("checks.csv", bare(15, 22));
    let files = ["arm.urdf", "poses.csv", "checks.csv"];
    let call = [&["init"], files.as_slice(), &["--out", "it.yaml"]].concat();
    let made = dir.calib_with(&call);
    assert_eq!(made.code, 0, "{}{}", made.stdout, made.stderr);
    dir.calib(["run", "it.yaml", "--out", "out"]).expect(0);
    assert!(held_out(&dir.json("out/report.json")) < 1e-3);
}

/// The tracker is left-handed, and the quill reversed would explain it as well; its readings would leave the limits.
#[test]
fn init_reverses_no_joint_out_of_its_limits() {
    let limits = "lower=\"-3\" upper=\"3\"";
    let own = urdf_of(&SCARA);
    let (before, quill) = own.split_once("name=\"quill\"").expect("there");
    let quill = quill.replacen(limits, "lower=\"0\" upper=\"0.18\"", 1);
    let urdf = format!("{before}name=\"quill\"{quill}");
    let robot = RobotModel::from_urdf_text(&urdf, "true").expect("a robot");
    let mirrored = |n: usize, seed: u64| {
        let text = recording_of(&robot, &SCARA, None, n, seed);
        negated(&text, |column| column.ends_with("_y_mm"))
    };
    let dir = Scratch::new()
        .file("arm.urdf", urdf.clone())
        .file("poses.csv", mirrored(40, 21))
        .file("checks.csv", mirrored(12, 22));
    let made = dir.calib([
        "init",
        "arm.urdf",
        "poses.csv",
        "checks.csv",
        "--out",
        "it.yaml",
    ]);
    let said = made.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("frame is left-handed"), "{said}");
    assert!(!dir.read("it.yaml").contains("reversed:"), "{said}");
    assert_eq!(made.code, 3, "{said}");
}

/// A table with the cells of some columns negated.
fn negated(text: &str, is: impl Fn(&str) -> bool) -> String {
    let (header, rows) = text.split_once('\n').expect("a header");
    let which: Vec<bool> = header.split(',').map(is).collect();
    let row = |row: &str| {
        let cells = row.split(',').zip(&which);
        let cells = cells.map(|(cell, which)| match (which, cell.strip_prefix('-')) {
            (false, _) => cell.to_owned(),
            (true, Some(without)) => without.to_owned(),
            (true, None) => format!("-{cell}"),
        });
        cells.collect::<Vec<_>>().join(",")
    };
    let rows: Vec<String> = rows.lines().map(row).collect();
    format!("{header}\n{}\n", rows.join("\n"))
}

/// Without a limit that decides, the reversed quill and the left-handed tracker are both possible: nothing is corrected, and what decides it is said.
#[test]
fn init_does_not_choose_between_a_sign_and_a_left_handed_tracker() {
    let robot = RobotModel::from_urdf_text(&urdf_of(&SCARA), "true").expect("a robot");
    let good = |n, seed| recording_of(&robot, &SCARA, None, n, seed);
    let of_tracker = |column: &str| column.ends_with("_y_mm");
    let of_quill = |column: &str| column == "quill_m";
    let wrong: [&dyn Fn(&str) -> bool; 2] = [&of_tracker, &of_quill];
    for is in wrong {
        let dir = Scratch::new()
            .file("arm.urdf", urdf_of(&SCARA))
            .file("poses.csv", negated(&good(40, 21), is))
            .file("checks.csv", negated(&good(12, 22), is));
        let files = ["arm.urdf", "poses.csv", "checks.csv"];
        let made = dir.calib(["init", files[0], files[1], files[2], "--out", "it.yaml"]);
        let said = made.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains("Nothing is corrected"), "{said}");
        assert!(said.contains("frame is left-handed"), "{said}");
        // The line that it says is one that the program takes, and the joint is then right.
        let line = "columns: {prismatic: {quill: quill_m}, reversed: [quill]}";
        assert!(
            said.contains(&format!("write `{line}` in each recording")),
            "{said}"
        );
        assert_eq!(made.code, 3, "{said}");
        let text = dir.read("it.yaml");
        let entries = text
            .lines()
            .map(|entry| match entry.strip_prefix("    file: ") {
                Some(_) => format!("{entry}\n    {line}\n"),
                None => format!("{entry}\n"),
            });
        let edited: String = entries.collect();
        assert!(!text.contains("\n    columns:"), "{text}");
        let dir = dir.file("edited.yaml", edited);
        dir.calib(["check", "edited.yaml"]).expect(0);
        assert_eq!(made.code, 3, "{said}");
        // A run says the same of the remedy.
        let said = dir.calib(["check", "it.yaml"]).expect(3).stdout;
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(
            said.contains("First rule out `mirrored(tracker)`"),
            "{said}"
        );
        let map = "columns: {prismatic: {quill: <column>}, reversed: [quill]}";
        assert!(said.contains(map), "{said}");
    }
}

/// A lift with its own name, or a number of its own, beside an arm whose columns are only numbered.
#[test]
fn init_pairs_numbered_columns_beside_another_one() {
    let robot = RobotModel::from_urdf_text(&urdf_of(&LIFT), "true").expect("a robot");
    for (lift, arm) in [("lift", "q"), ("E1", "A")] {
        let numbered = |n: usize, seed: u64| {
            let text = recording_of(&robot, &LIFT, None, n, seed);
            let text = text.replacen("lift_m", lift, 1);
            let columns = (1..).zip(&LIFT[1..]);
            columns.fold(text, |text, (k, joint)| {
                text.replacen(&format!("{}_rad", joint.0), &format!("{arm}{k}"), 1)
            })
        };
        let dir = Scratch::new()
            .file("arm.urdf", urdf_of(&LIFT))
            .file("poses.csv", numbered(50, 21))
            .file("checks.csv", numbered(15, 22));
        let files = ["arm.urdf", "poses.csv", "checks.csv"];
        dir.calib(["init", files[0], files[1], files[2], "--out", "it.yaml"])
            .expect(0);
        let written = dir.read("it.yaml");
        for (k, joint) in (1..).zip(&LIFT[1..]) {
            let pair = format!("{}: {arm}{k}", joint.0);
            assert!(written.contains(&pair), "{pair}: {written}");
        }
        assert!(written.contains(&format!("lift: {lift}")), "{written}");
        let report = dir.calib(["run", "it.yaml", "--out", "out"]);
        assert!(report.code < 2, "{}", report.stderr);
        assert!(held_out(&dir.json("out/report.json")) < 1e-3);
    }
}

/// Joints that slide scatter in meters, with a level of their own: it is found, and what is said of the axes holds. Taken for noise of the
/// body's pose, the intervals of some axes are too narrow.
#[test]
fn the_scatter_of_slides_has_a_level_of_its_own() {
    const SEEDS: u64 = 24;
    const SLIDE: f64 = 4e-4;
    let urdf = urdf_of(&SCARA);
    let robot = RobotModel::from_urdf_text(&urdf, "true").expect("a robot");
    let profile = PROFILE.replace("link: l5", "link: l4");
    let (mut chosen, mut sum, mut count) = (0, 0.0, 0.0);
    for seed in 0..SEEDS {
        let table = |n, seed| scattered(&robot, &SCARA, None, [SLIDE, 1e-4], n, seed);
        let dir = Scratch::new()
            .file("gantry/gantry.urdf", &urdf)
            .file("gantry.yaml", &profile)
            .file("gantry/poses.csv", table(40, 100 + seed))
            .file("gantry/checks.csv", table(12, 200 + seed));
        let report = run(&dir);
        let noise = report["noise"].as_array().expect("a list");
        if report["noise_choice"]["chosen"] == "joint_and_slide" {
            chosen += 1;
            let level = noise.iter().find(|n| n["kind"] == "slide");
            let level = level.expect("chosen");
            assert_eq!(level["unit"], "m");
            let sigma = level["sigma"].as_f64().expect("found");
            assert!((0.5..1.6).contains(&(sigma / SLIDE)), "{seed}: {level:#}");
        }
        // The robot is as its URDF says: tilts of its axes are errors.
        let all = report["parameters"].as_array().expect("a list");
        let of = |name: &str| all.iter().find(|p| p["name"] == name);
        for name in [
            "j2.origin.rx",
            "j2.origin.ry",
            "quill.origin.rx",
            "quill.origin.ry",
        ] {
            let tilt = of(name).unwrap_or_else(|| panic!("{name}"));
            let of = |key: &str| tilt[key].as_f64().expect("a number");
            sum += (of("value") / of("sigma")).powi(2);
            count += 1.0;
        }
    }
    assert!(chosen * 10 >= SEEDS * 8, "{chosen} of {SEEDS}");
    let ratio: f64 = sum / count;
    println!("{chosen} of {SEEDS}, {:.2} σ", ratio.sqrt());
    assert!((0.6..1.2).contains(&ratio.sqrt()), "{ratio}");
}
