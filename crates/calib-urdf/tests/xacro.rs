//! A xacro is patched where its text is literal and stands for one joint, and refused with the reason elsewhere.

use calib_urdf::{
    Companion, Companions, Reads, UrdfEdit, patch, patch_with, references, replay, revert,
    rpy::rotation_from_rpy,
};
use nalgebra::{Isometry3, Translation3, Vector3};

const ARM: &str = r#"<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="h" value="0.3"/>
  <xacro:property name="reach" value=" 0.40 "/>
  <xacro:property name="twice_named" value="0.5"/>
  <xacro:property name="computed" value="${h * 2}"/>
  <xacro:macro name="finger" params="side">
    <link name="${side}_finger"/>
    <joint name="${side}_knuckle" type="revolute">
      <parent link="hand"/><child link="${side}_finger"/>
      <origin xyz="0 0 0.1"/>
    </joint>
  </xacro:macro>
  <xacro:macro name="both"><joint name="twice" type="fixed"><origin xyz="0 0 1"/></joint></xacro:macro>
  <xacro:macro name="once"><joint name="single" type="fixed"><origin xyz="0 0 1"/></joint></xacro:macro>
  <xacro:macro name="library"><joint name="elsewhere" type="fixed"><origin xyz="0 0 1"/></joint></xacro:macro>
  <xacro:macro name="outer"><xacro:inner/></xacro:macro>
  <xacro:macro name="inner"><joint name="nested" type="fixed"><origin xyz="0 0 1"/></joint></xacro:macro>
  <xacro:finger side="left"/>
  <xacro:finger side="right"/>
  <xacro:both/> <xacro:both/> <xacro:once/>
  <xacro:outer/> <xacro:outer/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/>
    <origin xyz="0 0 ${h}" rpy="0 0 0"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="hand"/>
    <origin xyz="0.4 0 0" rpy="0 0 ${pi/2 - h}"/>
  </joint>
  <joint name="sleeve" type="fixed"><origin xyz="${reach}  0 0.25"/></joint>
  <joint name="shared" type="fixed"><origin xyz="${twice_named} 0 0"/></joint>
  <joint name="other" type="fixed"><origin xyz="0 0 ${twice_named}"/></joint>
  <joint name="indirect" type="fixed"><origin xyz="0 0 ${computed}"/></joint>
  <xacro:if value="$(arg long)"><joint name="tool" type="fixed"><origin xyz="0 0 2"/></joint></xacro:if>
  <xacro:unless value="$(arg long)"><joint name="tool" type="fixed"><origin xyz="0 0 1"/></joint></xacro:unless>
  <joint name="wrist" type="revolute">
    <parent link="hand"/><child link="tip"/>
    <origin xyz="0.1 0 0" rpy="0 0 0"/>
  </joint>
  <transmission name="t"><joint name="wrist"/></transmission>
</robot>
"#;

fn to(joint: &str) -> [UrdfEdit; 1] {
    [UrdfEdit::SetOrigin {
        joint: joint.to_owned(),
        parent_link_from_joint: Isometry3::translation(0.125, 0.0, 0.0),
    }]
}

#[test]
fn literal_text_is_patched() {
    let done = patch(ARM, "arm.xacro", &to("wrist")).unwrap();
    assert_eq!(
        done.text,
        ARM.replace("xyz=\"0.1 0 0\"", "xyz=\"0.125 0 0\"")
    );
    assert_eq!(revert(&done.text, &done.record(ARM)).unwrap(), ARM);
    assert!(
        patch(&done.text, "arm.xacro", &to("wrist"))
            .unwrap()
            .splices
            .is_empty()
    );
    let single = patch(ARM, "arm.xacro", &to("single")).unwrap();
    assert_eq!(single.changes.len(), 1);
}

#[test]
fn a_property_of_one_joint_is_patched_where_it_is_defined() {
    let done = patch(ARM, "arm.xacro", &to("sleeve")).unwrap();
    let expected = ARM
        .replace("\" 0.40 \"", "\" 0.125 \"")
        .replace("${reach}  0 0.25", "${reach}  0 0");
    assert_eq!(done.text, expected);
    assert_eq!(revert(&done.text, &done.record(ARM)).unwrap(), ARM);
    let with_include = ARM.replace(
        "  <xacro:finger side=\"left\"/>",
        "  <xacro:include filename=\"hand.xacro\"/>",
    );
    insta::assert_snapshot!(
        "included",
        patch(&with_include, "arm.xacro", &to("sleeve")).unwrap_err()
    );
}

#[test]
fn what_xacro_computes_is_refused() {
    let joints = [
        "shoulder",
        "elbow",
        "shared",
        "indirect",
        "left_knuckle",
        "twice",
        "elsewhere",
        "nested",
        "tool",
        "wirst",
    ];
    let text: String = joints
        .iter()
        .map(|joint| {
            format!(
                "--- {joint}\n{}\n",
                patch(ARM, "arm.xacro", &to(joint)).unwrap_err()
            )
        })
        .collect();
    insta::assert_snapshot!("refused", text);
}

#[test]
fn a_constant_is_replaced_as_a_whole() {
    let text = ARM.replace("${pi/2 - h}", "${ pi / 2 }");
    let done = patch(&text, "arm.xacro", &to("elbow")).unwrap();
    let expected = text.replace(
        "xyz=\"0.4 0 0\" rpy=\"0 0 ${ pi / 2 }\"",
        "xyz=\"0.125 0 0\" rpy=\"0 0 0\"",
    );
    assert_eq!(done.text, expected);
    assert_eq!(revert(&done.text, &done.record(&text)).unwrap(), text);
}

#[test]
fn a_macro_that_is_used_once_may_compute_the_name() {
    let once = ARM.replace("  <xacro:finger side=\"right\"/>\n", "");
    let done = patch(&once, "arm.xacro", &to("left_knuckle")).unwrap();
    assert_eq!(done.text, once.replace("0 0 0.1\"", "0.125 0 0\""));
}

const CALIBRATED: &str = r#"<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="file" default="$(find arm)/config/calibration.yaml"/>
  <xacro:property name="calibration" value="${xacro.load_yaml('$(arg file)')}"/>
  <xacro:property name="joints" value="${calibration['joints']}"/>
  <xacro:property name="elbow_z" value="${joints.elbow.z}"/>
  <xacro:property name="whole" value="0.1  0 0.3"/>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="fore"/>
    <origin xyz="${joints['elbow']['x']} ${calibration['joints']['elbow']['y']} ${elbow_z}"
            rpy="${joints.elbow.roll} ${joints.elbow.pitch} ${joints.elbow.yaw}"/>
  </joint>
  <joint name="wrist" type="revolute">
    <origin xyz="${joints.wrist.x} 0 0"/>
  </joint>
  <joint name="wrist_twin" type="revolute">
    <origin xyz="0 ${joints.wrist.x} 0"/>
  </joint>
  <joint name="given_away" type="fixed">
    <origin xyz="${joints.tool.x} 0 0"/>
  </joint>
  <xacro:tool where="${joints.tool}"/>
  <joint name="computed" type="fixed">
    <origin xyz="${joints.flange.x * 1e-3} 0 0"/>
  </joint>
  <joint name="also_computed" type="fixed">
    <origin xyz="${joints.flange.x} 0 0"/>
  </joint>
  <joint name="quoted" type="fixed"><origin xyz="${joints.quoted.x} 0 0"/></joint>
  <joint name="anchored" type="fixed"><origin xyz="${joints.anchored.x} 0 0"/></joint>
  <joint name="missing" type="fixed"><origin xyz="${joints.missing.x} 0 0"/></joint>
  <joint name="elsewhere" type="fixed"><origin xyz="${xacro.load_yaml('other.yaml')['x']} 0 0"/></joint>
  <joint name="sleeve" type="fixed"><origin xyz="${whole}"/></joint>
</robot>
"#;

const YAML: &str = "# measured on a Monday \u{2014} \u{fc}\njoints:\n  elbow: {x: 0.40, y: 0,   z: 0.0e0, roll: 0, pitch: 0.10, yaw: -0.0} # keep me\n\
\x20 wrist:\n    x: 0.1\n  tool: {x: 0.2}\n  flange: {x: 7}\n  quoted: {x: '0.1'}\n  anchored: &a {x: 0.1}\n  copy: *a\n";

fn around(yaml: &str) -> Companions {
    Companions {
        yaml: vec![Companion {
            argument: "$(find arm)/config/calibration.yaml".to_owned(),
            name: "calibration.yaml".to_owned(),
            text: yaml.to_owned(),
        }],
        ..Companions::default()
    }
}

fn elbow_to() -> [UrdfEdit; 1] {
    [UrdfEdit::SetOrigin {
        joint: "elbow".to_owned(),
        parent_link_from_joint: Isometry3::from_parts(
            Translation3::new(0.401, 0.002, 0.003),
            rotation_from_rpy(&Vector3::new(0.01, 0.10, 0.02)),
        ),
    }]
}

#[test]
fn numbers_in_a_loaded_yaml_are_replaced_there() {
    let done = patch_with(CALIBRATED, "arm.xacro", &elbow_to(), &around(YAML)).unwrap();
    assert_eq!(done.main.text, CALIBRATED);
    let [(0, yaml)] = done.yaml.as_slice() else {
        panic!("one YAML changes: {:?}", done.yaml);
    };
    let expected = YAML.replace(
        "{x: 0.40, y: 0,   z: 0.0e0, roll: 0, pitch: 0.10, yaw: -0.0}",
        "{x: 0.401, y: 0.002,   z: 0.003, roll: 0.01, pitch: 0.10, yaw: 0.02}",
    );
    assert_eq!(yaml.text, expected);
    assert_eq!(revert(&yaml.text, &yaml.record(YAML)).unwrap(), YAML);
    assert_eq!(replay(YAML, &yaml.record(YAML)), Some(yaml.text.clone()));
    assert_eq!(replay(&yaml.text, &yaml.record(YAML)), None);
    let before = done.before["elbow"];
    assert!((before.translation.vector - Vector3::new(0.4, 0.0, 0.0)).norm() < 1e-15);
    assert!((before.rotation.angle() - 0.1).abs() < 1e-15);
    let again = patch_with(CALIBRATED, "arm.xacro", &elbow_to(), &around(&yaml.text)).unwrap();
    assert!(again.yaml.is_empty() && again.main.splices.is_empty());
    insta::assert_debug_snapshot!("yaml_changes", yaml.changes);
}

#[test]
fn one_property_may_hold_all_three_numbers() {
    let done = patch_with(CALIBRATED, "arm.xacro", &to("sleeve"), &around(YAML)).unwrap();
    assert_eq!(
        done.main.text,
        CALIBRATED.replace("0.1  0 0.3", "0.125  0 0")
    );
}

#[test]
fn values_that_others_read_are_refused() {
    let joints = [
        "wrist",
        "given_away",
        "computed",
        "also_computed",
        "quoted",
        "anchored",
        "missing",
        "elsewhere",
    ];
    let text: String = joints
        .iter()
        .map(|joint| {
            let refused =
                patch_with(CALIBRATED, "arm.xacro", &to(joint), &around(YAML)).unwrap_err();
            format!("--- {joint}\n{refused}\n")
        })
        .collect();
    insta::assert_snapshot!("refused_yaml", text);
}

#[test]
fn included_files_count_as_readers() {
    let text = ARM.replace(
        "  <xacro:finger side=\"left\"/>",
        "  <xacro:include filename=\"hand.xacro\"/>",
    );
    let with = |hand: &str| Companions {
        included: vec![Companion {
            argument: "hand.xacro".to_owned(),
            name: "hand.xacro".to_owned(),
            text: hand.to_owned(),
        }],
        ..Companions::default()
    };
    let quiet = "<robot><link name=\"reach\"/></robot>";
    assert!(patch_with(&text, "arm.xacro", &to("sleeve"), &with(quiet)).is_ok());
    let reader = "<robot><link name=\"${reach * 2}\"/></robot>";
    let refused = patch_with(&text, "arm.xacro", &to("sleeve"), &with(reader)).unwrap_err();
    insta::assert_snapshot!("included_reader", refused);
    let mut unknown = with(quiet);
    unknown.unseen.push("more.xacro".to_owned());
    assert!(patch_with(&text, "arm.xacro", &to("sleeve"), &unknown).is_err());
}

#[test]
fn what_a_xacro_reads() {
    let text = CALIBRATED.replace(
        "  <xacro:arg",
        "  <xacro:include filename=\"a.xacro\"/>\n  <xacro:arg",
    );
    let found: Vec<_> = references(&text, "arm.xacro")
        .unwrap()
        .into_iter()
        .map(|r| (r.reads, r.argument, r.place.line))
        .collect();
    assert_eq!(
        found,
        [
            (Reads::Include, "a.xacro".to_owned(), 2),
            (
                Reads::Yaml,
                "$(find arm)/config/calibration.yaml".to_owned(),
                4
            ),
            (Reads::Yaml, "other.yaml".to_owned(), 32),
        ]
    );
}
