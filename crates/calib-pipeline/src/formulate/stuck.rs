//! Rows in which the readings of a joint stand although it moved take no part in a fit.
//!
//! As long as they do, what the joint did in them looks like a change: of its zero, or of a body on its link.

use std::collections::{BTreeMap, BTreeSet};

use calib_core::Settings;
use calib_finding::{About, Fact, Finding, Severity, catalog};
use calib_profile::Usage;

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
    /// Joints whose gains and couplings these rows look like.
    joints: BTreeSet<String>,
}

/// Takes the rows out of the recordings, and fits again, for some joints one after the other; where nothing can be fitted without them, they stay.
pub(crate) fn without_stuck(
    inputs: &mut Inputs,
    tracks: &mut BTreeMap<String, BodyTrack>,
    start: &Start,
    fit: MlFit,
    settings: &Settings,
) -> WithoutStuck {
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
        let mut without = inputs.clone();
        without.exclude(found.bad.stuck.clone());
        let Ok((of_bodies, fit)) = fitted(&without, start, settings) else {
            found.bad.stuck.clear();
            break;
        };
        let said = std::mem::take(&mut found.bad.findings);
        for finding in said.into_iter().filter(is_stuck) {
            let rows = finding.facts.get("of").cloned();
            found.of_joint(finding.with_some("left_out", rows));
        }
        found.rows_of(inputs);
        found.bad = bad_rows(&without, &of_bodies, &fit);
        found.fit = fit;
        (*inputs, *tracks) = (without, of_bodies);
    }
    found
}

fn fitted(
    inputs: &Inputs,
    start: &Start,
    settings: &Settings,
) -> Result<(BTreeMap<String, BodyTrack>, MlFit), PipelineError> {
    let tracks = body_tracks(inputs, &mut Vec::new())?;
    let full = ml::state(inputs, &tracks, start, FreeSet::Profile);
    let fit = ml::fit(full, inputs, settings)?;
    Ok((tracks, fit))
}

/// Whether a finding names rows in which the readings of a joint stand although it moved.
pub(crate) fn is_stuck(finding: &Finding) -> bool {
    let kind = finding.facts.get("kind").and_then(Fact::word);
    finding.id == catalog::JOINT_NEVER_MOVED && kind == Some("although_in_rows")
}

impl WithoutStuck {
    /// One finding for each joint and recording: that of the body which shows most.
    fn of_joint(&mut self, finding: Finding) {
        let same = |f: &&mut Finding| f.subject == finding.subject;
        match self.findings.iter_mut().find(same) {
            Some(earlier) if finding.rows.len() > earlier.rows.len() => *earlier = finding,
            Some(_) => {}
            None => {
                if let About::Joint(name) = &finding.subject.about {
                    self.joints.insert(name.clone());
                }
                self.findings.push(finding);
            }
        }
    }

    /// Remembers the rows; where they are a sizable part of what is fitted, they look like mistakes of all joints before the bodies.
    fn rows_of(&mut self, inputs: &Inputs) {
        /// Part of the fitted rows.
        const SIZABLE: f64 = 0.1;
        for out in &self.bad.stuck {
            let row = inputs.recordings[&out.recording].poses.rows[out.row];
            self.rows.insert((out.recording.clone(), row));
        }
        let recordings = inputs.recordings.values();
        let fitted = recordings.filter(|r| r.spec.usage != Usage::Validation);
        let all: usize = fitted.map(|r| r.poses.len()).sum();
        if self.rows.len() as f64 <= SIZABLE * all as f64 {
            return;
        }
        let model = &inputs.robot.model;
        let bodies: BTreeSet<&String> = self.bad.stuck.iter().map(|out| &out.body).collect();
        let links = bodies
            .iter()
            .map(|body| inputs.robot.profile.bodies[*body].link);
        let joints = links.flat_map(|link| model.chain_to_root(link));
        self.joints
            .extend(joints.map(|joint| model.joint(joint).name.clone()));
    }

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
