//! A scene of the made-up arm.

use super::{MARKERS, inputs, joint_values};
use calib_report::scene::{
    Provenance, SceneBody, SceneFrame, SceneMarker, SceneObject, SceneRobot, Shape,
};
use calib_report::{Scene, Status};
use nalgebra::{Isometry3, Vector3};

/// A table, a robot on it, a body on the gripper.
pub fn scene() -> Scene {
    let frame = |name: &str, parent: &str, xyz: [f64; 3], yaw: f64, status| {
        SceneFrame::new(
            name,
            parent,
            &Isometry3::new(xyz.into(), Vector3::z() * yaw),
            None,
            status,
        )
    };
    let mut base = frame(
        "base_link",
        "table",
        [0.4, -0.2, 0.0],
        0.1,
        Status::Calibrated,
    )
    .in_urdf();
    base.covariance = Some(std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            if i == j {
                if i < 3 { 1e-8 } else { 2.5e-9 }
            } else {
                0.0
            }
        })
    }));
    Scene {
        name: "ripley".into(),
        robot: SceneRobot {
            name: "ripley".into(),
            urdf: "ripley.calibrated.urdf".into(),
            base: "base_link".into(),
            joints: joint_values(&[0.1, -0.2, 0.3, 0.0, 1.0 / 3.0]),
            has_masses: true,
        },
        frames: vec![
            SceneFrame::root("vicon", Status::Measured),
            frame("table", "vicon", [0.0, 0.1, 0.72], 0.0, Status::Measured),
            base,
            frame(
                "gripper",
                "base_link",
                [0.3, 0.0, 0.9],
                0.0,
                Status::Calibrated,
            )
            .in_urdf(),
            frame(
                "gripM",
                "gripper",
                [0.01, 0.0, 0.05],
                -1.2,
                Status::Calibrated,
            ),
            frame(
                "camera",
                "gripper",
                [0.05, 0.0, -0.02],
                0.0,
                Status::Assumed,
            ),
        ],
        bodies: vec![SceneBody {
            name: "gripM".into(),
            link: "gripper".into(),
            markers: MARKERS
                .iter()
                .map(|(name, xyz_m)| SceneMarker {
                    name: (*name).into(),
                    xyz_m: *xyz_m,
                })
                .collect(),
        }],
        objects: vec![SceneObject {
            name: "table_top".into(),
            frame: "table".into(),
            shape: Shape::Box {
                size_m: [1.6, 0.8, 0.03],
            },
            xyz_m: [0.0, 0.0, -0.015],
            quat_xyzw: [0.0, 0.0, 0.0, 1.0],
            status: Status::Assumed,
        }],
        provenance: Provenance {
            tool: "calib".into(),
            version: "0.1.0".into(),
            profile: "robots/ripley.yaml".into(),
            inputs: inputs(),
            ..Provenance::default()
        },
        ..Scene::default()
    }
}
