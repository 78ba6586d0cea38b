//! Two mistakes at once: each of the leading hypotheses with every other.

use nalgebra::Vector3;

use super::apply::{apply, apply_all};
use super::hypothesis::{Hypothesis, Scoped};
use super::naming::{Asked, EQUIVALENT_WITHIN};
use super::outcome::{Correction, Evidence, Named};
use super::ranking::{Ranking, distinct, few_samples, ratio};
use super::scan::{Scan, Score};
use super::sized;
use super::twin::twin;

/// Lengths in another unit differ by a factor of 2.5 at least, and leave more than this part of the motion when robot and tracker are laid over each other.
const OF_MOTION: f64 = 0.3;

/// Two corrections, with the residual after both.
struct Pair {
    correction: Correction,
    score: Score,
}

/// The best pair: each of the leading hypotheses with every other.
pub(super) fn name_pair(asked: &Asked<'_>) -> Option<Named> {
    let Asked {
        data,
        candidates,
        ranking,
        screened,
        options,
    } = *asked;
    let shows_unit = ranking.none.rms > OF_MOTION * motion(&Scan::new(data, screened));
    let mut pairs: Vec<Pair> = Vec::new();
    for leader in distinct(&ranking.scored, options.beam) {
        let first = apply(&leader.scoped, data);
        // Where one size is corrected, the others are estimated again.
        let again = (leader.scoped.hypothesis.is_sized())
            .then(|| sized::again(candidates, &first, screened, options));
        let candidates = again.as_deref().unwrap_or(candidates);
        // Densities multiply: the second score is relative to the data after the first correction.
        let scale = leader.score.score / leader.score.rms.max(f64::MIN_POSITIVE);
        for second in Ranking::of(&first, candidates, screened)
            .scored
            .into_iter()
            .take(20)
        {
            let of_unit = [&leader.scoped, &second.scoped].map(is_of_unit);
            if undoes(&leader.scoped, &second.scoped) || (!shows_unit && of_unit.contains(&true)) {
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
        left: asked.left(&apply_all(&best.correction, data)),
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
        allowing: None,
    })
}

fn is_of_unit(scoped: &Scoped) -> bool {
    matches!(scoped.hypothesis, Hypothesis::TrackerUnit { .. })
}

/// How far the points move about their own middle, rms, m.
fn motion(scan: &Scan<'_>) -> f64 {
    let count = scan.channels.len().max(1);
    let (mut squares, mut all) = (0.0, 0.0);
    for channel in 0..count {
        let rows = || {
            let rows = scan.points.iter().zip(&scan.weights);
            rows.skip(channel).step_by(count)
        };
        let weight: f64 = rows().map(|(_, w)| w).sum();
        if weight > 0.0 {
            let mean = rows().map(|(p, w)| p * *w).sum::<Vector3<f64>>() / weight;
            squares += rows()
                .map(|(p, w)| w * (p - mean).norm_squared())
                .sum::<f64>();
            all += weight;
        }
    }
    (squares / f64::max(all, f64::MIN_POSITIVE)).sqrt()
}

/// A correction and the one that takes it back.
fn undoes(first: &Scoped, second: &Scoped) -> bool {
    let same_kind =
        std::mem::discriminant(&first.hypothesis) == std::mem::discriminant(&second.hypothesis);
    // Two shifts of rows leave fewer rows, and nothing else.
    let own = matches!(
        first.hypothesis,
        Hypothesis::TrackerMoved | Hypothesis::Remounted { .. } | Hypothesis::RowShift { .. }
    );
    first == second || (same_kind && own)
}
