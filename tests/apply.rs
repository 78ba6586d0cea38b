//! A calibration in other people's files. Only the numbers change, everything can be reverted byte for byte, and what does not fit is refused.

use crate::scratch;

use calib_urdf::rpy::rotation_from_rpy;
use calib_urdf::{RobotModel, UrdfEdit, patch};
use nalgebra::{Isometry3, Translation3, Vector3};
use scratch::{Scratch, files_below, finished, root};

/// Moves the joints, a different way each, and writes what `calib run` would have written.
pub(crate) fn result(dir: Scratch, folder: &str, urdf: &str, joints: &[&str]) -> Scratch {
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
pub(crate) fn without_numbers(text: &str) -> String {
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

pub(crate) const ARM: &str = r#"<robot name="arm">
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

pub(crate) const YAML: &str = "# wrist of cell 3\njoints:\n  wrist: {x: 0.25, y: 0.0, z: 0.0, roll: 0.0, pitch: 0.0, yaw: 0.0} # at its zero configuration\n";

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
