//! A calibration in files where numbers stand in another place than the joint, or several joints share them: xacros with properties, macros and
//! blocks, and the kinematics YAML of a UR arm.

use crate::scratch;

use calib_urdf::rpy::rotation_from_rpy;
use calib_urdf::{RobotModel, UrdfEdit, patch};
use nalgebra::{Isometry3, Translation3, Vector3};
use scratch::Scratch;

use crate::apply::{ARM, PROPERTIES, RESULT, YAML, result, with_xacro, without_numbers};

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

/// The left arm's result and a file whose one macro call gives the right arm: what the file itself calls its joints decides, through parameters, their
/// defaults, nested macros and properties.
#[test]
fn a_file_that_names_its_joints_for_another_arm_is_refused() {
    let left = ARM
        .replace("name=\"shoulder\"", "name=\"left_shoulder\"")
        .replace("name=\"elbow\"", "name=\"left_elbow\"")
        .replace("name=\"wrist\"", "name=\"left_wrist\"");
    let joints = ["left_shoulder", "left_elbow", "left_wrist"];
    let body = ARM
        .replace("name=\"shoulder\"", "name=\"${side}shoulder\"")
        .replace("name=\"elbow\"", "name=\"${side}elbow\"")
        .replace("name=\"wrist\"", "name=\"${side}wrist\"");
    let body = body
        .trim_start_matches("<robot name=\"arm\">\n")
        .trim_end_matches("</robot>\n");
    let file = |head: &str, params: &str, call: &str| {
        format!(
            "<robot name=\"arm\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\">\n{head}<xacro:macro name=\"arm\" \
             params=\"{params}\">\n{body}</xacro:macro>\n{call}\n</robot>\n"
        )
    };
    let property = |side: &str| format!("<xacro:property name=\"s\" value=\"{side}\"/>\n");
    let nested = |side: &str| {
        format!(
            "<xacro:macro name=\"cell\" params=\"p\"><xacro:arm side=\"${{p}}\"/></xacro:macro>\n<xacro:cell p=\"{side}\"/>"
        )
    };
    for (what, wrong, right) in [
        (
            "call",
            file("", "side", "<xacro:arm side=\"right_\"/>"),
            file("", "side", "<xacro:arm side=\"left_\"/>"),
        ),
        (
            "default",
            file("", "side:=right_", "<xacro:arm/>"),
            file("", "side:=left_", "<xacro:arm/>"),
        ),
        (
            "nested",
            file("", "side", &nested("right_")),
            file("", "side", &nested("left_")),
        ),
        (
            "property",
            file(&property("right_"), "side", "<xacro:arm side=\"${s}\"/>"),
            file(&property("left_"), "side", "<xacro:arm side=\"${s}\"/>"),
        ),
        (
            "no prefix",
            file("", "side", "<xacro:arm side=\"\"/>"),
            file("", "side", "<xacro:arm side=\"$(arg side)\"/>"),
        ),
    ] {
        let dir = result(Scratch::new(), "result", &left, &joints);
        let dir = dir.file("a.xacro", &wrong).file("b.xacro", &right);
        let refused = dir.calib(["apply", RESULT, "a.xacro", "--in-place"]);
        let said = refused.expect(7).stderr.replace('\n', " ");
        assert!(
            said.contains("has no joint `left_shoulder`"),
            "{what}: {said}"
        );
        assert!(dir.read("a.xacro") == wrong, "{what}");
        dir.calib(["apply", RESULT, "b.xacro", "--in-place"])
            .expect(0);
        assert!(dir.read("b.xacro") != right, "{what}");
    }
}
