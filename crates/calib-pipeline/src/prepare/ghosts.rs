//! Reflections that were taken for markers: what the distances between markers prove false takes no part.
//!
//! A fit that knows the robot badly cannot tell rows with a reflection from rows that its model fits worst, and where they are many, it readmits them.

use calib_checks::out_of_place;
use calib_finding::{Finding, catalog};
use calib_report::RejectedFor;

use crate::prepare::checks::expectations;
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
