//! Hypotheses ranked by the residual of the best registration.

use super::candidates::Candidate;
use super::data::Data;
use super::ids::SampleIndex;
use super::scan::{Scan, Score, Scored};
use super::score::score;

/// A hypothesis with a residual of this many times that of the data as they are explains nothing: a bound of it will do.
const BEYOND: f64 = 2.0;
/// The same in m, where the data are free of noise.
const LEAST_BEYOND: f64 = 1e-4;
/// Residuals that agree to this are those of one and the same correction.
const SAME: f64 = 1e-6;

/// Hypotheses ranked on the same samples.
pub(super) struct Ranking {
    pub none: Score,
    pub scored: Vec<Scored>,
}

impl Ranking {
    pub fn of(data: &Data, candidates: &[Candidate], screened: &[SampleIndex]) -> Self {
        let scan = Scan::new(data, screened);
        let none = scan.none();
        let enough = (BEYOND * none.rms).max(LEAST_BEYOND);
        let mut scored = score(&scan, candidates, enough);
        scored.retain(|s| s.score.score.is_finite());
        scored.sort_by(|a, b| a.score.score.total_cmp(&b.score.score));
        Self { none, scored }
    }

    /// These hypotheses and those of another ranking of the same data.
    pub fn with(&self, other: Self) -> Self {
        let mut scored = self.scored.clone();
        scored.extend(other.scored);
        scored.sort_by(|a, b| a.score.score.total_cmp(&b.score.score));
        let none = self.none;
        Self { none, scored }
    }

    pub fn ratio(&self, score: f64) -> f64 {
        ratio(self.none.score, score)
    }
}

/// `none / best`, finite: residuals under a micrometer, less than any tracker resolves, count as one.
pub(super) fn ratio(none: f64, best: f64) -> f64 {
    const FLOOR: f64 = 1e-6;
    none.max(FLOOR) / best.max(FLOOR)
}

/// The best hypotheses, one of each group with the same residual.
pub(super) fn distinct(scored: &[Scored], count: usize) -> impl Iterator<Item = &Scored> {
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

/// How many times larger than with many samples a ratio must be.
pub(super) fn few_samples(data: &Data, screened: &[SampleIndex]) -> f64 {
    let (_, freedom) = Scan::new(data, screened).freedom();
    least_ratio(freedom)
}

/// With few degrees of freedom ν the best of hundreds of hypotheses gains by chance: the ratios asked for grow by 1 + 4/ν.
pub(super) fn least_ratio(freedom: f64) -> f64 {
    const CHANCE: f64 = 4.0;
    1.0 + CHANCE / freedom.max(1.0)
}
