//! Bodies that the fit used and no held-out pose shows: nothing verifies their mounts, nor the joints that only they follow.

use std::collections::BTreeSet;

use calib_profile::{Body, BodyKind, Usage};
use calib_report::UnseenBody;
use calib_urdf::JointId;

use crate::prepare::inputs::{Inputs, Loaded};

/// The independent joints that what a row shows follows.
pub(super) struct Shown<'a> {
    bodies: Vec<(&'a String, &'a Body, BTreeSet<JointId>)>,
    /// Recordings whose rows are contacts, which follow every joint.
    contacts: BTreeSet<&'a String>,
}

impl<'a> Shown<'a> {
    pub(super) fn new(inputs: &'a Inputs) -> Self {
        let profile = &inputs.robot.profile;
        let model = &inputs.robot.model;
        let followed = |body: &Body| {
            let up = model.chain_to_root(body.link).into_iter();
            up.map(|joint| model.joint(joint).law.source).collect()
        };
        let bodies = profile.bodies.iter();
        let contacts = profile.contacts.values();
        Self {
            bodies: bodies.map(|(name, b)| (name, b, followed(b))).collect(),
            contacts: contacts.flat_map(|contact| &contact.recordings).collect(),
        }
    }

    /// Whether something that a row shows follows a joint.
    pub(super) fn follows(&self, loaded: &Loaded, row: usize, joint: JointId) -> bool {
        self.contacts.contains(&loaded.name)
            || self.bodies.iter().any(|(name, body, followed)| {
                followed.contains(&joint) && is_seen(loaded, name, body, row)
            })
    }

    /// The bodies that follow joints of `moved`, and that fitted rows show but no held-out one. A body before a `split` is not what is published.
    pub(super) fn unseen(&self, inputs: &Inputs, moved: &[JointId]) -> Vec<UnseenBody> {
        let profile = &inputs.robot.profile;
        let shows = |name: &String, body: &Body, held_out: bool| {
            let mut of = inputs.recordings.values();
            of.any(|loaded| {
                (loaded.spec.usage == Usage::Validation) == held_out
                    && (0..loaded.q.len())
                        .any(|row| loaded.q[row].is_some() && is_seen(loaded, name, body, row))
            })
        };
        let in_held_out = |(name, body, _): &&(&String, &Body, BTreeSet<JointId>)| {
            shows(name, body, true) || self.contacts.iter().any(|r| is_held_out(inputs, r))
        };
        let verified = self.bodies.iter().filter(in_held_out);
        let verified = verified.flat_map(|(_, _, followed)| followed.iter().copied());
        let verified: BTreeSet<JointId> = verified.collect();
        let is_before = |name: &String| {
            let mut split = profile
                .bodies
                .iter()
                .filter(|(_, body)| body.split.is_some());
            split.any(|(of, _)| *name == format!("{of}{}", crate::prepare::split::BEFORE))
        };
        let unseen = self.bodies.iter().filter(|(name, body, followed)| {
            moved.iter().any(|joint| followed.contains(joint))
                && !is_before(name)
                && shows(name, body, false)
                && !shows(name, body, true)
        });
        let of = unseen.map(|(name, body, followed)| {
            let only = moved.iter();
            let only = only.filter(|joint| followed.contains(joint) && !verified.contains(joint));
            UnseenBody {
                name: (*name).clone(),
                joints: only
                    .map(|joint| inputs.robot.model.joint(*joint).name.clone())
                    .collect(),
                remounted: body.split.is_some(),
            }
        });
        of.collect()
    }
}

fn is_held_out(inputs: &Inputs, recording: &str) -> bool {
    let loaded = inputs.recordings.get(recording);
    loaded.is_some_and(|loaded| loaded.spec.usage == Usage::Validation)
}

fn is_seen(loaded: &Loaded, name: &str, body: &Body, row: usize) -> bool {
    match &body.kind {
        BodyKind::Pose => {
            let track = loaded.poses.bodies.get(name);
            track.is_some_and(|track| track[row].is_some())
        }
        BodyKind::Markers { names, .. } => names.iter().any(|marker| {
            let track = loaded.poses.markers.get(marker);
            track.is_some_and(|track| track[row].is_some())
        }),
    }
}
