//! The scene: the calibrated world for a situation model, as data.
//!
//! A tree of frames, each `parent_from_frame` with covariance where it is known and the status measured, calibrated or
//! assumed; joints, markers of each body, tips, what was touched, simple objects; the robot's URDF and joint positions; the verdict; where
//! all of it comes from.
//! JSON is the primary form and keeps every bit of every number. The ROS 2 launch file and the SDF world are derived from it
//! and lossy: they know no covariance and no status.

mod known;
mod launch;
mod sdf;

pub use known::{Provenance, SceneJoint, SceneTip, SceneTouched, SceneVerdict, TouchedShape};

use crate::{JointValue, ReportError, Status, json};
use nalgebra::{Isometry3, Matrix6};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// The calibrated world. SI; quaternions x, y, z, w.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Scene {
    /// Version of this format.
    pub calib_scene: crate::FormatVersion,
    /// The scene's name: the profile's.
    pub name: String,
    /// The robot.
    pub robot: SceneRobot,
    /// What the calibration was judged to be; null for a scene that no run wrote.
    #[serde(default)]
    pub verdict: Option<SceneVerdict>,
    /// Frames, each after its parent.
    pub frames: Vec<SceneFrame>,
    /// Joints of the robot, each after the joint that carries it.
    #[serde(default)]
    pub joints: Vec<SceneJoint>,
    /// Tracking bodies and their markers.
    pub bodies: Vec<SceneBody>,
    /// Points of the robot that touch or are aimed: tips and tool center points.
    #[serde(default)]
    pub tips: Vec<SceneTip>,
    /// What was touched.
    #[serde(default)]
    pub touched: Vec<SceneTouched>,
    /// Objects of simple shape: a table.
    #[serde(default)]
    pub objects: Vec<SceneObject>,
    /// Where it comes from.
    pub provenance: Provenance,
}

/// The robot in the scene.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SceneRobot {
    /// Its name.
    pub name: String,
    /// The calibrated URDF, relative to the scene's file.
    pub urdf: String,
    /// Its root link; a frame of this name places it in the world.
    pub base: String,
    /// Joint positions of the scene.
    pub joints: Vec<JointValue>,
    /// Whether every link has a mass, of its own or of a link it is fixed to: simulators drop links without.
    #[serde(default)]
    pub has_masses: bool,
}

/// A frame and where it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SceneFrame {
    /// Unique.
    pub name: String,
    /// The frame that `xyz` and `quat_xyzw` are in; null for a root.
    pub parent: Option<String>,
    /// Origin in the parent, m.
    pub xyz_m: [f64; 3],
    /// Orientation in the parent, unit quaternion x, y, z, w.
    pub quat_xyzw: [f64; 4],
    /// Of the pose in the parent, 6×6 in [ω; v] of this frame (rad², rad·m, m²); null when it is unknown.
    pub covariance: Option<[[f64; 6]; 6]>,
    /// Of the pose in the root with all joints at 0, in the same axes: what is a convention between two joints does not show in it. Null when
    /// it is unknown.
    #[serde(default)]
    pub covariance_in_root: Option<[[f64; 6]; 6]>,
    /// Where the numbers come from.
    pub status: Status,
    /// Directions in which nothing that was recorded tells where it is, as unit twists [ω; v] of this frame: there the numbers are the
    /// nominal ones. Empty where everything is known, or nothing was estimated.
    #[serde(default)]
    pub unobservable: Vec<[f64; 6]>,
    /// Whether it is a link of the robot's URDF: then `robot_state_publisher` publishes it, and the launch file does not.
    #[serde(default)]
    pub in_urdf: bool,
}

impl Default for SceneFrame {
    fn default() -> Self {
        Self {
            name: String::new(),
            parent: None,
            xyz_m: [0.0; 3],
            quat_xyzw: [0.0, 0.0, 0.0, 1.0],
            covariance: None,
            covariance_in_root: None,
            status: Status::Assumed,
            unobservable: Vec::new(),
            in_urdf: false,
        }
    }
}

impl SceneFrame {
    /// A root: the tracker's or the world's frame.
    #[must_use]
    pub fn root(name: impl Into<String>, status: Status) -> Self {
        Self {
            name: name.into(),
            status,
            ..Self::default()
        }
    }

    /// From `parent_from_frame` and its covariance in [ω; v] of the frame.
    #[must_use]
    pub fn new(
        name: impl Into<String>,
        parent: impl Into<String>,
        parent_from_frame: &Isometry3<f64>,
        covariance: Option<&Matrix6<f64>>,
        status: Status,
    ) -> Self {
        let q = parent_from_frame.rotation.coords;
        Self {
            name: name.into(),
            parent: Some(parent.into()),
            // x + 0 is x, except that −0 becomes 0.
            xyz_m: <[f64; 3]>::from(parent_from_frame.translation.vector).map(|x| x + 0.0),
            quat_xyzw: [q.x, q.y, q.z, q.w].map(|x| x + 0.0),
            covariance: covariance.map(rows),
            covariance_in_root: None,
            status,
            unobservable: Vec::new(),
            in_urdf: false,
        }
    }

    /// The same with what was found of it: its covariance in the parent and in the root, and the directions in which nothing is known.
    #[must_use]
    pub fn with_known(
        mut self,
        covariance: Option<&Matrix6<f64>>,
        in_root: Option<&Matrix6<f64>>,
        unobservable: Vec<[f64; 6]>,
    ) -> Self {
        self.covariance = covariance.map(rows);
        self.covariance_in_root = in_root.map(rows);
        self.unobservable = unobservable;
        self
    }

    /// The same as a link of the robot's URDF.
    #[must_use]
    pub fn in_urdf(mut self) -> Self {
        self.in_urdf = true;
        self
    }
}

/// A tracking body: a frame of the scene with markers.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SceneBody {
    /// The body's name; a frame has the same name.
    pub name: String,
    /// The link it is bolted to.
    pub link: String,
    /// Its markers.
    pub markers: Vec<SceneMarker>,
}

/// A marker of a body.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SceneMarker {
    /// The marker's name.
    pub name: String,
    /// In the body's frame, m.
    pub xyz_m: [f64; 3],
}

/// An object of simple shape.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SceneObject {
    /// Unique among objects.
    pub name: String,
    /// The frame that its center is in.
    pub frame: String,
    /// Its shape.
    pub shape: Shape,
    /// Center in the frame, m.
    pub xyz_m: [f64; 3],
    /// Orientation in the frame.
    pub quat_xyzw: [f64; 4],
    /// Where shape and place come from.
    pub status: Status,
}

/// A simple shape around its center.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Edge lengths along x, y, z, m.
    Box {
        /// m.
        size_m: [f64; 3],
    },
    /// A ball.
    Sphere {
        /// m.
        radius_m: f64,
    },
    /// Along z.
    Cylinder {
        /// m.
        radius_m: f64,
        /// m.
        length_m: f64,
    },
}

/// How far a quaternion's length may be from 1: rounding of 64-bit arithmetic over a long chain.
const UNIT_QUATERNION: f64 = 1e-9;

impl Scene {
    /// The scene as versioned JSON; every number is the shortest decimal that reads back to the same bits.
    ///
    /// # Errors
    /// As [`Scene::check`].
    pub fn json(&self) -> Result<String, ReportError> {
        self.check()?;
        json::exact_json(self)
    }

    /// Read a scene and check it.
    ///
    /// # Errors
    /// [`ReportError::Json`] with line and column, or as [`Scene::check`].
    pub fn from_json(text: &str) -> Result<Self, ReportError> {
        let scene: Self =
            serde_json::from_str(text).map_err(|source| ReportError::Json(source.to_string()))?;
        scene.check()?;
        Ok(scene)
    }

    /// A ROS 2 launch file (Python): one `static_transform_publisher` per frame that has a parent and is not a link of the URDF.
    ///
    /// # Errors
    /// As [`Scene::check`].
    pub fn ros_launch(&self) -> Result<String, ReportError> {
        self.check()?;
        Ok(launch::launch(self))
    }

    /// An SDF 1.9 world: frames, the robot by reference to its URDF, markers and objects as static visuals.
    ///
    /// # Errors
    /// As [`Scene::check`].
    pub fn sdf(&self) -> Result<String, ReportError> {
        self.check()?;
        Ok(sdf::sdf(self))
    }

    /// Checks that names are unique, parents exist, come first and form no cycle, and every pose is valid.
    ///
    /// # Errors
    /// The first violation: [`ReportError::FrameTwice`], [`ReportError::UnknownParent`], [`ReportError::FrameCycle`],
    /// [`ReportError::ParentLater`], [`ReportError::NotAPose`].
    pub fn check(&self) -> Result<(), ReportError> {
        let mut parent_of: BTreeMap<&str, Option<&str>> = BTreeMap::new();
        for frame in &self.frames {
            if parent_of
                .insert(&frame.name, frame.parent.as_deref())
                .is_some()
            {
                return Err(ReportError::FrameTwice(frame.name.clone()));
            }
            let covariance_is_finite = [frame.covariance, frame.covariance_in_root]
                .iter()
                .flatten()
                .flatten()
                .flatten()
                .all(|x| x.is_finite());
            if !is_pose(frame.xyz_m, frame.quat_xyzw) || !covariance_is_finite {
                return Err(ReportError::NotAPose(frame.name.clone()));
            }
        }
        let exists = |child: &str, parent: &str| {
            let missing = || ReportError::UnknownParent {
                child: child.to_owned(),
                parent: parent.to_owned(),
            };
            parent_of
                .contains_key(parent)
                .then_some(())
                .ok_or_else(missing)
        };
        let mut before: BTreeSet<&str> = BTreeSet::new();
        for frame in &self.frames {
            let mut at = frame.parent.as_deref();
            let mut steps = 0;
            while let Some(parent) = at {
                exists(&frame.name, parent)?;
                steps += 1;
                if steps > self.frames.len() {
                    return Err(ReportError::FrameCycle(frame.name.clone()));
                }
                at = parent_of.get(parent).copied().flatten();
            }
            if let Some(parent) = frame.parent.as_deref()
                && !before.contains(parent)
            {
                return Err(ReportError::ParentLater {
                    child: frame.name.clone(),
                    parent: parent.to_owned(),
                });
            }
            before.insert(&frame.name);
        }
        for joint in &self.joints {
            exists(&joint.name, &joint.parent)?;
            exists(&joint.name, &joint.child)?;
        }
        for tip in &self.tips {
            exists(&tip.name, &tip.link)?;
        }
        for thing in &self.touched {
            exists(&thing.name, &thing.frame)?;
        }
        for body in &self.bodies {
            exists(&body.name, &body.name)?;
            if let Some(marker) = body
                .markers
                .iter()
                .find(|marker| !marker.xyz_m.iter().all(|x| x.is_finite()))
            {
                return Err(ReportError::NotAPose(marker.name.clone()));
            }
        }
        for object in &self.objects {
            exists(&object.name, &object.frame)?;
            if !is_pose(object.xyz_m, object.quat_xyzw) {
                return Err(ReportError::NotAPose(object.name.clone()));
            }
        }
        Ok(())
    }
}

fn rows(c: &Matrix6<f64>) -> [[f64; 6]; 6] {
    std::array::from_fn(|i| std::array::from_fn(|j| c[(i, j)]))
}

fn is_pose(xyz: [f64; 3], quat: [f64; 4]) -> bool {
    let length = quat.iter().map(|x| x * x).sum::<f64>().sqrt();
    xyz.iter().all(|x| x.is_finite()) && (length - 1.0).abs() <= UNIT_QUATERNION
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(frames: Vec<SceneFrame>) -> Scene {
        Scene {
            frames,
            ..Scene::default()
        }
    }

    fn frame(name: &str, parent: &str) -> SceneFrame {
        SceneFrame::new(
            name,
            parent,
            &Isometry3::translation(0.1, 0.2, 0.3),
            None,
            Status::Calibrated,
        )
    }

    #[test]
    fn a_scene_that_is_not_a_tree_is_refused_with_the_frame() {
        let root = || SceneFrame::root("world", Status::Assumed);
        let table = [
            (
                vec![root(), root()],
                ReportError::FrameTwice("world".into()),
            ),
            (
                vec![root(), frame("a", "b")],
                ReportError::UnknownParent {
                    child: "a".into(),
                    parent: "b".into(),
                },
            ),
            (
                vec![root(), frame("a", "b"), frame("b", "a")],
                ReportError::FrameCycle("a".into()),
            ),
            (vec![frame("a", "a")], ReportError::FrameCycle("a".into())),
            (
                vec![frame("a", "world"), root()],
                ReportError::ParentLater {
                    child: "a".into(),
                    parent: "world".into(),
                },
            ),
            (
                vec![SceneFrame {
                    xyz_m: [f64::NAN, 0.0, 0.0],
                    ..root()
                }],
                ReportError::NotAPose("world".into()),
            ),
            (
                vec![SceneFrame {
                    quat_xyzw: [0.0; 4],
                    ..root()
                }],
                ReportError::NotAPose("world".into()),
            ),
            (
                vec![SceneFrame {
                    covariance: Some([[f64::INFINITY; 6]; 6]),
                    ..root()
                }],
                ReportError::NotAPose("world".into()),
            ),
        ];
        for (frames, error) in table {
            let scene = scene(frames);
            assert_eq!(scene.check(), Err(error.clone()));
            assert_eq!(scene.json(), Err(error.clone()));
            assert_eq!(scene.ros_launch(), Err(error.clone()));
            assert_eq!(scene.sdf(), Err(error));
        }
    }

    #[test]
    fn a_body_or_object_needs_its_frame() {
        let body = SceneBody {
            name: "gripM".into(),
            ..SceneBody::default()
        };
        let without = Scene {
            bodies: vec![body],
            ..Scene::default()
        };
        assert_eq!(
            without.check(),
            Err(ReportError::UnknownParent {
                child: "gripM".into(),
                parent: "gripM".into()
            })
        );
    }

    #[test]
    fn every_bit_comes_back() {
        let awkward = Isometry3::new(
            nalgebra::Vector3::new(0.1 + 0.2, 1.0 / 3.0, -1e-17),
            nalgebra::Vector3::new(0.3, -2.0, 1e-8),
        );
        let written = scene(vec![
            SceneFrame::root("world", Status::Assumed),
            SceneFrame::new(
                "a",
                "world",
                &awkward,
                Some(&Matrix6::from_diagonal_element(1e-7 / 3.0)),
                Status::Calibrated,
            ),
        ]);
        let read = Scene::from_json(&written.json().expect("a tree")).expect("the same scene");
        assert_eq!(read, written);
        assert!(matches!(Scene::from_json("{"), Err(ReportError::Json(_))));
    }
}
