use super::{Scene, SceneFrame, Shape};
use crate::number::round_trip;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Markers are drawn as balls of 14 mm across, the usual size of a reflective marker.
const MARKER_RADIUS_M: f64 = 0.007;

/// An SDF 1.9 world. The scene has been checked.
pub(super) fn sdf(scene: &Scene) -> String {
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<!-- A calibrated scene; made by calib, changes will be lost. -->\n<sdf version=\"1.9\">\n",
    );
    let _ = writeln!(text, "  <world name=\"{}\">", xml(&scene.name));
    let frames: BTreeMap<&str, &SceneFrame> = scene
        .frames
        .iter()
        .map(|frame| (frame.name.as_str(), frame))
        .collect();
    if !scene.robot.has_masses {
        text.push_str(
            "    <!-- The robot's links are frames, at the scene's joint positions: its URDF states no masses, and a simulator drops links without. -->\n",
        );
    }
    for frame in scene
        .frames
        .iter()
        .filter(|frame| !(frame.in_urdf && scene.robot.has_masses) && frame.name != "world")
    {
        let _ = writeln!(text, "    <!-- {} -->", frame.status.word());
        let _ = writeln!(
            text,
            "    <frame name=\"{}\"{}>",
            xml(&frame.name),
            attached_to(scene, &frames, frame)
        );
        let relative_to = frame
            .parent
            .as_deref()
            .map(|parent| name_in_world(scene, &frames, parent));
        let _ = writeln!(
            text,
            "      {}",
            pose(relative_to.as_deref(), frame.xyz_m, frame.quat_xyzw)
        );
        text.push_str("    </frame>\n");
    }
    if scene.robot.has_masses && !scene.robot.urdf.is_empty() {
        let _ = writeln!(
            text,
            "    <include>\n      <name>{}</name>\n      <uri>{}</uri>",
            xml(&scene.robot.name),
            xml(&scene.robot.urdf)
        );
        if let Some(base) = frames.get(scene.robot.base.as_str()) {
            let relative_to = base
                .parent
                .as_deref()
                .map(|parent| name_in_world(scene, &frames, parent));
            let _ = writeln!(
                text,
                "      {}",
                pose(relative_to.as_deref(), base.xyz_m, base.quat_xyzw)
            );
        }
        text.push_str("    </include>\n");
    }
    for body in &scene.bodies {
        let frame = name_in_world(scene, &frames, &body.name);
        for marker in &body.markers {
            let shape = Shape::Sphere {
                radius_m: MARKER_RADIUS_M,
            };
            model(
                &mut text,
                &format!("{}_{}", body.name, marker.name),
                &frame,
                marker.xyz_m,
                [0.0, 0.0, 0.0, 1.0],
                &shape,
            );
        }
    }
    for object in &scene.objects {
        model(
            &mut text,
            &object.name,
            &name_in_world(scene, &frames, &object.frame),
            object.xyz_m,
            object.quat_xyzw,
            &object.shape,
        );
    }
    text.push_str("  </world>\n</sdf>\n");
    text
}

/// A frame that hangs on a moving link moves with it.
fn attached_to(scene: &Scene, frames: &BTreeMap<&str, &SceneFrame>, frame: &SceneFrame) -> String {
    match frame.parent.as_deref() {
        Some(parent) => format!(
            " attached_to=\"{}\"",
            xml(&name_in_world(scene, frames, parent))
        ),
        None => String::new(),
    }
}

/// Links of a robot that is included are addressed through its model: `ripley::gripper`.
fn name_in_world(scene: &Scene, frames: &BTreeMap<&str, &SceneFrame>, name: &str) -> String {
    if scene.robot.has_masses && frames.get(name).is_some_and(|frame| frame.in_urdf) {
        format!("{}::{name}", scene.robot.name)
    } else {
        name.to_owned()
    }
}

fn pose(relative_to: Option<&str>, xyz: [f64; 3], quat: [f64; 4]) -> String {
    let relative_to = relative_to.map_or_else(String::new, |name| {
        format!(" relative_to=\"{}\"", xml(name))
    });
    let join = |numbers: &[f64]| {
        numbers
            .iter()
            .map(|x| round_trip(*x))
            .collect::<Vec<_>>()
            .join(" ")
    };
    format!(
        "<pose{relative_to} rotation_format=\"quat_xyzw\">{}  {}</pose>",
        join(&xyz),
        join(&quat)
    )
}

fn model(text: &mut String, name: &str, frame: &str, xyz: [f64; 3], quat: [f64; 4], shape: &Shape) {
    let name = xml(name);
    let _ = writeln!(
        text,
        "    <model name=\"{name}\">\n      <static>true</static>\n      {}",
        pose(Some(frame), xyz, quat)
    );
    let geometry = match *shape {
        Shape::Box { size_m: [x, y, z] } => format!(
            "<box><size>{} {} {}</size></box>",
            round_trip(x),
            round_trip(y),
            round_trip(z)
        ),
        Shape::Sphere { radius_m } => {
            format!("<sphere><radius>{}</radius></sphere>", round_trip(radius_m))
        }
        Shape::Cylinder { radius_m, length_m } => {
            format!(
                "<cylinder><radius>{}</radius><length>{}</length></cylinder>",
                round_trip(radius_m),
                round_trip(length_m)
            )
        }
    };
    let _ = writeln!(
        text,
        "      <link name=\"link\"><visual name=\"visual\"><geometry>{geometry}</geometry></visual></link>\n    </model>"
    );
}

/// Text inside an attribute or element.
fn xml(text: &str) -> String {
    let mut escaped = String::new();
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            // Control characters other than these three are no XML at all.
            c if c.is_control() && !matches!(c, '\t' | '\n' | '\r') => escaped.push('\u{FFFD}'),
            c => escaped.push(c),
        }
    }
    escaped
}
