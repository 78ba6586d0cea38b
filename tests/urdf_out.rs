//! The URDF that a run writes: only what was calibrated differs, it says what the report says, and it can be reverted.

use crate::scratch;

use calib_urdf::RobotModel;
use scratch::{Scratch, finished};
use serde_json::Value;

const ROBOTS: [&str; 2] = ["ripley", "justin"];

fn robot_text(robot: &str) -> (String, String) {
    let dir = &finished(robot, "ml").dir;
    let original = dir.files(&format!("robots/{robot}"));
    let (_, urdf) = original
        .iter()
        .find(|(name, _)| name.ends_with(".urdf"))
        .expect("a URDF");
    let patched = dir.read(&format!("out/{robot}.calibrated.urdf"));
    (String::from_utf8(urdf.clone()).expect("text"), patched)
}

/// Without the values of `xyz` and `rpy`, the only attributes that a calibration writes.
fn without_poses(text: &str) -> String {
    let mut rest = text;
    let mut kept = String::new();
    while let Some(at) = ["xyz=\"", "rpy=\""]
        .iter()
        .filter_map(|key| Some(rest.find(key)? + key.len()))
        .min()
    {
        kept += &rest[..at];
        rest = &rest[at..];
        rest = &rest[rest.find('"').expect("a closing quote")..];
    }
    kept + rest
}

/// Removes the fixed joints and links that the profile asks for; what is left must be the original.
fn without_added_bodies(patched: &str, bodies: &[&str]) -> String {
    let mut lines: Vec<&str> = patched.split_inclusive('\n').collect();
    for body in bodies {
        let joint = format!("<joint name=\"{body}_mount\"");
        let link = format!("<link name=\"{body}\"/>");
        let first = lines
            .iter()
            .position(|l| l.contains(&joint))
            .unwrap_or_else(|| panic!("no {joint}"));
        let last = first
            + lines[first..]
                .iter()
                .position(|l| l.contains("</joint>"))
                .expect("its end");
        lines.drain(first..=last);
        let at = lines
            .iter()
            .position(|l| l.contains(&link))
            .unwrap_or_else(|| panic!("no {link}"));
        lines.remove(at);
        let comment = format!("<!-- tracking body {body} -->");
        lines.retain(|l| l.trim() != comment);
    }
    lines.concat()
}

#[test]
fn only_numbers_of_poses_differ_besides_the_added_bodies() {
    for (robot, bodies) in [("ripley", ["linkM", "gripM"]), ("justin", ["heT", "haT"])] {
        let (original, patched) = robot_text(robot);
        let rest = without_added_bodies(&patched, &bodies);
        assert_eq!(without_poses(&rest), without_poses(&original), "{robot}");
        assert_ne!(rest, original, "{robot}: nothing was calibrated");
    }
}

/// Without added bodies the file has the same lines, and each changed line is an `<origin>`.
#[test]
fn without_added_bodies_only_origins_change() {
    let dir = Scratch::new().brief("ripley").edit(
        "robots/ripley.yaml",
        "  add_bodies: [linkM, gripM]\n",
        "",
    );
    dir.calib(["run", "robots/ripley.yaml", "--out", "out"])
        .expect(0);
    let (original, patched) = (
        dir.read("robots/ripley/r17.urdf"),
        dir.read("out/ripley.calibrated.urdf"),
    );
    assert_eq!(original.lines().count(), patched.lines().count());
    for (before, after) in original
        .lines()
        .zip(patched.lines())
        .filter(|(a, b)| a != b)
    {
        assert!(before.contains("<origin "), "{before}\n{after}");
    }
    assert_eq!(without_poses(&patched), without_poses(&original));
}

/// Line endings, byte order mark, quotes and foreign elements are the owner's.
#[test]
fn other_people_s_bytes_are_kept() {
    let odd = |text: &str| {
        let text = text
            .replace(
                "xyz=\"0.375 0 0\" rpy=\"0 0 0\"",
                "rpy = '0 0 0'  xyz='0.375 0 0' ",
            )
            .replace(
                "</robot>",
                "  <gazebo reference=\"hand\"><mu1>0.2</mu1></gazebo>\n</robot>",
            );
        format!("\u{feff}{}", text.replace('\n', "\r\n"))
    };
    let dir = Scratch::new().brief("ripley");
    let text = odd(&dir.read("robots/ripley/r17.urdf"));
    let dir = dir.file("robots/ripley/r17.urdf", &text);
    dir.calib(["run", "robots/ripley.yaml", "--out", "out"])
        .expect(0);
    let patched = dir.read("out/ripley.calibrated.urdf");
    assert!(patched.starts_with('\u{feff}'));
    assert_eq!(
        patched.matches('\n').count(),
        patched.matches("\r\n").count()
    );
    assert!(patched.contains("<gazebo reference=\"hand\"><mu1>0.2</mu1></gazebo>\r\n"));
    assert!(patched.contains("rpy = '"), "{patched}");
    dir.calib(["revert", "out/ripley.calibrated.urdf", "--out", "back.urdf"])
        .expect(0);
    assert!(dir.read("back.urdf") == text);
}

/// Every changed number of the file is the report's "after", and every other joint is as it was.
#[test]
fn the_file_says_what_the_report_says() {
    for robot in ROBOTS {
        let (original, patched) = robot_text(robot);
        let before = RobotModel::from_urdf_text(&original, "original").expect("a robot");
        let after = RobotModel::from_urdf_text(&patched, "patched").expect("a robot");
        let changes = finished(robot, "ml").report["changes"]
            .as_array()
            .expect("changes")
            .clone();
        for joint in before.joints() {
            let now = after.joint(after.joint_id(&joint.name).expect("the joint is kept"));
            let moved = (joint.parent_link_from_joint.inverse() * now.parent_link_from_joint)
                .to_homogeneous();
            let changed = (moved - nalgebra::Matrix4::identity()).norm() > 1e-12;
            let told = changes
                .iter()
                .any(|c| c.to_string().contains(&format!("\"{}\"", joint.name)));
            assert_eq!(changed, told, "{robot}: {}", joint.name);
        }
    }
}

/// The mounts in the file put the origins where the report says they are.
#[test]
fn the_re_read_file_has_the_reported_transforms() {
    for (robot, links) in [
        (
            "ripley",
            [
                ("linkM_from_base", "linkM", "upper_arm"),
                ("gripM_from_endJ", "gripM", "gripper"),
            ],
        ),
        (
            "justin",
            [
                ("heT_from_head", "heT", "head"),
                ("haT_from_hand", "haT", "tcp"),
            ],
        ),
    ] {
        let (_, patched) = robot_text(robot);
        let model = RobotModel::from_urdf_text(&patched, "patched").expect("a robot");
        let at_zero = model.forward_kinematics(&model.zero_positions());
        let place = |link: &str| at_zero[model.link_id(link).expect("a link").index()];
        for (name, body, origin) in links {
            let body_from_origin = place(body).inverse() * place(origin);
            let report = &finished(robot, "ml").report["transforms"];
            let reported = report
                .as_array()
                .expect("transforms")
                .iter()
                .find(|t| t["name"] == name)
                .expect("the transform");
            let written = body_from_origin.translation.vector;
            for (k, value) in reported["translation_m"]
                .as_array()
                .expect("three")
                .iter()
                .enumerate()
            {
                // Written origins have nine decimals, and a transform has several.
                let gap = (written[k] - value.as_f64().expect("a number")).abs();
                assert!(gap < 3e-9, "{robot} {name}[{k}]: {gap:.1e} m");
            }
            let q = body_from_origin.rotation.coords;
            let reported: Vec<f64> = reported["rotation_xyzw"]
                .as_array()
                .expect("four")
                .iter()
                .filter_map(Value::as_f64)
                .collect();
            let cosine: f64 = (0..4).map(|k| q[k] * reported[k]).sum();
            assert!(1.0 - cosine.abs() < 1e-12, "{robot} {name}: {cosine}");
        }
    }
}

/// Rows of a table by the names of its columns, without those that lost a cell.
fn table(text: &str) -> Vec<std::collections::BTreeMap<String, f64>> {
    let text: String = text
        .lines()
        .filter(|l| !l.starts_with('#'))
        .map(|l| format!("{l}\n"))
        .collect();
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().expect("a header").clone();
    let rows = reader.records().map(|row| {
        let row = row.expect("a row");
        let cells = header.iter().zip(row.iter());
        cells
            .filter_map(|(name, cell)| Some((name.to_owned(), cell.parse().ok()?)))
            .collect()
    });
    rows.collect()
}

/// The URDF that is used without effects is as good as the report says where the tracker stands as the model file and the scene have it.
#[test]
fn the_urdf_alone_predicts_as_stated_from_the_tracker_that_is_published() {
    let run = finished("justin", "ml");
    let text = run.dir.read("out/justin.calibrated.alone.urdf");
    let model = RobotModel::from_urdf_text(&text, "alone").expect("a robot");
    let file = run.dir.json("out/justin.calibrated.model.json");
    let numbers = |of: &Value| -> Vec<f64> {
        of.as_array()
            .expect("a list")
            .iter()
            .filter_map(Value::as_f64)
            .collect()
    };
    let pose = &file["tracker_from_root"];
    let (t, q) = (numbers(&pose["xyz_m"]), numbers(&pose["quat_xyzw"]));
    let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
        q[3], q[0], q[1], q[2],
    ));
    let tracker_from_root = nalgebra::Isometry3::from_parts([t[0], t[1], t[2]].into(), turn);
    let (mut sum, mut count) = (0.0, 0_u32);
    for row in table(&run.dir.read("robots/justin/torso_tests.csv")) {
        let mut q = model.zero_positions();
        for id in model.independent_joints() {
            let degrees = row.get(&format!("{}_deg", model.joint(id).name));
            q[id.index()] = degrees.map_or(0.0, |d| d.to_radians());
        }
        let links = model.forward_kinematics(&q);
        for body in ["heT", "haT"] {
            let seen: Vec<f64> = ["x", "y", "z"]
                .iter()
                .filter_map(|a| row.get(&format!("{body}.{a}_m")).copied())
                .collect();
            let [x, y, z] = seen[..] else { continue };
            let at = tracker_from_root * links[model.link_id(body).expect("added").index()];
            sum += (at.translation.vector - nalgebra::Vector3::new(x, y, z)).norm_squared();
            count += 1;
        }
    }
    let rms = (sum / f64::from(count)).sqrt();
    let stated = &run.report["verification"]["held_out"]["urdf_refitted"]["rms_m"];
    let stated = stated.as_f64().expect("a number");
    assert!(
        count > 100 && (rms / stated - 1.0).abs() < 0.02,
        "{rms} {stated}, {count} positions"
    );
}

#[test]
fn reverting_gives_the_original_bytes() {
    for robot in ROBOTS {
        let dir = &finished(robot, "ml").dir;
        let out = format!("reverted-{robot}.urdf");
        dir.calib([
            "revert",
            &format!("out/{robot}.calibrated.urdf"),
            "--out",
            &out,
        ])
        .expect(0);
        assert!(dir.read(&out) == robot_text(robot).0, "{robot}");
    }
}

#[test]
fn an_edited_file_is_not_reverted() {
    let run = &finished("ripley", "ml").dir;
    let dir = Scratch::new()
        .file("r.urdf", run.read("out/ripley.calibrated.urdf"))
        .file(
            "r.urdf.changes.json",
            run.read("out/ripley.calibrated.urdf.changes.json"),
        )
        .edit("r.urdf", "velocity=\"2.6\"", "velocity=\"2.7\"");
    let ran = dir
        .calib(["revert", "r.urdf", "--out", "back.urdf"])
        .expect(3);
    insta::with_settings!({filters => [("[0-9a-f]{64}", "[sha256]")]}, {
        insta::assert_snapshot!(ran.stderr);
    });
    assert!(!dir.path("back.urdf").exists());
}

#[test]
fn reverting_overwrites_nothing() {
    let run = &finished("ripley", "ml").dir;
    let dir = Scratch::new()
        .file("r.urdf", run.read("out/ripley.calibrated.urdf"))
        .file(
            "r.urdf.changes.json",
            run.read("out/ripley.calibrated.urdf.changes.json"),
        )
        .file("mine.urdf", "mine");
    let ran = dir
        .calib(["revert", "r.urdf", "--out", "mine.urdf"])
        .expect(7);
    assert!(
        ran.stderr.contains("mine.urdf exists already"),
        "{}",
        ran.stderr
    );
    assert_eq!(dir.read("mine.urdf"), "mine");
}

#[test]
fn the_difference_is_shown() {
    let dir = Scratch::new().brief("ripley").file(
        "a.urdf",
        Scratch::new()
            .brief("ripley")
            .read("robots/ripley/r17.urdf"),
    );
    let moved = dir.read("a.urdf").replace(
        "xyz=\"0.375 0 0\" rpy=\"0 0 0\"",
        "xyz=\"0.3751 0 -0.0002\" rpy=\"0 0 0\"",
    );
    let dir = dir.file("b.urdf", moved);
    for format in ["table", "json", "unified"] {
        let ran = dir
            .calib(["diff", "a.urdf", "b.urdf", "--format", format])
            .expect(0);
        insta::assert_snapshot!(format!("diff_{format}"), ran.stdout);
    }
    let same = dir.calib(["diff", "a.urdf", "a.urdf"]).expect(0);
    insta::assert_snapshot!("diff_of_the_same", same.stdout);
}

/// Changed through a link, the file itself goes back, and the other way round.
#[cfg(unix)]
#[test]
fn the_record_of_a_change_is_found_by_every_name_of_the_file() {
    let run = &finished("ripley", "ml").dir;
    let original = robot_text("ripley").0;
    let dir = Scratch::new().file("in/real.urdf", &original);
    for name in [
        "ripley.calibrated.urdf",
        "ripley.calibrated.urdf.changes.json",
        "report.json",
        "ripley.calibrated.model.json",
    ] {
        let path = format!("out/{name}");
        std::fs::create_dir_all(dir.path("out")).expect("a folder");
        std::fs::write(dir.path(&path), run.read(&path)).expect("written");
    }
    std::os::unix::fs::symlink("in/real.urdf", dir.path("link.urdf")).expect("a link");
    for (applied, reverted) in [("link.urdf", "in/real.urdf"), ("in/real.urdf", "link.urdf")] {
        dir.calib(["apply", "out", applied, "--in-place"]).expect(0);
        assert_ne!(dir.read("in/real.urdf"), original);
        dir.calib(["revert", reverted, "--in-place"]).expect(0);
        assert_eq!(dir.read("in/real.urdf"), original, "{applied}");
        assert!(dir.path("link.urdf").is_symlink());
    }
}
