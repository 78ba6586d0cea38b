//! Errors that were measured, against limits, registration and noise.

use calib_finding::Fact;

use crate::verdict::facts::{BodyError, Facts, Validation};
use crate::verdict::{Compared, Effect, Improvement, Reason, ReasonId};
use crate::{Limit, Outcome, Unit};

/// A limit that lies in the interval of its estimate is neither met nor exceeded, on whichever side of it the estimate lies: more
/// data decide.
pub(super) fn limits(facts: &Facts) -> Vec<Reason> {
    if facts.limits.is_empty() {
        return vec![Reason::new(ReasonId::NoLimits, Effect::LeavesOpen)];
    }
    let reason = |limit: &Limit| {
        let (id, effect) = match limit.outcome {
            Outcome::NotEvaluated => (ReasonId::LimitNotEvaluated, Effect::LeavesOpen),
            Outcome::Met => (ReasonId::LimitMet, Effect::Supports),
            Outcome::Undecided => (ReasonId::LimitUndecided, Effect::LeavesOpen),
            Outcome::Exceeded => (ReasonId::LimitExceeded, Effect::Rejects),
        };
        let number = |value: Option<f64>| value.map(|value| Fact::number(value, limit.unit));
        Reason::new(id, effect)
            .with("name", Fact::name(&limit.name))
            .with("quantity", Fact::name(&limit.quantity))
            .with("limit", Fact::number(limit.limit, limit.unit))
            .with_some("value", number(limit.value))
            .with_some("low", number(limit.low))
            .with_some("high", number(limit.high))
            .with_some(
                "postures",
                enough(facts, limit)
                    .filter(|_| id == ReasonId::LimitUndecided)
                    .map(Fact::count),
            )
            .with_some(
                "because",
                Some(&limit.reason)
                    .filter(|r| !r.is_empty())
                    .map(Fact::name),
            )
    };
    facts.limits.iter().map(reason).collect()
}

/// A limit of the rms error is one of every body: a body alone can be above what all of them together meet.
pub(super) fn bodies(facts: &Facts) -> Vec<Reason> {
    let is_rms = |l: &&Limit| l.unit == Unit::Meter && l.name.starts_with("held_out_rms");
    let mut limits = facts.limits.iter().filter(is_rms);
    let Some(limit) = limits.find(|limit| limit.outcome != Outcome::Exceeded) else {
        return Vec::new();
    };
    let above = facts
        .of_bodies
        .iter()
        .filter(|body| body.interval.0 > limit.limit);
    let reason = |body: &BodyError| {
        Reason::new(ReasonId::BodyAboveLimit, Effect::LeavesOpen)
            .with("body", Fact::name(&body.name))
            .with("value", Fact::meters(body.rms))
            .with("low", Fact::meters(body.interval.0))
            .with("high", Fact::meters(body.interval.1))
            .with("limit", Fact::meters(limit.limit))
    };
    above.map(reason).collect()
}

/// Postures of which an estimate like this one would have its whole interval on its side of the limit: its half-width shrinks
/// with the square root of their number. `None` for limits of anything else, or where no number is of use.
pub(super) fn enough(facts: &Facts, limit: &Limit) -> Option<usize> {
    /// Nobody records more to decide a limit.
    const TOO_MANY: f64 = 1000.0;
    if !limit.name.starts_with("held_out") {
        return None;
    }
    let value = limit.value?;
    let end = if value <= limit.limit {
        limit.high?
    } else {
        limit.low.filter(|low| *low <= limit.limit)?
    };
    let wider = (end - value) / (limit.limit - value);
    let postures = (facts.validation.postures() as f64 * wider * wider).ceil();
    (postures > 0.0 && postures < TOO_MANY).then_some(postures as usize)
}

/// Chance makes a robot look better (or worse) so clearly in at most this share of the cases.
pub(super) const SIGNIFICANT: f64 = 0.05;

/// Chance makes it look worse by so much that the result is rejected in at most this share of the cases, and only where its errors
/// are also larger than the fit states of them, which a right fit's are once in a thousand validations ([`crate::Agreement`]).
/// Registration alone absorbs nearly all of a small robot's errors; the calibrated one then differs from it by its own uncertainty, in
/// all postures at once, and is truly a little worse in half of the cases. Eight postures, all of them worse, are as rare as this.
const REJECTS: f64 = 0.005;

/// Beside a quantity that is better, one that is worse by less than this, or than the other is better, is no loss.
const LOSS: f64 = 1.05;

/// The smallest p of a test that exchanges the signs of so many differences.
fn least_p(postures: usize) -> f64 {
    0.5_f64.powi(postures.try_into().unwrap_or(i32::MAX))
}

pub(super) fn registration(facts: &Facts) -> Vec<Reason> {
    if !facts.freed || facts.improvements.is_empty() {
        return Vec::new();
    }
    // Without a statement of its uncertainty, the comparison is all there is.
    let stated = facts.agreement.as_ref();
    let beyond = stated.is_none_or(crate::Agreement::is_beyond);
    let better = facts
        .improvements
        .iter()
        .filter(|i| i.p_better < SIGNIFICANT);
    let gain = better.map(|i| i.registration / i.calibrated);
    let gain = gain.reduce(f64::max);
    let better = gain.is_some();
    // What cannot become better, as the orientation of a robot that only slides or of a small body, differs by little, and yet always in the same sense.
    let counts =
        |i: &Improvement| gain.is_none_or(|gain| i.calibrated > LOSS.max(gain) * i.registration);
    let rejecting = |i: &&Improvement| beyond && i.p_worse < REJECTS && counts(i);
    let rejecting = facts.improvements.iter().find(rejecting);
    let worse = |i: &&Improvement| i.p_worse < SIGNIFICANT && counts(i);
    let worse = facts.improvements.iter().find(worse);
    let (id, effect, shown) = match (rejecting.or(worse), better) {
        (Some(worse), _) if rejecting.is_some() => {
            (ReasonId::WorseThanRegistration, Effect::Rejects, worse)
        }
        (Some(worse), _) => (ReasonId::NotBetterThanRegistration, Effect::Warns, worse),
        (None, true) => return Vec::new(),
        // Of fewer postures the smallest p, all of them better, is larger: nothing could have been significant.
        (None, false)
            if facts
                .improvements
                .iter()
                .all(|i| least_p(i.postures) >= SIGNIFICANT) =>
        {
            (
                ReasonId::TooFewToCompare,
                Effect::Warns,
                &facts.improvements[0],
            )
        }
        (None, false) => (
            ReasonId::NotBetterThanRegistration,
            Effect::Warns,
            &facts.improvements[0],
        ),
    };
    let unit = match shown.quantity {
        Compared::Position => Unit::Meter,
        Compared::Orientation => Unit::Radian,
    };
    let p = match id {
        ReasonId::WorseThanRegistration => shown.p_worse,
        _ => shown.p_better,
    };
    vec![
        Reason::new(id, effect)
            .with("registration", Fact::number(shown.registration, unit))
            .with("calibrated", Fact::number(shown.calibrated, unit))
            .with("postures", Fact::count(shown.postures))
            .with("p", Fact::ratio(p)),
    ]
}

/// Without a limit of the profile, an orientation error above this many times the noise is gross…
const GROSS: f64 = 5.0;

/// …but never one below this (rad): three small markers are noisy…
const NEVER_GROSS: f64 = 3.0 * std::f64::consts::PI / 180.0;

/// …and always one above this (rad), whatever the noise is said to be: noise that was found may have swallowed it.
const ALWAYS_GROSS: f64 = 10.0 * std::f64::consts::PI / 180.0;

pub(super) fn orientation(facts: &Facts) -> Vec<Reason> {
    if facts.validation == Validation::None {
        return Vec::new();
    }
    let Some(rms) = facts.orientation.rms else {
        return vec![Reason::new(ReasonId::OrientationNotMeasured, Effect::Warns)];
    };
    let expected = facts.orientation.expected.unwrap_or(0.0);
    let accepted = (GROSS * expected).clamp(NEVER_GROSS, ALWAYS_GROSS);
    let limited = facts.limits.iter().any(|limit| {
        limit.unit == Unit::Radian && limit.value.is_some() && limit.name.starts_with("held_out")
    });
    if limited || rms <= accepted {
        return Vec::new();
    }
    vec![
        Reason::new(ReasonId::OrientationOff, Effect::Rejects)
            .with("rms", Fact::radians(rms))
            .with("accepted", Fact::radians(accepted)),
    ]
}

/// Without a limit of the rms error, the URDF alone does as well as with effects up to this ratio.
const AS_WELL: f64 = 1.2;

pub(super) fn urdf_alone(facts: &Facts) -> Vec<Reason> {
    let Some(alone) = facts.urdf_alone else {
        return Vec::new();
    };
    let accepted = alone.limit.unwrap_or(AS_WELL * alone.with_effects);
    let effect = if alone.rms <= accepted {
        Effect::Supports
    } else {
        Effect::Warns
    };
    vec![
        Reason::new(ReasonId::UrdfAlone, effect)
            .with("rms", Fact::meters(alone.rms))
            .with("with_effects", Fact::meters(alone.with_effects))
            .with_some("refitted", alone.refitted.map(Fact::meters))
            .with_some("limit", alone.limit.map(Fact::meters)),
    ]
}
