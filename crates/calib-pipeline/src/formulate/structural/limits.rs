//! What was assumed, what could not be checked, and what these recordings cannot show.

use std::collections::{BTreeMap, BTreeSet};

use calib_checks::structural::{
    Continuous, Decision, Hypothesis, JointIndex, Measured, Outcome, Scope, Scoped,
};
use calib_finding::{About, Fact, Finding, Subject, Unit, catalog};

use super::codes;
use super::layout::Layout;
use crate::formulate::late::{with_late_joint, with_late_joints};
use crate::prepare::effects::free_with_gain;

/// Findings beside the decision; `consistent`: nothing but what the fit estimates is named.
#[must_use]
pub fn findings(layout: &Layout<'_>, outcome: &Outcome, consistent: bool) -> Vec<Finding> {
    let mut findings = assumed_zero(layout, outcome);
    findings.extend(not_checked(layout, outcome));
    // A mistake that is named comes first: what is left may be its trace.
    if consistent {
        let continuous = outcome.continuous.as_ref();
        findings.extend(continuous.and_then(|c| continuous_finding(layout, c)));
        findings.extend(invisible(layout, outcome));
    }
    findings
}

/// Joints above a body that were taken to stand at 0, one finding for each.
fn assumed_zero(layout: &Layout<'_>, outcome: &Outcome) -> Vec<Finding> {
    let named = |joint: JointIndex| match &outcome.decision {
        Decision::Named(named) => named.correction.iter().any(|s| match s.hypothesis {
            Hypothesis::MissingColumn { joint: j } | Hypothesis::StoodAt { joint: j, .. } => {
                j == joint
            }
            _ => false,
        }),
        _ => false,
    };
    let mut joints: BTreeMap<JointIndex, Vec<String>> = BTreeMap::new();
    for (joint, recording) in &outcome.assumed_zero {
        let name = layout.recordings[recording.0].name.clone();
        joints.entry(*joint).or_default().push(name);
    }
    joints.retain(|joint, _| !named(*joint));
    let finding = |(joint, recordings): (JointIndex, Vec<String>)| {
        let name = layout.joint(joint);
        let subject = Subject {
            recordings,
            ..Subject::joint(name)
        };
        let bodies = layout.bodies.iter().zip(&layout.data.bodies);
        let moved = bodies.filter(|(_, body)| layout.data.chain.path(body.link).contains(&joint));
        Finding::of_kind(catalog::JOINT_COLUMN_MISSING, "assumed_zero", subject)
            .with("joint", Fact::name(name))
            .with("bodies", Fact::names(moved.map(|(name, _)| *name)))
            .with("unit", Fact::choice(layout.shown(joint, 0.0).1))
    };
    joints.into_iter().map(finding).collect()
}

/// Bodies whose rows leave nothing to compare.
fn not_checked(layout: &Layout<'_>, outcome: &Outcome) -> Vec<Finding> {
    let too_few = matches!(outcome.decision, Decision::TooFewData { .. });
    let mut findings = Vec::new();
    for (b, name) in layout.bodies.iter().enumerate() {
        let body = &layout.data.bodies[b];
        let moves = layout.data.chain.path(body.link);
        let moves = moves.iter().any(|j| outcome.design.moving.contains(j));
        let (rows, samples, markers) = seen(&body.measured);
        // A marker takes one sample to find its place; what is left must say something of the motion.
        if moves && (too_few || samples <= markers + 1) {
            findings.push(
                Finding::new(catalog::NOT_CHECKED, Subject::body(*name))
                    .with("rows", Fact::count(rows))
                    .with("samples", Fact::count(samples)),
            );
        }
    }
    findings
}

/// Rows with a sample, samples, and markers of a body.
fn seen(measured: &Measured) -> (usize, usize, usize) {
    match measured {
        Measured::Markers(rows) => {
            let markers = rows.first().map_or(0, Vec::len);
            let seen = rows.iter().filter(|row| row.iter().any(Option::is_some));
            let samples = rows.iter().flatten().flatten().count();
            (seen.count(), samples, markers)
        }
        Measured::Poses {
            tracker_from_body, ..
        } => {
            let seen = tracker_from_body.iter().flatten().count();
            (seen, seen, 1)
        }
    }
}

/// A gain, a fraction of a coupling or readings that are late, where nothing in the profile accounts for it.
fn continuous_finding(layout: &Layout<'_>, found: &Continuous) -> Option<Finding> {
    let all = || std::iter::once(&found.hypothesis).chain(&found.alternatives);
    if all().any(|h| is_declared(layout, h)) {
        return None;
    }
    let alternatives: Vec<String> = found
        .alternatives
        .iter()
        .map(|h| {
            let scoped = Scoped {
                hypothesis: *h,
                scope: Scope::All,
            };
            codes::of(layout, &scoped)
        })
        .collect();
    let alternatives = (!alternatives.is_empty()).then(|| Fact::names(alternatives));
    let finding = match found.hypothesis {
        Hypothesis::Gain { joint, factor } => {
            let name = layout.joint(joint);
            Finding::of_kind(catalog::JOINT_GAIN, "excess", Subject::joint(name))
                .with("joint", Fact::name(name))
                .with("excess", Fact::ratio(factor - 1.0))
                .with_some("free", free_with_gain(layout.inputs, name))
        }
        Hypothesis::Coupling {
            joint,
            source,
            factor,
        } => {
            let name = layout.joint(joint);
            let unit = layout.unit_of_share(joint, source);
            let form = if unit == Unit::One {
                "fraction"
            } else {
                "unlike"
            };
            Finding::of_kind(catalog::JOINT_COUPLING, form, Subject::joint(name))
                .with("joint", Fact::name(name))
                .with("other", Fact::name(layout.joint(source)))
                .with("factor", Fact::number(factor, unit))
        }
        Hypothesis::Lag { recording, seconds } => {
            let name = layout.recordings[recording.0].name.clone();
            let kind = if seconds > 0.0 { "behind" } else { "ahead" };
            let subject = Subject {
                recordings: vec![name.clone()],
                ..About::Clocks.into()
            };
            return Some(
                Finding::of_kind(catalog::CLOCK_LAG, kind, subject)
                    .with("recording", Fact::name(name))
                    .with("offset", Fact::number(seconds.abs(), Unit::Second))
                    .with("sigma", Fact::number(found.sigma, Unit::Second))
                    .with("effect", Fact::meters(found.effect))
                    .with_some("alternatives", alternatives),
            );
        }
        Hypothesis::Latency { joint, seconds } => {
            let name = layout.joint(joint);
            let kind = if seconds > 0.0 {
                "joint_behind"
            } else {
                "joint_ahead"
            };
            let finding = Finding::of_kind(catalog::CLOCK_LAG, kind, Subject::joint(name))
                .with("offset", Fact::seconds(seconds.abs()))
                .with("recordings", Fact::names(timed(layout)));
            with_late_joint(finding, layout.inputs, name, seconds)
        }
        Hypothesis::LatencyBeyond { joint, seconds } => {
            let name = layout.joint(joint);
            let kind = if seconds > 0.0 {
                "joints_behind"
            } else {
                "joints_ahead"
            };
            let joints = layout.data.moving_with(joint);
            let joints: Vec<&str> = joints.into_iter().map(|j| layout.joint(j)).collect();
            let finding = Finding::of_kind(catalog::CLOCK_LAG, kind, Subject::joint(name))
                .with("joint", Fact::name(name))
                .with("offset", Fact::seconds(seconds.abs()))
                .with("recordings", Fact::names(timed(layout)));
            with_late_joints(finding, layout.inputs, &joints, seconds)
        }
        _ => return None,
    };
    let unit = match found.hypothesis {
        Hypothesis::Coupling { joint, source, .. } => layout.unit_of_share(joint, source),
        Hypothesis::Latency { .. } | Hypothesis::LatencyBeyond { .. } => Unit::Second,
        _ => Unit::One,
    };
    Some(
        finding
            .with("sigma", Fact::number(found.sigma, unit))
            .with("effect", Fact::meters(found.effect))
            .with_some("alternatives", alternatives),
    )
}

/// The recordings whose rows have speeds.
fn timed<'a>(layout: &'a Layout<'_>) -> BTreeSet<&'a str> {
    let rows = layout.data.recording.iter().zip(&layout.data.rates);
    rows.filter(|(_, rates)| rates.is_some())
        .map(|(recording, _)| layout.recordings[recording.0].name.as_str())
        .collect()
}

/// The profile frees an effect of the joint, declares the coupling, or lets the clock be estimated: the fit accounts for it.
fn is_declared(layout: &Layout<'_>, hypothesis: &Hypothesis) -> bool {
    if let Hypothesis::Lag { recording, .. } = *hypothesis {
        return layout.estimates_clock(recording);
    }
    let (Hypothesis::Gain { joint, .. } | Hypothesis::Coupling { joint, .. }) = *hypothesis else {
        return false;
    };
    let model = &layout.inputs.robot.model;
    let Some(id) = model.joint_ids().nth(joint.0) else {
        return false;
    };
    let solve = &layout.inputs.robot.profile.solve;
    let own = solve.free_set(id, true, !model.joint(id).kind.turns());
    let of_readings = own.effects.iter().any(|free| !free.effect.geometric);
    of_readings || !own.coupled_to.is_empty()
}

/// Mistakes about readings that would change nothing on this design.
fn invisible(layout: &Layout<'_>, outcome: &Outcome) -> Option<Finding> {
    let about_readings = |h: &Hypothesis| {
        matches!(
            h,
            Hypothesis::Sign { .. }
                | Hypothesis::Exchange { .. }
                | Hypothesis::Order { .. }
                | Hypothesis::Unit { .. }
                | Hypothesis::Coupling { .. }
        )
    };
    let mistakes = outcome.invisible.iter();
    let mistakes = mistakes.filter(|s| s.scope == Scope::All && about_readings(&s.hypothesis));
    let mistakes: Vec<String> = mistakes.map(|s| codes::of(layout, s)).collect();
    (!mistakes.is_empty()).then(|| {
        Finding::new(catalog::INVISIBLE_MISTAKES, Subject::default())
            .with("mistakes", Fact::names(mistakes))
    })
}
