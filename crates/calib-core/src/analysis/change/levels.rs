//! A scan under several levels of the noise from pose to pose.
//!
//! T and the reasons for it: `less_noise`. With one level T is that of the scan.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::columns::Candidates;
use super::sums::{Design, Found, Test, score};
use crate::analysis::less_noise::{Level, profiled};
use crate::analysis::solution::Solution;

/// Designs of the same samples, the one at the noise that was found first.
pub(super) struct Levels {
    pub designs: Vec<Design>,
    /// Σ ln|V| + ln|H| of each.
    log_dets: Vec<f64>,
}

/// By level and by candidate.
pub(super) type Tests = Vec<Vec<Vec<Test>>>;

/// The best change of a candidate.
pub(super) struct Best {
    pub found: Found,
    /// Number of its design.
    pub level: usize,
    /// T.
    pub score: f64,
}

/// What residuals give under one design: F, and U of every candidate.
pub(super) struct Drawn {
    pub cost: f64,
    pub u: Vec<DMatrix<f64>>,
}

impl Levels {
    /// At the level that was found, and with few samples at lower ones.
    pub fn new(
        solution: &Solution,
        candidates: &Candidates,
        samples: &[usize],
        edges: &[usize],
        borders: &[usize],
    ) -> Option<Self> {
        let own = Design::new(solution, candidates, samples, edges, borders)?;
        let mut out = Self::of(own);
        let lower = solution.with_less_noise(samples.len());
        let designs: Vec<Option<Design>> = lower
            .par_iter()
            .map(|lower| Design::new(lower, candidates, samples, edges, borders))
            .collect();
        for design in designs {
            let design = design?;
            out.log_dets.push(log_det(&design)?);
            out.designs.push(design);
        }
        Some(out)
    }

    /// One level.
    pub fn of(design: Design) -> Self {
        Self {
            log_dets: log_det(&design).into_iter().collect(),
            designs: vec![design],
        }
    }

    /// The tests of every candidate, by level.
    pub fn tests(&self) -> Tests {
        let of = |design: &Design| {
            let candidates = (0..design.columns.len()).into_par_iter();
            candidates.map(|k| design.tests(k)).collect()
        };
        self.designs.iter().map(of).collect()
    }

    /// The residuals as they are.
    pub fn seen(&self) -> Vec<Drawn> {
        let of = |design: &Design| Drawn {
            cost: design.cost,
            u: design.u.clone(),
        };
        self.designs.iter().map(of).collect()
    }

    /// The best change of every candidate, for residuals that gave these sums.
    pub fn best(&self, tests: &Tests, drawn: &[Drawn]) -> Vec<Option<Best>> {
        let count = self.designs[0].columns.len();
        (0..count).map(|k| self.best_of(k, tests, drawn)).collect()
    }

    /// The same, each one that lasted where that explains the data nearly as well: as much as chance could add to others.
    pub fn best_that_lasted(&self, tests: &Tests, drawn: &[Drawn]) -> Vec<Option<Best>> {
        /// Twice the log-likelihood ratio of 20 : 1.
        const NEARLY: f64 = 6.0;
        let best = self.best(tests, drawn).into_iter().enumerate();
        let that_lasted = |k: usize, best: &Best| {
            let level = best.level;
            let u = &drawn[level].u[k];
            let found = self.designs[level].best_in_order(k, &tests[level][k], u)?;
            let score = self.score(level, drawn, found.gain);
            // How clear it is that something changed does not depend on when.
            (score > best.score - NEARLY).then_some(Best {
                found,
                level,
                score: best.score,
            })
        };
        best.map(|(k, best)| {
            let best = best?;
            Some(that_lasted(k, &best).unwrap_or(best))
        })
        .collect()
    }

    fn best_of(&self, k: usize, tests: &Tests, drawn: &[Drawn]) -> Option<Best> {
        let levels = self.designs.iter().enumerate();
        let found = levels.filter_map(|(level, design)| {
            let own = &drawn[level];
            let found = design.best(k, &tests[level][k], &own.u[k])?;
            let score = self.score(level, drawn, found.gain);
            Some(Best {
                found,
                level,
                score,
            })
        });
        found.max_by(|a, b| a.score.total_cmp(&b.score))
    }

    fn score(&self, level: usize, drawn: &[Drawn], gain: f64) -> f64 {
        let first = &self.designs[0];
        if self.designs.len() == 1 {
            return score(first.rows, drawn[0].cost, gain);
        }
        let pairs = drawn.iter().zip(&self.log_dets);
        let levels: Vec<Level> = pairs
            .map(|(own, &log_det)| Level {
                cost: own.cost,
                log_det,
            })
            .collect();
        profiled(first.freedom(0), &levels, level, gain)
    }
}

/// Σ ln|V| + ln|H|.
fn log_det(design: &Design) -> Option<f64> {
    let of_covariance: f64 = design.root.diagonal().iter().map(|x| 2.0 * x.ln()).sum();
    of_covariance
        .is_finite()
        .then_some(design.log_det - of_covariance)
}
