//! Every rule of the verdict from both sides, and the table of the book.

use std::collections::BTreeSet;
use std::path::Path;

use calib_report::{
    Agreement, Effect, FoundNoise, Limit, Limited, Orientation, Part, Reason, ReasonId,
    RejectedPart, Share, UntestedKind, Validation, Verdict, VerdictFacts, judge,
};

use crate::verdict_facts::{broken, clean, found, improvement, limit, prediction, with};

fn verdict_of(effect: Effect) -> Verdict {
    match effect {
        Effect::Supports => Verdict::Accepted,
        Effect::Warns => Verdict::AcceptedWithWarnings,
        Effect::LeavesOpen => Verdict::NotEvaluated,
        Effect::Rejects => Verdict::Rejected,
    }
}

#[test]
fn the_stated_noise_of_rows_is_not_held_against_their_means() {
    let below = |of_rows| {
        let facts = with(|f| {
            let found = FoundNoise {
                of_rows,
                ..found(0.25, None)
            };
            f.goodness.as_mut().expect("there").below_stated = Some(found);
        });
        let reasons = judge(&facts).reasons;
        reasons.iter().any(|r| r.id == ReasonId::NoiseBelowStated)
    };
    assert!(!below(0.9) && below(0.4));
}

#[test]
fn every_rule_speaks_where_it_is_broken_and_decides() {
    let mut seen = BTreeSet::new();
    for (id, effect, facts) in broken() {
        let judgment = judge(&facts);
        let of_id: Vec<&Reason> = judgment.reasons.iter().filter(|r| r.id == id).collect();
        assert_eq!(of_id.len(), 1, "{id:?}: {:?}", judgment.reasons);
        assert_eq!(of_id[0].effect, effect, "{id:?}");
        let gravest = judgment.reasons.iter().map(|r| r.effect).max();
        assert_eq!(
            Some(judgment.reasons[0].effect),
            gravest,
            "the gravest is first"
        );
        // A change that nothing confirms comes with the reason for that.
        assert!(
            judgment.verdict == verdict_of(effect),
            "{id:?}: {:?}",
            judgment.verdict
        );
        seen.insert((id, effect));
    }
    for id in ReasonId::ALL {
        for effect in id.effects() {
            assert!(
                seen.contains(&(*id, *effect)),
                "no facts for {id:?} {effect:?}"
            );
        }
    }
    for (id, effect) in seen {
        assert!(id.effects().contains(&effect), "{id:?} has no {effect:?}");
    }
}

/// Once in a hundred cases is not rare enough to reject; what is stated is too small, and that leaves the result open.
#[test]
fn errors_beyond_the_stated_ones_that_chance_makes_larger_are_not_decided() {
    let facts = with(|f| {
        f.improvements = vec![improvement(0.0005, 0.001, 0.99, 0.01)];
        f.agreement = Some(Agreement::of(480.0, 120, 60.0));
    });
    let judgment = judge(&facts);
    assert_eq!(judgment.verdict, Verdict::NotEvaluated);
    let ids: Vec<ReasonId> = judgment.reasons.iter().map(|r| r.id).collect();
    assert!(ids.contains(&ReasonId::HeldOutBeyondStated), "{ids:?}");
    assert!(
        ids.contains(&ReasonId::NotBetterThanRegistration),
        "{ids:?}"
    );
}

#[test]
fn every_rule_is_silent_on_the_other_side() {
    let judgment = judge(&clean());
    assert_eq!(judgment.verdict, Verdict::Accepted);
    let ids: Vec<ReasonId> = judgment.reasons.iter().map(|r| r.id).collect();
    assert_eq!(ids, [ReasonId::LimitMet, ReasonId::PredictionExpected]);
    // Just below each threshold.
    let near = with(|f| {
        f.limits = limit(0.0009, Some((0.0008, 0.001)));
        f.rejected = Share { part: 49, of: 1000 };
        f.improvements = vec![improvement(0.001, 0.0009, 0.049, 0.96)];
        f.validation = Validation::Recordings {
            postures: 20,
            repeated: 1,
        };
        f.orientation = Orientation {
            rms: Some(0.05),
            expected: None,
        };
        let goodness = f.goodness.as_mut().expect("there");
        goodness.used = 1.45;
        goodness.above_stated = Some(found(2.0, None));
        goodness.below_stated = Some(found(0.5, None));
        goodness.above_scatter = Some(("marker".into(), 5.0));
    });
    assert_eq!(
        judge(&near).verdict,
        Verdict::Accepted,
        "{:?}",
        judge(&near).reasons
    );
    // A limit of the profile speaks of the orientation: then it decides.
    let limited = with(|f| {
        f.orientation.rms = Some(0.3);
        f.limits
            .push(Limit::evaluated(Limited::orientation_rms(false), 0.5, 0.3));
    });
    assert_eq!(judge(&limited).verdict, Verdict::Accepted);
    // Nothing of the robot was free: there is nothing to be better at.
    let held = with(|f| {
        f.freed = false;
        f.improvements = vec![improvement(0.001, 0.001, 1.0, 1.0)];
    });
    assert_eq!(judge(&held).verdict, Verdict::Accepted);
}

#[test]
fn facts_that_know_nothing_are_never_accepted() {
    assert_eq!(
        judge(&VerdictFacts::default()).verdict,
        Verdict::NotEvaluated
    );
}

#[test]
fn every_reason_is_a_sentence_with_its_values() {
    let mut sentences = Vec::new();
    for (id, _, facts) in broken() {
        let judgment = judge(&facts);
        let reason = judgment.reasons.iter().find(|r| r.id == id).expect("there");
        let sentence = reason.sentence();
        assert!(
            sentence.ends_with('.') && !sentence.contains('—'),
            "{sentence}"
        );
        assert!(
            !sentence.contains("  ") && !sentence.contains("another version"),
            "{sentence}"
        );
        sentences.push(format!("{} ({:?}): {sentence}", id.as_str(), reason.effect));
    }
    insta::assert_snapshot!("reasons", sentences.join("\n"));
}

#[test]
fn a_reason_reads_back_and_one_of_another_version_too() {
    for (_, _, facts) in broken() {
        for reason in judge(&facts).reasons {
            let json = serde_json::to_string(&reason).expect("finite");
            let read: Reason = serde_json::from_str(&json).expect("a reason");
            assert_eq!(read, reason);
        }
    }
    let later = r#"{"id": "not-yet-known", "effect": "warns", "values": {}}"#;
    let read: Reason = serde_json::from_str(later).expect("a reason");
    assert_eq!(read.id, ReasonId::Unknown);
}

/// The book's table has a row for every id, with its effects in words, in the order of the code.
#[test]
fn the_book_lists_every_rule() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/verdict.md");
    let page = std::fs::read_to_string(page).expect("the page on the verdict");
    let rows: Vec<(String, String)> = page
        .lines()
        .filter_map(|line| {
            let mut cells = line.strip_prefix("| `")?.split(" | ");
            let id = cells.next()?.trim_end_matches('`').to_owned();
            Some((id, cells.next()?.trim().to_owned()))
        })
        .filter(|(id, _)| !id.contains(' ') && id.contains('-'))
        .collect();
    let word = |effect: &Effect| match effect {
        Effect::Supports => "noted",
        Effect::Warns => "warning",
        Effect::LeavesOpen => "not decided",
        Effect::Rejects => "rejected",
    };
    let expected: Vec<(String, String)> = ReasonId::ALL
        .iter()
        .map(|id| {
            let effects: Vec<&str> = id.effects().iter().map(word).collect();
            (id.as_str().to_owned(), effects.join(", "))
        })
        .collect();
    assert_eq!(rows, expected);
}

#[test]
fn the_first_line_counts_every_warning_that_is_shown() {
    let facts = with(|f| {
        f.warnings = ["missing-physics", "row-outlier", "missing-physics"]
            .map(String::from)
            .to_vec();
    });
    let report = calib_report::Report::default().judged(judge(&facts));
    assert_eq!(report.verdict, Verdict::AcceptedWithWarnings);
    assert_eq!(report.warnings(), 3);
}

/// The smallest limit here is 1.5 mm or more: what 1e5 poses leave open of an effect is far below it, whatever they state.
#[test]
fn an_open_error_far_below_the_limit_is_no_reason() {
    let of = |open: f64| {
        let facts = with(|f| {
            let mut prediction = prediction(1.5e-6, 1.5 * open.hypot(3e-4), UntestedKind::Gain);
            let stated = prediction.as_mut().expect("stated");
            (stated.stated, stated.joints) = (4e-6, 3e-4);
            f.prediction = prediction;
        });
        let limits = facts
            .limits
            .iter()
            .filter(|l| l.name.starts_with("held_out"));
        let limit = limits.map(|l| l.limit).fold(f64::INFINITY, f64::min);
        let reasons = judge(&facts).reasons;
        let small = |r: &Reason| r.id == ReasonId::UncertaintyTooSmall;
        (limit, reasons.iter().any(small))
    };
    let (limit, _) = of(0.0);
    assert!((1e-4..1.0).contains(&limit), "{limit}");
    assert!(!of(0.015 * limit).1);
    assert!(of(0.03 * limit).1);
}

/// A body whose pose was wrong is one part of the data, however many markers it has.
#[test]
fn markers_of_a_recording_that_were_rejected_together_are_one_reason() {
    let of = |subjects: &[&str]| {
        let part = |subject: &&str| RejectedPart {
            part: Part::Subject {
                recording: "poses".into(),
                subject: (*subject).into(),
            },
            rejected: Share { part: 27, of: 40 },
        };
        let facts = with(|f| f.rejected_parts = subjects.iter().map(part).collect());
        let reasons = judge(&facts).reasons;
        let reasons = reasons.iter().filter(|r| r.id == ReasonId::RejectedPart);
        reasons.map(Reason::sentence).collect::<Vec<_>>()
    };
    assert_eq!(
        of(&["hand_1", "hand_2", "hand_3"]),
        [
            "81 of 120 (68 %) of the measurements of `hand_1`, `hand_2`, `hand_3` in recording `poses` were excluded before the fit or rejected by it: the model does not fit this part of the data."
        ]
    );
    assert_eq!(of(&["hand_1"]).len(), 1);
}

/// Markers that scatter about their own bodies as much as about the robot show the tracker's noise, whatever was stated.
#[test]
fn a_limit_below_the_noise_that_the_bodies_show_is_called_that() {
    let of = |rigid: Option<f64>| {
        let limit = Limit::compared(
            Limited::position_rms(false),
            0.0015,
            0.00266,
            Some((0.0024, 0.0029)),
        );
        let facts = with(|f| {
            f.limits = vec![limit.clone()];
            let goodness = f.goodness.as_mut().expect("a goodness of fit");
            goodness.above_stated = Some(found(5.0, rigid));
        });
        let marker = calib_report::Noise {
            kind: calib_report::NoiseKind::Position,
            sigma: Some(0.0015),
            stated: Some(0.0003),
            ..calib_report::Noise::default()
        };
        let held_out = calib_report::HeldOut {
            postures: 20,
            expected: Some(calib_report::ExpectedError {
                rms_m: 0.00266,
                tracker_m: Some(0.00265),
                ..calib_report::ExpectedError::default()
            }),
            ..calib_report::HeldOut::default()
        };
        let report = calib_report::Report {
            limits: vec![limit],
            noise: vec![marker],
            verification: calib_report::Verification {
                held_out: Some(held_out),
                ..calib_report::Verification::default()
            },
            ..calib_report::Report::default()
        };
        report.judged(judge(&facts))
    };
    let noisy = of(Some(5.0));
    let look = calib_report::terminal::Look::default();
    let places = calib_report::terminal::Places::default();
    let screen = calib_report::terminal::summary(&noisy, look, places);
    let screen = screen.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        screen.contains("The tracker is 5.0 times as noisy as the profile states"),
        "{screen}"
    );
    assert!(
        screen.contains("set `solve.limits.held_out_rms_mm` to 4 or more"),
        "{screen}"
    );
    // Residuals alone are also what the model lacks.
    assert_eq!(
        of(None).diagnosis,
        Some(calib_report::Diagnosis::Unexplained)
    );
}
