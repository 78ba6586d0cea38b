//! A xacro is patched where its text is literal and stands for one joint, and refused with the reason elsewhere.

use calib_urdf::{UrdfEdit, patch, revert};
use nalgebra::Isometry3;

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
    <origin xyz="0.4 0 0" rpy="0 0 ${pi/2}"/>
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
