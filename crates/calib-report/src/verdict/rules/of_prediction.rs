//! Errors that the fit predicts over the joint ranges, and whether held-out errors bear its uncertainty out.

use calib_finding::{Fact, Id, catalog};

use crate::verdict::facts::{Facts, Predicted, Untested, Validation};
use crate::verdict::rules::of_data::REPEATED;
use crate::verdict::rules::of_errors::SIGNIFICANT;
use crate::verdict::{Effect, Reason, ReasonId};
use crate::{Limit, Outcome, Unit};

/// Held-out poses in which the joints move together met every limit, and prove the calibration better than registration: what
/// they vouch for is then a warning, and leaves the verdict open otherwise.
pub(super) fn unless_confirmed(facts: &Facts) -> Effect {
    let independent = matches!(facts.validation, Validation::Recordings { postures, repeated }
        if (repeated as f64) < REPEATED * postures as f64);
    let met = |limit: &Limit| limit.outcome == Outcome::Met;
    let better = facts.improvements.iter().any(|i| i.p_better < SIGNIFICANT);
    let seen = facts
        .unseen_bodies
        .iter()
        .all(|body| body.joints.is_empty());
    let combined = !facts.single_joint.held_out && facts.not_verified.is_empty() && seen;
    if independent && combined && better && facts.limits.iter().all(met) {
        Effect::Warns
    } else {
        Effect::LeavesOpen
    }
}

/// Held-out postures, those that repeat fitted ones left out, from which on what they show is taken for the joint ranges: an error
/// that one posture of ten has is then missed in one validation of eight.
const VERIFIED: usize = 20;

/// What is computed for the joint ranges against what was measured there: few held-out postures do not outweigh it.
fn unless_measured(facts: &Facts) -> Effect {
    match facts.validation {
        Validation::Recordings { postures, repeated } if postures >= VERIFIED + repeated => {
            unless_confirmed(facts)
        }
        _ => Effect::LeavesOpen,
    }
}

/// The smallest limit of the profile for position errors, m.
fn position_limit(facts: &Facts) -> Option<f64> {
    let limits = facts.limits.iter();
    limits
        .filter(|l| l.unit == Unit::Meter && l.name.starts_with("held_out"))
        .map(|l| l.limit)
        .min_by(f64::total_cmp)
}

/// What the parameters leave open, then what one effect could add: the held-out poses are few, the joint ranges are wide.
pub(super) fn predicted(facts: &Facts) -> Vec<Reason> {
    let (Some(prediction), Some(limit)) = (&facts.prediction, position_limit(facts)) else {
        return Vec::new();
    };
    let reason = |id: ReasonId, found: Predicted| {
        Reason::new(id, unless_measured(facts))
            .with("expected", Fact::meters(found.rms))
            .with("upper", Fact::meters(found.upper))
            .with("limit", Fact::meters(limit))
    };
    if prediction.alone.upper > limit {
        return vec![reason(ReasonId::PredictionUndecided, prediction.alone)];
    }
    let open = prediction
        .with
        .iter()
        .filter(|(_, with)| with.upper > limit);
    open.map(|(what, with)| of_effect(reason(ReasonId::EffectsNotExcluded, *with), what))
        .collect()
}

fn of_effect(reason: Reason, what: &Untested) -> Reason {
    reason
        .with("effect", Fact::choice(what.effect.id()))
        .with("of", Fact::name(&what.of))
        .with_some("other", what.other.as_ref().map(Fact::name))
}

/// Findings of what changed before the validation: its errors are then no measure of what the fit states.
const CHANGED_BEFORE: [Id; 4] = [
    catalog::JOINT_ZERO_CHANGED,
    catalog::JOINT_ORIGIN_MOVED,
    catalog::TRACKER_MOVED,
    catalog::BODY_REMOUNTED,
];

pub(super) fn agreement(facts: &Facts) -> Vec<Reason> {
    let said = |id: &Id| {
        let mut all = facts.errors.iter().chain(&facts.warnings);
        all.any(|said| said == id.as_str())
    };
    let cause = CHANGED_BEFORE.into_iter().find(said);
    let reason = |a: &crate::Agreement| {
        Reason::new(ReasonId::HeldOutBeyondStated, unless_measured(facts))
            .with("value", Fact::ratio(a.value))
            .with("high", Fact::ratio(a.accepted()))
            .with_some("cause", cause.map(|id| Fact::choice(id.as_str())))
    };
    let found = facts.agreement.as_ref().filter(|a| a.is_beyond());
    found.map(reason).into_iter().collect()
}

/// An error that the data do not exclude, in units of what the fit states of its predictions, up to which stating it instead is
/// enough. Beyond it the effect is either seen, or so poorly that what is stated rests on how large such effects usually are.
const TOO_SMALL: f64 = 2.5;
/// An error of this share of the limit changes one at the limit by one part in five thousand: the fit of very many poses states
/// less, and no untested effect is known so well.
const NEGLIGIBLE: f64 = 0.02;

pub(super) fn uncertainty(facts: &Facts) -> Vec<Reason> {
    let Some(prediction) = &facts.prediction else {
        return Vec::new();
    };
    let least = position_limit(facts).map_or(0.0, |limit| NEGLIGIBLE * limit);
    // What the joints do from pose to pose is stated as their noise.
    let of_fit = (TOO_SMALL * prediction.stated)
        .max(least)
        .hypot(prediction.joints);
    let far = |with: &Predicted| with.rms > of_fit;
    let found = prediction.with.iter().filter(|(_, with)| far(with));
    let reason = |with: &Predicted| {
        Reason::new(ReasonId::UncertaintyTooSmall, unless_measured(facts))
            .with("stated", Fact::meters(prediction.stated))
            .with("expected", Fact::meters(with.rms))
    };
    found
        .map(|(what, with)| of_effect(reason(with), what))
        .collect()
}

/// The fit's own uncertainty does not know of what is not in its model: the larger error is stated in any case.
pub(super) fn expected(facts: &Facts) -> Vec<Reason> {
    let Some(prediction) = &facts.prediction else {
        return Vec::new();
    };
    let reason = |found: &Predicted| {
        Reason::new(ReasonId::PredictionExpected, Effect::Supports)
            .with("stated", Fact::meters(prediction.stated))
            .with("expected", Fact::meters(found.rms))
            .with("upper", Fact::meters(found.upper))
    };
    let larger = prediction.with.iter();
    let larger = larger.filter(|(_, with)| with.rms > prediction.alone.rms);
    let mut found = larger.map(|(what, with)| of_effect(reason(with), what));
    vec![
        found
            .next_back()
            .unwrap_or_else(|| reason(&prediction.alone)),
    ]
}
