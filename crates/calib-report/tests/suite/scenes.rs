//! The scene's files: what the situation model, ROS and Gazebo read.

use crate::examples;

use calib_report::Scene;
use insta::assert_snapshot;
use std::process::Command;

#[test]
fn the_scene_and_its_derived_files() {
    let scene = examples::scene();
    assert_snapshot!("scene_json", scene.json().expect("a tree"));
    assert_snapshot!("scene_launch", scene.ros_launch().expect("a tree"));
    assert_snapshot!("scene_sdf", scene.sdf().expect("a tree"));
}

#[test]
fn the_scene_reads_back() {
    let scene = examples::scene();
    assert_eq!(
        Scene::from_json(&scene.json().expect("a tree")).expect("its own JSON"),
        scene
    );
}

fn hostile() -> Scene {
    let mut scene = examples::scene();
    let name = "\"a\" & <b>\\\n'c'";
    scene.name = name.into();
    scene.frames.push(calib_report::scene::SceneFrame::root(
        name,
        calib_report::Status::Assumed,
    ));
    scene.frames.push(calib_report::scene::SceneFrame::new(
        "below",
        name,
        &nalgebra::Isometry3::identity(),
        None,
        calib_report::Status::Assumed,
    ));
    scene
}

#[test]
fn the_sdf_is_xml_and_every_frame_is_named_before_it_is_used() {
    for scene in [examples::scene(), hostile()] {
        let text = scene.sdf().expect("a tree");
        let document = roxmltree::Document::parse(&text).expect("XML");
        let named: Vec<&str> = document
            .descendants()
            .filter(|node| node.has_tag_name("frame") || node.has_tag_name("model"))
            .filter_map(|node| node.attribute("name"))
            .collect();
        for pose in document
            .descendants()
            .filter(|node| node.has_tag_name("pose"))
        {
            let numbers: Vec<f64> = pose
                .text()
                .expect("numbers")
                .split_whitespace()
                .map(|x| x.parse().expect("a number"))
                .collect();
            assert_eq!(numbers.len(), 7);
            if let Some(frame) = pose.attribute("relative_to") {
                assert!(
                    named.contains(&frame) || frame.starts_with("ripley::"),
                    "{frame} of {named:?}"
                );
            }
        }
    }
}

/// The launch file is run with stand-ins for the two ROS modules: every frame once, numbers that read back, nothing of the URDF but its root.
#[test]
fn the_launch_file_is_python_that_publishes_every_frame_once() {
    let harness = r#"
import sys, types
calls = []
launch = types.ModuleType("launch"); launch.LaunchDescription = lambda nodes: nodes
actions = types.ModuleType("launch_ros.actions"); actions.Node = lambda **k: calls.append(k) or k
sys.modules.update({"launch": launch, "launch_ros": types.ModuleType("launch_ros"), "launch_ros.actions": actions})
source = sys.stdin.read()
scope = {}
exec(compile(source, "scene.launch.py", "exec"), scope)
scope["generate_launch_description"]()
for call in calls:
    a = call["arguments"]
    pairs = dict(zip(a[0::2], a[1::2]))
    assert call["package"] == "tf2_ros" and call["executable"] == "static_transform_publisher"
    q = [float(pairs["--q" + c]) for c in "xyzw"]
    assert abs(sum(x * x for x in q) - 1) < 1e-9
    [float(pairs["--" + c]) for c in "xyz"]
    print(repr((pairs["--frame-id"], pairs["--child-frame-id"])))
"#;
    for (scene, expected) in [(examples::scene(), 4), (hostile(), 5)] {
        let child = Command::new("python3")
            .args(["-c", harness])
            .stdin(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn();
        let Ok(mut child) = child else {
            skipped_tests::skip("no python3");
            return;
        };
        let mut stdin = child.stdin.take().expect("a pipe");
        std::io::Write::write_all(&mut stdin, scene.ros_launch().expect("a tree").as_bytes())
            .expect("a pipe");
        drop(stdin);
        let out = child.wait_with_output().expect("it ends");
        assert!(
            out.status.success(),
            "{}",
            String::from_utf8_lossy(&out.stderr)
        );
        assert_eq!(
            String::from_utf8_lossy(&out.stdout).lines().count(),
            expected
        );
    }
}
