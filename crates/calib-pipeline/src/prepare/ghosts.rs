//! Reflections that were taken for markers: what the distances between markers prove false takes no part.
//!
//! A fit that knows the robot badly cannot tell rows with a reflection from rows that its model fits worst, and where they are many, it readmits them.

use std::borrow::Cow;

use calib_checks::{Expectations, checks, out_of_place};
use calib_finding::{Finding, catalog};
use calib_profile::Profile;
use calib_recording::Poses;
use calib_report::RejectedFor;

use crate::prepare::checks::{expectations, of_markers};
use crate::prepare::excluded::Excluded;
use crate::prepare::inputs::Inputs;

/// Takes the markers out that are grossly out of place, where the checks of the data found some.
pub fn take_out(inputs: &mut Inputs, findings: &[Finding]) {
    if findings.iter().all(|f| f.id != catalog::MARKER_OUTLIER) {
        return;
    }
    let mut excluded = Vec::new();
    for (name, loaded) in &inputs.recordings {
        let found = out_of_place(&loaded.poses, &expectations(inputs, loaded));
        excluded.extend(found.into_iter().map(|(marker, row)| Excluded {
            recording: name.clone(),
            row,
            body: marker,
            cause: RejectedFor::OutOfPlace,
        }));
    }
    inputs.exclude(excluded);
}

/// A stream without the samples that are grossly out of place, and what the checks say of them: nothing would stand still with them, and the motion
/// of their body would tell no clock.
pub(super) fn of_stream<'a>(
    profile: &Profile,
    stream: &'a Poses,
) -> (Cow<'a, Poses>, Vec<Finding>) {
    let (bodies, templates) = of_markers(profile, stream);
    let expected = Expectations {
        bodies,
        templates,
        marker_sigma: profile.tracker.marker_coordinate(),
        ..Expectations::default()
    };
    let found = out_of_place(stream, &expected);
    let mut rest = Cow::Borrowed(stream);
    if found.is_empty() {
        return (rest, Vec::new());
    }
    for (marker, row) in found {
        if let Some(track) = rest.to_mut().markers.get_mut(&marker) {
            track[row] = None;
        }
    }
    let mut findings = checks(stream, &expected);
    findings.retain(|finding| finding.id == catalog::MARKER_OUTLIER);
    (rest, findings)
}
