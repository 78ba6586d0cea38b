//! The rules of the verdict, in the order in which reasons of one effect are listed.

use calib_finding::Fact;

use crate::verdict::facts::{Facts, Part, Predicted, RejectedPart, Untested, Validation};
use crate::verdict::{Compared, Effect, Reason, ReasonId};
use crate::{FitEnd, Limit, Outcome, Unit, Verdict};

/// A rule: what it asks of the facts.
pub type Rule = fn(&Facts) -> Vec<Reason>;

/// Every rule. What each asks for stands in the book, by the ids of its reasons.
pub const RULES: [Rule; 21] = [
    converged,
    origins,
    limits,
    registration,
    rejected_parts,
    orientation,
    errors,
    predicted,
    agreement,
    uncertainty,
    expected,
    validation,
    plausible,
    rejected_share,
    screened,
    goodness,
    stated_noise,
    single_joint,
    verified_joints,
    urdf_alone,
    warnings,
];

/// The verdict and why.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Judgment {
    /// The verdict.
    pub verdict: Verdict,
    /// The reasons, the gravest first, otherwise in the order of the rules.
    pub reasons: Vec<Reason>,
}

/// Applies every rule. The gravest effect decides; facts without any limit are never accepted.
#[must_use]
pub fn judge(facts: &Facts) -> Judgment {
    let mut reasons: Vec<Reason> = RULES.iter().flat_map(|rule| rule(facts)).collect();
    reasons.sort_by_key(|reason| std::cmp::Reverse(reason.effect));
    let verdict = match reasons.first().map(|reason| reason.effect) {
        Some(Effect::Supports) => Verdict::Accepted,
        Some(Effect::Warns) => Verdict::AcceptedWithWarnings,
        Some(Effect::LeavesOpen) | None => Verdict::NotEvaluated,
        Some(Effect::Rejects) => Verdict::Rejected,
    };
    Judgment { verdict, reasons }
}

fn converged(facts: &Facts) -> Vec<Reason> {
    let stopped = facts.solver.filter(|s| s.ended != FitEnd::Converged);
    let reason = |solver: crate::verdict::Solver| {
        Reason::new(ReasonId::NotConverged, Effect::Rejects)
            .with("ended", Fact::choice(solver.ended.id()))
            .with("iterations", Fact::count(solver.iterations))
    };
    stopped.map(reason).into_iter().collect()
}

fn origins(facts: &Facts) -> Vec<Reason> {
    let reason = |name: &String| {
        Reason::new(ReasonId::OriginNotDetermined, Effect::Rejects).with("origin", Fact::name(name))
    };
    facts.undetermined_origins.iter().map(reason).collect()
}

/// An estimate above its limit rejects, whether its interval reaches below or not; one below it that its interval does not
/// bear out leaves open what more data decide.
fn limits(facts: &Facts) -> Vec<Reason> {
    if facts.limits.is_empty() {
        return vec![Reason::new(ReasonId::NoLimits, Effect::LeavesOpen)];
    }
    let reason = |limit: &Limit| {
        let above = limit.value.is_none_or(|value| value > limit.limit);
        let (id, effect) = match limit.outcome {
            Outcome::NotEvaluated => (ReasonId::LimitNotEvaluated, Effect::LeavesOpen),
            Outcome::Met => (ReasonId::LimitMet, Effect::Supports),
            Outcome::Undecided if !above => (ReasonId::LimitUndecided, Effect::LeavesOpen),
            Outcome::Undecided | Outcome::Exceeded => (ReasonId::LimitExceeded, Effect::Rejects),
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

/// Postures of which an estimate like this one would have its whole interval below the limit: its half-width shrinks with
/// the square root of their number. `None` for limits of anything else, or where no number is of use.
fn enough(facts: &Facts, limit: &Limit) -> Option<usize> {
    /// Nobody records more to decide a limit.
    const TOO_MANY: f64 = 1000.0;
    if !limit.name.starts_with("held_out") {
        return None;
    }
    let value = limit.value?;
    let wider = (limit.high? - value) / (limit.limit - value);
    let postures = (facts.validation.postures() as f64 * wider * wider).ceil();
    (postures > 0.0 && postures < TOO_MANY).then_some(postures as usize)
}

/// Held-out poses in which the joints move together met every limit, and prove the calibration better than registration: what
/// they vouch for is then a warning, and leaves the verdict open otherwise.
fn unless_confirmed(facts: &Facts) -> Effect {
    let independent = matches!(facts.validation, Validation::Recordings { postures, repeated }
        if (repeated as f64) < REPEATED * postures as f64);
    let met = |limit: &Limit| limit.outcome == Outcome::Met;
    let better = facts.improvements.iter().any(|i| i.p_better < SIGNIFICANT);
    let combined = !facts.single_joint.held_out && facts.not_verified.is_empty();
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
fn predicted(facts: &Facts) -> Vec<Reason> {
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

/// Held-out errors up to this many times their stated variance are left alone: no stated σ is that exact.
const AGREES: f64 = 1.5;

fn agreement(facts: &Facts) -> Vec<Reason> {
    let beyond = |a: &&crate::Agreement| a.value > a.high.max(AGREES);
    let reason = |a: &crate::Agreement| {
        Reason::new(ReasonId::HeldOutBeyondStated, unless_measured(facts))
            .with("value", Fact::ratio(a.value))
            .with("high", Fact::ratio(a.high.max(AGREES)))
    };
    let found = facts.agreement.as_ref().filter(beyond);
    found.map(reason).into_iter().collect()
}

/// An error that the data do not exclude, in units of what the fit states of its predictions, up to which stating it instead is
/// enough. Beyond it the effect is either seen, or so poorly that what is stated rests on how large such effects usually are.
const TOO_SMALL: f64 = 2.5;

fn uncertainty(facts: &Facts) -> Vec<Reason> {
    let Some(prediction) = &facts.prediction else {
        return Vec::new();
    };
    let far = |with: &Predicted| with.rms > TOO_SMALL * prediction.stated;
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
fn expected(facts: &Facts) -> Vec<Reason> {
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

/// Chance makes a robot look better (or worse) so clearly in at most this share of the cases.
const SIGNIFICANT: f64 = 0.05;

fn registration(facts: &Facts) -> Vec<Reason> {
    if !facts.freed || facts.improvements.is_empty() {
        return Vec::new();
    }
    let worse = facts.improvements.iter().find(|i| i.p_worse < SIGNIFICANT);
    let better = facts.improvements.iter().any(|i| i.p_better < SIGNIFICANT);
    let (id, effect, shown) = match (worse, better) {
        (Some(worse), _) => (ReasonId::WorseThanRegistration, Effect::Rejects, worse),
        (None, true) => return Vec::new(),
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

fn rejected_parts(facts: &Facts) -> Vec<Reason> {
    let reason = |rejected: &RejectedPart| {
        let reason = Reason::new(ReasonId::RejectedPart, Effect::Rejects)
            .with("rejected", Fact::count(rejected.rejected.part))
            .with("of", Fact::count(rejected.rejected.of));
        match &rejected.part {
            Part::Recording(recording) => reason.with("recording", Fact::name(recording)),
            Part::Subject { recording, subject } => reason
                .with("recording", Fact::name(recording))
                .with("subject", Fact::name(subject)),
            Part::Range {
                joint,
                from,
                to,
                unit,
            } => reason
                .with("joint", Fact::name(joint))
                .with("from", Fact::number(*from, *unit))
                .with("to", Fact::number(*to, *unit)),
        }
    };
    facts.rejected_parts.iter().map(reason).collect()
}

/// Without a limit of the profile, an orientation error above this many times the noise is gross…
const GROSS: f64 = 5.0;
/// …but never one below this (rad): three small markers are noisy…
const NEVER_GROSS: f64 = 3.0 * std::f64::consts::PI / 180.0;
/// …and always one above this (rad), whatever the noise is said to be: noise that was found may have swallowed it.
const ALWAYS_GROSS: f64 = 10.0 * std::f64::consts::PI / 180.0;

fn orientation(facts: &Facts) -> Vec<Reason> {
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

fn errors(facts: &Facts) -> Vec<Reason> {
    found(ReasonId::UnresolvedError, Effect::LeavesOpen, &facts.errors)
}

fn warnings(facts: &Facts) -> Vec<Reason> {
    found(ReasonId::WarningFinding, Effect::Warns, &facts.warnings)
}

/// One reason per id of a finding, in the order of the ids.
fn found(id: ReasonId, effect: Effect, findings: &[String]) -> Vec<Reason> {
    let mut counted = std::collections::BTreeMap::<&String, usize>::new();
    for finding in findings {
        *counted.entry(finding).or_default() += 1;
    }
    let reason = |(finding, times): (&String, usize)| {
        Reason::new(id, effect)
            .with("finding", Fact::name(finding))
            .with("times", Fact::count(times))
    };
    counted.into_iter().map(reason).collect()
}

/// Validation that repeats fitted postures in this share, measured again, proves little about new ones…
const REPEATED: f64 = 2.0 / 3.0;
/// …and below this share it does not matter.
const FEW_REPEATED: f64 = 0.05;

fn validation(facts: &Facts) -> Vec<Reason> {
    match facts.validation {
        Validation::None => vec![Reason::new(ReasonId::NoValidation, Effect::LeavesOpen)],
        Validation::LeaveOneOut { postures } => vec![
            Reason::new(ReasonId::LeaveOneOut, Effect::Warns)
                .with("postures", Fact::count(postures)),
        ],
        Validation::Recordings { postures, repeated } => {
            let share = repeated as f64 / postures.max(1) as f64;
            let effect = match share {
                share if share >= REPEATED => Effect::LeavesOpen,
                share if share > FEW_REPEATED => Effect::Warns,
                _ => return Vec::new(),
            };
            vec![
                Reason::new(ReasonId::ValidationRepeatsFit, effect)
                    .with("repeated", Fact::count(repeated))
                    .with("postures", Fact::count(postures)),
            ]
        }
    }
}

/// A nominal value can be far off; held-out poses in which joints move together then confirm what was found.
fn plausible(facts: &Facts) -> Vec<Reason> {
    let effect = unless_confirmed(facts);
    let mut out = Vec::new();
    for (id, reversed) in [
        (ReasonId::ReversedAxis, true),
        (ReasonId::ImplausibleChange, false),
    ] {
        let of_kind = || {
            facts
                .changes
                .iter()
                .filter(|c| c.sigmas.is_none() == reversed)
        };
        let largest = of_kind().max_by(|a, b| {
            let size = |c: &crate::ImplausibleChange| c.sigmas.unwrap_or(c.change.abs());
            size(a).total_cmp(&size(b))
        });
        let Some(largest) = largest else { continue };
        out.push(
            Reason::new(id, effect)
                .with("name", Fact::name(&largest.name))
                .with("change", Fact::number(largest.change, largest.unit))
                .with_some("sigmas", largest.sigmas.map(Fact::ratio))
                .with("more", Fact::count(of_kind().count() - 1)),
        );
    }
    out
}

/// Rejected or screened measurements above this share are a warning: the robust fit is still right…
const NOTABLE: f64 = 0.05;
/// …and above this one nothing is accepted: the rest was chosen by the model that it is to confirm.
const TOO_MANY: f64 = 0.10;

fn share_effect(share: f64) -> Effect {
    match share {
        share if share > TOO_MANY => Effect::LeavesOpen,
        share if share >= NOTABLE => Effect::Warns,
        _ => Effect::Supports,
    }
}

fn rejected_share(facts: &Facts) -> Vec<Reason> {
    let effect = share_effect(facts.rejected.ratio());
    if effect == Effect::Supports {
        return Vec::new();
    }
    vec![
        Reason::new(ReasonId::RejectedShare, effect)
            .with("rejected", Fact::count(facts.rejected.part))
            .with("of", Fact::count(facts.rejected.of)),
    ]
}

fn screened(facts: &Facts) -> Vec<Reason> {
    if facts.screened.part == 0 {
        return Vec::new();
    }
    vec![
        Reason::new(
            ReasonId::ScreenedHeldOut,
            share_effect(facts.screened.ratio()),
        )
        .with("screened", Fact::count(facts.screened.part))
        .with("of", Fact::count(facts.screened.of)),
    ]
}

/// χ²/dof between these is left alone even where so many samples make the band narrower: no stated σ is that exact.
const TOLERATED: (f64, f64) = (0.5, 1.5);

fn goodness(facts: &Facts) -> Vec<Reason> {
    let Some(goodness) = &facts.goodness else {
        return Vec::new();
    };
    let low = goodness.band.0.min(TOLERATED.0);
    let high = goodness.band.1.max(TOLERATED.1);
    // Too large a stated uncertainty is safe, too small a one is not.
    let effect = match goodness.used {
        used if used < low => Effect::Warns,
        used if used <= high => return Vec::new(),
        _ => Effect::LeavesOpen,
    };
    vec![
        Reason::new(ReasonId::GoodnessOfFit, effect)
            .with("value", Fact::ratio(goodness.used))
            .with("low", Fact::ratio(low))
            .with("high", Fact::ratio(high)),
    ]
}

/// Found noise above this many times the stated one says that something is missing, although the uncertainty has it.
const ABOVE_STATED: f64 = 2.0;

fn stated_noise(facts: &Facts) -> Vec<Reason> {
    let above = facts
        .goodness
        .as_ref()
        .and_then(|g| g.above_stated.as_ref());
    let reason = |(group, factor): &(String, f64)| {
        Reason::new(ReasonId::NoiseAboveStated, Effect::Warns)
            .with("group", Fact::name(group))
            .with("factor", Fact::ratio(*factor))
    };
    let far = above.filter(|(_, factor)| *factor > ABOVE_STATED);
    far.map(reason).into_iter().collect()
}

fn single_joint(facts: &Facts) -> Vec<Reason> {
    let single = facts.single_joint;
    let which = match (single.fitted, single.held_out) {
        (false, false) => return Vec::new(),
        (true, false) => "fitted",
        (false, true) => "held_out",
        (true, true) => "all",
    };
    vec![Reason::new(ReasonId::SingleJointData, Effect::Warns).with("data", Fact::choice(which))]
}

fn verified_joints(facts: &Facts) -> Vec<Reason> {
    if facts.not_verified.is_empty() {
        return Vec::new();
    }
    vec![
        Reason::new(ReasonId::JointsNotVerified, Effect::Warns)
            .with("joints", Fact::names(facts.not_verified.clone())),
    ]
}

/// Without a limit of the rms error, the URDF alone does as well as with effects up to this ratio.
const AS_WELL: f64 = 1.2;

fn urdf_alone(facts: &Facts) -> Vec<Reason> {
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
            .with_some("limit", alone.limit.map(Fact::meters)),
    ]
}
