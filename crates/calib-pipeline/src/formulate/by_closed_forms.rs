//! The result of the paper's method: the closed forms, each origin by itself.

use std::collections::{BTreeMap, BTreeSet};

use calib_finding::{About, Finding, catalog};
use calib_geometry::registration::rigid_registration;
use calib_profile::Usage;
use calib_urdf::JointId;
use nalgebra::{Isometry3, Point3};

use crate::estimate::paper::OriginEstimate;
use crate::estimate::start::{Start, mean_pose};
use crate::formulate::found::Found;
use crate::formulate::kinematics::Calibration;
use crate::formulate::solved::Solved;
use crate::prepare::conditions::conditions;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;

/// What the paper's method takes for granted; its regions hold only as far as this is true.
pub(crate) fn paper_assumptions() -> Finding {
    Finding::new(catalog::PAPER_ASSUMPTIONS, About::Method)
}

/// The paper's result as a robot: mounts from the origins, everything else nominal.
pub(crate) fn paper_result(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    start: &Start,
    origins: &BTreeMap<String, OriginEstimate>,
    nominal: &Calibration,
) -> Solved {
    let profile = &inputs.robot.profile;
    let model = &inputs.robot.model;
    let zero = model.forward_kinematics(&model.zero_positions());
    let mut robot = nominal.clone();
    let mut found = Vec::new();
    for (name, estimate) in origins {
        let origin = &profile.origins[name];
        let Some(pose) = estimate.pose else { continue };
        let body = &profile.bodies[&origin.body];
        // link_from_body = link_from_origin · (body_from_origin)⁻¹
        let link_from_origin = zero[body.link.index()].inverse() * zero[origin.link.index()];
        robot
            .mounts
            .insert(origin.body.clone(), link_from_origin * pose.inverse());
        found.push(Found {
            name: format!("{}_from_{name}", origin.body),
            origin: Some(name.clone()),
            parent: origin.body.clone(),
            child: name.clone(),
            pose,
            covariance: estimate.covariance,
            unobservable: estimate.unobservable.clone(),
            status: estimate.status,
        });
    }
    let known_place = profile.bodies.values().any(|b| b.mount.is_some());
    let found_mounts: BTreeSet<&String> = found.iter().map(|f| &f.parent).collect();
    let place = root_with_mounts_held(inputs, tracks, &robot, &found_mounts);
    if let (false, Some(place)) = (known_place, place) {
        robot.tracker_from_root = place;
    }
    for (name, t) in &profile.transforms {
        if let Some((joint, found_transform)) =
            paper_transform(inputs, tracks, (start, nominal), origins, name, t)
        {
            if let Some(joint) = joint {
                let (id, origin) = joint;
                robot.model = robot.model.with_origin(id, origin);
            }
            found.push(found_transform);
        }
    }
    Solved {
        fk: Calibration {
            mounts: robot.mounts.clone(),
            ..nominal.clone()
        },
        robot,
        registered: None,
        registration: None,
        found,
        root_covariance: None,
        fit: None,
    }
}

/// Where the root stands: the place that carries the bodies, on the mounts that were found, from where the robot's own kinematics has them
/// onto where the tracker saw them, in all fitted recordings together.
fn root_with_mounts_held(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    robot: &Calibration,
    bodies: &BTreeSet<&String>,
) -> Option<Isometry3<f64>> {
    /// Points of a body beside its origin, m: they weigh an orientation as a body of this size does.
    const SIZE: f64 = 0.1;
    let of_body = [
        Point3::origin(),
        Point3::new(SIZE, 0.0, 0.0),
        Point3::new(0.0, SIZE, 0.0),
        Point3::new(0.0, 0.0, SIZE),
    ];
    let profile = &inputs.robot.profile;
    let (mut at_root, mut seen_at) = (Vec::new(), Vec::new());
    let recordings = inputs.recordings.iter();
    for (name, loaded) in recordings.filter(|(_, r)| r.spec.usage != Usage::Validation) {
        let under = conditions(loaded, &inputs.robot, profile.solve.load);
        for (row, q) in loaded.q.iter().enumerate() {
            let Some(q) = q else { continue };
            let root_from_link = robot.root_from_link_under(q, &under[row]);
            for &body in bodies {
                let seen = tracks[body].in_recording(name).get(row).copied();
                let (Some(Some(seen)), Some(mount)) = (seen, robot.mounts.get(body)) else {
                    continue;
                };
                let root_from_body = root_from_link[profile.bodies[body].link.index()] * mount;
                at_root.extend(of_body.map(|p| root_from_body * p));
                seen_at.extend(of_body.map(|p| seen * p));
            }
        }
    }
    let found = rigid_registration(&at_root, &seen_at, None).ok()?;
    Some(found.b_from_a)
}

type CorrectedJoint = Option<(JointId, Isometry3<f64>)>;

/// A transform between links by the paper's method: from the sweep of the origin whose link is its child.
fn paper_transform(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    (start, robot): (&Start, &Calibration),
    origins: &BTreeMap<String, OriginEstimate>,
    name: &str,
    t: &calib_profile::LinkTransform,
) -> Option<(CorrectedJoint, Found)> {
    let profile = &inputs.robot.profile;
    let model = &inputs.robot.model;
    let (origin_name, origin) = profile.origins.iter().find(|(_, o)| o.link == t.child)?;
    let estimate = origins.get(origin_name)?;
    let pose = estimate.pose?;
    let zero = model.forward_kinematics(&model.zero_positions());
    let sweep = &inputs.recordings[&origin.sweep];
    let under = conditions(sweep, &inputs.robot, profile.solve.load);
    let mut samples = Vec::new();
    for ((q, under), seen) in sweep
        .q
        .iter()
        .zip(&under)
        .zip(tracks[&origin.body].in_recording(&origin.sweep))
    {
        let (Some(q), Some(seen)) = (q, seen) else {
            continue;
        };
        // A stiffness that is stated lets the joints yield to what was measured of their torques, or to gravity.
        let root_from_link = robot.root_from_link_under(q, under);
        // The child as it would stand at zero: undo the swept joints in the robot's own frame.
        let child_from_child_at_zero =
            root_from_link[t.child.index()].inverse() * zero[t.child.index()];
        let parent = start.tracker_from_root * root_from_link[t.parent.index()];
        samples.push(parent.inverse() * seen * pose * child_from_child_at_zero);
    }
    let parent_from_child = mean_pose(&samples)?;
    let corrected = t.correct.map(|joint| {
        let j = model.joint(joint);
        let parent_from_joint_parent = zero[t.parent.index()].inverse() * zero[j.parent.index()];
        let joint_child_from_child = zero[j.child.index()].inverse() * zero[t.child.index()];
        (
            joint,
            parent_from_joint_parent.inverse()
                * parent_from_child
                * joint_child_from_child.inverse(),
        )
    });
    let found = Found {
        name: name.to_owned(),
        origin: None,
        parent: model.link(t.parent).name.clone(),
        child: model.link(t.child).name.clone(),
        pose: parent_from_child,
        covariance: estimate.covariance,
        unobservable: estimate.unobservable.clone(),
        status: estimate.status,
    };
    Some((corrected, found))
}
