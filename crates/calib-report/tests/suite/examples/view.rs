//! The 3-D view of the made-up arm.

use super::{Draw, MARKERS, frames, held_out_poses};
use calib_report::View3d;
use calib_report::view3d::{
    Axis, Circle, Cloud, Solid, Sphere, ViewFrame, ViewMarker, ViewPose, pose_row,
};
use nalgebra::{Isometry3, Point3, Vector3};

/// The arm of [`frames`] in its ten validation poses, with two sweeps.
pub fn view() -> View3d {
    let names = [
        "base_link",
        "waist",
        "shoulder",
        "elbow",
        "wrist_pitch",
        "wrist_roll",
        "gripper",
    ];
    let mut draw = Draw::new(21);
    let marker = |frames: &[Isometry3<f64>], place: &[f64; 3]| frames[6] * Point3::from(*place);
    let poses = held_out_poses()
        .into_iter()
        .map(|(q, pose)| {
            let (real, model) = (frames(&q, 1.0), frames(&q, 0.97));
            ViewPose {
                name: pose.pose,
                text: format!(
                    "error {:.2} mm",
                    pose.calibrated_m.expect("a held-out error") * 1e3
                ),
                nominal: frames(&q, 0.0).iter().map(pose_row).collect(),
                calibrated: model.iter().map(pose_row).collect(),
                markers: MARKERS
                    .iter()
                    .map(|(name, place)| ViewMarker {
                        name: (*name).into(),
                        observed: Some((marker(&real, place) + draw.vector(0.000_1)).into()),
                        predicted: marker(&model, place).into(),
                    })
                    .collect(),
                ..ViewPose::default()
            }
        })
        .collect();
    // The upper arm swept over waist and shoulder, the gripper over wrist_roll.
    let sweep: Vec<[f64; 3]> = (0..12)
        .flat_map(|i| {
            (0..20).map(move |j| {
                [
                    f64::from(i) * 0.35 - 1.2,
                    f64::from(j) * 0.25 - 2.4,
                    0.0,
                    0.0,
                    0.0,
                ]
            })
        })
        .map(|q| frames(&q, 1.0)[3].translation.vector.into())
        .collect();
    let bent = [0.4, 0.5, 1.2, 0.6, 0.0];
    let wrist = frames(&bent, 1.0)[5];
    let roll: Vec<[f64; 3]> = (0..21)
        .map(|i| {
            marker(
                &frames(&[0.4, 0.5, 1.2, 0.6, f64::from(i) * 0.17 - 1.7], 1.0),
                &[0.03, 0.02, 0.01],
            )
            .into()
        })
        .collect();
    let shoulder = frames(&[0.0; 5], 1.0)[2].translation.vector;
    View3d {
        frame: "vicon".into(),
        magnification: 100.0,
        frames: names
            .iter()
            .enumerate()
            .map(|(i, name)| ViewFrame {
                name: (*name).into(),
                parent: i.checked_sub(1),
            })
            .collect(),
        solids: vec![
            Solid::cylinder(0, &Isometry3::translation(0.0, 0.0, 0.1), 0.09, 0.2),
            Solid::cuboid(2, &Isometry3::translation(0.0, 0.0, 0.19), [0.08, 0.1, 0.4]),
            Solid::cuboid(
                3,
                &Isometry3::translation(0.0, 0.0, 0.19),
                [0.06, 0.08, 0.4],
            ),
        ],
        poses,
        clouds: vec![
            Cloud {
                name: "base_sweep linkM".into(),
                points: sweep,
            },
            Cloud {
                name: "wrist_sweep gripM_1".into(),
                points: roll,
            },
        ],
        spheres: vec![Sphere {
            name: "shoulder".into(),
            center: shoulder.into(),
            radius: 0.378,
            sigma: Some(0.000_5),
        }],
        circles: vec![Circle {
            name: "wrist_roll".into(),
            center: (wrist * Point3::new(0.0, 0.0, 0.169)).into(),
            normal: (wrist.rotation * Vector3::z()).into(),
            radius: 0.036,
        }],
        axes: vec![Axis {
            name: "wrist_roll".into(),
            point: (wrist * Point3::origin()).into(),
            direction: (wrist.rotation * Vector3::z()).into(),
            half_length: 0.25,
            sigma_point: Some(0.000_2),
            sigma_direction: Some(0.001),
            frame: None,
        }],
        planned: false,
    }
}
