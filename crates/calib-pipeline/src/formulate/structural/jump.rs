//! A change at one row, as a finding.

use calib_checks::structural::{Jump, Moved, Outcome, RecordingIndex};
use calib_finding::{About, Fact, Finding, Subject, catalog};

use super::layout::Layout;

/// The tracker, a body or the zero of a joint moved while the data were recorded, farther than a fit follows.
pub(super) fn finding(layout: &Layout<'_>, outcome: &Outcome, found: &Jump) -> Finding {
    let id = catalog::CHANGED_WHILE_RECORDING;
    let recording = |r: &RecordingIndex| layout.recordings[r.0].name.clone();
    let row =
        |of: usize| layout.recordings[layout.data.recording[of].0].poses.rows[layout.rows[of]];
    let finding = match found.moved {
        Moved::Tracker => Finding::of_kind(id, "tracker-far", About::Tracker),
        Moved::Body(body) => {
            let name = layout.bodies[body.0];
            Finding::of_kind(id, "body-far", Subject::body(name)).with("body", Fact::name(name))
        }
        Moved::Joint(joint) => {
            Finding::of_kind(id, "joint-far", Subject::joint(layout.joint(joint)))
        }
        Moved::Names {
            first,
            second,
            after,
        } => {
            let kind = if after { "names-after" } else { "names-before" };
            let [body, other] = [first, second].map(|body| layout.bodies[body.0]);
            Finding::of_kind(id, kind, Subject::body(body))
                .with("body", Fact::name(body))
                .with("other", Fact::name(other))
        }
        Moved::Rows { by } => {
            let kind = if by > 0 { "rows-earlier" } else { "rows-later" };
            Finding::of_kind(id, kind, Subject::default())
                .with("rows", Fact::count(usize::from(by.unsigned_abs())))
        }
    };
    let name = |moved: &Moved| match *moved {
        Moved::Tracker => Some(layout.inputs.robot.profile.tracker.frame.clone()),
        Moved::Body(body) => Some(layout.bodies[body.0].to_owned()),
        Moved::Joint(joint) => Some(layout.joint(joint).to_owned()),
        Moved::Names { .. } | Moved::Rows { .. } => None,
    };
    let later: Vec<String> = found.later.iter().map(recording).collect();
    let own = recording(&found.recording);
    let all = layout.recordings.iter().map(|r| &r.name);
    let earlier: Vec<String> = all
        .filter(|name| **name != own && !later.contains(name))
        .cloned()
        .collect();
    let rivals: Vec<String> = found.rivals.iter().filter_map(name).collect();
    let some = |names: Vec<String>| (!names.is_empty()).then(|| Fact::names(names));
    let (before, after) = (row(found.before), row(found.after));
    finding
        .with_some("distance", found.size.distance.map(Fact::meters))
        .with_some("angle", found.size.angle.map(Fact::radians))
        .with("before", Fact::name(before.to_string()))
        .with("row", Fact::name(after.to_string()))
        .with("recording", Fact::name(own.clone()))
        .with_some("later", some(later))
        .with_some("earlier", some(earlier))
        .with_some("rivals", some(rivals))
        .with("best", Fact::meters(found.rms))
        .with("none", Fact::meters(outcome.rms))
        .with_some("limit", outcome.expected.map(|e| Fact::meters(e.limit)))
        .in_recording(own)
        .at_rows([after])
}
