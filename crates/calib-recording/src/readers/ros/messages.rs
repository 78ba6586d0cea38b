//! The messages that carry joints, bodies and markers.

use super::cdr::Cdr;
use crate::error::Placed;
use crate::rotation::UNIT_TOLERANCE;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};

/// What one message says about streams that share their instants.
#[derive(Default)]
pub(super) struct Content {
    /// Streams of one group share their instants.
    pub group: String,
    /// Header stamp, s; 0 = none.
    pub stamp: f64,
    pub joints: Vec<(String, Option<f64>)>,
    pub torques: Vec<(String, Option<f64>)>,
    /// `Err` = the quaternion is no rotation.
    pub bodies: Vec<(String, Pose)>,
    pub markers: Vec<(String, Option<Point3<f64>>)>,
}

pub(super) struct NoRotation;

/// `Ok(None)` = lost.
type Pose = Result<Option<Isometry3<f64>>, NoRotation>;

/// `None`: a message of another type.
pub(super) fn decode(
    at: u64,
    topic: &str,
    kind: &str,
    data: &[u8],
) -> Placed<Option<Vec<Content>>> {
    let (package, name) = (
        kind.split('/').next().unwrap_or(""),
        kind.rsplit('/').next().unwrap_or(""),
    );
    let read: fn(&mut Cdr, &str) -> Placed<Vec<Content>> = match (package, name) {
        ("sensor_msgs", "JointState") => joint_state,
        ("tf2_msgs", "TFMessage") => transforms,
        ("geometry_msgs", "TransformStamped") => |cdr, topic| Ok(vec![transform(cdr, topic)?]),
        ("geometry_msgs", "PoseStamped") => pose_stamped,
        ("motion_capture_tracking_interfaces", "NamedPoseArray") => named_poses,
        ("mocap4r2_msgs", "RigidBodies") => rigid_bodies,
        ("mocap4r2_msgs", "Markers") => markers,
        _ => return Ok(None),
    };
    read(&mut Cdr::new(at, data)?, topic).map(Some)
}

/// Stamp, s, and frame.
fn header(cdr: &mut Cdr) -> Placed<(f64, String)> {
    let (seconds, nanoseconds) = (cdr.i32()?, cdr.u32()?);
    Ok((
        f64::from(seconds) + f64::from(nanoseconds) * 1e-9,
        cdr.string()?,
    ))
}

fn joint_state(cdr: &mut Cdr, topic: &str) -> Placed<Vec<Content>> {
    let (stamp, _) = header(cdr)?;
    let mut names = Vec::new();
    for _ in 0..cdr.count(4)? {
        names.push(cdr.string()?);
    }
    let mut values = || -> Placed<Vec<f64>> {
        let count = cdr.count(8)?;
        (0..count).map(|_| cdr.f64()).collect()
    };
    let (positions, _velocities, efforts) = (values()?, values()?, values()?);
    let pair = |values: &[f64]| -> Vec<(String, Option<f64>)> {
        names
            .iter()
            .cloned()
            .zip(values.iter().map(|&v| v.is_finite().then_some(v)))
            .collect()
    };
    let (joints, torques) = (pair(&positions), pair(&efforts));
    Ok(vec![Content {
        group: topic.to_string(),
        stamp,
        joints: unique(joints),
        torques: unique(torques),
        ..Content::default()
    }])
}

/// One message must not name a joint, body or marker twice: the first counts.
fn unique<T>(mut items: Vec<(String, T)>) -> Vec<(String, T)> {
    let mut seen = std::collections::BTreeSet::new();
    items.retain(|(name, _)| seen.insert(name.clone()));
    items
}

fn transforms(cdr: &mut Cdr, topic: &str) -> Placed<Vec<Content>> {
    let count = cdr.count(8 + 4 + 4 + 56)?;
    (0..count).map(|_| transform(cdr, topic)).collect()
}

fn transform(cdr: &mut Cdr, topic: &str) -> Placed<Content> {
    let (stamp, parent) = header(cdr)?;
    let child = cdr.string()?;
    let pose = pose(cdr.array()?, cdr.array()?);
    Ok(Content {
        group: format!("{topic} {parent} {child}"),
        stamp,
        bodies: vec![(child, pose)],
        ..Content::default()
    })
}

fn pose_stamped(cdr: &mut Cdr, topic: &str) -> Placed<Vec<Content>> {
    let (stamp, _) = header(cdr)?;
    let pose = pose(cdr.array()?, cdr.array()?);
    // `/vrpn_client_node/hand/pose` is the body `hand`.
    let parts: Vec<&str> = topic.split('/').filter(|part| !part.is_empty()).collect();
    let name = match parts.as_slice() {
        [.., body, "pose"] => body,
        [.., body] => body,
        [] => "body",
    };
    Ok(vec![Content {
        group: topic.to_string(),
        stamp,
        bodies: vec![(name.to_string(), pose)],
        ..Content::default()
    }])
}

fn named_poses(cdr: &mut Cdr, topic: &str) -> Placed<Vec<Content>> {
    let (stamp, _) = header(cdr)?;
    let mut bodies = Vec::new();
    for _ in 0..cdr.count(4 + 56)? {
        let name = cdr.string()?;
        bodies.push((name, pose(cdr.array()?, cdr.array()?)));
    }
    Ok(vec![Content {
        group: topic.to_string(),
        stamp,
        bodies: unique(bodies),
        ..Content::default()
    }])
}

fn rigid_bodies(cdr: &mut Cdr, topic: &str) -> Placed<Vec<Content>> {
    let (stamp, _) = header(cdr)?;
    let _frame = cdr.u32()?;
    let (mut bodies, mut points) = (Vec::new(), Vec::new());
    for _ in 0..cdr.count(4 + 4 + 56)? {
        let name = cdr.string()?;
        for _ in 0..cdr.count(8 + 24)? {
            let (marker, point) = marker(cdr)?;
            points.push((format!("{name}:{marker}"), point));
        }
        bodies.push((name, pose(cdr.array()?, cdr.array()?)));
    }
    Ok(vec![Content {
        group: topic.to_string(),
        stamp,
        bodies: unique(bodies),
        markers: unique(points),
        ..Content::default()
    }])
}

fn markers(cdr: &mut Cdr, topic: &str) -> Placed<Vec<Content>> {
    let (stamp, _) = header(cdr)?;
    let _frame = cdr.u32()?;
    let count = cdr.count(8 + 24)?;
    let points: Vec<(String, Option<Point3<f64>>)> =
        (0..count).map(|_| marker(cdr)).collect::<Placed<_>>()?;
    Ok(vec![Content {
        group: topic.to_string(),
        stamp,
        markers: unique(points),
        ..Content::default()
    }])
}

/// Name (or number, where the tracker gives only that) and point.
fn marker(cdr: &mut Cdr) -> Placed<(String, Option<Point3<f64>>)> {
    let (_id_type, index, name) = (cdr.i8()?, cdr.i32()?, cdr.string()?);
    let [x, y, z] = cdr.array()?;
    let seen = x.is_finite() && y.is_finite() && z.is_finite() && [x, y, z] != [0.0; 3];
    let name = if name.is_empty() {
        format!("marker_{index}")
    } else {
        name
    };
    Ok((name, seen.then(|| Point3::new(x, y, z))))
}

/// NaN or all zeros is lost.
fn pose([x, y, z]: [f64; 3], [qx, qy, qz, qw]: [f64; 4]) -> Pose {
    let q = Quaternion::new(qw, qx, qy, qz);
    let finite = [x, y, z, qx, qy, qz, qw]
        .iter()
        .all(|value| value.is_finite());
    if !finite || q.norm() == 0.0 {
        return Ok(None);
    }
    if (q.norm() - 1.0).abs() > UNIT_TOLERANCE {
        return Err(NoRotation);
    }
    Ok(Some(Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_quaternion(q),
    )))
}
