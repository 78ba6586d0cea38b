//! Everything that may be wrong with a URDF, and what the person who gets the message reads.

use calib_urdf::RobotModel;
use calib_urdf::source::{decode, read_text};

const GOOD: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="upper_arm"/>
  <link name="fore_arm"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/>
    <child link="upper_arm"/>
    <origin xyz="0 0 0.3" rpy="0 0 0"/>
    <axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper_arm"/>
    <child link="fore_arm"/>
    <origin xyz="0.4 0 0"/>
    <axis xyz="0 1 0"/>
  </joint>
</robot>
"#;

/// The message about `GOOD` with one text exchanged for another.
fn message(old: &str, new: &str) -> String {
    assert!(GOOD.contains(old), "{old}");
    message_of(&GOOD.replacen(old, new, 1))
}

fn message_of(text: &str) -> String {
    match RobotModel::from_urdf_text(text, "arm.urdf") {
        Ok(_) => "accepted".to_owned(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn the_good_one_is_good() {
    assert_eq!(message_of(GOOD), "accepted");
    assert_eq!(
        message_of(&format!("\u{feff}{}", GOOD.replace('\n', "\r\n"))),
        "accepted"
    );
}

#[test]
fn messages() {
    let table = [
        ("empty file", message_of(" \n")),
        ("cut off", message_of(&GOOD[..GOOD.len() - 10])),
        ("cut off in a tag", message_of(&GOOD[..300])),
        ("wrong closing tag", message("</joint>", "</jiont>")),
        (
            "unescaped ampersand",
            message("name=\"arm\"", "name=\"arm & hand\""),
        ),
        ("unknown entity", message("0.4 0 0", "&d; 0 0")),
        (
            "not a robot",
            message_of("<sdf version='1.6'><model/></sdf>"),
        ),
        ("a web page", message_of("<html><body>404</body></html>")),
        ("not XML", message_of("robot: arm\n")),
        ("no links", message_of("<robot name='x'></robot>")),
        (
            "link without a name",
            message("<link name=\"base\"/>", "<link nme=\"base\"/>"),
        ),
        (
            "link twice",
            message(
                "<link name=\"fore_arm\"/>",
                "<link name=\"fore_arm\"/>\n  <link name=\"base\"/>",
            ),
        ),
        (
            "joint twice",
            message("name=\"elbow\"", "name=\"shoulder\""),
        ),
        (
            "unknown parent",
            message(
                "<parent link=\"upper_arm\"/>",
                "<parent link=\"uper_arm\"/>",
            ),
        ),
        (
            "unknown child",
            message("<child link=\"fore_arm\"/>", "<child link=\"gripper\"/>"),
        ),
        ("no parent", message("<parent link=\"upper_arm\"/>", "")),
        (
            "parent without a link",
            message(
                "<parent link=\"upper_arm\"/>",
                "<parent name=\"upper_arm\"/>",
            ),
        ),
        (
            "two parents",
            message("<child link=\"fore_arm\"/>", "<child link=\"upper_arm\"/>"),
        ),
        (
            "circle",
            message("<parent link=\"base\"/>", "<parent link=\"fore_arm\"/>"),
        ),
        (
            "own parent",
            message(
                "<parent link=\"upper_arm\"/>",
                "<parent link=\"fore_arm\"/>",
            ),
        ),
        (
            "two roots",
            message(
                "<link name=\"base\"/>",
                "<link name=\"base\"/><link name=\"table\"/>",
            ),
        ),
        ("a word in xyz", message("0.4 0 0", "0 abc 0")),
        ("two numbers", message("0.4 0 0", "0.4 0")),
        ("four numbers", message("0.4 0 0", "0.4 0 0 0")),
        ("nothing", message("xyz=\"0.4 0 0\"", "xyz=\"\"")),
        ("NaN", message("0.4 0 0", "0.4 nan 0")),
        ("inf", message("rpy=\"0 0 0\"", "rpy=\"0 0 -inf\"")),
        ("too large a number", message("0.4 0 0", "0.4 0 1e999")),
        ("decimal comma", message("0.4 0 0", "0,4 0 0")),
        ("commas between", message("0.4 0 0", "0.4,0,0")),
        (
            "zero axis",
            message("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 0\"/>"),
        ),
        (
            "slip in an attribute",
            message("xyz=\"0.4 0 0\"", "xzy=\"0.4 0 0\""),
        ),
        (
            "two origins",
            message(
                "<origin xyz=\"0.4 0 0\"/>",
                "<origin xyz=\"0.4 0 0\"/>\n    <origin xyz=\"0.5 0 0\"/>",
            ),
        ),
        ("unknown type", message("continuous", "continous")),
        ("no type", message(" type=\"continuous\"", "")),
        ("floating", message("continuous", "floating")),
        ("planar", message("continuous", "planar")),
        ("reversed limits", message("lower=\"-1\"", "lower=\"3\"")),
        (
            "mimic of nobody",
            message(
                "<axis xyz=\"0 1 0\"/>\n  </joint>",
                "<mimic joint=\"sholder\"/></joint>",
            ),
        ),
        (
            "mimic of itself",
            message(
                "<axis xyz=\"0 1 0\"/>\n  </joint>",
                "<mimic joint=\"elbow\"/></joint>",
            ),
        ),
        (
            "negative mass",
            message(
                "<link name=\"base\"/>",
                "<link name=\"base\"><inertial><mass value=\"-1\"/></inertial></link>",
            ),
        ),
        (
            "quaternion and rpy",
            message_of(
                &GOOD
                    .replace("<robot", "<robot version=\"1.1\"")
                    .replace("rpy=\"0 0 0\"", "rpy=\"0 0 0\" quat_xyzw=\"0 0 0 1\""),
            ),
        ),
        (
            "zero quaternion",
            message_of(
                &GOOD
                    .replace("<robot", "<robot version=\"1.1\"")
                    .replace("rpy=\"0 0 0\"", "quat_xyzw=\"0 0 0 0\""),
            ),
        ),
        ("xacro expression", message("0.4 0 0", "${length} 0 0")),
        (
            "xacro element",
            message_of(
                "<robot name=\"arm\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\">\n  <xacro:include filename=\"arm.xacro\"/>\n</robot>",
            ),
        ),
        (
            "xacro without its declaration",
            message("<link name=\"base\"/>", "<xacro:arm/>"),
        ),
        (
            "several at once",
            message_of(
                &GOOD
                    .replace("0.4 0 0", "0.4 0")
                    .replace("continuous", "hinge")
                    .replace(
                        "<axis xyz=\"0 1 0\"/>\n    <limit",
                        "<axis xyz=\"0 0 0\"/>\n    <limit",
                    ),
            ),
        ),
    ];
    // Half of the messages at a time is what a person reviews.
    for (part, cases) in table.chunks(table.len().div_ceil(2)).enumerate() {
        let text: String = cases
            .iter()
            .map(|(name, message)| format!("--- {name}\n{message}\n"))
            .collect();
        insta::assert_snapshot!(format!("messages_{}", part + 1), text);
    }
}

#[test]
fn bytes_that_are_not_text() {
    let mut latin1 = GOOD.as_bytes().to_vec();
    let at = GOOD.find("elbow").unwrap();
    latin1[at] = 0xfc;
    insta::assert_snapshot!("latin1", decode(&latin1, "arm.urdf").unwrap_err());
    insta::assert_snapshot!(
        "utf16",
        decode(&[0xff, 0xfe, b'<', 0], "arm.urdf").unwrap_err()
    );
    let huge = vec![b' '; (64 << 20) + 1];
    insta::assert_snapshot!("huge", decode(&huge, "arm.urdf").unwrap_err());
    assert_eq!(decode(b"", "arm.urdf").map(message_of), Ok(message_of("")));
}

#[test]
fn a_file_that_is_not_there() {
    let error =
        read_text(std::path::Path::new("no/such/arm.urdf"), "no/such/arm.urdf").unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("no/such/arm.urdf: cannot be read: "),
        "{error}"
    );
}

#[test]
fn meshes_are_kept_and_never_opened() {
    let text = GOOD.replace(
        "<link name=\"base\"/>",
        "<link name=\"base\"><visual><geometry><mesh filename=\"package://nowhere/$(x)/base.stl\"/></geometry></visual></link>",
    );
    assert_eq!(message_of(&text), "accepted");
}

#[test]
fn nested_rubbish_does_not_overflow_the_stack() {
    let deep = format!(
        "<robot>{}{}</robot>",
        "<link>".repeat(200_000),
        "</link>".repeat(200_000)
    );
    assert_ne!(message_of(&deep), "accepted");
    let bomb = "<!DOCTYPE robot [<!ENTITY a \"aaaaaaaaaa\">".to_owned()
        + &(0..12)
            .map(|i| {
                format!(
                    "<!ENTITY {} \"{}\">",
                    char::from(b'b' + i),
                    format!("&{};", char::from(b'a' + i)).repeat(10)
                )
            })
            .collect::<String>()
        + "]><robot name=\"&m;\"/>";
    assert_ne!(message_of(&bomb), "accepted");
}

#[test]
fn a_file_with_a_hundred_thousand_mistakes_is_answered_soon() {
    let begin = std::time::Instant::now();
    let links = "<link name=\"same\"/>\n<joint name=\"j\"/>\n".repeat(50_000);
    let message = message_of(&format!("<robot>\n{links}</robot>"));
    assert!(
        message.ends_with("… and more findings"),
        "{}",
        &message[message.len() - 100..]
    );
    let strangers: String = (0..5_000).map(|i| format!("<link name=\"link_{i}\"/><joint name=\"j{i}\" type=\"fixed\"><parent link=\"lnk_{i}\"/><child link=\"lkn_{i}\"/></joint>\n")).collect();
    assert!(
        message_of(&format!("<robot>\n{strangers}</robot>")).contains("did you mean `link_0`?")
    );
    assert!(begin.elapsed().as_secs() < 10, "{:?}", begin.elapsed());
}

#[test]
fn what_bears_on_no_kinematics_is_a_warning_with_its_place() {
    let still = "<link name=\"plate\"/><joint name=\"still\" type=\"fixed\"><parent link=\"base\"/><child link=\"plate\"/></joint>\n</robot>";
    let text = GOOD
        .replace("lower=\"-1\"", "lower=\"3\"")
        .replace(
            "<axis xyz=\"0 1 0\"/>\n  </joint>",
            "<axis xyz=\"0 1 0\"/><mimic joint=\"still\" offset=\"0.5\"/></joint>",
        )
        .replace("</robot>", still);
    let model = RobotModel::from_urdf_text(&text, "arm.urdf").unwrap();
    let said: Vec<String> = model
        .warnings()
        .iter()
        .map(|w| format!("{}: {}", w.place.expect("a place"), w.problem))
        .collect();
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(said[0].starts_with("10:5: the lower limit 3"), "{said:?}");
    assert!(
        said[1].contains("mimics the fixed joint `still`"),
        "{said:?}"
    );
    let joint = |name: &str| model.joint(model.joint_id(name).unwrap());
    assert_eq!(joint("shoulder").limits.range(), None);
    // It stands still, at its offset.
    let law = joint("elbow").law;
    assert_eq!((law.multiplier, law.offset), (0.0, 0.5));
}

#[test]
fn a_document_type_definition_is_refused_with_its_place() {
    let text = format!(
        "<?xml version=\"1.0\"?>\n<!DOCTYPE robot [<!ENTITY d \"0.4\">]>\n{}",
        GOOD.replace("0.4 0 0", "&d; 0 &#48;")
    );
    let message = message_of(&text);
    assert!(message.starts_with("arm.urdf:2:1: "), "{message}");
    assert!(message.contains("document type definition"), "{message}");
    // A kilobyte of entities that stand for gigabytes: no parser sees it.
    let bomb = text.replace("&d;", &"&d;".repeat(1_000_000));
    let begin = std::time::Instant::now();
    assert!(message_of(&bomb).contains("document type definition"));
    assert!(begin.elapsed().as_secs() < 1, "{:?}", begin.elapsed());
}

#[test]
fn nesting_is_bounded_before_any_parser_runs() {
    for (levels, accepted) in [(900, true), (1_100, false), (200_000, false)] {
        let inside = "<x>".repeat(levels) + &"</x>".repeat(levels);
        let text = GOOD.replacen("</robot>", &format!("<gazebo>{inside}</gazebo></robot>"), 1);
        let message = message_of(&text);
        assert_eq!(message == "accepted", accepted, "{levels}: {message}");
        assert!(
            accepted || message.contains("nested in more than 1000 levels"),
            "{message}"
        );
        if accepted {
            // The other readers take it too: a patch is verified by them.
            let model = RobotModel::from_urdf_text(&text, "arm.urdf").unwrap();
            let joint = &model.joints()[0];
            let edit = calib_urdf::UrdfEdit::SetOrigin {
                joint: joint.name.clone(),
                parent_link_from_joint: calib_urdf::nalgebra::Isometry3::translation(0.1, 0.2, 0.3),
            };
            calib_urdf::patch(&text, "arm.urdf", &[edit]).unwrap();
        }
    }
}
