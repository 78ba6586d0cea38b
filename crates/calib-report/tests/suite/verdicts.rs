//! Every rule of the verdict from both sides, and the table of the book.

use std::collections::BTreeSet;
use std::path::Path;

use calib_report::{
    Agreement, Compared, Effect, FitEnd, FoundNoise, Goodness, ImplausibleChange, Improvement,
    Limit, Limited, Orientation, Part, Predicted, Prediction, Reason, ReasonId, RejectedPart,
    Share, SingleJoint, Solver, Unit, UnseenBody, Untested, UntestedKind, UrdfAlone, Validation,
    Verdict, VerdictFacts, judge,
};

/// A result against which nothing speaks.
fn clean() -> VerdictFacts {
    VerdictFacts {
        limits: vec![Limit::compared(
            Limited::position_rms(false),
            0.001,
            0.0005,
            Some((0.0004, 0.0007)),
        )],
        solver: Some(Solver {
            ended: FitEnd::Converged,
            iterations: 9,
        }),
        rejected: Share { part: 3, of: 2930 },
        screened: Share { part: 0, of: 80 },
        freed: true,
        improvements: vec![improvement(0.004, 0.0005, 0.001, 0.999)],
        validation: Validation::Recordings {
            postures: 20,
            repeated: 0,
        },
        orientation: Orientation {
            rms: Some(0.004),
            expected: Some(0.004),
        },
        // All just within what is accepted.
        prediction: prediction(0.00099, 0.00099, UntestedKind::Drift),
        agreement: Some(Agreement::of(180.0, 120, 60.0)),
        goodness: Some(Goodness {
            used: 1.0,
            band: Goodness::band_of(800.0),
            above_stated: Some(found(1.1, None)),
            below_stated: Some(found(0.9, None)),
            above_scatter: None,
        }),
        ..VerdictFacts::default()
    }
}

fn found(factor: f64, rigid: Option<f64>) -> FoundNoise {
    FoundNoise {
        group: "marker".into(),
        factor,
        of_rows: factor,
        rigid,
        few: None,
    }
}

fn improvement(registration: f64, calibrated: f64, p_better: f64, p_worse: f64) -> Improvement {
    Improvement {
        quantity: Compared::Position,
        registration,
        calibrated,
        postures: 20,
        p_better,
        p_worse,
    }
}

fn limit(value: f64, interval: Option<(f64, f64)>) -> Vec<Limit> {
    vec![Limit::compared(
        Limited::position_rms(false),
        0.001,
        value,
        interval,
    )]
}

/// Clean facts with one thing changed.
fn with(change: impl FnOnce(&mut VerdictFacts)) -> VerdictFacts {
    let mut facts = clean();
    change(&mut facts);
    facts
}

/// Fitted to and checked with motions of single joints, with a warning.
fn single_joint_and(warning: &str) -> VerdictFacts {
    with(|f| {
        f.single_joint = SingleJoint {
            fitted: true,
            held_out: true,
        };
        f.warnings = vec![warning.into()];
    })
}

fn change(sigmas: Option<f64>) -> ImplausibleChange {
    ImplausibleChange {
        name: "elbow.origin.x".into(),
        change: 0.03,
        unit: Unit::Meter,
        sigmas,
    }
}

fn part(part: Part) -> Vec<RejectedPart> {
    let rejected = Share { part: 40, of: 41 };
    vec![RejectedPart { part, rejected }]
}

/// Upper limits of what is expected: by the parameters alone, with an effect; 0.27 mm are stated.
fn prediction(alone: f64, with: f64, effect: UntestedKind) -> Option<Prediction> {
    let predicted = |upper| Predicted {
        rms: upper / 1.5,
        upper,
    };
    let untested = Untested {
        effect,
        of: "elbow".into(),
        other: (effect == UntestedKind::Coupling).then(|| "wrist".into()),
    };
    Some(Prediction {
        stated: 0.00027,
        joints: 0.0,
        alone: predicted(alone),
        with: Some((untested, predicted(with))),
    })
}

/// Facts that break a rule, and what must come of it. Where a rule has two effects both stand here.
fn broken() -> Vec<(ReasonId, Effect, VerdictFacts)> {
    use Effect::{LeavesOpen, Rejects, Supports, Warns};
    let unconfirmed = |facts: &mut VerdictFacts| facts.single_joint.held_out = true;
    let repeats = |repeated| {
        with(|f| {
            f.validation = Validation::Recordings {
                postures: 20,
                repeated,
            }
        })
    };
    let share = |part| Share { part, of: 100 };
    let alone = |rms, limit| {
        let with_effects = 0.0005;
        with(|f| {
            f.urdf_alone = Some(UrdfAlone {
                rms,
                refitted: None,
                with_effects,
                limit,
            });
        })
    };
    let open = UntestedKind::ALL.map(|kind| {
        (
            ReasonId::EffectsNotExcluded,
            LeavesOpen,
            with(|f| {
                f.prediction = prediction(0.0008, 0.0011, kind);
                unconfirmed(f);
            }),
        )
    });
    let mut out = vec![
        (ReasonId::LimitMet, Supports, clean()),
        (
            ReasonId::NotConverged,
            Rejects,
            with(|f| {
                f.solver = Some(Solver {
                    ended: FitEnd::Stalled,
                    iterations: 3,
                });
            }),
        ),
        (
            ReasonId::OriginNotDetermined,
            Rejects,
            with(|f| f.undetermined_origins = vec!["base".into()]),
        ),
        (
            ReasonId::LimitExceeded,
            Rejects,
            with(|f| f.limits = limit(0.0012, Some((0.0011, 0.0014)))),
        ),
        // The interval reaches below the limit, the estimate does not.
        (
            ReasonId::LimitUndecided,
            LeavesOpen,
            with(|f| f.limits = limit(0.0012, Some((0.0009, 0.0014)))),
        ),
        // Above it with a pose less, perhaps not with all of them.
        (
            ReasonId::LimitUndecided,
            LeavesOpen,
            with(|f| {
                let above = limit(0.0016, Some((0.0012, 0.0019)));
                f.limits = above.into_iter().map(|l| l.left_out(Some(1.3))).collect();
            }),
        ),
        (
            ReasonId::LimitExceeded,
            Rejects,
            with(|f| {
                let above = limit(0.0016, Some((0.0012, 0.0019)));
                f.limits = above.into_iter().map(|l| l.left_out(Some(1.1))).collect();
            }),
        ),
        (
            ReasonId::LimitUndecided,
            LeavesOpen,
            with(|f| f.limits = limit(0.0009, Some((0.0007, 0.0012)))),
        ),
        // An interval that more poses do not shrink.
        (
            ReasonId::LimitUndecided,
            LeavesOpen,
            with(|f| {
                let closed = Limited::loop_mean("hand");
                f.limits.push(Limit::compared(
                    closed,
                    0.001,
                    0.0009,
                    Some((0.0007, 0.0012)),
                ));
            }),
        ),
        (
            ReasonId::LimitNotEvaluated,
            LeavesOpen,
            with(|f| {
                f.limits.push(Limited::orientation_rms(false).unknown(0.01));
            }),
        ),
        (ReasonId::NoLimits, LeavesOpen, with(|f| f.limits.clear())),
        (
            ReasonId::PredictionUndecided,
            LeavesOpen,
            with(|f| {
                f.prediction = prediction(0.0011, 0.0012, UntestedKind::Gain);
                unconfirmed(f);
            }),
        ),
        // All else confirms it, but with one posture too few.
        (
            ReasonId::PredictionUndecided,
            LeavesOpen,
            with(|f| {
                f.prediction = prediction(0.0011, 0.0012, UntestedKind::Gain);
                f.validation = Validation::Recordings {
                    postures: 20,
                    repeated: 1,
                };
            }),
        ),
        (
            ReasonId::PredictionUndecided,
            Warns,
            with(|f| f.prediction = prediction(0.0011, 0.0012, UntestedKind::Gain)),
        ),
        (
            ReasonId::EffectsNotExcluded,
            Warns,
            with(|f| f.prediction = prediction(0.0008, 0.0011, UntestedKind::Gain)),
        ),
        (
            ReasonId::HeldOutBeyondStated,
            LeavesOpen,
            with(|f| {
                f.agreement = Some(Agreement::of(360.0, 120, 60.0));
                unconfirmed(f);
            }),
        ),
        (
            ReasonId::HeldOutBeyondStated,
            Warns,
            with(|f| f.agreement = Some(Agreement::of(360.0, 120, 60.0))),
        ),
        (
            ReasonId::UncertaintyTooSmall,
            LeavesOpen,
            with(|f| {
                f.prediction = prediction(0.0004, 0.0009, UntestedKind::Gain);
                f.prediction.as_mut().expect("stated").stated = 0.0002;
                unconfirmed(f);
            }),
        ),
        (
            ReasonId::UncertaintyTooSmall,
            Warns,
            with(|f| {
                f.prediction = prediction(0.0004, 0.0009, UntestedKind::Gain);
                f.prediction.as_mut().expect("stated").stated = 0.0002;
            }),
        ),
        (ReasonId::PredictionExpected, Supports, clean()),
        (
            ReasonId::PredictionExpected,
            Supports,
            with(|f| f.prediction = prediction(0.0009, 0.0008, UntestedKind::Gain)),
        ),
        (
            ReasonId::WorseThanRegistration,
            Rejects,
            with(|f| {
                f.improvements = vec![improvement(0.0005, 0.001, 0.99, 0.001)];
                f.agreement = Some(Agreement::of(480.0, 120, 60.0));
            }),
        ),
        // A closed form states no uncertainty.
        (
            ReasonId::WorseThanRegistration,
            Rejects,
            with(|f| {
                f.improvements = vec![improvement(0.0005, 0.001, 0.99, 0.001)];
                f.agreement = None;
            }),
        ),
        // Larger errors that the stated uncertainty explains are no reason to reject.
        (
            ReasonId::NotBetterThanRegistration,
            Warns,
            with(|f| {
                f.improvements = vec![improvement(0.00025, 0.00029, 1.0, 0.004)];
            }),
        ),
        (
            ReasonId::NotBetterThanRegistration,
            Warns,
            with(|f| {
                f.improvements = vec![improvement(0.0006, 0.0005, 0.2, 0.8)];
            }),
        ),
        // Orientations that became worse by more than positions became better.
        (
            ReasonId::NotBetterThanRegistration,
            Warns,
            with(|f| {
                f.improvements.push(Improvement {
                    quantity: Compared::Orientation,
                    ..improvement(0.001, 0.01, 1.0, 0.001)
                });
            }),
        ),
        (
            ReasonId::TooFewToCompare,
            Warns,
            with(|f| {
                let few = Improvement {
                    postures: 3,
                    ..improvement(0.0009, 0.0005, 0.125, 0.99)
                };
                f.improvements = vec![few];
            }),
        ),
        (
            ReasonId::RejectedPart,
            Rejects,
            with(|f| f.rejected_parts = part(Part::Recording("sweep".into()))),
        ),
        (
            ReasonId::RejectedPart,
            Rejects,
            with(|f| {
                f.rejected_parts = part(Part::Subject {
                    recording: "sweep".into(),
                    subject: "hand".into(),
                });
            }),
        ),
        (
            ReasonId::RejectedPart,
            Rejects,
            with(|f| {
                f.rejected_parts = part(Part::Range {
                    joint: "elbow".into(),
                    from: 0.0,
                    to: 0.5,
                    unit: Unit::Radian,
                });
            }),
        ),
        (
            ReasonId::RejectedShare,
            Warns,
            with(|f| f.rejected = share(5)),
        ),
        (
            ReasonId::RejectedShare,
            LeavesOpen,
            with(|f| f.rejected = share(16)),
        ),
        (
            ReasonId::ScreenedHeldOut,
            Supports,
            with(|f| f.screened = share(1)),
        ),
        (
            ReasonId::ScreenedHeldOut,
            Warns,
            with(|f| f.screened = share(6)),
        ),
        (
            ReasonId::ScreenedHeldOut,
            LeavesOpen,
            with(|f| f.screened = share(16)),
        ),
        // Two of twelve are no proof of more than a tenth, four are.
        (
            ReasonId::ScreenedHeldOut,
            Warns,
            with(|f| f.screened = Share { part: 2, of: 12 }),
        ),
        (
            ReasonId::ScreenedHeldOut,
            LeavesOpen,
            with(|f| f.screened = Share { part: 4, of: 12 }),
        ),
        (
            ReasonId::RejectedShare,
            Warns,
            with(|f| f.rejected = share(15)),
        ),
        (
            ReasonId::OrientationOff,
            Rejects,
            with(|f| f.orientation.rms = Some(2.5)),
        ),
        // Found noise that has swallowed the fault does not excuse it.
        (
            ReasonId::OrientationOff,
            Rejects,
            with(|f| {
                f.orientation = Orientation {
                    rms: Some(2.5),
                    expected: Some(2.5),
                };
            }),
        ),
        (
            ReasonId::OrientationNotMeasured,
            Warns,
            with(|f| f.orientation.rms = None),
        ),
        (
            ReasonId::UnresolvedError,
            LeavesOpen,
            with(|f| f.errors = vec!["joint-sign".into()]),
        ),
        (
            ReasonId::WarningFinding,
            Warns,
            with(|f| f.warnings = vec!["missing-physics".into()]),
        ),
        (
            ReasonId::NoValidation,
            LeavesOpen,
            with(|f| f.validation = Validation::None),
        ),
        (
            ReasonId::LeaveOneOut,
            Warns,
            with(|f| f.validation = Validation::LeaveOneOut { postures: 40 }),
        ),
        (ReasonId::ValidationRepeatsFit, Warns, repeats(2)),
        (ReasonId::ValidationRepeatsFit, LeavesOpen, repeats(14)),
        (
            ReasonId::ImplausibleChange,
            Warns,
            with(|f| f.changes = vec![change(Some(6.0))]),
        ),
        (
            ReasonId::ImplausibleChange,
            LeavesOpen,
            with(|f| {
                f.changes = vec![change(Some(6.0))];
                unconfirmed(f);
            }),
        ),
        (
            ReasonId::ReversedAxis,
            Warns,
            with(|f| f.changes = vec![change(None)]),
        ),
        (
            ReasonId::ReversedAxis,
            LeavesOpen,
            with(|f| {
                f.changes = vec![change(None)];
                unconfirmed(f);
            }),
        ),
        (
            ReasonId::GoodnessOfFit,
            Warns,
            with(|f| f.goodness.as_mut().expect("there").used = 0.3),
        ),
        (
            ReasonId::GoodnessOfFit,
            LeavesOpen,
            with(|f| f.goodness.as_mut().expect("there").used = 1.7),
        ),
        (
            ReasonId::NoiseAboveStated,
            Warns,
            with(|f| {
                f.goodness.as_mut().expect("there").above_stated = Some(found(2.5, Some(1.1)));
            }),
        ),
        (
            ReasonId::NoiseAboveStated,
            Warns,
            with(|f| {
                f.goodness.as_mut().expect("there").above_stated = Some(found(2.5, Some(2.4)));
            }),
        ),
        (
            ReasonId::NoiseAboveStated,
            Warns,
            with(|f| {
                let few = Some(9);
                let found = FoundNoise {
                    few,
                    ..found(2.5, None)
                };
                f.goodness.as_mut().expect("there").above_stated = Some(found);
            }),
        ),
        (
            ReasonId::NoiseBelowStated,
            Warns,
            with(|f| {
                f.goodness.as_mut().expect("there").below_stated = Some(found(0.4, Some(0.4)));
            }),
        ),
        (
            ReasonId::NoiseAboveScatter,
            Warns,
            with(|f| {
                f.goodness.as_mut().expect("there").above_scatter = Some(("marker".into(), 6.0));
            }),
        ),
        (
            ReasonId::SingleJointData,
            Warns,
            with(|f| {
                f.single_joint = SingleJoint {
                    fitted: true,
                    held_out: false,
                };
            }),
        ),
        (
            ReasonId::SingleJointData,
            LeavesOpen,
            single_joint_and("missing-physics"),
        ),
        (
            ReasonId::SingleJointData,
            LeavesOpen,
            single_joint_and("changed-while-recording"),
        ),
        (
            ReasonId::RejectedShare,
            LeavesOpen,
            with(|f| {
                f.rejected = share(6);
                f.validation = Validation::LeaveOneOut { postures: 10 };
                f.warnings = vec!["unsettled-rows".into()];
            }),
        ),
        (ReasonId::UrdfAlone, Supports, alone(0.0009, Some(0.001))),
        (ReasonId::UrdfAlone, Warns, alone(0.0011, Some(0.001))),
        (ReasonId::UrdfAlone, Supports, alone(0.0005, None)),
        (ReasonId::UrdfAlone, Warns, alone(0.0007, None)),
        (
            ReasonId::BodyNotVerified,
            Warns,
            with(|f| f.unseen_bodies = vec![unseen(&[], false)]),
        ),
        (
            ReasonId::BodyNotVerified,
            LeavesOpen,
            with(|f| f.unseen_bodies = vec![unseen(&["elbow"], false)]),
        ),
        (
            ReasonId::BodyNotVerified,
            LeavesOpen,
            with(|f| f.unseen_bodies = vec![unseen(&[], true)]),
        ),
        (
            ReasonId::JointsNotVerified,
            Warns,
            with(|f| f.not_verified = vec!["elbow".into()]),
        ),
    ];
    out.extend(open);
    out
}

fn unseen(joints: &[&str], remounted: bool) -> UnseenBody {
    UnseenBody {
        name: "tool".into(),
        joints: joints.iter().map(|joint| (*joint).to_owned()).collect(),
        remounted,
    }
}

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
