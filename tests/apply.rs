//! A calibration in other people's files: URDFs, xacros with properties and YAML, the kinematics YAML of a UR arm. Only the
//! numbers change, everything can be reverted byte for byte, and what several joints share is refused.

use crate::scratch;

use calib_urdf::rpy::rotation_from_rpy;
use calib_urdf::{RobotModel, UrdfEdit, patch};
use nalgebra::{Isometry3, Translation3, Vector3};
use scratch::{Scratch, files_below, finished, root};

/// Moves the joints, a different way each, and writes what `calib run` would have written.
fn result(dir: Scratch, folder: &str, urdf: &str, joints: &[&str]) -> Scratch {
    let model = RobotModel::from_urdf_text(urdf, folder).expect("a robot");
    let edits: Vec<UrdfEdit> = joints
        .iter()
        .enumerate()
        .map(|(n, joint)| {
            let small = 1e-3 * (n as f64 + 1.0);
            let delta = Isometry3::from_parts(
                Translation3::new(small, -0.5 * small, 0.25 * small),
                rotation_from_rpy(&Vector3::new(0.3 * small, small, -0.5 * small)),
            );
            let id = model.joint_id(joint).expect("a joint");
            UrdfEdit::SetOrigin {
                joint: (*joint).to_owned(),
                parent_link_from_joint: model.joint(id).parent_link_from_joint * delta,
            }
        })
        .collect();
    let done = patch(urdf, folder, &edits).expect("a patch");
    let record = serde_json::to_string(&done.record(urdf)).expect("JSON");
    dir.file(&format!("{folder}/r.calibrated.urdf"), done.text)
        .file(&format!("{folder}/r.calibrated.urdf.changes.json"), record)
}

pub const RESULT: &str = "result/r.calibrated.urdf";

/// The text with every number replaced by `#`: what no calibration may touch.
fn without_numbers(text: &str) -> String {
    let mut out = String::new();
    let mut word = String::new();
    for c in text.chars().chain(['\0']) {
        if c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | 'e' | 'E') {
            word.push(c);
            continue;
        }
        let number = word.contains(|c: char| c.is_ascii_digit());
        out += if number { "#" } else { &word };
        word.clear();
        out.push(c);
    }
    out
}

/// Every URDF and xacro at hand: (name, text, text of the expanded URDF).
fn robots() -> Vec<(String, String, Option<String>)> {
    let mut files = Vec::new();
    let real = skipped_tests::real_data("");
    for folder in [root().join("robots")].into_iter().chain(real) {
        for (name, bytes) in files_below(&folder) {
            if name.ends_with(".urdf") || name.ends_with(".xacro") {
                files.push((name, String::from_utf8(bytes).expect("text")));
            }
        }
    }
    assert!(files.len() >= 2, "the shipped robots at least");
    let expanded = |name: &str| {
        let urdf = name.strip_suffix(".xacro")?;
        let found = files.iter().find(|(other, _)| other == urdf);
        found.map(|(_, text)| text.clone())
    };
    let all = files.iter();
    all.map(|(name, text)| (name.clone(), text.clone(), expanded(name)))
        .collect()
}

#[test]
fn every_robot_at_hand_takes_a_result_and_gives_it_back() {
    for (name, text, expanded) in robots() {
        if name.ends_with(".urdf") {
            let model = RobotModel::from_urdf_text(&text, &name).expect("a robot");
            let joints: Vec<&str> = model.joints().iter().map(|j| j.name.as_str()).collect();
            applied_and_reverted(&name, &text, &text, &joints);
            println!("{name}: all {} joints applied and reverted", joints.len());
            continue;
        }
        let Some(urdf) = expanded else {
            println!("{name}: skipped, no expanded URDF beside it tells its joints");
            continue;
        };
        let model = RobotModel::from_urdf_text(&urdf, &name).expect("a robot");
        let mut taken = Vec::new();
        for joint in model.joints() {
            let dir = result(Scratch::new(), "result", &urdf, &[&joint.name]);
            let dir = dir.file("robot.xacro", &text);
            let ran = dir.calib(["apply", RESULT, "robot.xacro", "--diff"]);
            if ran.code == 0 {
                taken.push(joint.name.as_str());
                continue;
            }
            // Never a half-understood file: each refusal says what and where.
            let said = ran.stderr.lines().next().unwrap_or_default();
            let known = [
                "has no joint",
                "xacro computes",
                "is written in several places",
            ];
            assert!(known.iter().any(|k| said.contains(k)), "{name}: {said}");
            assert_eq!(ran.code, 7, "{name}: {said}");
            println!("{name}: {} refused: {said}", joint.name);
        }
        assert!(!taken.is_empty(), "{name}: no joint could be applied");
        applied_and_reverted(&name, &text, &urdf, &taken);
        println!("{name}: applied and reverted: {}", taken.join(", "));
    }
}

fn applied_and_reverted(name: &str, text: &str, urdf: &str, joints: &[&str]) {
    let file = if name.ends_with(".xacro") {
        "robot.xacro"
    } else {
        "robot.urdf"
    };
    let dir = result(Scratch::new(), "result", urdf, joints).file(file, text);
    dir.calib(["apply", RESULT, file, "--in-place"]).expect(0);
    let patched = dir.read(file);
    assert!(patched != text, "{name}");
    let has_all_numbers = |t: &str| t.matches("<origin").count() == text.matches("<origin").count();
    if has_all_numbers(&patched) && patched.matches("rpy").count() == text.matches("rpy").count() {
        assert_eq!(without_numbers(&patched), without_numbers(text), "{name}");
    } else {
        // An origin or an attribute that was not written had to be added; every old line but those is there still.
        let gone = text.lines().filter(|l| !patched.lines().any(|p| p == *l));
        for line in gone {
            let numbers = line.contains("xyz") || line.contains("rpy") || line.contains("<origin");
            assert!(numbers, "{name}: {line}");
        }
    }
    let again = dir.calib(["apply", RESULT, file, "--diff"]).expect(0);
    assert!(again.stdout.contains("holds this result already"), "{name}");
    dir.calib(["revert", file, "--in-place"]).expect(0);
    assert!(dir.read(file) == text, "{name}: not the same bytes");
    assert!(!dir.path(&format!("{file}.changes.json")).exists());
}

const ARM: &str = r#"<robot name="arm">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="hand"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="fore"/>
    <origin xyz="0.4 0 0" rpy="0 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="wrist" type="revolute">
    <parent link="fore"/><child link="hand"/>
    <origin xyz="0.25 0 0" rpy="0 0 0"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
</robot>
"#;

pub const PROPERTIES: &str = r#"<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <!-- lengths in meters -->
  <xacro:property name="upper_length" value="0.4"/>
  <xacro:property name="calibration" value="${xacro.load_yaml('$(find my_arm)/config/arm.yaml')}"/>
  <xacro:property name="w" value="${calibration['joints']['wrist']}"/>
  <xacro:macro name="arm" params="side">
    <joint name="${side}shoulder" type="revolute">
      <parent link="base"/><child link="upper"/>
      <origin xyz="0 0 0.3" rpy="0 0 0"/>
    </joint>
  </xacro:macro>
  <xacro:arm side=""/>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="fore"/>
    <origin xyz="${upper_length} 0 0" rpy="0 0 0"/>
  </joint>
  <joint name="wrist" type="revolute">
    <parent link="fore"/><child link="hand"/>
    <origin xyz="${w.x} ${w.y} ${w.z}" rpy="${w.roll} ${w.pitch} ${w.yaw}"/>
  </joint>
</robot>
"#;

const YAML: &str = "# wrist of cell 3\njoints:\n  wrist: {x: 0.25, y: 0.0, z: 0.0, roll: 0.0, pitch: 0.0, yaw: 0.0} # at its zero configuration\n";

pub fn with_xacro(xacro: &str) -> Scratch {
    result(
        Scratch::new(),
        "result",
        ARM,
        &["shoulder", "elbow", "wrist"],
    )
    .file(
        "my_arm/package.xml",
        "<package><name>my_arm</name></package>",
    )
    .file("my_arm/urdf/arm.urdf.xacro", xacro)
    .file("my_arm/config/arm.yaml", YAML)
}

/// The same with the result applied, and in `next` that of the calibration after it.
pub fn with_xacro_applied() -> Scratch {
    let dir = with_xacro(PROPERTIES);
    dir.calib(["apply", RESULT, "my_arm/urdf/arm.urdf.xacro", "--in-place"])
        .expect(0);
    let urdf = dir.read(RESULT);
    result(dir, "next", &urdf, &["shoulder", "elbow", "wrist"])
}

/// Records that wait belong to a change that was stopped: before its first file they are removed, lest a later change complete that one; between its files it
/// is completed, and a dry run says so.
#[test]
fn what_a_stopped_second_apply_left_is_removed_or_completed() {
    let next = "next/r.calibrated.urdf";
    let xacro = "my_arm/urdf/arm.urdf.xacro";
    let targets = [xacro, "my_arm/config/arm.yaml"];
    let done = with_xacro_applied();
    done.calib(["apply", next, xacro, "--in-place"]).expect(0);
    let waiting = |file: &str| format!("{file}.changes.json.next");
    let stopped = || {
        targets.iter().fold(with_xacro_applied(), |dir, file| {
            dir.file(&waiting(file), done.read(&format!("{file}.changes.json")))
        })
    };
    let dir = stopped();
    let before = targets.map(|file| dir.read(file));
    dir.calib(["apply", RESULT, xacro, "--in-place"]).expect(0);
    assert_eq!(targets.map(|file| dir.read(file)), before);
    assert!(!targets.iter().any(|file| dir.path(&waiting(file)).exists()));
    for changed in targets {
        let dir = stopped().file(changed, done.read(changed));
        let dry = dir.calib(["apply", next, xacro, "--diff"]);
        assert_eq!(dry.code, 3, "{}", dry.stderr);
        assert!(
            dry.stderr.contains("complete it with --in-place"),
            "{}",
            dry.stderr
        );
        dir.calib(["apply", next, xacro, "--in-place"]).expect(0);
        assert_eq!(
            targets.map(|file| dir.read(file)),
            targets.map(|file| done.read(file))
        );
        assert!(!targets.iter().any(|file| dir.path(&waiting(file)).exists()));
    }
}

#[test]
fn a_xacro_with_properties_and_a_loaded_yaml() {
    let dir = with_xacro(PROPERTIES);
    let xacro = "my_arm/urdf/arm.urdf.xacro";
    let dry = dir.calib(["apply", RESULT, xacro, "--diff"]).expect(0);
    insta::assert_snapshot!("xacro_diff", dry.stdout);
    assert!(dir.read(xacro) == PROPERTIES, "a dry run writes nothing");
    let ran = dir.calib(["apply", RESULT, xacro, "--in-place"]).expect(0);
    insta::assert_snapshot!("xacro_in_place", ran.stdout);
    assert_eq!(
        without_numbers(&dir.read(xacro)),
        without_numbers(PROPERTIES)
    );
    let diff = dir
        .calib(["diff", "result/r.calibrated.urdf", xacro])
        .expect(0);
    assert!(diff.stdout.contains("${side}shoulder"), "{}", diff.stdout);
    let changed = dir.read("my_arm/config/arm.yaml");
    assert!(
        changed.starts_with("# wrist of cell 3\n")
            && changed.ends_with("} # at its zero configuration\n")
    );
    for file in [xacro, "my_arm/config/arm.yaml"] {
        dir.calib(["revert", file, "--in-place"]).expect(0);
    }
    assert!(dir.read(xacro) == PROPERTIES && dir.read("my_arm/config/arm.yaml") == YAML);
    // Somewhere else: two files need a folder.
    dir.calib(["apply", RESULT, xacro, "--out", "new"])
        .expect(0);
    let written: Vec<String> = dir.files("new").into_keys().collect();
    assert_eq!(
        written,
        [
            "arm.urdf.xacro",
            "arm.urdf.xacro.changes.json",
            "arm.yaml",
            "arm.yaml.changes.json"
        ]
    );
    dir.calib(["revert", "new/arm.yaml", "--out", "old.yaml"])
        .expect(0);
    assert!(dir.read("old.yaml") == YAML && dir.read("my_arm/config/arm.yaml") == YAML);
}

#[test]
fn the_same_yaml_by_itself() {
    let dir = result(Scratch::new(), "result", ARM, &["wrist"]).file("arm.yaml", YAML);
    let ran = dir.calib(["apply", RESULT, "arm.yaml", "--out", "new.yaml", "--json"]);
    let json = ran.expect(0).json();
    assert_eq!(json["kind"], "yaml");
    assert_eq!(json["written"], true);
    assert_eq!(
        json["files"][0]["changes"].as_array().map(Vec::len),
        Some(6)
    );
    assert_eq!(json["undo"][0], "calib revert new.yaml --out ORIGINAL");
    let diff = dir.calib(["diff", "arm.yaml", "new.yaml"]).expect(0);
    insta::assert_snapshot!("yaml_diff", diff.stdout);
    let unified = dir.calib(["diff", "arm.yaml", "new.yaml", "--format", "unified"]);
    assert!(
        unified
            .expect(0)
            .stdout
            .contains("-  wrist: {x: 0.25, y: 0.0,")
    );
    let json = dir.calib(["diff", "arm.yaml", "new.yaml", "--format", "json"]);
    assert_eq!(json.expect(0).json()["joints"][0]["joint"], "wrist");
}

/// The layout of ur_description's `default_kinematics.yaml`, with numbers of our own.
fn ur_kinematics() -> String {
    let mut text = String::from("# arm 7\nkinematics:\n");
    for (n, key) in [
        "shoulder",
        "upper_arm",
        "forearm",
        "wrist_1",
        "wrist_2",
        "wrist_3",
    ]
    .iter()
    .enumerate()
    {
        let n = n as f64;
        text += &format!(
            "  {key}:\n    x: {}\n    y: 0\n    z: {}\n    roll: {}\n    pitch: 0\n    yaw: -1.5e-08\n",
            0.1 * n,
            0.16 - 0.01 * n,
            (std::f64::consts::FRAC_PI_2 * 1e9).round() / 1e9 * (n % 2.0)
        );
    }
    text + "  hash: calib_12788084448423163542\n"
}

#[test]
fn a_ur_arm_s_kinematics_yaml() {
    let yaml = ur_kinematics();
    let names = [
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    ];
    let mut urdf = String::from("<robot name=\"ur\"><link name=\"l0\"/>");
    for (n, name) in names.iter().enumerate() {
        let x = n as f64;
        urdf += &format!(
            "<link name=\"l{}\"/><joint name=\"{name}\" type=\"continuous\"><parent link=\"l{n}\"/><child link=\"l{}\"/>\
             <origin xyz=\"{} 0 {}\" rpy=\"{} 0 -1.5e-08\"/><axis xyz=\"0 0 1\"/></joint>",
            n + 1,
            n + 1,
            0.1 * x,
            0.16 - 0.01 * x,
            (std::f64::consts::FRAC_PI_2 * 1e9).round() / 1e9 * (x % 2.0)
        );
    }
    urdf += "</robot>";
    let dir = result(Scratch::new(), "result", &urdf, &names).file("k.yaml", &yaml);
    let ran = dir
        .calib(["apply", RESULT, "k.yaml", "--in-place"])
        .expect(0);
    insta::assert_snapshot!("ur_in_place", ran.stdout);
    let changed = dir.read("k.yaml");
    assert_eq!(changed.lines().count(), yaml.lines().count());
    assert!(changed.ends_with("  hash: calib_12788084448423163542\n"));
    let diff = dir
        .calib(["diff", "result/r.calibrated.urdf", "k.yaml"])
        .expect(0);
    assert_eq!(diff.stdout, "no differences\n");
    dir.calib(["revert", "k.yaml", "--in-place"]).expect(0);
    assert!(dir.read("k.yaml") == yaml);
}

/// A macro for each joint, called once for each: the numbers of a joint are in its call.
const CALLS: &str = r#"<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:macro name="axis" params="name parent child xyz rpy:='0 0 0'">
    <joint name="${name}" type="revolute">
      <parent link="${parent}"/><child link="${child}"/>
      <origin xyz="${xyz}" rpy="${rpy}"/>
    </joint>
  </xacro:macro>
  <xacro:axis name="shoulder" parent="base" child="upper" xyz="0 0 0.3" rpy="0 0 0"/>
  <xacro:axis name="elbow" parent="upper" child="fore" xyz="0.4 0 0" rpy="0 ${0} 0"/>
  <xacro:axis rpy="0 0 0" xyz="0.25 0 0" name="wrist" parent="fore" child="hand"/>
</robot>
"#;

#[test]
fn a_macro_that_is_called_for_each_joint_is_patched_in_its_calls() {
    let dir = with_xacro(CALLS);
    let xacro = "my_arm/urdf/arm.urdf.xacro";
    dir.calib(["apply", RESULT, xacro, "--in-place"]).expect(0);
    let changed = dir.read(xacro);
    let macro_end = changed.find("</xacro:macro>").expect("the macro");
    assert_eq!(changed[..macro_end], CALLS[..macro_end]);
    let calibrated = RobotModel::from_urdf_text(&dir.read(RESULT), "r").expect("a robot");
    for line in changed.lines().filter(|line| line.contains("<xacro:axis")) {
        let of = |key: &str| {
            let (_, rest) = line.split_once(&format!(" {key}=\"")).expect(key);
            rest.split('"').next().unwrap_or_default().to_owned()
        };
        let numbers = |key: &str| -> Vec<f64> {
            let numbers = of(key);
            numbers.split(' ').map(|x| x.parse().expect(line)).collect()
        };
        let (xyz, rpy) = (numbers("xyz"), numbers("rpy"));
        let written = Isometry3::from_parts(
            Translation3::new(xyz[0], xyz[1], xyz[2]),
            rotation_from_rpy(&Vector3::new(rpy[0], rpy[1], rpy[2])),
        );
        let joint = calibrated.joint_id(&of("name")).expect("a joint");
        let off = calibrated.joint(joint).parent_link_from_joint.inverse() * written;
        assert!(
            off.translation.vector.norm() < 2e-9 && off.rotation.angle() < 2e-9,
            "{line}"
        );
    }
    dir.calib(["revert", xacro, "--in-place"]).expect(0);
    assert!(dir.read(xacro) == CALLS);
    // What does not stand in a call of its own is refused.
    for (from, to, said) in [
        (
            " rpy=\"0 0 0\"/>",
            "/>",
            "arm.urdf.xacro:8:3: the call that gives joint `shoulder` leaves `rpy` at its default",
        ),
        (
            "<origin xyz=\"${xyz}\"",
            "<origin xyz=\"0.4 0 0\"",
            "several joints",
        ),
        (
            "xyz=\"0.4 0 0\"",
            "xyz=\"${0.2 * 2} 0 ${height}\"",
            "computes",
        ),
        (
            "<parent link=\"${parent}\"/>",
            "<parent link=\"${parent}\"/><safety xyz=\"${xyz}\"/>",
            "the parameter `xyz` of the macro",
        ),
        ("name=\"elbow\"", "name=\"wrist\"", "several joints"),
    ] {
        let other = CALLS.replacen(from, to, 1);
        assert_ne!(other, CALLS, "{from}");
        let dir = with_xacro(&other);
        let ran = dir.calib(["apply", RESULT, xacro, "--in-place"]);
        assert_ne!(ran.code, 0, "{to}");
        println!("{to}: {}", ran.stderr);
        assert!(ran.stderr.contains(said), "{to}: {}", ran.stderr);
        assert!(dir.read(xacro) == other, "{to}: it was changed");
    }
}

/// The same with the origins as elements of the calls, of one call and of several.
#[test]
fn a_block_of_a_macro_is_patched_in_its_call() {
    let several = CALLS
        .replace("xyz rpy:='0 0 0'\"", "*place\"")
        .replace(
            "<origin xyz=\"${xyz}\" rpy=\"${rpy}\"/>",
            "<xacro:insert_block name=\"place\"/>",
        )
        .replace(
            "xyz=\"0 0 0.3\" rpy=\"0 0 0\"/>",
            "><origin xyz=\"0 0 0.3\"/></xacro:axis>",
        )
        .replace(
            "xyz=\"0.4 0 0\" rpy=\"0 ${0} 0\"/>",
            "><origin xyz=\"0.4 0 0\"/></xacro:axis>",
        )
        .replace("rpy=\"0 0 0\" xyz=\"0.25 0 0\" name", "name")
        .replace(
            "child=\"hand\"/>",
            "child=\"hand\"><origin rpy=\"0 0 0\" xyz=\"0.25 0 0\"/></xacro:axis>",
        );
    // A block beside it that is no origin, and one of a property, do not hide it.
    let beside = several
        .replace("*place\"", "*turns *place\"")
        .replace(
            "<xacro:insert_block name=\"place\"/>",
            "<xacro:insert_block name=\"turns\"/><xacro:insert_block name=\"place\"/><xacro:insert_block name=\"rubs\"/>",
        )
        .replace("<origin x", "<calibration rising=\"0\"/><origin x")
        .replace("<origin r", "<calibration rising=\"0\"/><origin r")
        .replace(
            "<xacro:macro",
            "<xacro:property name=\"rubs\"><dynamics damping=\"1\"/></xacro:property><xacro:macro",
        );
    assert_eq!(beside.matches("<calibration").count(), 3);
    for text in [&several, &beside] {
        blocks_are_patched(text);
    }
    // A block that several places insert, or whose call has something else there, is not one joint's own.
    let xacro = "my_arm/urdf/arm.urdf.xacro";
    for (from, to) in [
        ("</joint>", "</joint><xacro:insert_block name=\"place\"/>"),
        ("<origin xyz=\"0.4 0 0\"/>", "<xacro:my_origin/>"),
    ] {
        let other = several.replacen(from, to, 1);
        let dir = with_xacro(&other);
        let ran = dir.calib(["apply", RESULT, xacro, "--in-place"]);
        assert_ne!(ran.code, 0, "{to}");
        assert!(
            ran.stderr.contains("comes from the block `place`"),
            "{to}: {}",
            ran.stderr
        );
        assert!(dir.read(xacro) == other, "{to}: it was changed");
    }
}

/// Each call has the calibrated origin of its joint, the macro is as it was, and all of it goes back.
fn blocks_are_patched(several: &str) {
    let xacro = "my_arm/urdf/arm.urdf.xacro";
    let calibrated =
        |dir: &Scratch| RobotModel::from_urdf_text(&dir.read(RESULT), "r").expect("a robot");
    let dir = with_xacro(several);
    dir.calib(["apply", RESULT, xacro, "--in-place"]).expect(0);
    let changed = dir.read(xacro);
    let macro_end = changed.find("</xacro:macro>").expect("the macro");
    assert_eq!(changed[..macro_end], several[..macro_end]);
    let expanded = roxmltree::Document::parse(&changed).expect("XML");
    let calls: Vec<_> = expanded
        .descendants()
        .filter(|n| n.tag_name().name() == "axis")
        .collect();
    assert_eq!(calls.len(), 3);
    for call in calls {
        let origins: Vec<_> = call
            .children()
            .filter(|n| n.has_tag_name("origin"))
            .collect();
        assert_eq!(origins.len(), 1, "{changed}");
        let numbers = |key: &str| -> Vec<f64> {
            let text = origins[0].attribute(key).unwrap_or("0 0 0");
            text.split(' ')
                .map(|x| x.parse().expect("a number"))
                .collect()
        };
        let (xyz, rpy) = (numbers("xyz"), numbers("rpy"));
        let written = Isometry3::from_parts(
            Translation3::new(xyz[0], xyz[1], xyz[2]),
            rotation_from_rpy(&Vector3::new(rpy[0], rpy[1], rpy[2])),
        );
        let robot = calibrated(&dir);
        let joint = robot
            .joint_id(call.attribute("name").expect("a name"))
            .expect("a joint");
        let off = robot.joint(joint).parent_link_from_joint.inverse() * written;
        assert!(
            off.translation.vector.norm() < 2e-9 && off.rotation.angle() < 2e-9,
            "{changed}"
        );
    }
    dir.calib(["revert", xacro, "--in-place"]).expect(0);
    assert!(dir.read(xacro) == several);
}

/// The file is named as it is in its own folder, and packages are sought above it.
#[test]
fn a_bare_file_name_finds_its_package() {
    let dir = with_xacro(PROPERTIES);
    let place = "my_arm/urdf";
    let command = "calib apply ../../result/r.calibrated.urdf arm.urdf.xacro --in-place";
    dir.quoted(place, command).expect(0);
    let changed = dir.read("my_arm/config/arm.yaml");
    assert_ne!(changed, YAML);
    let dry = format!("{} --diff", command.trim_end_matches(" --in-place"));
    let again = dir.quoted(place, &dry).expect(0);
    assert!(again.stdout.contains("nothing to do"), "{}", again.stdout);
    // The xacro goes back alone, and says what still holds its part.
    let back = dir
        .quoted(place, "calib revert arm.urdf.xacro --in-place")
        .expect(0);
    let said = format!("{}{}", back.stdout, back.stderr);
    assert!(said.contains("arm.yaml"), "{said}");
    assert!(dir.read("my_arm/urdf/arm.urdf.xacro") == PROPERTIES);
    dir.calib(["revert", "my_arm/config/arm.yaml", "--in-place"])
        .expect(0);
    assert!(dir.read("my_arm/config/arm.yaml") == YAML);
}

/// A dry run says what a change in place would be refused for.
#[test]
fn a_dry_run_says_what_would_be_refused() {
    let dir = result(Scratch::new(), "result", ARM, &["elbow"]).file("arm.urdf", ARM);
    let first = dir
        .calib(["apply", RESULT, "arm.urdf", "--in-place"])
        .expect(0);
    assert!(!first.stdout.contains("refused"), "{}", first.stdout);
    // The next month: another joint, from the changed file, which somebody edited since.
    let edited = dir
        .read("arm.urdf")
        .replace("</robot>", "<!-- by hand -->\n</robot>");
    let dir = result(dir, "result", &edited, &["wrist"]).file("arm.urdf", &edited);
    let dry = dir.calib(["apply", RESULT, "arm.urdf", "--diff"]);
    let said = format!("{}{}", dry.stdout, dry.stderr);
    assert!(said.contains("--in-place would be refused"), "{said}");
    let ran = dir.calib(["apply", RESULT, "arm.urdf", "--in-place"]);
    assert_ne!(ran.code, 0, "{}", ran.stdout);
    assert!(dir.read("arm.urdf") == edited);
}

/// A folder lets its files be replaced by others, whatever their own permissions: neither the change nor its way back does that to a protected file.
#[test]
fn a_protected_file_is_not_replaced() {
    let dir = result(Scratch::new(), "result", ARM, &["elbow"]).file("arm.urdf", ARM);
    let protect = |readonly: bool| {
        let path = dir.path("arm.urdf");
        let mut permissions = path.metadata().expect("there").permissions();
        permissions.set_readonly(readonly);
        std::fs::set_permissions(&path, permissions).expect("own file");
    };
    let in_place = || dir.calib(["apply", RESULT, "arm.urdf", "--in-place"]);
    protect(true);
    let dry = dir.calib(["apply", RESULT, "arm.urdf", "--diff"]).expect(0);
    assert!(dry.words().contains("would be refused"), "{}", dry.stdout);
    let ran = in_place();
    assert_eq!(ran.code, 7, "{}", ran.stderr);
    assert!(ran.stderr.contains("write-protected"), "{}", ran.stderr);
    assert!(ran.stderr.contains("chmod u+w arm.urdf"), "{}", ran.stderr);
    assert!(dir.read("arm.urdf") == ARM);
    assert!(!dir.path("arm.urdf.changes.json").exists());
    protect(false);
    in_place().expect(0);
    let changed = dir.read("arm.urdf");
    protect(true);
    let back = dir.calib(["revert", "arm.urdf", "--in-place"]);
    assert_eq!(back.code, 7, "{}", back.stderr);
    assert!(dir.read("arm.urdf") == changed);
    protect(false);
    dir.calib(["revert", "arm.urdf", "--in-place"]).expect(0);
    assert!(dir.read("arm.urdf") == ARM);
}

/// The controller's YAML has sixteen digits, the expanded URDF that was calibrated six decimals.
#[test]
fn a_ur_arm_s_yaml_keeps_the_digits_of_what_did_not_change() {
    let yaml = "kinematics:\n  shoulder:\n    x: 0\n    y: 0\n    z: 0.1625123456789\n    roll: -0\n    pitch: 0\n    yaw: -1.2345678901e-07\n  upper_arm:\n    x: -1.23456789e-07\n    y: 0\n    z: 0\n    roll: 1.570796326794897\n    pitch: 0\n    yaw: 0\n";
    let urdf = "<robot name=\"ur\"><link name=\"a\"/><link name=\"b\"/><link name=\"c\"/>\
        <joint name=\"shoulder_pan_joint\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/><origin xyz=\"0 0 0.162512\" rpy=\"0 0 0\"/><axis xyz=\"0 0 1\"/></joint>\
        <joint name=\"shoulder_lift_joint\" type=\"continuous\"><parent link=\"b\"/><child link=\"c\"/><origin xyz=\"0 0 0\" rpy=\"1.570796 0 0\"/><axis xyz=\"0 0 1\"/></joint></robot>";
    // A quarter of a turn in the URDF's six decimals.
    let quarter = (std::f64::consts::FRAC_PI_2 * 1e6).floor() / 1e6;
    // The yaw of the first joint, and y of the second.
    let edit = |joint: &str, xyz: [f64; 3], rpy: [f64; 3]| UrdfEdit::SetOrigin {
        joint: joint.to_owned(),
        parent_link_from_joint: Isometry3::from_parts(
            Translation3::from(Vector3::from(xyz)),
            rotation_from_rpy(&Vector3::from(rpy)),
        ),
    };
    let edits = [
        edit(
            "shoulder_pan_joint",
            [0.0, 0.0, 0.162512],
            [0.0, 0.0, 0.002],
        ),
        edit(
            "shoulder_lift_joint",
            [0.0, 0.001, 0.0],
            [quarter, 0.0, 0.0],
        ),
    ];
    let done = patch(urdf, "r", &edits).expect("a patch");
    let record = serde_json::to_string(&done.record(urdf)).expect("JSON");
    let dir = Scratch::new()
        .file(RESULT, done.text)
        .file("result/r.calibrated.urdf.changes.json", record)
        .file("k.yaml", yaml);
    dir.calib(["apply", RESULT, "k.yaml", "--in-place"])
        .expect(0);
    let expected = yaml
        .replacen("yaw: -1.2345678901e-07", "yaw: 0.001999877", 1)
        .replacen(
            "x: -1.23456789e-07\n    y: 0",
            "x: -1.23456789e-07\n    y: 0.001",
            1,
        );
    assert_eq!(dir.read("k.yaml"), expected);
}

#[test]
fn what_several_joints_share_is_refused() {
    let twice = PROPERTIES.replace(
        "  <xacro:arm side=\"\"/>",
        "  <xacro:arm side=\"\"/>\n  <xacro:arm side=\"left_\"/>",
    );
    let shared = PROPERTIES.replace(
        "<parent link=\"upper\"/>",
        "<parent link=\"upper\"/><limit upper=\"${upper_length}\"/>",
    );
    let computed = PROPERTIES.replace("${upper_length} 0 0", "${upper_length / 2} 0 0");
    let two_readers = PROPERTIES.replace(
        "  <joint name=\"wrist\"",
        "  <link name=\"probe\"><visual><origin xyz=\"${calibration.joints.wrist.x} 0 0\"/></visual></link>\n  <joint name=\"wrist\"",
    );
    let lost = PROPERTIES.replace("config/arm.yaml", "config/leg.yaml");
    let included = PROPERTIES.replace(
        "  <xacro:macro",
        "  <xacro:include filename=\"$(find other)/tool.xacro\"/>\n  <xacro:macro",
    );
    let mut said = String::new();
    for (what, xacro) in [
        ("a macro used twice", &twice),
        ("a property of two", &shared),
        ("an expression", &computed),
        ("a YAML value of two", &two_readers),
        ("no such YAML", &lost),
        ("an unknown include", &included),
    ] {
        let dir = with_xacro(xacro);
        let before = dir.files("my_arm");
        let ran = dir.calib(["apply", RESULT, "my_arm/urdf/arm.urdf.xacro", "--in-place"]);
        let ran = ran.expect(7);
        assert!(
            dir.files("my_arm") == before,
            "{what}: something was written"
        );
        said += &format!("--- {what}\n{}", ran.stderr);
    }
    insta::assert_snapshot!("refused_xacro", said);
    // The YAML may be named instead of found.
    let dir = with_xacro(&lost);
    let arguments = [
        "apply",
        RESULT,
        "my_arm/urdf/arm.urdf.xacro",
        "--diff",
        "--yaml",
    ];
    let mut arguments = arguments.to_vec();
    arguments.push("my_arm/config/arm.yaml");
    dir.calib_with(&arguments).expect(0);
}

#[test]
fn what_does_not_fit_is_refused() {
    let dir = || result(Scratch::new(), "result", ARM, &["elbow", "wrist"]).file("arm.urdf", ARM);
    let mut said = String::new();
    let mut tell = |what: &str, dir: Scratch, arguments: &[&str], code: i32| {
        let before = dir.files("");
        let ran = dir.calib_with(arguments).expect(code);
        assert!(dir.files("") == before, "{what}: something was written");
        said += &format!("--- {what}\n{}", ran.stderr);
    };
    let apply = ["apply", RESULT, "arm.urdf", "--in-place"];
    tell(
        "another robot",
        dir().edit("arm.urdf", "0.4 0 0", "0.5 0 0"),
        &apply,
        3,
    );
    tell(
        "another axis",
        dir().edit(
            "arm.urdf",
            "<axis xyz=\"0 1 0\"/>",
            "<axis xyz=\"0 -1 0\"/>",
        ),
        &apply,
        3,
    );
    tell(
        "a joint less",
        dir().edit("arm.urdf", "name=\"wrist\"", "name=\"wirst\""),
        &apply,
        7,
    );
    tell(
        "a file is there",
        dir(),
        &["apply", RESULT, "arm.urdf", "--out", "arm.urdf"],
        7,
    );
    tell(
        "no result",
        dir(),
        &["apply", "nothing", "arm.urdf", "--diff"],
        3,
    );
    tell(
        "no record",
        dir().without("result/r.calibrated.urdf.changes.json"),
        &apply,
        3,
    );
    tell(
        "an edited result",
        dir().edit(RESULT, "velocity=\"1\"", "velocity=\"2\""),
        &apply,
        3,
    );
    tell(
        "no YAML in it",
        dir(),
        &["apply", RESULT, "arm.urdf", "--diff", "--yaml", "x.yaml"],
        2,
    );
    tell(
        "a YAML without the joint",
        dir().file(
            "k.yaml",
            "joints: {elbow: {x: 0.4, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0}}\n",
        ),
        &["apply", RESULT, "k.yaml", "--in-place"],
        7,
    );
    let twice = dir();
    twice.calib_with(&apply).expect(0);
    let other = twice.edit(
        "arm.urdf",
        "<limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/>",
        "<limit lower=\"-2\" upper=\"1\" effort=\"1\" velocity=\"1\"/>",
    );
    tell(
        "edited since",
        other,
        &["revert", "arm.urdf", "--in-place"],
        3,
    );
    let half = dir();
    half.calib_with(&apply).expect(0);
    let elbow = half.read("arm.urdf");
    let elbow = elbow
        .lines()
        .find(|l| l.contains("0.401"))
        .expect("elbow")
        .to_owned();
    let half = half.without("arm.urdf.changes.json").edit(
        "arm.urdf",
        &elbow,
        "    <origin xyz=\"0.4 0 0\" rpy=\"0 0 0\"/><axis xyz=\"0 1 0\"/>",
    );
    tell("half applied", half, &apply, 3);
    let taken = dir().file("arm.urdf.changes.json", "{}");
    tell("a record is there", taken, &apply, 3);
    insta::with_settings!({filters => [("[0-9a-f]{64}", "[sha256]")]}, {
        insta::assert_snapshot!("refused_result", said);
    });
}

#[test]
fn a_run_is_applied_to_the_robot_it_was_made_for() {
    for robot in ["ripley", "justin"] {
        let dir = &finished(robot, "ml").dir;
        let urdf = match robot {
            "ripley" => "robots/ripley/r17.urdf",
            _ => "robots/justin/justin.urdf",
        };
        for (n, from) in ["out", "out/report.json"].iter().enumerate() {
            let new = format!("applied-{n}.urdf");
            let ran = dir.calib(["apply", from, urdf, "--out", &new]).expect(0);
            let written = dir.read(&format!("out/{robot}.calibrated.urdf"));
            assert!(dir.read(&new) == written, "{robot}: what the run wrote");
            let effects = ran.stdout.contains("calibration.yaml");
            assert_eq!(effects, robot == "justin", "{}", ran.stdout);
        }
        let listed = dir.read("out/report.json");
        for file in dir.files("out").keys().filter(|f| *f != "calib.manifest") {
            let named = format!("\"path\": \"{file}\"");
            assert!(listed.contains(&named), "{robot}: {file} is not listed");
        }
    }
}

#[test]
fn a_rejected_calibration_is_not_applied() {
    let dir = Scratch::new().brief("ripley").edit(
        "robots/ripley.yaml",
        "held_out_max_mm: 4",
        "held_out_max_mm: 0.1",
    );
    dir.calib(["run", "robots/ripley.yaml", "--out", "out"])
        .expect(1);
    let urdf = "robots/ripley/r17.urdf";
    let ran = dir.calib(["apply", "out", urdf, "--diff"]).expect(1);
    assert!(ran.stderr.contains("is \"rejected\""), "{}", ran.stderr);
    assert!(ran.stderr.contains("--force"), "{}", ran.stderr);
    let forced = dir
        .calib(["apply", "out", urdf, "--diff", "--force"])
        .expect(0);
    assert!(
        forced
            .stdout
            .contains("note: the verdict of this calibration is")
    );
}
