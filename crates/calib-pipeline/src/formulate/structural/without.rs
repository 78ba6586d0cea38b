//! Which recordings the others fit without, where no single mistake explains all of them.

use std::collections::BTreeSet;

use calib_checks::structural::{
    Hypothesis, JointIndex, Named, Outcome, RecordingIndex, Scope, Scoped, registration_residual,
};
use calib_finding::{Fact, Finding, Subject, catalog};

use super::layout::Layout;

/// What is left out must have raised the residual by this, as a mistake that is named does.
pub(super) const DIVIDED: f64 = 1.5;

/// Recordings that disagree with the others.
pub(super) struct Apart {
    recordings: BTreeSet<RecordingIndex>,
    /// Their joints without a column, which were taken to stand at 0.
    joints: BTreeSet<JointIndex>,
    /// Residual of the others, rms, m.
    rest: f64,
}

/// The recordings without which the others fit as well as nominal errors let them: those that lack columns, else one.
pub(super) fn apart(layout: &Layout<'_>, outcome: &Outcome) -> Option<Apart> {
    let limit = outcome.expected?.limit;
    let all: BTreeSet<RecordingIndex> = layout.data.recording.iter().copied().collect();
    let lacking: BTreeSet<RecordingIndex> = outcome.assumed_zero.iter().map(|a| a.1).collect();
    let singly = all.iter().map(|r| BTreeSet::from([*r]));
    let candidates = [lacking].into_iter().chain(singly);
    candidates
        .filter(|out| !out.is_empty() && out.len() < all.len())
        .find_map(|recordings| {
            let rows = 0..layout.data.recording.len();
            let rows = rows.filter(|row| !recordings.contains(&layout.data.recording[*row]));
            let rows: Vec<usize> = rows.collect();
            let rest = registration_residual(&layout.data.select(&rows)).ok()?;
            // No residual at all: too few rows to have one.
            let fits = rest > 0.0 && rest <= limit && rest * DIVIDED < outcome.rms;
            let joints = outcome.assumed_zero.iter();
            let joints = joints.filter(|(_, r)| recordings.contains(r));
            let joints = joints.map(|(joint, _)| *joint).collect();
            fits.then_some(Apart {
                recordings,
                joints,
                rest,
            })
        })
}

/// The finding about joints without a column where another frame or mount in the same recording was named: joints that stood
/// elsewhere move all that is behind them, as a frame of its own does, and the profile knows that their columns are not there.
pub(super) fn in_place_of(
    layout: &Layout<'_>,
    outcome: &Outcome,
    named: &Named,
) -> Option<Finding> {
    let lacks = |r: &RecordingIndex| outcome.assumed_zero.iter().any(|(_, empty)| empty == r);
    let frame = |scoped: &Scoped| {
        let of_frame = matches!(
            scoped.hypothesis,
            Hypothesis::TrackerMoved
                | Hypothesis::TrackerAxes { .. }
                | Hypothesis::Remounted { .. }
        );
        of_frame && matches!(&scoped.scope, Scope::Recording(r) if lacks(r))
    };
    if !named.correction.iter().all(frame) {
        return None;
    }
    apart(layout, outcome)?.of_columns(layout, outcome)
}

/// Whether a finding about all joints without a column in some recordings says what another finds of one of them.
pub(super) fn says(findings: &[Finding], other: &Finding) -> bool {
    let of_all = |finding: &&Finding| {
        let kind = finding.facts.get("kind").and_then(Fact::word);
        finding.id == catalog::JOINT_COLUMN_MISSING && kind == Some("apart")
    };
    let mut of_all = findings.iter().filter(of_all);
    let recordings = &other.subject.recordings;
    other.id == catalog::JOINT_COLUMN_MISSING
        && of_all.any(|finding| recordings.iter().all(|r| finding.subject.is_in(r)))
}

impl Apart {
    fn names(&self, layout: &Layout<'_>) -> Vec<String> {
        let recordings = self.recordings.iter();
        recordings
            .map(|r| layout.recordings[r.0].name.clone())
            .collect()
    }

    /// The finding about the joints that have no column there; `None` where every joint has one.
    pub(super) fn of_columns(&self, layout: &Layout<'_>, outcome: &Outcome) -> Option<Finding> {
        let first = *self.joints.first()?;
        let joints = self.joints.iter();
        let joints = joints.map(|joint| layout.joint(*joint).to_owned());
        let recordings = self.names(layout);
        let subject = Subject {
            recordings: recordings.clone(),
            ..Subject::default()
        };
        Some(
            Finding::of_kind(catalog::JOINT_COLUMN_MISSING, "apart", subject)
                .with("joint", Fact::name(layout.joint(first)))
                .with("unit", Fact::choice(layout.shown(first, 0.0).1))
                .with("joints", Fact::names(joints))
                .with("recordings", Fact::names(recordings))
                .with("none", Fact::meters(outcome.rms))
                .with_some("limit", outcome.expected.map(|e| Fact::meters(e.limit)))
                .with("rest", Fact::meters(self.rest)),
        )
    }

    /// What a finding about all recordings says of these.
    pub(super) fn noted(&self, layout: &Layout<'_>, finding: Finding) -> Finding {
        finding
            .with("recordings", Fact::names(self.names(layout)))
            .with("rest", Fact::meters(self.rest))
    }
}
