//! What the fit says of itself, its findings, and what it changed.

use calib_finding::Fact;

use crate::FitEnd;
use crate::verdict::facts::{Facts, FoundNoise};
use crate::verdict::rules::of_prediction::unless_confirmed;
use crate::verdict::{Effect, Reason, ReasonId};

pub(super) fn converged(facts: &Facts) -> Vec<Reason> {
    let stopped = facts.solver.filter(|s| s.ended != FitEnd::Converged);
    let reason = |solver: crate::verdict::Solver| {
        Reason::new(ReasonId::NotConverged, Effect::Rejects)
            .with("ended", Fact::choice(solver.ended.id()))
            .with("iterations", Fact::count(solver.iterations))
    };
    stopped.map(reason).into_iter().collect()
}

pub(super) fn origins(facts: &Facts) -> Vec<Reason> {
    let reason = |name: &String| {
        Reason::new(ReasonId::OriginNotDetermined, Effect::Rejects).with("origin", Fact::name(name))
    };
    facts.undetermined_origins.iter().map(reason).collect()
}

pub(super) fn errors(facts: &Facts) -> Vec<Reason> {
    found(ReasonId::UnresolvedError, Effect::LeavesOpen, &facts.errors)
}

pub(super) fn warnings(facts: &Facts) -> Vec<Reason> {
    found(ReasonId::WarningFinding, Effect::Warns, &facts.warnings)
}

/// One reason per id of a finding, in the order of the ids.
pub(super) fn found(id: ReasonId, effect: Effect, findings: &[String]) -> Vec<Reason> {
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

/// A nominal value can be far off; held-out poses in which joints move together then confirm what was found.
pub(super) fn plausible(facts: &Facts) -> Vec<Reason> {
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

/// χ²/dof between these is left alone even where so many samples make the band narrower: no stated σ is that exact.
const TOLERATED: (f64, f64) = (0.5, 1.5);

pub(super) fn goodness(facts: &Facts) -> Vec<Reason> {
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

/// Found noise below this part of the stated one says that the stated one is wrong.
const BELOW_STATED: f64 = 0.5;

/// The same over the scatter of the markers about their own bodies, where nothing is stated: what all markers of a body share, as errors of a tracker's
/// volume, does not show in it.
const ABOVE_SCATTER: f64 = 5.0;

/// From this part of the excess on, the scatter about the rigid bodies explains it.
const EXPLAINS: f64 = 0.8;

pub(super) fn stated_noise(facts: &Facts) -> Vec<Reason> {
    let Some(goodness) = &facts.goodness else {
        return Vec::new();
    };
    let reason = |id: ReasonId, found: &FoundNoise, factor: f64| {
        Reason::new(id, Effect::Warns)
            .with("group", Fact::name(&found.group))
            .with("factor", Fact::ratio(factor))
    };
    let above = goodness.above_stated.as_ref();
    let above = above.filter(|found| found.factor > ABOVE_STATED);
    let above = above.map(|found| {
        let rigid = found.rigid.filter(|rigid| *rigid > EXPLAINS * found.factor);
        reason(ReasonId::NoiseAboveStated, found, found.factor)
            .with_some("rigid", rigid.map(Fact::ratio))
            .with_some("samples", found.few.map(Fact::count))
    });
    let below = goodness.below_stated.as_ref();
    let below = below.filter(|found| found.of_rows < BELOW_STATED);
    let below = below.map(|found| reason(ReasonId::NoiseBelowStated, found, found.of_rows));
    let scatter = goodness.above_scatter.as_ref();
    let scatter = scatter.filter(|(_, factor)| *factor > ABOVE_SCATTER);
    let scatter = scatter.map(|(group, factor)| {
        Reason::new(ReasonId::NoiseAboveScatter, Effect::Warns)
            .with("group", Fact::name(group))
            .with("factor", Fact::ratio(*factor))
    });
    above.into_iter().chain(below).chain(scatter).collect()
}
