//! A named mistake as findings: one for each correction, with the evidence and what is not distinguishable from it.

use calib_checks::structural::{
    ColumnOrder, Correction, Hypothesis, JointIndex, Length, Named, Outcome, PoseMistake,
    RecordingIndex, Scope, Scoped, UnitMistake,
};
use calib_finding::{About, Fact, Finding, Id, Subject, catalog};

use super::codes;
use super::columns;
use super::layout::Layout;

/// A fit finds a zero that is off by up to this, rad: of simulated arms all converged from 60°, some not from 75°.
pub(super) const FAR: f64 = std::f64::consts::FRAC_PI_4;
/// The gains that a fit finds: of simulated robots all converged from 0.2 to 2.2, one in 18 not from 2.4.
pub(super) const FITTED_GAINS: std::ops::RangeInclusive<f64> = 0.2..=2.2;

/// The findings of a named correction.
#[must_use]
pub fn findings(layout: &Layout<'_>, outcome: &Outcome, named: &Named) -> Vec<Finding> {
    let one = |scoped: &Scoped| {
        let others = named.correction.iter().filter(|other| *other != scoped);
        let others: Vec<String> = others.map(|other| codes::of(layout, other)).collect();
        let finding = of_hypothesis(layout, outcome, scoped);
        let finding = with_evidence(layout, finding, outcome, named);
        let mut finding = finding.with_some("other_correction", names(others));
        let recordings = layout.recordings_in(scoped.scope).into_iter();
        let lacking = lacking(layout, outcome, scoped);
        let concerned = recordings.filter(|name| {
            let known = lacking.as_ref();
            known.is_none_or(|lacking| lacking.contains(name))
        });
        finding.subject.recordings = concerned.map(str::to_owned).collect();
        finding
    };
    named.correction.iter().map(one).collect()
}

/// The recordings without the column that a hypothesis is about; `None` where it is about another thing.
fn lacking<'a>(layout: &'a Layout<'_>, outcome: &Outcome, scoped: &Scoped) -> Option<Vec<&'a str>> {
    let (Hypothesis::MissingColumn { joint } | Hypothesis::StoodAt { joint, .. }) =
        scoped.hypothesis
    else {
        return None;
    };
    let empty = outcome.assumed_zero.iter().filter(|(j, _)| *j == joint);
    let name = |(_, r): &(JointIndex, RecordingIndex)| layout.recordings[r.0].name.as_str();
    let names: Vec<&str> = empty.map(name).collect();
    (!names.is_empty()).then_some(names)
}

fn names(all: Vec<String>) -> Option<Fact> {
    (!all.is_empty()).then(|| Fact::names(all))
}

/// Residuals before and after, the next best, and what is as good.
pub(super) fn with_evidence(
    layout: &Layout<'_>,
    finding: Finding,
    outcome: &Outcome,
    named: &Named,
) -> Finding {
    let code = |correction| codes::of_correction(layout, correction);
    // Where a joint stands still its mistake is the same with and without that recording.
    let hypotheses = |c: &Correction| c.iter().map(|s| s.hypothesis).collect::<Vec<_>>();
    let mut known = vec![hypotheses(&named.correction)];
    let mut equivalent = Vec::new();
    for other in &named.equivalent {
        if !known.contains(&hypotheses(other)) {
            known.push(hypotheses(other));
            equivalent.push(code(other));
        }
    }
    let doubtful = named.within_expected == Some(false);
    // What has unknowns of its own must leave so much less, and is no better where it leaves a little less.
    let next = named
        .evidence
        .next
        .filter(|next| *next >= named.evidence.best);
    let limit = outcome.expected.filter(|_| doubtful).map(|e| e.limit);
    finding
        .with("none", Fact::meters(named.evidence.none))
        .with("best", Fact::meters(named.evidence.best))
        .with_some("next", next.map(Fact::meters))
        .with_some("allowed_none", named.allowing.map(|a| Fact::meters(a.none)))
        .with_some("allowed", named.allowing.map(|a| Fact::meters(a.best)))
        .with_some("limit", limit.map(Fact::meters))
        .with_some("equivalent", names(equivalent))
        .with_some(
            "alternatives",
            names(named.alternatives.iter().map(|a| code(&a.0)).collect()),
        )
        .with_some("slides_unit", as_good(named, true).map(Fact::name))
        .with_some("tracker_unit", as_good(named, false).map(Fact::name))
}

/// The unit of the prismatic joints, or of the tracker, that explains the recordings as well or nearly as well.
fn as_good(named: &Named, of_slides: bool) -> Option<&'static str> {
    let nearly = named.alternatives.iter().map(|(correction, _)| correction);
    let mut all = named.equivalent.iter().chain(nearly);
    all.find_map(|correction| match correction.as_slice() {
        [one] => match one.hypothesis {
            Hypothesis::TrackerUnit { unit, .. } if !of_slides => Some(codes::length(unit)),
            Hypothesis::Units {
                mistake: UnitMistake::Length { unit, .. },
            } if of_slides => Some(codes::length(unit)),
            _ => None,
        },
        _ => None,
    })
}

/// Several columns in another order.
fn several(
    layout: &Layout<'_>,
    order: ColumnOrder,
    map_of: impl Fn(JointIndex) -> Fact,
) -> Finding {
    let columns = order.columns(&layout.data.chain).into_iter().enumerate();
    let moved: Vec<(JointIndex, JointIndex)> = columns
        .map(|(joint, column)| (JointIndex(joint), column))
        .filter(|(joint, column)| joint != column)
        .collect();
    let of = |(joint, column): &(JointIndex, JointIndex)| {
        format!(
            "{}: <column of {}>",
            layout.joint(*joint),
            layout.joint(*column)
        )
    };
    let entries: Vec<String> = moved.iter().map(of).collect();
    let first = moved.first().map_or(JointIndex(0), |m| m.0);
    Finding::of_kind(
        catalog::JOINT_ORDER,
        "several",
        Subject::joint(layout.joint(first)),
    )
    .with("map", map_of(first))
    .with("count", Fact::count(moved.len()))
    .with("entries", Fact::name(entries.join(", ")))
}

/// The zero of a joint is off: whether the fit finds it decides what is to be done.
fn zero(layout: &Layout<'_>, scope: Scope, joint: JointIndex, offset: f64) -> Finding {
    let turns = layout.data.chain.turns(joint.0) != Some(false);
    let kind = match (scope, layout.frees_zero(joint)) {
        (Scope::All, _) if turns && offset.abs() > FAR => "turned",
        (Scope::All, true) => "zero",
        (Scope::All, false) => "zero_held",
        _ => "zero_of_some",
    };
    let some = (scope != Scope::All).then(|| layout.recordings_in(scope));
    let offset = match turns {
        true => Fact::radians(offset),
        false => Fact::meters(offset),
    };
    let subject = Subject::joint(layout.joint(joint));
    Finding::of_kind(catalog::JOINT_OFFSET, kind, subject)
        .with("joint", Fact::name(layout.joint(joint)))
        .with("offset", offset)
        .with_some("recordings", some.map(Fact::names))
}

/// A joint moves a multiple of what its column says: whether the fit finds it decides what is to be done.
fn gain(layout: &Layout<'_>, scope: Scope, joint: JointIndex, factor: f64) -> Finding {
    let fitted = FITTED_GAINS.contains(&factor);
    let kind = match (scope, layout.frees_gain(joint)) {
        (Scope::All, true) if fitted => "multiple",
        (Scope::All, false) if fitted => "multiple_held",
        (Scope::All, _) => "multiple_far",
        _ => "multiple_of_some",
    };
    let some = (scope != Scope::All).then(|| layout.recordings_in(scope));
    let name = layout.joint(joint);
    Finding::of_kind(catalog::JOINT_GAIN, kind, Subject::joint(name))
        .with("joint", Fact::name(name))
        .with("factor", Fact::ratio(factor))
        .with_some("recordings", some.map(Fact::names))
}

/// Id, subject and values of one hypothesis.
fn of_hypothesis(layout: &Layout<'_>, outcome: &Outcome, scoped: &Scoped) -> Finding {
    let of_joint = |id: Id, joint: JointIndex| {
        let name = layout.joint(joint);
        Finding::new(id, Subject::joint(name)).with("joint", Fact::name(name))
    };
    let other = |joint| Fact::name(layout.joint(joint));
    // Where a column map has the joint.
    let map_of = |joint: JointIndex| match layout.data.chain.turns(joint.0) {
        Some(false) => Fact::choice("prismatic"),
        _ => Fact::choice("joints"),
    };
    match scoped.hypothesis {
        Hypothesis::Sign { joint } => of_joint(catalog::JOINT_SIGN, joint)
            .with("map", map_of(joint))
            .with_some("axis", reversed_axis(layout, joint)),
        Hypothesis::Axis { joint, along } => {
            let law = &layout.data.chain.joints()[joint.0].law;
            let own = law.iter().any(|(source, _)| *source == joint);
            let follows = law.last().filter(|_| !own);
            of_joint(catalog::JOINT_AXIS, joint)
                .with("axis", Fact::name(codes::axis(&along.vector())))
                .with_some("follows", follows.map(|(source, _)| other(*source)))
        }
        Hypothesis::Exchange { first, second } => {
            let subject = Subject::joint(layout.joint(first));
            Finding::of_kind(catalog::JOINT_ORDER, "two", subject)
                .with("joint", Fact::name(layout.joint(first)))
                .with("map", map_of(first))
                .with("other", other(second))
        }
        Hypothesis::Order { order } => several(layout, order, map_of),
        Hypothesis::Offset { joint, turns } => Finding::of_kind(
            catalog::JOINT_OFFSET,
            "turned",
            Subject::joint(layout.joint(joint)),
        )
        .with("joint", Fact::name(layout.joint(joint)))
        .with("offset", Fact::radians(turns.angle())),
        Hypothesis::Zero { joint, offset } => zero(layout, scoped.scope, joint, offset),
        Hypothesis::Gain { joint, factor } => gain(layout, scoped.scope, joint, factor),
        Hypothesis::Coupling {
            joint,
            source,
            factor,
        } => {
            let subject = Subject::joint(layout.joint(joint));
            Finding::of_kind(catalog::JOINT_COUPLING, "whole", subject)
                .with("joint", Fact::name(layout.joint(joint)))
                .with("other", other(source))
                .with("factor", Fact::ratio(factor))
        }
        Hypothesis::MissingColumn { joint } => {
            let subject = Subject::joint(layout.joint(joint));
            let empty = outcome.assumed_zero.iter().any(|(j, _)| *j == joint);
            let kind = if empty { "moved" } else { "stuck" };
            Finding::of_kind(catalog::JOINT_COLUMN_MISSING, kind, subject)
                .with("joint", Fact::name(layout.joint(joint)))
                .with("unit", Fact::choice(layout.shown(joint, 0.0).1))
        }
        Hypothesis::StoodAt { joint, value } => {
            let subject = Subject::joint(layout.joint(joint));
            let (shown, unit) = layout.shown(joint, value);
            let id = match outcome.assumed_zero.iter().any(|(j, _)| *j == joint) {
                true => catalog::JOINT_COLUMN_MISSING,
                false => catalog::JOINT_OFFSET,
            };
            Finding::of_kind(id, "stood", subject)
                .with("joint", Fact::name(layout.joint(joint)))
                .with("at", Fact::name(format!("{shown:.0}")))
                .with("unit", Fact::choice(unit))
        }
        Hypothesis::Unit { joint, mistake } => {
            let subject = Subject::joint(layout.joint(joint));
            let finding = Finding::of_kind(catalog::UNIT_MISMATCH, of_one_joint(mistake), subject)
                .with("joint", Fact::name(layout.joint(joint)));
            let finding = with_units(finding, mistake);
            columns::with_remedy(layout, finding, Some(joint), mistake, scoped.scope)
        }
        Hypothesis::Units { mistake } => {
            let kind = of_all_joints(mistake);
            let finding = Finding::of_kind(catalog::UNIT_MISMATCH, kind, Subject::default());
            let finding = with_units(finding, mistake);
            columns::with_remedy(layout, finding, None, mistake, scoped.scope)
        }
        _ => of_tracker(layout, scoped),
    }
}

/// Hypotheses about bodies, tracker and clocks.
fn of_tracker(layout: &Layout<'_>, scoped: &Scoped) -> Finding {
    let body = |b| Subject::body(layout.body(b));
    let recordings = || Fact::names(layout.recordings_in(scoped.scope));
    match scoped.hypothesis {
        Hypothesis::RowShift { rows } => {
            // Row i needs the readings of row i − rows.
            let kind = if rows > 0 {
                "rows_before"
            } else {
                "rows_after"
            };
            Finding::of_kind(catalog::CLOCK_LAG, kind, About::Clocks)
                .with("rows", Fact::count(usize::from(rows.unsigned_abs())))
        }
        Hypothesis::WrongLink { body: b, link } => {
            Finding::of_kind(catalog::WRONG_MOUNT, "other_link", body(b))
                .with("body", Fact::name(layout.body(b)))
                .with(
                    "link",
                    Fact::name(layout.link(layout.data.bodies[b.0].link)),
                )
                .with("other", Fact::name(layout.link(link)))
        }
        Hypothesis::ExchangedBodies { first, second } => {
            Finding::of_kind(catalog::WRONG_MOUNT, "exchanged", body(first))
                .with("body", Fact::name(layout.body(first)))
                .with("other", Fact::name(layout.body(second)))
        }
        Hypothesis::TrackerUnit { unit, read_as } => tracker_unit(layout, unit, read_as),
        Hypothesis::Mirrored => Finding::of_kind(catalog::MIRRORED, "tracker", About::Tracker),
        Hypothesis::TrackerMoved => {
            Finding::of_kind(catalog::TRACKER_MOVED, "moved", About::Tracker)
                .with("recordings", recordings())
        }
        Hypothesis::TrackerAxes { .. } => {
            Finding::of_kind(catalog::TRACKER_MOVED, "axes", About::Tracker)
                .with("recordings", recordings())
        }
        Hypothesis::Remounted { body: b } => {
            Finding::of_kind(catalog::BODY_REMOUNTED, "recordings", body(b))
                .with("body", Fact::name(layout.body(b)))
                .with("recordings", recordings())
        }
        Hypothesis::Poses { body: b, mistake } => {
            let (id, kind) = match mistake {
                PoseMistake::ScalarFirstReadAsLast => (catalog::QUATERNION_ORDER, "scalar_first"),
                PoseMistake::ScalarLastReadAsFirst => (catalog::QUATERNION_ORDER, "scalar_last"),
                PoseMistake::Inverse => (catalog::POSE_CONVENTION, "inverse"),
                PoseMistake::Transposed => (catalog::POSE_CONVENTION, "transposed"),
            };
            let subject = b.map_or_else(|| About::Tracker.into(), body);
            let bodies = b.map_or_else(|| layout.posed(), |b| vec![layout.body(b)]);
            Finding::of_kind(id, kind, subject).with("bodies", Fact::names(bodies))
        }
        // The engine's list may grow; what has no words of its own is undecided.
        _ => Finding::of_kind(catalog::MODEL_DISAGREES, "undecided", About::Recording)
            .with("leading", Fact::names([codes::of(layout, scoped)])),
    }
}

/// The tracker's unit of length, or that of a robot which is larger than robots are.
fn tracker_unit(layout: &Layout<'_>, unit: Length, read_as: Length) -> Finding {
    let ratio = unit.meters() / read_as.meters();
    let reach = calib_urdf::doubt::reach(&layout.inputs.robot.model);
    if ratio > 1.0 && reach > calib_urdf::doubt::LARGEST {
        return Finding::of_kind(catalog::UNIT_MISMATCH, "robot_too_large", About::Lengths)
            .with("reach", Fact::meters(reach))
            .with("ratio", Fact::ratio(ratio));
    }
    let (kind, ratio) = match ratio > 1.0 {
        true => ("lengths_too_small", ratio),
        false => ("lengths_too_large", ratio.recip()),
    };
    Finding::of_kind(catalog::UNIT_MISMATCH, kind, About::Lengths)
        .with("ratio", Fact::ratio(ratio))
        .with("unit", Fact::name(codes::length(unit)))
        .with("read_as", Fact::name(codes::length(read_as)))
}

/// The axis of a joint in the URDF with the other sign, as a URDF writes it.
fn reversed_axis(layout: &Layout<'_>, joint: JointIndex) -> Option<Fact> {
    let model = &layout.inputs.robot.model;
    let id = model.joint_ids().nth(joint.0)?;
    let axis = model.joint(id).kind.axis()?;
    Some(Fact::name(codes::axis(&-axis.into_inner())))
}

/// Which units of length, where the kind of the finding does not say it.
fn with_units(finding: Finding, mistake: UnitMistake) -> Finding {
    let named = [
        UnitMistake::MILLIMETERS_READ_AS_METERS,
        UnitMistake::METERS_READ_AS_MILLIMETERS,
    ];
    match mistake {
        UnitMistake::Length { unit, read_as } if !named.contains(&mistake) => finding
            .with("unit", Fact::name(codes::length(unit)))
            .with("read_as", Fact::name(codes::length(read_as)))
            .with("factor", Fact::ratio(mistake.factor())),
        _ => finding,
    }
}

fn of_one_joint(mistake: UnitMistake) -> &'static str {
    match mistake {
        UnitMistake::DegreesReadAsRadians => "joint_degrees",
        UnitMistake::RadiansReadAsDegrees => "joint_radians",
        UnitMistake::MILLIMETERS_READ_AS_METERS => "joint_millimeters",
        UnitMistake::METERS_READ_AS_MILLIMETERS => "joint_meters",
        UnitMistake::Length { .. } => "joint_lengths",
    }
}

fn of_all_joints(mistake: UnitMistake) -> &'static str {
    match mistake {
        UnitMistake::DegreesReadAsRadians => "all_degrees",
        UnitMistake::RadiansReadAsDegrees => "all_radians",
        UnitMistake::MILLIMETERS_READ_AS_METERS => "all_millimeters",
        UnitMistake::METERS_READ_AS_MILLIMETERS => "all_meters",
        UnitMistake::Length { .. } => "all_lengths",
    }
}
