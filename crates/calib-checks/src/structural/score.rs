//! Scores of all candidates.

use rayon::prelude::*;

use super::candidates::Candidate;
use super::hypothesis::{Hypothesis, Scope, Scoped};
use super::scan::{Scan, Score, Scored};
use super::special;

/// A frame or a mount of a recording's own takes up nominal errors: clean sweeps in recordings of their own gained up to 2.
/// Such a hypothesis must gain this many times as much as others, 3 instead of 1.5.
const OWN_FRAME: f64 = 2.0;

/// Every hypothesis in every scope that is allowed for it; beyond `enough`, m, a lower bound of the residual will do.
pub(crate) fn score(scan: &Scan<'_>, candidates: &[Candidate], enough: f64) -> Vec<Scored> {
    let of_candidate = |(hypothesis, scopes): &Candidate| {
        let mut scored: Vec<Scored> = match hypothesis {
            Hypothesis::TrackerMoved | Hypothesis::MissingColumn { .. } => scopes
                .iter()
                .map(|scope| estimated(scan, hypothesis, *scope))
                .collect(),
            _ => scan.score(hypothesis, scopes, enough),
        };
        if matches!(
            hypothesis,
            Hypothesis::TrackerMoved | Hypothesis::Remounted { .. }
        ) {
            scored.iter_mut().for_each(|s| s.score.score *= OWN_FRAME);
        }
        scored
    };
    let scored: Vec<Vec<Scored>> = candidates.par_iter().map(of_candidate).collect();
    scored.into_iter().flatten().collect()
}

/// A hypothesis that estimates something of its own.
fn estimated(scan: &Scan<'_>, hypothesis: &Hypothesis, scope: Scope) -> Scored {
    let scoped = Scoped {
        hypothesis: *hypothesis,
        scope,
    };
    let fit = scan.fit_corrected(&special::apply(&scoped, scan.data));
    let score = match hypothesis {
        Hypothesis::MissingColumn { .. } => penalized(scan, scope, fit.score),
        _ => fit.score,
    };
    Scored { scoped, score }
}

/// One estimated reading per row: the degrees of freedom that are left are fewer.
fn penalized(scan: &Scan<'_>, scope: Scope, score: Score) -> Score {
    let inside = |r: &&super::ids::RecordingIndex| scope.contains(**r);
    let rows = scan.data.recording.iter().filter(inside).count() as f64;
    let (_, freedom) = scan.freedom();
    let left = (freedom - rows) / freedom.max(1.0);
    let factor = if left > 0.1 {
        left.sqrt().recip()
    } else {
        f64::INFINITY
    };
    Score {
        rms: score.rms * factor,
        score: score.score * factor,
    }
}
