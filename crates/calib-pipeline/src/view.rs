//! The 3-D view of the report: nominal and calibrated robot, sweeps, centers and axes, in the tracker's frame.

use std::collections::BTreeMap;

use calib_profile::{BodyKind, Usage};
use calib_report::view3d::{
    Axis, Cloud, Sphere, View3d, ViewFrame, ViewMarker, ViewPose, pose_row,
};
use nalgebra::{Isometry3, Point3};

use crate::kinematics::Calibration;
use crate::load::{Inputs, Loaded};
use crate::paper::OriginEstimate;
use crate::tracks::BodyTrack;

/// Half length of a drawn axis, m.
const AXIS_HALF_LENGTH: f64 = 0.3;
/// Residual arrows begin this many times longer than they are.
const MAGNIFICATION: f64 = 50.0;

/// Everything that the view shows.
#[must_use]
pub fn view(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    nominal: &Calibration,
    robot: &Calibration,
    origins: &BTreeMap<String, OriginEstimate>,
) -> View3d {
    let model = &inputs.robot.model;
    let mut frames: Vec<ViewFrame> = Vec::new();
    for link in model.links() {
        let parent = link.parent_joint.map(|j| model.joint(j).parent.index());
        frames.push(ViewFrame {
            name: link.name.clone(),
            parent,
        });
    }
    let validation = inputs
        .recordings
        .values()
        .filter(|r| r.spec.usage == Usage::Validation);
    let poses = validation
        .flat_map(|r| poses(inputs, tracks, nominal, robot, r))
        .collect();
    let mut clouds = Vec::new();
    for r in inputs
        .recordings
        .values()
        .filter(|r| r.spec.usage == Usage::Sweep)
    {
        clouds.extend(sweep_clouds(inputs, r));
    }
    let (mut spheres, mut axes) = (Vec::new(), Vec::new());
    for (name, estimate) in origins {
        let origin = &inputs.robot.profile.origins[name];
        if let Some(center) = estimate.center {
            let seen = tracks[&origin.body].in_recording(&origin.sweep);
            let radii: Vec<f64> = seen
                .iter()
                .flatten()
                .map(|t| (t.translation.vector - center.coords).norm())
                .collect();
            let radius = radii.iter().sum::<f64>() / radii.len().max(1) as f64;
            spheres.push(Sphere {
                name: name.clone(),
                center: center.coords.into(),
                radius,
                sigma: None,
            });
        }
        if let Some(axis) = estimate.axis {
            axes.push(Axis {
                name: name.clone(),
                point: axis.point.coords.into(),
                direction: axis.direction.into_inner().into(),
                half_length: AXIS_HALF_LENGTH,
                sigma_point: None,
                sigma_direction: None,
            });
        }
    }
    View3d {
        frame: inputs.robot.profile.tracker.frame.clone(),
        magnification: MAGNIFICATION,
        frames,
        poses,
        clouds,
        spheres,
        circles: Vec::new(),
        axes,
        ..View3d::default()
    }
}

fn poses(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    nominal: &Calibration,
    robot: &Calibration,
    r: &Loaded,
) -> Vec<ViewPose> {
    let mut poses = Vec::new();
    for (row, q) in r.q.iter().enumerate() {
        let Some(q) = q else { continue };
        let placed = |c: &Calibration| -> Vec<Isometry3<f64>> {
            c.root_from_link(q)
                .iter()
                .map(|t| c.tracker_from_root * t)
                .collect()
        };
        let calibrated = placed(robot);
        let mut markers = Vec::new();
        for (name, body) in &inputs.robot.profile.bodies {
            let link = calibrated[body.link.index()];
            match &body.kind {
                BodyKind::Pose => {
                    let observed = tracks[name]
                        .in_recording(&r.name)
                        .get(row)
                        .copied()
                        .flatten();
                    if let Some(mount) = robot.mounts.get(name) {
                        markers.push(ViewMarker {
                            name: name.clone(),
                            observed: observed.map(|t| t.translation.vector.into()),
                            predicted: (link * mount).translation.vector.into(),
                        });
                    }
                }
                BodyKind::Markers { names, .. } => {
                    for marker in names {
                        let on_link: Option<&Point3<f64>> =
                            robot.points.get(name).and_then(|p| p.get(marker));
                        if let Some(on_link) = on_link {
                            let observed = r.poses.markers.get(marker).and_then(|t| t[row]);
                            markers.push(ViewMarker {
                                name: marker.clone(),
                                observed: observed.map(|p| p.coords.into()),
                                predicted: (link * on_link).coords.into(),
                            });
                        }
                    }
                }
            }
        }
        poses.push(ViewPose {
            name: format!("{}:{}", r.name, r.poses.rows[row]),
            text: String::new(),
            nominal: placed(nominal).iter().map(pose_row).collect(),
            calibrated: calibrated.iter().map(pose_row).collect(),
            markers,
        });
    }
    poses
}

fn sweep_clouds(inputs: &Inputs, r: &Loaded) -> Vec<Cloud> {
    let mut clouds = Vec::new();
    for (name, body) in &inputs.robot.profile.bodies {
        let points: Vec<[f64; 3]> = match &body.kind {
            BodyKind::Pose => {
                let track = r.poses.bodies.get(name).map_or(&[][..], Vec::as_slice);
                track
                    .iter()
                    .flatten()
                    .map(|t| t.translation.vector.into())
                    .collect()
            }
            BodyKind::Markers { names, .. } => {
                let tracks = names.iter().filter_map(|m| r.poses.markers.get(m));
                tracks
                    .flatten()
                    .flatten()
                    .map(|p| p.coords.into())
                    .collect()
            }
        };
        if !points.is_empty() {
            clouds.push(Cloud {
                name: format!("{} in {}", name, r.name),
                points,
            });
        }
    }
    clouds
}
