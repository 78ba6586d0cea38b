//! The tracked points: markers, and virtual points that stand for a pose.

use nalgebra::{Isometry3, Vector3};

use super::data::{Data, Measured};
use super::hypothesis::Hypothesis;
use super::ids::{BodyIndex, RecordingIndex};

/// Virtual points of a pose: its position and three points at the arm's length along its axes.
const POINTS_OF_A_POSE: usize = 4;
/// Limits of the arm σ_position/σ_orientation, m: outside, one of the two parts of the pose would not count at all.
const ARM: (f64, f64) = (0.02, 1.0);

/// A tracked point: a marker, or a virtual point of a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Channel {
    pub body: usize,
    /// Marker, or number of the virtual point.
    pub point: usize,
    /// Its coordinates carry the tracker's unit of length.
    pub scales: bool,
}

/// Recordings that share a mount of a body.
pub(crate) fn mounts(data: &Data, body: usize, recordings: usize) -> Vec<Vec<usize>> {
    let mut groups: Vec<(u32, Vec<usize>)> = Vec::new();
    for r in 0..recordings {
        let mount = data.mount(BodyIndex(body), RecordingIndex(r));
        match groups.iter_mut().find(|g| g.0 == mount) {
            Some(group) => group.1.push(r),
            None => groups.push((mount, vec![r])),
        }
    }
    groups.into_iter().map(|g| g.1).collect()
}

pub(crate) fn channels_of(data: &Data) -> Vec<Channel> {
    let mut channels = Vec::new();
    for (body, b) in data.bodies.iter().enumerate() {
        let (points, pose) = match &b.measured {
            Measured::Markers(rows) => (rows.first().map_or(0, Vec::len), false),
            Measured::Poses { .. } => (POINTS_OF_A_POSE, true),
        };
        channels.extend((0..points).map(|point| Channel {
            body,
            point,
            scales: !pose || point == 0,
        }));
    }
    channels
}

/// The measured point of a channel in a row, m, corrected by a hypothesis that changes points or poses.
pub(crate) fn point(
    data: &Data,
    i: usize,
    channel: &Channel,
    h: Option<&Hypothesis>,
) -> Option<Vector3<f64>> {
    match &data.bodies[channel.body].measured {
        Measured::Markers(rows) => {
            let p = rows[i][channel.point]?.coords;
            Some(h.and_then(|h| h.point(&p)).unwrap_or(p))
        }
        Measured::Poses {
            tracker_from_body,
            sigma_position,
            sigma_orientation,
        } => {
            let measured = tracker_from_body[i]?;
            let pose: Isometry3<f64> = h
                .and_then(|h| h.pose(BodyIndex(channel.body), &measured))
                .unwrap_or(measured);
            let arm = (sigma_position / sigma_orientation).clamp(ARM.0, ARM.1);
            let position = pose.translation.vector;
            Some(match channel.point {
                0 => position,
                a => position + pose.rotation * (Vector3::ith(a - 1, arm)),
            })
        }
    }
}
