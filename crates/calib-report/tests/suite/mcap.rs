//! The MCAP file as another reader finds it.

use crate::examples;
use ::mcap::MessageStream;
use calib_report::mcap::mcap;
use calib_report::{Scene, View3d};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde_json::Value;
use std::collections::BTreeMap;

/// Numbers are written to a nanometer; a chain of seven links of a meter adds to less than this, m.
const ROUNDING: f64 = 2e-8;

/// Messages of a topic, in their order.
fn messages(bytes: &[u8], topic: &str) -> Vec<Value> {
    let all = MessageStream::new(bytes).expect("a file");
    all.map(|message| message.expect("a message"))
        .filter(|message| message.channel.topic == topic)
        .map(|message| serde_json::from_slice(&message.data).expect("JSON"))
        .collect()
}

fn xyz(of: &Value) -> Vector3<f64> {
    Vector3::from(["x", "y", "z"].map(|key| of[key].as_f64().expect("a number")))
}

fn turn(of: &Value) -> UnitQuaternion<f64> {
    let [w, x, y, z] = ["w", "x", "y", "z"].map(|key| of[key].as_f64().expect("a number"));
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// Where every frame of a message is in the tracker's.
fn places(message: &Value) -> BTreeMap<String, Isometry3<f64>> {
    let mut all = BTreeMap::new();
    for transform in message["transforms"].as_array().expect("a list") {
        let name = |key: &str| transform[key].as_str().expect("a name").to_owned();
        let shift = Translation3::from(xyz(&transform["translation"]));
        let own = Isometry3::from_parts(shift, turn(&transform["rotation"]));
        // A parent stands before its children; the tracker's frame has no transform.
        let parent = all.get(&name("parent_frame_id")).copied();
        all.insert(name("child_frame_id"), parent.unwrap_or_default() * own);
    }
    all
}

#[test]
fn another_reader_finds_links_joints_markers_and_errors() {
    let mut view = examples::view();
    for (i, pose) in (0_u32..).zip(&mut view.poses) {
        pose.joints = vec![("elbow".into(), 0.1 * f64::from(i))];
    }
    let bytes = mcap(&examples::scene(), &view).expect("a file");
    let [transforms, states, updates] =
        ["/tf", "/joint_states", "/markers"].map(|topic| messages(&bytes, topic));
    assert_eq!(
        [transforms.len(), states.len(), updates.len()],
        [view.poses.len(); 3]
    );
    for (i, pose) in view.poses.iter().enumerate() {
        let places = places(&transforms[i]);
        assert_eq!(places.len(), 2 * view.frames.len());
        let robots = [("", &pose.calibrated), ("nominal/", &pose.nominal)];
        for (prefix, rows) in robots {
            for (frame, row) in view.frames.iter().zip(rows) {
                let found = places[&format!("{prefix}{}", frame.name)];
                let off = found.translation.vector - Vector3::new(row[0], row[1], row[2]);
                assert!(off.norm() < ROUNDING, "{prefix}{} in pose {i}", frame.name);
            }
        }
        let elbow = &states[i]["joints"][0];
        assert_eq!(elbow["position"], pose.joints[0].1);
        let entity = &updates[i]["entities"][0];
        for (k, marker) in pose.markers.iter().enumerate() {
            let observed = Vector3::from(marker.observed.expect("seen"));
            let drawn = xyz(&entity["spheres"][k]["pose"]["position"]);
            assert!((drawn - observed).norm() < ROUNDING);
            let arrow = &entity["arrows"][k];
            let length = ["shaft_length", "head_length"].map(|key| arrow[key].as_f64());
            let length: f64 = length.into_iter().flatten().sum();
            let tip = xyz(&arrow["pose"]["position"])
                + turn(&arrow["pose"]["orientation"]) * Vector3::x() * length;
            let error = Vector3::from(marker.residual_m().expect("seen"));
            let expected = observed + error * view.magnification;
            assert!((tip - expected).norm() < ROUNDING, "{tip} and {expected}");
        }
        assert_eq!(transforms[i]["transforms"][0]["timestamp"]["sec"], i);
    }
}

#[test]
fn the_same_view_gives_the_same_bytes_and_odd_views_are_files_too() {
    let written = |view: &View3d| mcap(&examples::scene(), view).expect("a file");
    let view = examples::view();
    for _ in 0..8 {
        assert_eq!(written(&view), written(&view));
    }
    let empty = mcap(&Scene::default(), &View3d::default()).expect("nothing to show");
    assert!(messages(&empty, "/tf").is_empty());
    let mut view = examples::view();
    let pose = &mut view.poses[0];
    pose.nominal.clear();
    pose.markers[0].observed = None;
    pose.markers[1].observed = Some(pose.markers[1].predicted);
    let update = &messages(&written(&view), "/markers")[0]["entities"][0];
    let count = |key: &str| update[key].as_array().map(Vec::len);
    assert_eq!([count("spheres"), count("arrows")], [Some(2), Some(1)]);
}
