//! The 3-D view of the report: nominal and calibrated robot, sweeps, centers and axes, in the tracker's frame.

use std::collections::BTreeMap;

use calib_geometry::Line;
use calib_profile::{BodyKind, Usage};
use calib_report::HeldOut;
use calib_report::view3d::{
    Axis, Circle, Cloud, Solid, Sphere, View3d, ViewFrame, ViewMarker, ViewPose, pose_row,
};
use nalgebra::{Isometry3, Matrix3, Point3};

use crate::estimate::paper::OriginEstimate;
use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::Calibration;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;
use crate::verify::accuracy::configuration;
use crate::verify::deviations::joint_values;

/// Half length of a drawn axis of a sweep, m.
const AXIS_HALF_LENGTH: f64 = 0.3;
/// Half length of the drawn axis of a joint, m: the width of an arm.
const JOINT_HALF_LENGTH: f64 = 0.1;
/// Residual arrows begin this many times longer than they are.
const MAGNIFICATION: f64 = 50.0;

/// What was found, as far as the view shows it.
#[derive(Debug)]
pub struct Shown<'a> {
    /// The robot as in the nominal URDF.
    pub nominal: &'a Calibration,
    /// The calibrated robot.
    pub robot: &'a Calibration,
    /// Centers and axes by closed forms.
    pub origins: &'a BTreeMap<String, OriginEstimate>,
    /// Errors of the poses.
    pub held_out: Option<&'a HeldOut>,
    /// The fit, with `method: ml`.
    pub fit: Option<&'a MlFit>,
}

/// Everything that the view shows; the shapes of the links are those of [`crate::output::shapes`].
#[must_use]
pub fn view(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    shown: &Shown<'_>,
    solids: Vec<Solid>,
) -> View3d {
    let Shown {
        nominal,
        robot,
        origins,
        held_out,
        fit,
    } = *shown;
    let model = &inputs.robot.model;
    let mut frames: Vec<ViewFrame> = Vec::new();
    for link in model.links() {
        let parent = link.parent_joint.map(|j| model.joint(j).parent.index());
        frames.push(ViewFrame {
            name: link.name.clone(),
            parent,
        });
    }
    let poses = shown_rows(inputs, held_out)
        .into_iter()
        .flat_map(|(r, rows)| poses(inputs, tracks, (nominal, robot), r, &rows))
        .map(|pose| ViewPose {
            text: held_out.map_or_else(String::new, |h| h.errors_of(&pose.name)),
            ..pose
        })
        .collect();
    let mut clouds = Vec::new();
    for r in inputs
        .recordings
        .values()
        .filter(|r| r.spec.usage == Usage::Sweep)
    {
        clouds.extend(sweep_clouds(inputs, r));
    }
    let (mut spheres, mut circles) = (Vec::new(), Vec::new());
    let mut axes = fit.map_or_else(Vec::new, |fit| joint_axes(inputs, fit));
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
                sigma: estimate.center_sigma,
            });
        }
        if let Some(axis) = estimate.axis {
            axes.push(Axis {
                name: name.clone(),
                point: axis.point.coords.into(),
                direction: axis.direction.into_inner().into(),
                half_length: AXIS_HALF_LENGTH,
                sigma_point: estimate.axis_sigma[0],
                sigma_direction: estimate.axis_sigma[1],
                frame: None,
            });
            circles.extend(circle(name, &axis, places(inputs, tracks, origin)));
        }
    }
    View3d {
        frame: inputs.robot.profile.tracker.frame.clone(),
        magnification: MAGNIFICATION,
        frames,
        poses,
        clouds,
        spheres,
        circles,
        axes,
        solids,
        planned: false,
    }
}

/// Where the swept body was.
fn places(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    origin: &calib_profile::Origin,
) -> Vec<Point3<f64>> {
    let known = inputs.recordings.contains_key(&origin.sweep);
    let seen = known.then(|| tracks[&origin.body].in_recording(&origin.sweep));
    let poses = seen.into_iter().flatten().flatten();
    poses.map(|t| Point3::from(t.translation.vector)).collect()
}

/// The circle on which a body went about an axis; `None` when it was never seen.
fn circle(name: &str, axis: &Line, places: Vec<Point3<f64>>) -> Option<Circle> {
    let n = places.len() as f64;
    let along = |p: &Point3<f64>| (p - axis.point).dot(&axis.direction);
    let mean = places.iter().map(along).sum::<f64>() / n;
    let off = |p: &Point3<f64>| (p - axis.point).cross(&axis.direction).norm();
    let radius = places.iter().map(off).sum::<f64>() / n;
    radius.is_finite().then(|| Circle {
        name: name.to_owned(),
        center: (axis.point + axis.direction.into_inner() * mean).into(),
        normal: axis.direction.into_inner().into(),
        radius,
    })
}

/// The axes of the joints that moved in the fit, each in the frame of its child, as uncertain as they are in the tracker.
fn joint_axes(inputs: &Inputs, fit: &MlFit) -> Vec<Axis> {
    let model = &inputs.robot.model;
    let fitted = inputs
        .recordings
        .values()
        .filter(|r| r.spec.usage != Usage::Validation);
    let Some(q) = fitted.flat_map(|r| r.q.iter().flatten()).next() else {
        return Vec::new();
    };
    let at = configuration(inputs, fit, q);
    let mut axes = Vec::new();
    for id in model.independent_joints() {
        let joint = model.joint(id);
        let unmoved = &fit.solution.observability.unmoved;
        let moved = fit.formulation.joints[id.index()].is_none_or(|edge| !unmoved.contains(&edge));
        let frame = fit.formulation.links[joint.child.index()].filter(|_| moved);
        let (Some(frame), true, Some(direction)) = (frame, joint.kind.turns(), joint.kind.axis())
        else {
            continue;
        };
        let derived = fit
            .solution
            .relative_pose(fit.formulation.tracker, frame, &at);
        let covariance = derived.ok().and_then(|d| d.covariance);
        // A line does not change when it turns about itself or slides along itself: what is left is two numbers each.
        let across = Matrix3::identity() - direction.into_inner() * direction.transpose();
        let sigma = |from: usize| {
            covariance.map(|c| {
                let block: Matrix3<f64> = c.fixed_view::<3, 3>(from, from).into();
                (0.5 * (across * block * across).trace()).max(0.0).sqrt()
            })
        };
        axes.push(Axis {
            name: joint.name.clone(),
            point: [0.0; 3],
            direction: direction.into_inner().into(),
            half_length: JOINT_HALF_LENGTH,
            sigma_point: sigma(3),
            sigma_direction: sigma(0),
            frame: Some(joint.child.index()),
        });
    }
    axes
}

/// Postures that are shown where none was recorded to be held out.
const LEFT_OUT: usize = 24;

/// What a pose of a recording is called.
fn pose_name(r: &Loaded, row: usize) -> String {
    format!("{}:{}", r.name, r.poses.rows[row])
}

/// Rows to show: the held-out ones; where there are none, the worst of those that were left out in turn, and others evenly.
fn shown_rows<'a>(inputs: &'a Inputs, held_out: Option<&HeldOut>) -> Vec<(&'a Loaded, Vec<usize>)> {
    let known = |r: &Loaded| {
        (0..r.q.len())
            .filter(|row| r.q[*row].is_some())
            .collect::<Vec<_>>()
    };
    let (validation, fitted): (Vec<_>, Vec<_>) = inputs
        .recordings
        .values()
        .map(|r| (r, known(r)))
        .partition(|(r, _)| r.spec.usage == Usage::Validation);
    if !validation.is_empty() {
        return validation;
    }
    let count: usize = fitted.iter().map(|(_, rows)| rows.len()).sum();
    let every = count.div_ceil(LEFT_OUT).max(1);
    let worst = held_out.and_then(|h| h.worst.as_ref());
    let thinned = |(r, rows): (&'a Loaded, Vec<usize>)| {
        let is_worst = |row: usize| worst.is_some_and(|w| w.pose == pose_name(r, row));
        let rows = rows.into_iter().enumerate();
        let rows = rows.filter(|(i, row)| i % every == 0 || is_worst(*row));
        (r, rows.map(|(_, row)| row).collect())
    };
    fitted.into_iter().map(thinned).collect()
}

fn poses(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    (nominal, robot): (&Calibration, &Calibration),
    r: &Loaded,
    rows: &[usize],
) -> Vec<ViewPose> {
    let mut poses = Vec::new();
    for &row in rows {
        let Some(q) = &r.q[row] else { continue };
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
            name: pose_name(r, row),
            text: String::new(),
            nominal: placed(nominal).iter().map(pose_row).collect(),
            calibrated: calibrated.iter().map(pose_row).collect(),
            markers,
            joints: joint_values(inputs, &r.name, row)
                .into_iter()
                .map(|value| (value.joint, value.value))
                .collect(),
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
