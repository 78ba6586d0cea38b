//! Bodies that are the same measurements as others: a pose beside the markers that the tracker computed it from.

use calib_checks::rigid_body::is_pose_of;
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::BodyKind;

use crate::prepare::inputs::Inputs;

/// A finding for each pose of the profile that is the fit of markers of the profile, with the recordings that show it.
pub(super) fn findings(inputs: &Inputs) -> Vec<Finding> {
    let bodies = &inputs.robot.profile.bodies;
    let poses = bodies
        .iter()
        .filter(|(_, body)| body.kind == BodyKind::Pose);
    let mut findings = Vec::new();
    for (pose, _) in poses {
        for (body, of) in bodies {
            let BodyKind::Markers { names, .. } = &of.kind else {
                continue;
            };
            let shown = inputs.recordings.iter().filter(|(_, loaded)| {
                let tracks = names.iter().map(|name| loaded.poses.markers.get(name));
                let tracks: Option<Vec<_>> = tracks.map(|track| track.map(Vec::as_slice)).collect();
                let pose = loaded.poses.bodies.get(pose);
                (pose.zip(tracks)).is_some_and(|(pose, tracks)| is_pose_of(pose, &tracks))
            });
            let shown: Vec<String> = shown.map(|(name, _)| name.clone()).collect();
            if shown.is_empty() {
                continue;
            }
            let mut finding = Finding::new(catalog::POSE_OF_MARKERS, Subject::body(pose))
                .with("body", Fact::name(pose))
                .with("other", Fact::name(body));
            finding.subject.recordings = shown;
            findings.push(finding);
        }
    }
    findings
}
