//! Data checks that need the nominal robot, before the fit: structural hypotheses first, single rows only where none of them
//! stands out, and the tracker's up axis.

use std::collections::BTreeMap;

use calib_checks::model::up_axis;
use calib_finding::{Fact, Finding, Subject};
use calib_profile::{UpAxis, Usage};

use crate::estimate::start::Start;
use crate::formulate::contact_directions;
use crate::formulate::exchanged_poses::put_right;
use crate::formulate::row_checks::rows;
use crate::formulate::structural::{keep_unexplained, structural};
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;

/// Tilt of a robot's base that its feet explain, rad (20°).
const BASE_TILT: f64 = 0.35;

/// Adds what the nominal robot says of the recordings to what their own checks found.
pub fn before_the_fit(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    start: &Start,
    findings: &mut Vec<Finding>,
) {
    // Bodies in different units fit no robot, and a hypothesis would explain the rest.
    let mixed = |f: &Finding| f.facts.get("kind").and_then(Fact::word) == Some("some_millimeters");
    if findings.iter().any(mixed) {
        return;
    }
    let mut found = structural(inputs, tracks);
    let put_right = put_right(inputs, tracks, &found);
    let (mut judged, mut of_judged) = (inputs, tracks);
    if let Some(right) = &put_right {
        (judged, of_judged) = (&right.inputs, &right.tracks);
        found = right.structural.clone();
        findings.extend(right.findings.iter().cloned());
    }
    let recordings = inputs.recordings.iter();
    let fitted = recordings.filter(|(_, r)| r.spec.usage != Usage::Validation);
    let fitted: Vec<&String> = fitted.map(|(name, _)| name).collect();
    keep_unexplained(findings, &found.findings, &fitted);
    findings.extend(found.findings.iter().cloned());
    if found.rows_count {
        findings.extend(rows(judged, of_judged, &found));
    }
    findings.extend(contact_directions::missing(inputs));
    for (name, loaded) in &inputs.recordings {
        // What the person says counts more than what the exporter wrote.
        let stated = inputs.robot.profile.tracker.up_axis.map(UpAxis::name);
        let declared = stated.or(loaded.meta.up_axis.as_deref());
        let tilted = declared.and_then(|axis| up_axis(axis, &start.tracker_from_root, BASE_TILT));
        findings.extend(tilted.map(|mut finding| {
            finding.subject = Subject::recording(name);
            finding
        }));
    }
}
