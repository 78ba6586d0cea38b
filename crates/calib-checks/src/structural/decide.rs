//! The decision: rank, screen, name, verify.

use rayon::prelude::*;

use super::apply::{apply, apply_all};
use super::axes::{several_axes, together};
use super::candidates::{Candidate, candidates, span};
use super::continuous;
use super::data::{Data, DataError};
use super::expected::expected;
use super::few;
use super::further::{Leads, Signs, further};
use super::hypothesis::{Hypothesis, Scope, Scoped};
use super::ids::{JointIndex, SampleIndex};
use super::jump::{Jump, jump};
use super::likelihood::{Opinion, errors_explain, has_unknowns, opinion};
use super::lost::lost_rows;
use super::naming::{Asked, EQUIVALENT_WITHIN, on_twin};
use super::outcome::{Correction, Decision, Design, Named, Options, Outcome};
use super::pairs::name_pair;
use super::ranking::{Ranking, distinct, few_samples, ratio};
use super::readings::{WrongReadings, wrong_readings};
use super::scan::{Scan, Scored};
use super::screen::{Screened, screen};
use super::swept::{at_rest, moved_after_all};
use super::thinning::thinned;
use super::twin::twin;

/// Degrees of freedom below which a gross outlier looks like a mistake. One marker in six poses has nine, and six where
/// the rows are shifted by one.
const FEW_FREEDOM: f64 = 10.0;
/// A change that leaves the residual below this part of what nominal errors explain is found, with its size, by a fit.
const WITHIN_A_FIT: f64 = 0.8;
/// Rows that must be left where rows are paired otherwise.
const LEAST_ROWS: usize = 4;
/// Rounds of screening: the set settles in one or two.
const SCREENINGS: usize = 3;
/// Leaders under which outliers are looked for, beside the data as they are.
const SCREENED_LEADERS: usize = 5;

/// Tries every structural hypothesis on the data.
///
/// # Errors
/// [`DataError`] when the input contradicts itself.
pub fn explain(data: &Data, options: &Options) -> Result<Outcome, DataError> {
    data.check()?;
    let rows = thinned(data, options.most_rows);
    let work = &data.select(&rows);
    let design = design(data);
    let mut outcome = Outcome {
        decision: Decision::Consistent {
            best: None,
            ratio: 1.0,
        },
        readings: None,
        jump: None,
        continuous: None,
        rms: 0.0,
        expected: None,
        invisible: Vec::new(),
        screened: Vec::new(),
        assumed_zero: data.assumed_zero(),
        rows_scored: rows.len(),
        rows: data.readings.len(),
        design,
    };
    let (_, freedom) = Scan::new(work, &[]).freedom();
    let mut candidates = candidates(work);
    candidates.retain(|c| leaves_rows(&c.0, rows.len()));
    if rows.len() < data.readings.len() {
        // The neighbor of a row is not among the rows that are left.
        candidates.retain(|c| !matches!(c.0, Hypothesis::RowShift { .. }));
    }
    if !options.suspects.is_empty() {
        let about =
            |scope: &Scope| matches!(scope, Scope::Recording(r) if options.suspects.contains(r));
        candidates.iter_mut().for_each(|c| c.1.retain(about));
        candidates.retain(|c| !c.1.is_empty());
    }
    if freedom < FEW_FREEDOM {
        outcome.rms = Scan::new(work, &[]).none().rms;
        outcome.decision = few::decide(work, candidates, freedom, options);
        return Ok(outcome);
    }
    let (ranking, screened) = screened_ranking(work, &candidates);
    outcome.rms = ranking.none.rms;
    let asked = Asked {
        data: work,
        candidates: &candidates,
        ranking: &ranking,
        screened: &screened,
        options,
    };
    let continuous_of = |data: &Data| match options.score_tests {
        true => continuous::continuous(data, &screened, options),
        false => None,
    };
    // Most data need no correction: the tests do not wait for the decision.
    let (correction, as_they_are) =
        rayon::join(|| decided(&asked, &mut outcome), || continuous_of(work));
    outcome.continuous = match correction.is_empty() {
        true => as_they_are,
        false => continuous_of(&apply_all(&correction, work)),
    };
    let original = |s: &SampleIndex| SampleIndex {
        row: rows[s.row],
        ..*s
    };
    outcome.screened = screened.iter().map(original).collect();
    beyond_hypotheses(data, (work, &screened), &mut outcome, options);
    Ok(outcome)
}

/// What pairs rows otherwise takes some out: a few that are left fit anything.
fn leaves_rows(hypothesis: &Hypothesis, rows: usize) -> bool {
    match hypothesis {
        Hypothesis::RowShift { rows: shift } => {
            rows >= LEAST_ROWS + usize::from(shift.unsigned_abs())
        }
        _ => true,
    }
}

/// Decides, with the residual that nominal errors explain and what the data cannot show; the correction of the hypothesis that is named or leads.
fn decided(asked: &Asked<'_>, outcome: &mut Outcome) -> Correction {
    let Asked {
        data,
        ranking,
        screened,
        options,
        ..
    } = *asked;
    outcome.expected = expected(data, screened, options);
    let wrong = outcome.expected.is_some_and(|e| ranking.none.rms > e.limit);
    let signs = Signs {
        wrong,
        leads: leads(ranking, options),
    };
    let more = further(data, screened, options, signs);
    let mut of_more = Ranking::of(data, &more, screened);
    if !wrong {
        // A place that is off by a few degrees is an error that the fit finds.
        of_more
            .scored
            .retain(|s| !matches!(s.scoped.hypothesis, Hypothesis::StoodAt { .. }));
    }
    let (all, with_more) = ([asked.candidates, &more].concat(), ranking.with(of_more));
    let asked = &Asked {
        candidates: &all,
        ranking: &with_more,
        ..*asked
    };
    let ranking = &with_more;
    if options.list_invisible {
        outcome.invisible = invisible(data, ranking, screened, options);
    }
    outcome.decision = match decide(asked, outcome) {
        Decision::Named(named) => Decision::Named(match at_rest(&named, data, screened) {
            Some(other) => asked.with_expected(asked.name(&other)),
            None => moved_after_all(named, data, screened),
        }),
        other => other,
    };
    match &outcome.decision {
        Decision::Named(named)
        | Decision::Undecided {
            leading: Some(named),
            ..
        } => named.correction.clone(),
        _ => Vec::new(),
    }
}

/// What leads that one zero, gain or share may explain as well.
fn leads(ranking: &Ranking, options: &Options) -> Leads {
    let first = ranking.scored.first();
    let ratio = first.map_or(1.0, |s| ranking.ratio(s.score.score));
    match first.map(|s| s.scoped.hypothesis) {
        Some(h) if h.is_frame() && ratio > 1.0 => Leads::Frame,
        Some(Hypothesis::Axis { .. }) if ratio >= options.runner_up_ratio => Leads::Axis,
        _ => Leads::Other,
    }
}

/// What no hypothesis of the list says: a change at one row, or a column that is wrong in a way of its own. `work` and `screened`:
/// the rows that were scored, and their outliers.
fn beyond_hypotheses(
    data: &Data,
    (work, screened): (&Data, &[SampleIndex]),
    outcome: &mut Outcome,
    options: &Options,
) {
    match &outcome.decision.clone() {
        Decision::Undecided { .. } => {
            let most = clearly_below(outcome.rms, outcome, options);
            outcome.jump = changed(data, outcome, most, options);
            if outcome.jump.is_none() {
                outcome.readings = wrong_readings(data, outcome, options);
            }
        }
        Decision::Named(named)
            if named.evidence.ratio < options.pair_ratio
                || is_of_sizes(named)
                || is_of_rows(named) =>
        {
            let ratio = named.evidence.ratio;
            let most = clearly_below(named.evidence.best, outcome, options);
            let lost = || {
                let corrected = is_of_rows(named).then(|| apply_all(&named.correction, data))?;
                behind_outliers((data, &corrected), screened, outcome, options)
            };
            if let Some(found) = lost().or_else(|| changed(data, outcome, most, options)) {
                outcome.jump = Some(found);
                outcome.decision = undecided(None, ratio);
            } else if let Some(found) = better_than(named, data, outcome, options) {
                outcome.readings = Some(found);
                outcome.decision = undecided(None, ratio);
            }
        }
        // What looks like a gain of the whole joint may be a change of its zero at one row.
        Decision::Consistent { ratio, .. } => {
            if let Some(found) = behind_outliers((data, data), screened, outcome, options) {
                outcome.decision = undecided(None, *ratio);
                outcome.continuous = None;
                outcome.jump = Some(found);
                return;
            }
            if let Some(found) = &outcome.continuous {
                let whole = Scoped {
                    hypothesis: found.hypothesis,
                    scope: Scope::All,
                };
                let left = Scan::new(&apply(&whole, work), screened).none().rms;
                let most = clearly_below(left, outcome, options);
                let limit = outcome.expected.map_or(0.0, |e| e.limit);
                if outcome.rms > WITHIN_A_FIT * limit
                    && let Some(found) = changed(data, outcome, most, options)
                {
                    outcome.decision = undecided(None, *ratio);
                    outcome.continuous = None;
                    outcome.jump = Some(found);
                }
            }
        }
        _ => {}
    }
}

/// A change at one row, or rows that were lost there.
fn changed(data: &Data, outcome: &Outcome, most: f64, options: &Options) -> Option<Jump> {
    let moved = jump(data, outcome, most, options);
    match lost_rows(data, outcome, most) {
        Some(lost) if moved.as_ref().is_none_or(|m| lost.rms < m.rms) => Some(lost),
        _ => moved,
    }
}

/// Rows that were lost, where all that follow, or all before them once the others are paired, are outliers for that reason.
fn behind_outliers(
    (data, corrected): (&Data, &Data),
    screened: &[SampleIndex],
    outcome: &Outcome,
    options: &Options,
) -> Option<Jump> {
    let limit = outcome.expected?.limit;
    let of_all = (!screened.is_empty()).then(|| Scan::new(corrected, &[]).none().rms);
    let of_all = of_all.filter(|rms| *rms > limit)?;
    lost_rows(data, outcome, of_all / options.name_ratio.powi(2))
}

/// A zero, a gain or a share takes up much of a change at one row.
fn is_of_sizes(named: &Named) -> bool {
    named.correction.iter().any(|s| s.hypothesis.is_sized())
}

/// Rows that are lost in the middle of a recording make all later ones look shifted.
fn is_of_rows(named: &Named) -> bool {
    let mut all = named.correction.iter();
    all.any(|s| matches!(s.hypothesis, Hypothesis::RowShift { .. }))
}

/// What a change at one row may leave beside another explanation, m: less than that by the ratio that names a hypothesis, and than
/// the data as they are by that ratio twice.
fn clearly_below(other: f64, outcome: &Outcome, options: &Options) -> f64 {
    other.min(outcome.rms / options.name_ratio) / options.name_ratio
}

/// The joint whose readings are wrong, where that explains clearly more than the name, and most of them are off after the correction as well.
fn better_than(
    named: &Named,
    data: &Data,
    outcome: &Outcome,
    options: &Options,
) -> Option<WrongReadings> {
    let found = wrong_readings(data, outcome, options)?;
    let corrected = apply_all(&named.correction, data);
    let still = wrong_readings(&corrected, outcome, options)?;
    let clearly = found.rms * options.name_ratio <= named.evidence.best;
    (clearly && still.joint == found.joint && 2 * still.off >= still.rows).then_some(found)
}

/// Residual of the registration of the data as they are, rms, m: all samples count.
///
/// # Errors
/// [`DataError`] when the input contradicts itself.
pub fn registration_residual(data: &Data) -> Result<f64, DataError> {
    data.check()?;
    Ok(Scan::new(data, &[]).none().rms)
}

/// Ranks, looks for outliers under the leaders, and ranks again without them.
fn screened_ranking(data: &Data, candidates: &[Candidate]) -> (Ranking, Vec<SampleIndex>) {
    let mut screened = Vec::new();
    let mut ranking = Ranking::of(data, candidates, &screened);
    for _ in 0..SCREENINGS {
        let mut leaders: Vec<Correction> = vec![Vec::new()];
        leaders.extend(distinct(&ranking.scored, SCREENED_LEADERS).map(|s| vec![s.scoped]));
        let axes = Some(together(data, candidates, &ranking, &screened));
        leaders.extend(axes.filter(|axes| !axes.is_empty()));
        let found: Vec<Screened> = leaders
            .par_iter()
            .map(|leader| screen(data, leader))
            .collect();
        let found = found.into_iter().min_by(|a, b| a.scale.total_cmp(&b.scale));
        let Some(found) = found.filter(|f| f.matters && f.samples != screened) else {
            break;
        };
        screened = found.samples;
        ranking = Ranking::of(data, candidates, &screened);
    }
    (ranking, screened)
}

/// Hypotheses that fit the twin of correct data.
fn invisible(
    data: &Data,
    ranking: &Ranking,
    screened: &[SampleIndex],
    options: &Options,
) -> Vec<Scoped> {
    let near = |s: &&Scored| {
        let times = ratio(s.score.score, ranking.none.score);
        (1.0 / EQUIVALENT_WITHIN..=EQUIVALENT_WITHIN).contains(&times)
    };
    let close: Vec<Scoped> = ranking
        .scored
        .iter()
        .filter(near)
        .map(|s| s.scoped)
        .collect();
    let twin = twin(data, &[], screened);
    on_twin(&twin, &close, screened, options)
}

fn decide(asked: &Asked<'_>, outcome: &Outcome) -> Decision {
    let (ranking, options) = (asked.ranking, asked.options);
    let alarm = outcome.expected.is_some_and(|e| ranking.none.rms > e.limit);
    let best = ranking
        .scored
        .iter()
        .find(|s| !outcome.invisible.contains(&s.scoped));
    let best_ratio = best.map_or(1.0, |s| ranking.ratio(s.score.score));
    let consistent = Decision::Consistent {
        best: best.map(|s| s.scoped),
        ratio: best_ratio,
    };
    let few = few_samples(asked.data, asked.screened);
    let single = best.filter(|_| best_ratio >= options.name_ratio * few);
    let single = single.map(|best| asked.with_expected(asked.name(best)));
    // Ten times as large, what a small motion leaves is what a robot's errors do to one ten times as small.
    let single = single.filter(|named| !is_of_unit(named) || is_explained(named));
    // Two at once are a pair, where something stands out.
    let axes = several_axes(asked).map(|axes| asked.with_expected(axes));
    let better_than_pairs = |axes: &Named| match axes.correction.len() {
        2 => single.is_none() && !alarm,
        _ => name_pair(asked).is_none_or(|pair| axes.evidence.ratio >= pair.evidence.ratio),
    };
    let explains = |axes: &Named| axes.within_expected != Some(false) && axes.verified(options);
    if let Some(axes) = axes.filter(|axes| explains(axes) && better_than_pairs(axes)) {
        return Decision::Named(axes);
    }
    // A cloud of points in a wrong unit of length looks like a body on a link that does not move.
    let settled_by_residual = single
        .as_ref()
        .filter(|named| settled(named, options) && !maybe_unit(named, ranking));
    if let Some(named) = settled_by_residual
        && alarm
        && named.within_expected != Some(false)
    {
        return Decision::Named(named.clone());
    }
    // Errors of the robot within the priors would explain the residual, or do not explain what is left: they are asked.
    let against = match opinion(asked, single.as_ref(), &outcome.invisible) {
        Opinion::Likelier(named) => return Decision::Named(named),
        Opinion::Against if !alarm => return consistent,
        Opinion::Against => true,
        Opinion::Open => false,
    };
    // A frame of its own for a recording of few postures takes errors of the robot: where these explain all, nothing has moved.
    let is_frame = |named: &Named| {
        let mut scoped = named.correction.iter();
        scoped.all(|scoped| has_unknowns(&scoped.hypothesis))
    };
    if !alarm && single.as_ref().is_some_and(is_frame) && errors_explain(asked) {
        return consistent;
    }
    if let Some(named) = settled_by_residual.filter(|_| !against) {
        return Decision::Named(named.clone());
    }
    if single.is_none() && !alarm {
        return consistent;
    }
    let pair = name_pair(asked);
    let pair = pair.map(|pair| asked.with_expected(pair));
    let gain = |pair: &Named| {
        let single = single.as_ref().map_or(1.0, |s| s.evidence.ratio);
        pair.evidence.ratio / single
    };
    match pair {
        Some(pair) if gain(&pair) >= options.name_ratio && settled(&pair, options) => {
            Decision::Named(pair)
        }
        Some(pair) if gain(&pair) >= options.name_ratio => undecided(Some(pair), best_ratio),
        _ => match single {
            // No pair explains more: nominal errors beyond the priors are the likelier reason for what is left.
            Some(named) if named.verified(options) && !against => Decision::Named(named),
            single => undecided(single, best_ratio),
        },
    }
}

/// Nothing stands out after the correction, and nominal errors explain what is left, or the name is beyond doubt anyway.
fn settled(named: &Named, options: &Options) -> bool {
    named.verified(options) && is_explained(named)
}

/// Nominal errors explain what is left, or the name is beyond doubt anyway.
fn is_explained(named: &Named) -> bool {
    /// Wrong names among pairs of faults had ratios up to 3.5 and left more than nominal errors explain.
    const BEYOND_DOUBT: f64 = 5.0;
    named.within_expected != Some(false) || named.evidence.ratio >= BEYOND_DOUBT
}

fn is_of_unit(named: &Named) -> bool {
    let mut all = named.correction.iter();
    all.any(|s| matches!(s.hypothesis, Hypothesis::TrackerUnit { .. }))
}

/// The name is another link, and the unit of the tracker alone does nearly as well.
fn maybe_unit(named: &Named, ranking: &Ranking) -> bool {
    const NEARLY: f64 = 10.0;
    let link = named
        .correction
        .iter()
        .any(|s| matches!(s.hypothesis, Hypothesis::WrongLink { .. }));
    let unit = |s: &&Scored| matches!(s.scoped.hypothesis, Hypothesis::TrackerUnit { .. });
    let unit = ranking.scored.iter().find(unit);
    link && unit.is_some_and(|s| ranking.ratio(s.score.score) * NEARLY > named.evidence.ratio)
}

fn undecided(leading: Option<Named>, ratio: f64) -> Decision {
    Decision::Undecided { leading, ratio }
}

fn design(data: &Data) -> Design {
    let (moving, still): (Vec<JointIndex>, Vec<JointIndex>) = data
        .relevant_joints()
        .into_iter()
        .partition(|j| span(data, *j) > 1e-6);
    let (mut single, mut steps) = (0.0, 0.0);
    for i in 1..data.readings.len() {
        if data.recording[i] == data.recording[i - 1] {
            let moved = |j: &&JointIndex| {
                let at = |i: usize| data.readings[i][j.0].unwrap_or(0.0);
                (at(i) - at(i - 1)).abs() > 1e-6
            };
            steps += 1.0;
            single += if moving.iter().filter(moved).count() <= 1 {
                1.0
            } else {
                0.0
            };
        }
    }
    Design {
        moving,
        still,
        one_joint_steps: single / f64::max(steps, 1.0),
    }
}
