//! The decision: rank, screen, name, verify.

use super::apply::{apply, apply_all};
use super::candidates::{Candidate, candidates, span};
use super::continuous;
use super::data::{Data, DataError};
use super::expected::expected;
use super::hypothesis::{Hypothesis, Scope, Scoped};
use super::ids::{JointIndex, SampleIndex};
use super::outcome::{Correction, Decision, Design, Evidence, Named, Options, Outcome};
use super::scan::{Scan, Score, Scored};
use super::score::score;
use super::screen::screen;
use super::thinning::thinned;
use super::twin::twin;

/// Degrees of freedom below which the residual of a registration says nothing. One marker in six poses has nine, and six where
/// the rows are shifted by one: with a gross outlier among them that was named by chance.
const LEAST_FREEDOM: f64 = 10.0;
/// Rounds of screening: the set settles in one or two.
const SCREENINGS: usize = 3;
/// Leaders under which outliers are looked for, beside the data as they are.
const SCREENED_LEADERS: usize = 5;
/// Only hypotheses with a residual up to this many times the winner's can be equivalent to it: equivalents differ by what
/// the nominal errors do to them.
const EQUIVALENT_WITHIN: f64 = 1.5;
/// A hypothesis with a residual of this many times that of the data as they are explains nothing: a bound of it will do.
const BEYOND: f64 = 2.0;
/// The same in m, where the data are free of noise.
const LEAST_BEYOND: f64 = 1e-4;
/// Residuals that agree to this are those of one and the same correction.
const SAME: f64 = 1e-6;

/// Hypotheses ranked on the same samples.
struct Ranking {
    none: Score,
    scored: Vec<Scored>,
}

impl Ranking {
    fn of(data: &Data, candidates: &[Candidate], screened: &[SampleIndex]) -> Self {
        let scan = Scan::new(data, screened);
        let none = scan.none();
        let enough = (BEYOND * none.rms).max(LEAST_BEYOND);
        let mut scored = score(&scan, candidates, enough);
        scored.retain(|s| s.score.score.is_finite());
        scored.sort_by(|a, b| a.score.score.total_cmp(&b.score.score));
        Self { none, scored }
    }

    fn ratio(&self, score: f64) -> f64 {
        ratio(self.none.score, score)
    }
}

/// `none / best`, finite: residuals under a micrometer, less than any tracker resolves, count as one.
fn ratio(none: f64, best: f64) -> f64 {
    const FLOOR: f64 = 1e-6;
    none.max(FLOOR) / best.max(FLOOR)
}

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
    if freedom < LEAST_FREEDOM {
        outcome.decision = Decision::TooFewData { freedom };
        return Ok(outcome);
    }
    let mut candidates = candidates(work);
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
    let (ranking, screened) = screened_ranking(work, &candidates);
    outcome.rms = ranking.none.rms;
    outcome.expected = expected(work, &screened, options);
    if options.list_invisible {
        outcome.invisible = invisible(work, &ranking, &screened, options);
    }
    outcome.decision = decide(work, &candidates, &ranking, &screened, &outcome, options);
    let correction = match &outcome.decision {
        Decision::Named(named)
        | Decision::Undecided {
            leading: Some(named),
            ..
        } => named.correction.clone(),
        _ => Vec::new(),
    };
    if options.score_tests {
        outcome.continuous =
            continuous::continuous(&apply_all(&correction, work), &screened, options);
    }
    outcome.screened = screened
        .iter()
        .map(|s| SampleIndex {
            row: rows[s.row],
            ..*s
        })
        .collect();
    Ok(outcome)
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
        let found = leaders
            .iter()
            .map(|leader| screen(data, leader))
            .min_by(|a, b| a.scale.total_cmp(&b.scale));
        let Some(found) = found.filter(|f| f.matters && f.samples != screened) else {
            break;
        };
        screened = found.samples;
        ranking = Ranking::of(data, candidates, &screened);
    }
    (ranking, screened)
}

/// The best hypotheses, one of each group with the same residual.
fn distinct(scored: &[Scored], count: usize) -> impl Iterator<Item = &Scored> {
    let mut last = f64::NEG_INFINITY;
    scored
        .iter()
        .filter(move |s| {
            let new = s.score.score > last * (1.0 + SAME) || last < 0.0;
            last = s.score.score;
            new
        })
        .take(count)
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

/// The hypotheses that fit a twin exactly.
fn on_twin(
    twin: &Data,
    hypotheses: &[Scoped],
    screened: &[SampleIndex],
    options: &Options,
) -> Vec<Scoped> {
    let scan = Scan::new(twin, screened);
    let list: Vec<Candidate> = hypotheses
        .iter()
        .map(|s| (s.hypothesis, vec![s.scope]))
        .collect();
    let fits = score(&scan, &list, f64::INFINITY)
        .into_iter()
        .filter(|s| s.score.score < options.twin_tolerance);
    fits.map(|s| s.scoped).collect()
}

fn decide(
    data: &Data,
    candidates: &[Candidate],
    ranking: &Ranking,
    screened: &[SampleIndex],
    outcome: &Outcome,
    options: &Options,
) -> Decision {
    let alarm = outcome.expected.is_some_and(|e| ranking.none.rms > e.limit);
    let best = ranking
        .scored
        .iter()
        .find(|s| !outcome.invisible.contains(&s.scoped));
    let best_ratio = best.map_or(1.0, |s| ranking.ratio(s.score.score));
    let few = few_samples(data, screened);
    let single = best.filter(|_| best_ratio >= options.name_ratio * few);
    let single = single.map(|best| name_single(data, candidates, ranking, best, screened, options));
    let single = single.map(|named| with_expected(named, screened, data, options));
    if let Some(named) = single.as_ref().filter(|named| settled(named, options)) {
        // A cloud of points in a wrong unit of length looks like a body on a link that does not move.
        if !maybe_unit(named, ranking) {
            return Decision::Named(named.clone());
        }
    }
    if single.is_none() && !alarm {
        return Decision::Consistent {
            best: best.map(|s| s.scoped),
            ratio: best_ratio,
        };
    }
    let pair = name_pair(data, candidates, ranking, screened, options);
    let pair = pair.map(|pair| with_expected(pair, screened, data, options));
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
            Some(named) if named.verified(options) => Decision::Named(named),
            single => undecided(single, best_ratio),
        },
    }
}

/// Nothing stands out after the correction, and nominal errors explain what is left, or the name is beyond doubt anyway.
fn settled(named: &Named, options: &Options) -> bool {
    /// Wrong names among pairs of faults had ratios up to 3.5 and left more than nominal errors explain.
    const BEYOND_DOUBT: f64 = 5.0;
    let explained = named.within_expected != Some(false) || named.evidence.ratio >= BEYOND_DOUBT;
    named.verified(options) && explained
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

/// With few degrees of freedom ν the best of hundreds of hypotheses gains by chance: the ratios asked for grow by 1 + 4/ν.
fn few_samples(data: &Data, screened: &[SampleIndex]) -> f64 {
    const CHANCE: f64 = 4.0;
    let (_, freedom) = Scan::new(data, screened).freedom();
    1.0 + CHANCE / freedom.max(1.0)
}

fn undecided(leading: Option<Named>, ratio: f64) -> Decision {
    Decision::Undecided { leading, ratio }
}

/// Compares what is left with what nominal errors explain.
fn with_expected(
    mut named: Named,
    screened: &[SampleIndex],
    data: &Data,
    options: &Options,
) -> Named {
    let corrected = apply_all(&named.correction, data);
    named.within_expected =
        expected(&corrected, screened, options).map(|e| named.evidence.best <= e.limit);
    named
}

fn name_single(
    data: &Data,
    candidates: &[Candidate],
    ranking: &Ranking,
    best: &Scored,
    screened: &[SampleIndex],
    options: &Options,
) -> Named {
    let near = ranking.scored.iter().filter(|s| s.scoped != best.scoped);
    let near = near.filter(|s| ratio(s.score.score, best.score.score) < EQUIVALENT_WITHIN);
    let close: Vec<Scoped> = near.map(|s| s.scoped).collect();
    let twin = twin(data, &[best.scoped], screened);
    let equivalent = on_twin(&twin, &close, screened, options);
    let others = || {
        ranking
            .scored
            .iter()
            .filter(|s| s.scoped != best.scoped && !equivalent.contains(&s.scoped))
    };
    let times = |s: &Scored| ratio(s.score.score, best.score.score);
    let corrected = apply(&best.scoped, data);
    Named {
        correction: vec![best.scoped],
        alternatives: others()
            .map(|s| (vec![s.scoped], times(s)))
            .take_while(|s| s.1 < options.runner_up_ratio)
            .collect(),
        evidence: Evidence {
            none: ranking.none.rms,
            best: best.score.rms,
            next: others().next().map(|s| s.score.rms),
            ratio: ranking.ratio(best.score.score),
        },
        left: left(&corrected, candidates, screened),
        equivalent: equivalent.into_iter().map(|s| vec![s]).collect(),
        within_expected: None,
    }
}

/// By how much the best further hypothesis divides the residual of corrected data.
fn left(corrected: &Data, candidates: &[Candidate], screened: &[SampleIndex]) -> f64 {
    let next = Ranking::of(corrected, candidates, screened);
    next.scored
        .first()
        .map_or(1.0, |s| next.ratio(s.score.score))
}

/// Two corrections, with the residual after both.
struct Pair {
    correction: Correction,
    score: Score,
}

/// The best pair: each of the leading hypotheses with every other.
fn name_pair(
    data: &Data,
    candidates: &[Candidate],
    ranking: &Ranking,
    screened: &[SampleIndex],
    options: &Options,
) -> Option<Named> {
    let mut pairs: Vec<Pair> = Vec::new();
    for leader in distinct(&ranking.scored, options.beam) {
        let first = apply(&leader.scoped, data);
        // Densities multiply: the second score is relative to the data after the first correction.
        let scale = leader.score.score / leader.score.rms.max(f64::MIN_POSITIVE);
        for second in Ranking::of(&first, candidates, screened)
            .scored
            .into_iter()
            .take(20)
        {
            if undoes(&leader.scoped, &second.scoped) {
                continue;
            }
            let score = Score {
                rms: second.score.rms,
                score: second.score.score * scale,
            };
            pairs.push(Pair {
                correction: vec![leader.scoped, second.scoped],
                score,
            });
        }
    }
    pairs.sort_by(|a, b| a.score.score.total_cmp(&b.score.score));
    let best = pairs.first().filter(|p| {
        ranking.ratio(p.score.score) >= options.pair_ratio * few_samples(data, screened)
    })?;
    let twin = twin(data, &best.correction, screened);
    let times = |p: &Pair| ratio(p.score.score, best.score.score);
    let (mut equivalent, mut alternatives, mut next) = (Vec::new(), Vec::new(), None);
    for pair in pairs[1..]
        .iter()
        .take_while(|p| times(p) < EQUIVALENT_WITHIN)
    {
        let same_set = pair.correction.iter().all(|s| best.correction.contains(s));
        let corrected = apply_all(&pair.correction, &twin);
        let fits = same_set || Scan::new(&corrected, screened).none().rms < options.twin_tolerance;
        if fits && !same_set {
            equivalent.push(pair.correction.clone());
        } else if !fits {
            next = next.or(Some(pair.score.rms));
            if times(pair) < options.runner_up_ratio {
                alternatives.push((pair.correction.clone(), times(pair)));
            }
        }
    }
    Some(Named {
        left: left(&apply_all(&best.correction, data), candidates, screened),
        evidence: Evidence {
            none: ranking.none.rms,
            best: best.score.rms,
            next,
            ratio: ranking.ratio(best.score.score),
        },
        correction: best.correction.clone(),
        equivalent,
        alternatives,
        within_expected: None,
    })
}

/// A correction and the one that takes it back.
fn undoes(first: &Scoped, second: &Scoped) -> bool {
    let same_kind =
        std::mem::discriminant(&first.hypothesis) == std::mem::discriminant(&second.hypothesis);
    let own = matches!(
        first.hypothesis,
        Hypothesis::TrackerMoved | Hypothesis::Remounted { .. }
    );
    first == second || (same_kind && own)
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
