//! A winner with what its design cannot tell from it, and what is left after it.

use super::apply::{apply, apply_all};
use super::candidates::Candidate;
use super::data::Data;
use super::expected::expected;
use super::hypothesis::{Hypothesis, Scoped};
use super::ids::SampleIndex;
use super::mirror::sign_patterns;
use super::outcome::{Correction, Evidence, Named, Options};
use super::ranking::{Ranking, ratio};
use super::scan::{Scan, Scored};
use super::score::score;
use super::twin::twin;

/// Only hypotheses with a residual up to this many times the winner's can be equivalent to it: equivalents differ by what
/// the nominal errors do to them.
pub(super) const EQUIVALENT_WITHIN: f64 = 1.5;

/// The hypotheses that fit a twin exactly.
pub(super) fn on_twin(
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

/// The data with their ranking, and how they are judged.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    pub data: &'a Data,
    pub candidates: &'a [Candidate],
    pub ranking: &'a Ranking,
    pub screened: &'a [SampleIndex],
    pub options: &'a Options,
}

impl Asked<'_> {
    /// A single hypothesis by name.
    pub fn name(&self, best: &Scored) -> Named {
        let (ranking, options) = (self.ranking, self.options);
        let near = ranking.scored.iter().filter(|s| s.scoped != best.scoped);
        let near = near.filter(|s| ratio(s.score.score, best.score.score) < EQUIVALENT_WITHIN);
        let close: Vec<Scoped> = near.map(|s| s.scoped).collect();
        let twin = twin(self.data, &[best.scoped], self.screened);
        let equivalent = on_twin(&twin, &close, self.screened, options);
        let others = || {
            ranking
                .scored
                .iter()
                .filter(|s| s.scoped != best.scoped && !equivalent.contains(&s.scoped))
        };
        let times = |s: &Scored| ratio(s.score.score, best.score.score);
        // A frame of its own takes up errors of the robot, which one place of a joint does not.
        let is_frame = best.scoped.hypothesis.is_frame();
        let nearly = |s: &Scored| match s.scoped.hypothesis {
            Hypothesis::StoodAt { .. } if is_frame => options.name_ratio,
            h if is_frame && h.is_sized() => options.name_ratio,
            _ => options.runner_up_ratio,
        };
        let corrected = apply(&best.scoped, self.data);
        let mirrored = self.like_a_mirror(&best.scoped, &twin);
        Named {
            correction: vec![best.scoped],
            alternatives: others()
                .filter(|s| times(s) < nearly(s))
                .map(|s| (vec![s.scoped], times(s)))
                .collect(),
            evidence: Evidence {
                none: ranking.none.rms,
                best: best.score.rms,
                next: others().next().map(|s| s.left_beside(best)),
                ratio: ranking.ratio(best.score.score),
            },
            left: self.left(&corrected),
            equivalent: equivalent
                .into_iter()
                .map(|s| vec![s])
                .chain(mirrored)
                .collect(),
            within_expected: None,
            allowing: None,
        }
    }

    /// Signs of several joints that a mirrored tracker is not distinguished from.
    fn like_a_mirror(&self, best: &Scoped, twin: &Data) -> Vec<Correction> {
        if best.hypothesis != Hypothesis::Mirrored {
            return Vec::new();
        }
        let fits = |correction: &Correction| {
            let corrected = apply_all(correction, twin);
            Scan::new(&corrected, self.screened).none().rms < self.options.twin_tolerance
        };
        let patterns = sign_patterns(self.data, best.scope);
        patterns.into_iter().filter(fits).collect()
    }

    /// By how much the best further hypothesis divides the residual of corrected data.
    pub fn left(&self, corrected: &Data) -> f64 {
        let next = Ranking::of(corrected, self.candidates, self.screened);
        let first = next.scored.first();
        first.map_or(1.0, |s| next.ratio(s.score.score))
    }

    /// Compares what is left with what nominal errors explain.
    pub fn with_expected(&self, mut named: Named) -> Named {
        let corrected = apply_all(&named.correction, self.data);
        named.within_expected = expected(&corrected, self.screened, self.options)
            .map(|e| named.evidence.best <= e.limit);
        named
    }
}
