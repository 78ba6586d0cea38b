//! Facts that the verdict is given from: those against which nothing speaks, and for every rule those that break it.

use calib_report::{
    Agreement, BodyError, Compared, Effect, FitEnd, FoundNoise, Goodness, ImplausibleChange,
    Improvement, Limit, Limited, Orientation, Part, Predicted, Prediction, ReasonId, RejectedPart,
    Share, SingleJoint, Solver, Unit, UnseenBody, Untested, UntestedKind, UrdfAlone, Validation,
    VerdictFacts,
};

/// A result against which nothing speaks.
pub(crate) fn clean() -> VerdictFacts {
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

pub(crate) fn found(factor: f64, rigid: Option<f64>) -> FoundNoise {
    FoundNoise {
        group: "marker".into(),
        factor,
        of_rows: factor,
        rigid,
        few: None,
    }
}

pub(crate) fn improvement(
    registration: f64,
    calibrated: f64,
    p_better: f64,
    p_worse: f64,
) -> Improvement {
    Improvement {
        quantity: Compared::Position,
        registration,
        calibrated,
        postures: 20,
        p_better,
        p_worse,
    }
}

pub(crate) fn limit(value: f64, interval: Option<(f64, f64)>) -> Vec<Limit> {
    vec![Limit::compared(
        Limited::position_rms(false),
        0.001,
        value,
        interval,
    )]
}

/// Clean facts with one thing changed.
pub(crate) fn with(change: impl FnOnce(&mut VerdictFacts)) -> VerdictFacts {
    let mut facts = clean();
    change(&mut facts);
    facts
}

/// Fitted to and checked with motions of single joints, with a warning.
pub(crate) fn single_joint_and(warning: &str) -> VerdictFacts {
    with(|f| {
        f.single_joint = SingleJoint {
            fitted: true,
            held_out: true,
        };
        f.warnings = vec![warning.into()];
    })
}

pub(crate) fn change(sigmas: Option<f64>) -> ImplausibleChange {
    ImplausibleChange {
        name: "elbow.origin.x".into(),
        change: 0.03,
        unit: Unit::Meter,
        sigmas,
    }
}

pub(crate) fn part(part: Part) -> Vec<RejectedPart> {
    let rejected = Share { part: 40, of: 41 };
    vec![RejectedPart { part, rejected }]
}

/// Upper limits of what is expected: by the parameters alone, with an effect; 0.27 mm are stated.
pub(crate) fn prediction(alone: f64, with: f64, effect: UntestedKind) -> Option<Prediction> {
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
pub(crate) fn broken() -> Vec<(ReasonId, Effect, VerdictFacts)> {
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
        (
            ReasonId::BodyAboveLimit,
            LeavesOpen,
            with(|f| f.of_bodies = vec![of_body(0.0004, 0.0005), of_body(0.0012, 0.0014)]),
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

/// Held-out errors of a body with the lower end of its interval.
pub(crate) fn of_body(low: f64, rms: f64) -> BodyError {
    BodyError {
        name: "tool".into(),
        rms,
        interval: (low, 2.0 * rms),
    }
}

pub(crate) fn unseen(joints: &[&str], remounted: bool) -> UnseenBody {
    UnseenBody {
        name: "tool".into(),
        joints: joints.iter().map(|joint| (*joint).to_owned()).collect(),
        remounted,
    }
}
