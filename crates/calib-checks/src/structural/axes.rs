//! Axes of several joints at once: a macro of a URDF writes the same mistake into every finger or leg, and correcting one of five leaves most of the residual.
//!
//! ```text
//! one joint after the other: the axis that leaves least, while it divides the residual by 1.05 (1 + 4/ν)
//! named where together they divide it by 5 (1 + 4/ν), and by 1.5 times more than any single hypothesis
//! ```

use super::apply::{apply, apply_all};
use super::candidates::Candidate;
use super::data::Data;
use super::hypothesis::Hypothesis;
use super::ids::SampleIndex;
use super::naming::Asked;
use super::outcome::{Correction, Evidence, Named};
use super::ranking::{Ranking, few_samples};
use super::scan::{Scan, Scored};

/// One of ten limbs that are alike divides the residual by 1.054.
const EACH: f64 = 1.05;
/// What several must divide the residual by: they are chosen from many.
const TOGETHER: f64 = 5.0;
/// More joints than this are another robot.
const MOST: usize = 12;

/// The axes of two or more joints that leave least together; none where one is enough, or no axis explains anything.
pub(super) fn together(
    data: &Data,
    candidates: &[Candidate],
    ranking: &Ranking,
    screened: &[SampleIndex],
) -> Correction {
    let each = EACH * few_samples(data, screened);
    let is_axis = |h: &Hypothesis| matches!(h, Hypothesis::Axis { .. });
    let mut correction: Correction = Vec::new();
    let mut scored = ranking.scored.iter();
    let of_one = scored.find(|s| is_axis(&s.scoped.hypothesis));
    let explains = |s: &Scored, before: f64| each * s.score.score <= before;
    let first = of_one.filter(|s| explains(s, ranking.none.score));
    let Some(mut next) = first.copied() else {
        return correction;
    };
    let axes = candidates.iter().filter(|c| is_axis(&c.0));
    let mut axes: Vec<Candidate> = axes.cloned().collect();
    let mut left = data.clone();
    while correction.len() < MOST {
        left = apply(&next.scoped, &left);
        axes.retain(|c| joint_of(&c.0) != joint_of(&next.scoped.hypothesis));
        correction.push(next.scoped);
        let before = next.score.score;
        let ranking = Ranking::of(&left, &axes, screened);
        match ranking.scored.first().filter(|s| explains(s, before)) {
            Some(best) => next = *best,
            None => break,
        }
    }
    match correction.len() {
        1 => Vec::new(),
        _ => correction,
    }
}

fn joint_of(hypothesis: &Hypothesis) -> Option<usize> {
    match *hypothesis {
        Hypothesis::Axis { joint, .. } => Some(joint.0),
        _ => None,
    }
}

/// The axes of several joints by name, where they explain far more than any single hypothesis.
pub(super) fn several_axes(asked: &Asked<'_>) -> Option<Named> {
    let Asked {
        data,
        candidates,
        ranking,
        screened,
        options,
    } = *asked;
    let correction = together(data, candidates, ranking, screened);
    if correction.is_empty() {
        return None;
    }
    let corrected = apply_all(&correction, data);
    let after = Scan::new(&corrected, screened).none();
    let single = ranking.scored.first();
    let single = single.map_or(1.0, |s| ranking.ratio(s.score.score));
    let ratio = ranking.ratio(after.score);
    let least = TOGETHER * few_samples(data, screened);
    (ratio >= least.max(options.name_ratio * single)).then(|| Named {
        left: asked.left(&corrected),
        evidence: Evidence {
            none: ranking.none.rms,
            best: after.rms,
            next: None,
            ratio,
        },
        correction,
        equivalent: Vec::new(),
        alternatives: Vec::new(),
        within_expected: None,
        allowing: None,
    })
}
