//! The 3-D view of a plan: the robot in every posture, with keep-outs and cameras, in the tracker's frame.

use calib_pipeline::output::shapes::solids;
use calib_report::view3d::{Cloud, Solid, View3d, ViewFrame, ViewMarker, ViewPose, pose_row};
use nalgebra::Isometry3;

use crate::list::{Plan, Why};
use crate::prepare::Prepared;
use crate::words;

/// Postures in their order, those to validate with last.
#[must_use]
pub fn view(prepared: &Prepared<'_>, plan: &Plan) -> View3d {
    let robot = &prepared.known.robot;
    let (model, spec) = (&robot.model, &robot.profile.plan);
    let mut frames: Vec<ViewFrame> = model
        .links()
        .iter()
        .map(|link| ViewFrame {
            name: link.name.clone(),
            parent: link.parent_joint.map(|j| model.joint(j).parent.index()),
        })
        .collect();
    let (mut solids, _) = solids(robot, &mut Vec::new());
    // The frame of the root once more: what stands beside the robot is no part of a link.
    if !spec.keep_outs.is_empty() {
        let frame = frames.len();
        frames.push(ViewFrame {
            name: words::KEEP_OUTS.to_owned(),
            parent: None,
        });
        let boxes = spec.keep_outs.values();
        solids.extend(boxes.map(|b| Solid::cuboid(frame, &b.root_from_box, b.size.into())));
    }
    let cameras: Vec<[f64; 3]> = spec.cameras.values().map(|c| c.at.coords.into()).collect();
    let clouds = (!cameras.is_empty()).then(|| Cloud {
        name: words::CAMERAS.to_owned(),
        points: cameras,
    });
    let postures = plan.postures.iter().enumerate().map(|(place, p)| {
        let why = words::why_in_full(p.why);
        let text = match p.why {
            Why::Detour => why.to_owned(),
            _ => words::posture(why, p.sigma),
        };
        (words::pose(plan.pose(place)), text, &p.q)
    });
    let held_out = plan.held_out.iter().enumerate();
    let held_out = held_out.map(|(k, q)| (words::held_out_pose(k), String::new(), q));
    let poses = postures.chain(held_out).map(|(name, text, q)| ViewPose {
        name,
        text,
        ..posture(prepared, frames.len(), q)
    });
    View3d {
        frame: robot.profile.tracker.frame.clone(),
        magnification: 1.0,
        poses: poses.collect(),
        solids,
        clouds: clouds.into_iter().collect(),
        planned: true,
        frames,
        ..View3d::default()
    }
}

/// The robot with its markers; what is not in sight has no observed place.
fn posture(prepared: &Prepared<'_>, frames: usize, q: &[f64]) -> ViewPose {
    let sight = &prepared.feasible.sight;
    let links = prepared.feasible.model.forward_kinematics(q);
    let mut placed: Vec<Isometry3<f64>> = links
        .iter()
        .map(|link| sight.tracker_from_root * link)
        .collect();
    placed.resize(frames, sight.tracker_from_root);
    let seen = prepared.feasible.looked_at(q);
    let markers = sight.subjects.iter().zip(&seen).map(|(subject, seen)| {
        let at: [f64; 3] = (placed[subject.link] * subject.at).coords.into();
        ViewMarker {
            name: subject.name().to_owned(),
            observed: seen.is_some().then_some(at),
            predicted: at,
        }
    });
    ViewPose {
        markers: markers.collect(),
        calibrated: placed.iter().map(pose_row).collect(),
        ..ViewPose::default()
    }
}
