//! Which diagnosis comes first.

use super::*;
use crate::Reason;
use calib_finding::{Finding, Subject};

/// The diagnosis of a rejected report with these findings.
fn of(findings: Vec<Finding>) -> Option<Diagnosis> {
    Diagnosis::of(&Report {
        verdict: Verdict::Rejected,
        findings,
        ..Report::default()
    })
}

fn slip() -> Finding {
    let subject = Subject::joint("elbow").in_recording("poses");
    Finding::of_kind(catalog::CHANGED_WHILE_RECORDING, "joint", subject)
}

fn named(evidence: Id) -> Option<Diagnosis> {
    let evidence = evidence.as_str().to_owned();
    Some(Diagnosis::NamedCause { evidence })
}

fn fault(evidence: Id) -> Option<Diagnosis> {
    let evidence = evidence.as_str().to_owned();
    Some(Diagnosis::StructuralFault { evidence })
}

/// What a clock was off by is taken into account; without limits nothing that is followed decides anything.
#[test]
fn a_clock_that_was_corrected_explains_no_verdict() {
    let clock = |kind| Finding::of_kind(catalog::CLOCK_LAG, kind, Subject::recording("poses"));
    assert_eq!(of(vec![clock("offset")]), Some(Diagnosis::Unexplained));
    assert_eq!(of(vec![clock("joint_behind")]), named(catalog::CLOCK_LAG));
    let without = |findings: Vec<Finding>, more: Vec<Reason>| {
        let limits = Reason::new(ReasonId::NoLimits, Effect::LeavesOpen);
        Diagnosis::of(&Report {
            verdict: Verdict::NotEvaluated,
            reason_facts: std::iter::once(limits).chain(more).collect(),
            findings,
            ..Report::default()
        })
    };
    for kind in ["offset", "joint_behind"] {
        assert_eq!(
            without(vec![clock(kind)], vec![]),
            Some(Diagnosis::NoLimits)
        );
    }
    let lost = Reason::new(ReasonId::NotConverged, Effect::Rejects);
    assert_eq!(
        without(vec![clock("joint_behind")], vec![lost]),
        named(catalog::CLOCK_LAG)
    );
}

#[test]
fn errors_beyond_what_is_stated_come_before_poses_that_would_decide_a_limit() {
    let of = |reasons: Vec<Reason>| {
        Diagnosis::of(&Report {
            verdict: Verdict::NotEvaluated,
            reason_facts: reasons,
            ..Report::default()
        })
    };
    let undecided = || Reason::new(ReasonId::LimitUndecided, Effect::LeavesOpen);
    let beyond = |effect| Reason::new(ReasonId::HeldOutBeyondStated, effect);
    let poses = Diagnosis::TooFewPoses {
        postures: None,
        fitted: false,
        tracker_m: None,
    };
    assert_eq!(of(vec![undecided()]), Some(poses.clone()));
    assert_eq!(
        of(vec![undecided(), beyond(Effect::LeavesOpen)]),
        Some(Diagnosis::BeyondStated {
            evidence: ReasonId::HeldOutBeyondStated.as_str().to_owned()
        })
    );
    assert_eq!(of(vec![undecided(), beyond(Effect::Warns)]), Some(poses));
}

#[test]
fn a_slip_comes_before_what_it_leaves_in_the_validation() {
    let moved = |joints: &[&str]| {
        Finding::of_kind(catalog::TRACKER_MOVED, "held_out", About::Tracker)
            .with("joints", Fact::names(joints.iter().copied()))
    };
    let zero = |joint: &str| Finding::new(catalog::JOINT_ZERO_CHANGED, Subject::joint(joint));
    let slipped = named(catalog::CHANGED_WHILE_RECORDING);
    assert_eq!(of(vec![moved(&["waist", "elbow"]), slip()]), slipped);
    assert_eq!(of(vec![zero("elbow"), slip()]), slipped);
    // What the slip does not explain is another fault.
    let tracker = fault(catalog::TRACKER_MOVED);
    assert_eq!(of(vec![moved(&["waist"]), slip()]), tracker);
    assert_eq!(of(vec![moved(&["elbow"])]), tracker);
    let other = fault(catalog::JOINT_ZERO_CHANGED);
    assert_eq!(of(vec![zero("waist"), slip()]), other);
    // Of the fitted recordings themselves it is no consequence.
    let fitted = Finding::of_kind(catalog::TRACKER_MOVED, "moved", About::Tracker)
        .with("joints", Fact::names(["elbow"]));
    assert_eq!(of(vec![fitted, slip()]), tracker);
}
