//! What the profile adds to the URDF and to the scene: tracking bodies, and points without orientation.

use calib_report::Status;
use calib_report::scene::SceneFrame;
use calib_urdf::{LinkId, RobotModel, UrdfEdit};
use nalgebra::{Isometry3, Point3};

use crate::formulate::kinematics::Calibration;
use crate::output::written::written;
use crate::prepare::inputs::Inputs;

/// The bodies and points that the profile adds to the URDF.
pub(super) fn added_frames(inputs: &Inputs, robot: &Calibration) -> Vec<UrdfEdit> {
    let nominal = &inputs.robot.model;
    let outputs = &inputs.robot.profile.outputs;
    let mut edits = Vec::new();
    for body in &outputs.add_bodies {
        let link = inputs.robot.profile.bodies[body].link;
        if let Some(mount) = robot.mounts.get(body) {
            edits.push(UrdfEdit::AddFixedFrame {
                name: body.clone(),
                parent_link: nominal.link(link).name.clone(),
                joint_name: format!("{body}_mount"),
                parent_from_frame: written(None, mount),
                comment: Some(format!("tracking body {body}")),
            });
        }
    }
    for point in single_points(inputs, robot) {
        let of_body = point.body.is_some_and(|b| outputs.add_bodies.contains(b));
        if of_body || point.body.is_none() && outputs.add_points.contains(&point.name) {
            edits.push(UrdfEdit::AddFixedFrame {
                joint_name: format!("{}_mount", point.name),
                parent_link: nominal.link(point.link).name.clone(),
                parent_from_frame: written(None, &Isometry3::from(point.on_link)),
                comment: Some(format!("point {} (no orientation)", point.name)),
                name: point.name,
            });
        }
    }
    edits
}

/// A point without orientation on a link: of a body of one or two markers, or one that touches something.
struct SinglePoint<'a> {
    name: String,
    /// The body that it belongs to.
    body: Option<&'a String>,
    link: LinkId,
    /// m.
    on_link: Point3<f64>,
    /// Taken from the profile as it is.
    stated: bool,
}

fn single_points<'a>(inputs: &'a Inputs, robot: &Calibration) -> Vec<SinglePoint<'a>> {
    let profile = &inputs.robot.profile;
    let mut points = Vec::new();
    for (body, spec) in &profile.bodies {
        let markers = robot.points.get(body);
        let markers = markers.filter(|_| !robot.mounts.contains_key(body));
        for (marker, on_link) in markers.into_iter().flatten() {
            // One marker is the body.
            let one = markers.is_some_and(|m| m.len() == 1);
            points.push(SinglePoint {
                name: if one { body } else { marker }.clone(),
                body: Some(body),
                link: spec.link,
                on_link: *on_link,
                stated: false,
            });
        }
    }
    points.extend(profile.points.iter().map(|(name, tip)| SinglePoint {
        name: name.clone(),
        body: None,
        link: tip.link,
        on_link: robot.contact_points.get(name).copied().unwrap_or(tip.at),
        stated: tip.sigma.is_none(),
    }));
    points
}

/// Points without orientation, in the axes of their links.
pub(super) fn point_frames(
    inputs: &Inputs,
    robot: &Calibration,
    model: &RobotModel,
) -> Vec<SceneFrame> {
    let frame = |point: SinglePoint<'_>| {
        let status = if point.stated {
            Status::Assumed
        } else {
            Status::Calibrated
        };
        SceneFrame::new(
            body_frame(model, &point.name),
            model.link(point.link).name.clone(),
            &Isometry3::from(point.on_link),
            None,
            status,
        )
    };
    let points = single_points(inputs, robot);
    points.into_iter().map(frame).collect()
}

/// Name of a body's frame in the scene: its own, unless a link has it.
pub(super) fn body_frame(model: &RobotModel, body: &str) -> String {
    if model.link_id(body).is_ok() {
        format!("{body}_body")
    } else {
        body.to_owned()
    }
}
