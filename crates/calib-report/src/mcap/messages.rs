//! Messages with the names and fields of Foxglove's schemas (docs.foxglove.dev/docs/sdk/schemas), as far as they are used here.
//!
//! The JSON Schema of each channel follows from its type. Lengths are meters, angles radians, times since the first pose.

use nalgebra::{Isometry3, Point3, Vector3};
use schemars::JsonSchema;
use serde::Serialize;

/// A time or a duration.
#[derive(Clone, Copy, Default, Serialize, JsonSchema)]
pub(super) struct Time {
    pub(super) sec: u32,
    pub(super) nsec: u32,
}

#[derive(Clone, Copy, Serialize, JsonSchema)]
pub(super) struct Xyz {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Clone, Copy, Serialize, JsonSchema)]
pub(super) struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

#[derive(Clone, Copy, Serialize, JsonSchema)]
pub(super) struct Pose {
    position: Xyz,
    orientation: Quaternion,
}

/// Red, green, blue and opacity in [0, 1].
#[derive(Clone, Copy, Serialize, JsonSchema)]
pub(super) struct Color {
    r: f32,
    g: f32,
    b: f32,
    a: f32,
}

/// `foxglove.FrameTransforms`.
#[derive(Serialize, JsonSchema)]
pub(super) struct FrameTransforms {
    pub(super) transforms: Vec<FrameTransform>,
}

#[derive(Serialize, JsonSchema)]
pub(super) struct FrameTransform {
    pub(super) timestamp: Time,
    pub(super) parent_frame_id: String,
    pub(super) child_frame_id: String,
    pub(super) translation: Xyz,
    pub(super) rotation: Quaternion,
}

/// `foxglove.JointStates`.
#[derive(Serialize, JsonSchema)]
pub(super) struct JointStates {
    pub(super) timestamp: Time,
    pub(super) joints: Vec<JointState>,
}

#[derive(Serialize, JsonSchema)]
pub(super) struct JointState {
    pub(super) name: String,
    pub(super) position: f64,
}

/// `foxglove.SceneUpdate`: an entity replaces the earlier one of its id.
#[derive(Serialize, JsonSchema)]
pub(super) struct SceneUpdate {
    pub(super) deletions: [Nothing; 0],
    pub(super) entities: Vec<Entity>,
}

/// What the schema asks for and no entity here has.
#[derive(Serialize, JsonSchema)]
pub(super) struct Nothing {}

#[derive(Serialize, JsonSchema)]
pub(super) struct Entity {
    pub(super) timestamp: Time,
    pub(super) frame_id: String,
    pub(super) id: String,
    /// Zero: until it is replaced.
    pub(super) lifetime: Time,
    pub(super) frame_locked: bool,
    pub(super) metadata: Vec<KeyValue>,
    pub(super) arrows: Vec<Arrow>,
    pub(super) cubes: [Nothing; 0],
    pub(super) spheres: Vec<Sphere>,
    pub(super) cylinders: [Nothing; 0],
    pub(super) lines: [Nothing; 0],
    pub(super) triangles: [Nothing; 0],
    pub(super) texts: Vec<Text>,
    pub(super) models: [Nothing; 0],
}

#[derive(Serialize, JsonSchema)]
pub(super) struct KeyValue {
    pub(super) key: String,
    pub(super) value: String,
}

/// An arrow along the x axis of its pose.
#[derive(Serialize, JsonSchema)]
pub(super) struct Arrow {
    pub(super) pose: Pose,
    pub(super) shaft_length: f64,
    pub(super) shaft_diameter: f64,
    pub(super) head_length: f64,
    pub(super) head_diameter: f64,
    pub(super) color: Color,
}

#[derive(Serialize, JsonSchema)]
pub(super) struct Sphere {
    pub(super) pose: Pose,
    pub(super) size: Xyz,
    pub(super) color: Color,
}

#[derive(Serialize, JsonSchema)]
pub(super) struct Text {
    pub(super) pose: Pose,
    pub(super) billboard: bool,
    pub(super) font_size: f64,
    pub(super) scale_invariant: bool,
    pub(super) color: Color,
    pub(super) text: String,
}

impl Time {
    /// Whole seconds.
    pub(super) fn seconds(sec: u32) -> Self {
        Self { sec, nsec: 0 }
    }
}

impl Xyz {
    pub(super) fn all(length: f64) -> Self {
        Vector3::repeat(length).into()
    }
}

impl Color {
    pub(super) const fn opaque([r, g, b]: [f32; 3]) -> Self {
        Self { r, g, b, a: 1.0 }
    }
}

/// Nanometers and nanoradians: below what any tracker sees, and half the text.
fn rounded(x: f64) -> f64 {
    (x * 1e9).round() / 1e9 + 0.0
}

impl From<Vector3<f64>> for Xyz {
    fn from(v: Vector3<f64>) -> Self {
        let [x, y, z] = v.map(rounded).into();
        Self { x, y, z }
    }
}

impl From<nalgebra::UnitQuaternion<f64>> for Quaternion {
    fn from(q: nalgebra::UnitQuaternion<f64>) -> Self {
        let [x, y, z, w] = q.coords.map(rounded).into();
        Self { x, y, z, w }
    }
}

impl From<Isometry3<f64>> for Pose {
    fn from(pose: Isometry3<f64>) -> Self {
        Self {
            position: pose.translation.vector.into(),
            orientation: pose.rotation.into(),
        }
    }
}

impl From<Point3<f64>> for Pose {
    fn from(point: Point3<f64>) -> Self {
        Isometry3::from(point.coords).into()
    }
}
