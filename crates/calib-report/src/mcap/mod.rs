//! The view as an MCAP file with the schemas of Foxglove: a player steps through the poses, beside the lab's own recordings.
//!
//! ```text
//! /tf             foxglove.FrameTransforms   the calibrated links; those of the nominal URDF under nominal/
//! /joint_states   foxglove.JointStates       the joint values of the pose, rad and m
//! /markers        foxglove.SceneUpdate       markers where the tracker saw them; an arrow towards where each was predicted, magnified
//! ```
//!
//! The poses are a second apart, and the first is at time 0: the order counts, no clock is stated. Messages are JSON, in one
//! chunk that is not compressed. MCAP specification, mcap.dev, version 0.

mod messages;

use std::collections::BTreeMap;
use std::io::Cursor;

use ::mcap::records::{MessageHeader, Metadata};
use ::mcap::{McapError, WriteOptions, Writer};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use schemars::{JsonSchema, generate::SchemaSettings};
use serde::Serialize;

use crate::view3d::{View3d, ViewMarker, ViewPose, pose_of};
use crate::{ReportError, Scene};
use messages::{
    Arrow, Color, Entity, FrameTransform, FrameTransforms, JointState, JointStates, KeyValue,
    SceneUpdate, Sphere, Text, Time,
};

/// Diameter of a drawn marker, m.
const MARKER_M: f64 = 0.014;

/// Diameter of an arrow's shaft, m.
const SHAFT_M: f64 = 0.004;

/// Share of an arrow that is its head.
const HEAD: f64 = 0.2;

/// Height of the label above the first link, m.
const LABEL_M: f64 = 0.3;

/// The colors of the page's 3-D view.
const MARKER: Color = Color::opaque([0.561, 0.224, 0.522]);
const ERROR: Color = Color::opaque([0.753, 0.0, 0.0]);
const LABEL: Color = Color::opaque([0.45, 0.45, 0.45]);

/// The view as the bytes of an `.mcap` file; `scene` gives the provenance. Same input, same bytes.
///
/// # Errors
/// [`ReportError::Mcap`] when a value cannot be written as JSON.
pub fn mcap(scene: &Scene, view: &View3d) -> Result<Vec<u8>, ReportError> {
    written(scene, &view.thinned()).map_err(|e| ReportError::Mcap(e.to_string()))
}

fn written(scene: &Scene, view: &View3d) -> Result<Vec<u8>, McapError> {
    let made = &scene.provenance;
    let library = format!("{} {}", made.tool, made.version).trim().to_owned();
    let mut writer = WriteOptions::new()
        .compression(None)
        .library(library)
        .create(Cursor::new(Vec::new()))?;
    let frame = match view.frame.as_str() {
        "" => "tracker",
        frame => frame,
    };
    let transforms = Channel::new::<FrameTransforms>(&mut writer, "/tf", "FrameTransforms")?;
    let joints = Channel::new::<JointStates>(&mut writer, "/joint_states", "JointStates")?;
    let markers = Channel::new::<SceneUpdate>(&mut writer, "/markers", "SceneUpdate")?;
    for (i, pose) in (0_u32..).zip(&view.poses) {
        let now = Time::seconds(i);
        let links = FrameTransforms {
            transforms: links(view, frame, pose, now),
        };
        transforms.write(&mut writer, i, &links)?;
        let states = |(name, position): &(String, f64)| JointState {
            name: name.clone(),
            position: *position,
        };
        let states = JointStates {
            timestamp: now,
            joints: pose.joints.iter().map(states).collect(),
        };
        joints.write(&mut writer, i, &states)?;
        let update = SceneUpdate {
            deletions: [],
            entities: vec![entity(view, frame, pose, now)],
        };
        markers.write(&mut writer, i, &update)?;
    }
    let about = [
        ("robot", scene.robot.name.clone()),
        ("profile", made.profile.clone()),
        ("frame", frame.to_owned()),
        ("error_magnification", view.magnification.to_string()),
    ];
    writer.write_metadata(&Metadata {
        name: "calib".to_owned(),
        metadata: about.map(|(key, value)| (key.to_owned(), value)).into(),
    })?;
    writer.finish()?;
    Ok(writer.into_inner().into_inner())
}

/// A topic with messages of one type.
struct Channel(u16);

impl Channel {
    fn new<T: JsonSchema>(
        writer: &mut Writer<Cursor<Vec<u8>>>,
        topic: &str,
        name: &str,
    ) -> Result<Self, McapError> {
        // Whole and of the draft that players read.
        let mut settings = SchemaSettings::draft07();
        settings.inline_subschemas = true;
        let schema = settings.into_generator().into_root_schema_for::<T>();
        let schema = writer.add_schema(
            &format!("foxglove.{name}"),
            "jsonschema",
            schema.as_value().to_string().as_bytes(),
        )?;
        let id = writer.add_channel(schema, topic, "json", &BTreeMap::new())?;
        Ok(Self(id))
    }

    fn write(
        &self,
        writer: &mut Writer<Cursor<Vec<u8>>>,
        pose: u32,
        message: &impl Serialize,
    ) -> Result<(), McapError> {
        let log_time = u64::from(pose) * 1_000_000_000;
        let header = MessageHeader {
            channel_id: self.0,
            sequence: pose,
            log_time,
            publish_time: log_time,
        };
        let text = serde_json::to_vec(message).map_err(std::io::Error::from)?;
        writer.write_to_known_channel(&header, &text)
    }
}

/// Every link in its parent, of both robots.
fn links(view: &View3d, frame: &str, pose: &ViewPose, now: Time) -> Vec<FrameTransform> {
    let robots = [("", &pose.calibrated), ("nominal/", &pose.nominal)];
    let mut all = Vec::new();
    for (prefix, rows) in robots {
        let poses: Vec<Isometry3<f64>> = rows.iter().map(pose_of).collect();
        for (link, root_from_link) in view.frames.iter().zip(&poses) {
            let parent = link.parent.and_then(|p| Some((p, poses.get(p)?)));
            let (parent, in_parent) = match parent {
                Some((p, root_from_parent)) => (
                    format!("{prefix}{}", view.frames[p].name),
                    root_from_parent.inv_mul(root_from_link),
                ),
                None => (frame.to_owned(), *root_from_link),
            };
            all.push(FrameTransform {
                timestamp: now,
                parent_frame_id: parent,
                child_frame_id: format!("{prefix}{}", link.name),
                translation: in_parent.translation.vector.into(),
                rotation: in_parent.rotation.into(),
            });
        }
    }
    all
}

/// What the tracker saw in a pose, how far the prediction is off, and the pose's name.
fn entity(view: &View3d, frame: &str, pose: &ViewPose, now: Time) -> Entity {
    let seen = pose.markers.iter().filter_map(|m| m.observed);
    let sphere = |place: [f64; 3]| Sphere {
        pose: Point3::from(place).into(),
        size: messages::Xyz::all(MARKER_M),
        color: MARKER,
    };
    let above = pose.calibrated.first().map(pose_of).unwrap_or_default();
    let above = Isometry3::translation(0.0, 0.0, LABEL_M) * above;
    let label = Text {
        pose: Point3::from(above.translation.vector).into(),
        billboard: true,
        font_size: 14.0,
        scale_invariant: true,
        color: LABEL,
        text: format!("{} {}", pose.name, pose.text).trim().to_owned(),
    };
    let residual = |marker: &ViewMarker| {
        let residual = Vector3::from(marker.residual_m()?);
        Some(KeyValue {
            key: format!("{} error, m", marker.name),
            value: format!("{:.9}", residual.norm()),
        })
    };
    Entity {
        timestamp: now,
        frame_id: frame.to_owned(),
        id: "markers".to_owned(),
        lifetime: Time::default(),
        frame_locked: true,
        metadata: pose.markers.iter().filter_map(residual).collect(),
        arrows: pose
            .markers
            .iter()
            .filter_map(|marker| arrow(marker, view.magnification))
            .collect(),
        cubes: [],
        spheres: seen.map(sphere).collect(),
        cylinders: [],
        lines: [],
        triangles: [],
        texts: vec![label],
        models: [],
    }
}

/// From where a marker was seen towards where it was predicted; nothing where they agree to the last digit.
fn arrow(marker: &ViewMarker, magnification: f64) -> Option<Arrow> {
    let error = Vector3::from(marker.residual_m()?) * magnification;
    let length = error.norm();
    let direction = error.try_normalize(f64::MIN_POSITIVE)?;
    // A half turn has no unique axis.
    let turn = UnitQuaternion::rotation_between(&Vector3::x(), &direction)
        .unwrap_or_else(|| UnitQuaternion::new(Vector3::z() * std::f64::consts::PI));
    let from = Point3::from(marker.observed?);
    Some(Arrow {
        pose: Isometry3::from_parts(from.into(), turn).into(),
        shaft_length: length * (1.0 - HEAD),
        shaft_diameter: SHAFT_M,
        head_length: length * HEAD,
        head_diameter: 2.0 * SHAFT_M,
        color: ERROR,
    })
}
