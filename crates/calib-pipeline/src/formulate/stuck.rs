//! Rows in which the readings of a joint stand although it moved take no part in a fit.
//!
//! As long as they do, what the joint did in them looks like a change: of its zero, or of a body on its link.

use std::collections::{BTreeMap, BTreeSet};

use calib_core::Settings;
use calib_finding::{About, Finding, Severity, catalog};

use crate::error::PipelineError;
use crate::estimate::start::Start;
use crate::formulate::bad_rows::{BadRows, bad_rows};
use crate::formulate::formulation::{FreeSet, MlFit};
use crate::formulate::ml;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::{BodyTrack, body_tracks};

/// Joints that stand in rows of a recording at most: with more of them, nothing of it is right.
const JOINTS: usize = 4;

/// A fit without such rows.
pub(crate) struct WithoutStuck {
    /// The fit.
    pub(crate) fit: MlFit,
    /// What is wrong with the rows that it left out.
    pub(crate) bad: BadRows,
    /// What was said of the rows that were taken out.
    pub(crate) findings: Vec<Finding>,
    /// The rows, as the recordings number them.
    rows: BTreeSet<(String, u64)>,
    /// Joints that the bodies in them hang on.
    joints: BTreeSet<String>,
}

/// Takes the rows out of the recordings, and fits again, until there are none.
///
/// # Errors
/// Those of the body tracks and of the fit.
pub(crate) fn without_stuck(
    inputs: &mut Inputs,
    tracks: &mut BTreeMap<String, BodyTrack>,
    start: &Start,
    fit: MlFit,
    settings: &Settings,
) -> Result<WithoutStuck, PipelineError> {
    let bad = bad_rows(inputs, tracks, &fit);
    let mut found = WithoutStuck {
        fit,
        bad,
        findings: Vec::new(),
        rows: BTreeSet::new(),
        joints: BTreeSet::new(),
    };
    for _ in 0..JOINTS {
        if found.bad.stuck.is_empty() {
            break;
        }
        let said = found.bad.findings.into_iter();
        let of_joints = said.filter(|f| f.id == catalog::JOINT_NEVER_MOVED);
        found.findings.extend(of_joints);
        for out in &found.bad.stuck {
            let row = inputs.recordings[&out.recording].poses.rows[out.row];
            found.rows.insert((out.recording.clone(), row));
            let model = &inputs.robot.model;
            let chain = model.chain_to_root(inputs.robot.profile.bodies[&out.body].link);
            let names = chain
                .into_iter()
                .map(|joint| model.joint(joint).name.clone());
            found.joints.extend(names);
        }
        inputs.exclude(found.bad.stuck);
        *tracks = body_tracks(inputs, &mut Vec::new())?;
        let full = ml::state(inputs, tracks, start, FreeSet::Profile);
        found.fit = ml::fit(full, inputs, settings)?;
        found.bad = bad_rows(inputs, tracks, &found.fit);
    }
    Ok(found)
}

impl WithoutStuck {
    /// Leaves out of `findings` what these rows looked like to the nominal robot: gains and couplings of the joints, and single rows that are wrong.
    pub(crate) fn leave_out_explained(&self, findings: &mut Vec<Finding>) {
        let of_rows = [
            catalog::ROW_OUTLIER,
            catalog::UNSETTLED_ROWS,
            catalog::BODY_FLIP,
        ];
        let is_explained = |f: &Finding| {
            let joint = match &f.subject.about {
                About::Joint(name) => self.joints.contains(name),
                _ => false,
            };
            let of_sizes = f.id == catalog::JOINT_GAIN || f.id == catalog::JOINT_COUPLING;
            let is_here = |row: &u64| match &f.subject.recordings[..] {
                [one] => self.rows.contains(&(one.clone(), *row)),
                _ => false,
            };
            let in_rows = of_rows.contains(&f.id) && !f.rows.is_empty();
            of_sizes && joint && f.severity == Severity::Warning
                || in_rows && f.rows.iter().all(is_here)
        };
        findings.retain(|f| !is_explained(f));
    }
}
