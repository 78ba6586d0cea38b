//! Did something move while the data were taken? Score tests of a step, an even drift, a warm-up and a scale against the fitted model.
//!
//! Candidates: everything seen at one frame (a body that slipped), the measuring frame (a tracker that was bumped), one
//! joint (an encoder that slipped). B holds the columns ∂e/∂c of a candidate for the samples of a range S and 0 elsewhere:
//!
//! ```text
//! U = Σ_{s∈S} B̃ᵀ w,   E = Σ_{s∈S} Aᵀ B̃,   I = Σ_{s∈S} B̃ᵀB̃ − Eᵀ C E + P,   B̃ = L⁻¹B           (1)
//! Δ = Uᵀ I⁻¹ U,   T = N ln(F / (F − Δ)),   ĉ = −I⁻¹ U,   cov ĉ = I⁻¹                              (2)
//! ```
//!
//! F is the minimum of the cost, N the count of rows, w, A, L and C those of the fit, P a wide prior that keeps jumps
//! finite where nothing shows them. T, unlike Δ, does not depend on the stated level of the noise. Sums over ranges
//! are differences of cumulative sums: the cost is linear in the samples. S is the end of one recording from some sample on,
//! with other recordings as a whole on either side, because the order in which recordings were made is not certain; the order of the samples is taken for
//! it where that explains the data nearly as well.
//!
//! With few samples a change is taken for noise of the joints or of the bodies: the level of that noise is then chosen again with each
//! change (`levels`).
//!
//! How large T becomes by chance over all ranges is simulated from the model. Candidates have up to six columns, so
//! every T counts from its own quantile of that simulation; the largest excess is compared with the quantile of the
//! largest excess. What one joint that scatters more than the others explains is no change (`scatter`), nor is what successive samples share
//! (`dependent`). Physics that is missing in the model and follows the order of the samples, as in sweeps of one joint after another, can still look like
//! a change: [`Solution::goodness_of_fit`] says whether it explains more.

mod chance;
pub(crate) mod columns;
pub(crate) mod contest;
mod dependent;
mod exact;
mod levels;
mod scatter;
mod sums;
mod together;

use std::cmp::Ordering;
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::analysis::solution::Solution;
use crate::graph::ids::{EdgeId, FrameId};
pub use chance::ChanceOfChanges;
use chance::{Scope, every, thinned};
use columns::Candidates;
use dependent::{Seen, in_blocks};
use exact::{Scanned, turned};
use levels::{Best, Levels, Tests};
pub use scatter::{BesideScatter, Left, Scatter};
use sums::{Design, LEAST};
use together::{asked_more, leave_what_is_simpler};

/// What may have moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Moved {
    /// Everything that is measured at this frame, by a step; jumps `[ω; v]` in its axes about the middle of its markers, or the origin of a measured
    /// pose.
    Body(FrameId),
    /// The measuring frame, by a step; jumps `[ω; v]` in its axes about the middle of what it sees.
    Reference(FrameId),
    /// The zero of a joint, by a step, rad or m.
    Joint(EdgeId),
    /// The zeros of all joints, each by a step of its own, as where a robot was homed; rad or m, in the order of [`Change::joints`].
    Zeros,
    /// The measuring frame, evenly over the samples; `[ω; v]` from first to last.
    Drift(FrameId),
    /// The measuring frame, fast at first and slower later, as what warms up; `[ω; v]` from first to last.
    Settling(FrameId),
    /// The lengths that the measuring frame reports, throughout; a ratio.
    Scale(FrameId),
}

/// How a scan is made.
///
/// Non-exhaustive: start from [`ChangeSettings::default`] and change what differs.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ChangeSettings {
    /// First sample of every recording but the first.
    pub borders: Vec<usize>,
    /// Simulated data sets for the threshold.
    pub draws: usize,
    /// Chance that clean data exceed the threshold anywhere.
    pub level: f64,
    /// Seed of the simulation.
    pub seed: u64,
    /// What [`Solution::chance_of_changes`] gave for data from the same postures and markers with the same noise, in place of a simulation; not looked at where
    /// the candidates, the count of samples or the levels of the noise show that it is not the same.
    pub known: Option<ChanceOfChanges>,
}

impl Default for ChangeSettings {
    fn default() -> Self {
        Self {
            borders: Vec::new(),
            // 200: the threshold then varies by about 1 in T.
            draws: 200,
            // The simulation takes the estimated noise levels for true: 0.3 % asked was 1.4 % of clean data got, and warnings of all
            // kinds together are to stay below 1 %.
            level: 0.001,
            seed: 1,
            known: None,
        }
    }
}

/// The best range of one candidate.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Change {
    /// What may have moved.
    pub moved: Moved,
    /// First sample after the change.
    pub first: usize,
    /// End of the recording that it lies in: one past its last used sample.
    pub end: usize,
    /// First samples of other recordings that lie after the change; those that are not listed lie before it.
    pub also: Vec<usize>,
    /// T of equation (2).
    pub score: f64,
    /// T less its quantile under the model: what candidates are compared by.
    pub excess: f64,
    /// Share of the cost that the change would remove.
    pub explains: f64,
    /// ĉ of equation (2).
    pub jump: Vec<f64>,
    /// The joints whose steps the jump holds; empty for what is no step of joints.
    pub joints: Vec<EdgeId>,
    /// Its standard deviations, for noise as found and the memory that successive samples show beside it.
    pub sigma: Vec<f64>,
}

/// The outcome of a scan.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ChangeScan {
    /// The best range of every candidate, most significant first.
    pub changes: Vec<Change>,
    /// Excess that clean data do not reach but with the stated chance.
    pub threshold: f64,
    /// F / N of equation (2).
    pub cost_per_row: f64,
    /// The rows that the fit rejected were scanned as well.
    pub with_rejected: bool,
    /// The joint that scatters more than the others, where that explains the data better; looked for where something seems to have changed.
    pub scatter: Option<Scatter>,
}

impl ChangeScan {
    /// The most significant change, where chance does not explain it.
    #[must_use]
    pub fn significant(&self) -> Option<&Change> {
        self.changes.first().filter(|c| c.excess > self.threshold)
    }

    /// Changes of something else that explain the data nearly as well as the most significant one.
    #[must_use]
    pub fn rivals(&self) -> Vec<&Change> {
        /// Twice the log-likelihood ratio of 20 : 1.
        const DISTINCT: f64 = 6.0;
        let Some(best) = self.significant() else {
            return Vec::new();
        };
        let others = self.changes.iter().skip(1);
        let is_alike = |c: &&Change| {
            let excess = c.excess + asked_more(c.moved);
            excess > best.excess - DISTINCT && excess > self.threshold
        };
        others.filter(is_alike).collect()
    }
}

/// A change leaves the cost per row of the rows that the fit kept, times this, where it is why the others were rejected.
const EXPLAINED: f64 = 1.5;

/// No memory of a tracker looks like a turn by more than this, rad, and what is left of one without linearization looks like memory.
const FAR: f64 = 0.05;

/// Candidates that the memory of successive rows is found beside, the most significant ones; it costs about what the scan does.
const ASKED: usize = 3;

/// Ranges begin and end at so many samples at most; the best range is then refined to the sample.
const EDGES: usize = 384;

impl Solution {
    /// Scans the samples of the fit for changes. `None` where the model cannot be evaluated, where fewer than
    /// six samples were used, and where the fit [leaves too little](Solution::is_testable).
    ///
    /// A robust fit rejects the rows on the shorter side of a large jump, and what is left shows none. Where most rows at an end of a recording were
    /// rejected, they are scanned as well; a change that leaves no more of them than of the others is why they did not fit.
    #[must_use]
    pub fn changes(&self, settings: &ChangeSettings) -> Option<ChangeScan> {
        if !self.is_testable() {
            return None;
        }
        let kept = self.scan(settings)?;
        let beside = |at: &Self, scan| at.beside_scatter(scan, &settings.borders);
        let all = self.with_rejected(settings);
        let Some((all, scan)) = all.and_then(|all| all.scan(settings).map(|scan| (all, scan)))
        else {
            return Some(beside(self, kept));
        };
        let explained = |change: &Change| {
            scan.cost_per_row * (1.0 - change.explains) < EXPLAINED * kept.cost_per_row
        };
        Some(if scan.significant().is_some_and(explained) {
            ChangeScan {
                with_rejected: true,
                ..beside(&all, scan)
            }
        } else {
            beside(self, kept)
        })
    }

    /// The same solution with the rejected observations, where they may have been rejected for a change.
    fn with_rejected(&self, settings: &ChangeSettings) -> Option<Self> {
        let model = &self.model;
        let rejected = |s: usize| {
            let mut observations = model.of_sample[s].clone();
            !model.is_held_out(s) && observations.any(|o| self.weights[o] == 0.0)
        };
        let rejected: Vec<bool> = (0..model.problem.samples).map(rejected).collect();
        let mut starts = vec![0];
        starts.extend(settings.borders.iter().copied());
        starts.push(rejected.len());
        let mut parts = starts.windows(2).map(|w| &rejected[w[0].min(w[1])..w[1]]);
        if !parts.any(|part| mostly(part.iter()) || mostly(part.iter().rev())) {
            return None;
        }
        let mut out = self.clone();
        for (o, observation) in model.observations.iter().enumerate() {
            if !model.is_held_out(observation.sample) {
                out.weights[o] = 1.0;
            }
        }
        Some(out)
    }

    /// Places the best change among all samples, and gives those that may be the cause the size that they have without linearization.
    fn refine(
        &self,
        changes: &mut [(usize, Change)],
        found: &[Option<Best>],
        coarse: &Scanned<'_>,
        chance: &ChanceOfChanges,
    ) {
        /// What explains less than this part of what the best one does to first order is not the cause.
        const PART: f64 = 0.25;
        let least = changes.first().map_or(0.0, |(_, c)| PART * c.explains);
        for (place, (k, change_of)) in changes.iter_mut().enumerate() {
            let Some(best) = &found[*k] else { continue };
            // A finer look finds a larger T, by chance too.
            if change_of.excess <= chance.threshold {
                continue;
            }
            let quantile = chance.quantiles[*k];
            let near = match place {
                0 => self.near(coarse, *k, best),
                _ => None,
            };
            if let Some(near) = &near {
                let design = near.scanned(coarse).design;
                *change_of = change((coarse.candidates, *k), &near.best, design, quantile);
            }
            if change_of.excess <= chance.threshold || change_of.explains < least {
                continue;
            }
            let exact = match &near {
                Some(near) => self.exact_step(&near.scanned(coarse), *k, &near.best, quantile),
                None => self.exact_step(coarse, *k, best, quantile),
            };
            if let Some(exact) = exact {
                *change_of = exact;
            }
        }
        changes.sort_by(by_excess);
    }

    /// Where something seems to have changed: the chance of that under the memory of the noise. How many times as large the variance of what was asked is.
    fn raise_for_memory(
        &self,
        changes: &mut [(usize, Change)],
        found: &[Option<Best>],
        scanned: &Scanned<'_>,
        chance: &mut ChanceOfChanges,
    ) -> BTreeMap<usize, f64> {
        let without = chance.clone();
        let mut memory = BTreeMap::new();
        let mut least = f64::INFINITY;
        while let Some((k, first)) = changes.first()
            && first.excess > chance.threshold
            && let Some(best) = found[*k].as_ref().filter(|best| best.level == 0)
            && turned(&first.joints, &best.found.jump, self) < FAR
            && !memory.contains_key(k)
        {
            // Each is asked beside itself: a change is no memory, and is one beside another.
            let seen = Seen {
                scanned,
                candidate: *k,
                found: &best.found,
            };
            let k = seen.candidate;
            let factor = if memory.len() < ASKED {
                self.memory_beside_change(&seen)
            } else {
                least
            };
            least = least.min(factor);
            let blocks = self.memory_in_blocks(&seen, &without);
            let largest = without.quantiles[k] + without.threshold;
            let under = blocks.iter().map(|of| in_blocks(largest, *of));
            let under = under.fold(factor * largest, f64::max);
            memory.insert(k, blocks.iter().fold(factor, |most, (m, _)| most.max(*m)));
            if first.score > under {
                // It stands out beside memory as well; others are compared with it as without.
                break;
            }
            chance.quantiles[k] = chance.quantiles[k].max(under - chance.threshold);
            for (k, change) in changes.iter_mut() {
                change.excess = change.score - chance.quantiles[*k];
            }
            changes.sort_by(by_excess);
        }
        memory
    }

    /// The chance of changes in data such as those of the fit, from all draws: for scans of other data from the same postures, markers and noise.
    /// `None` as for [`changes`](Self::changes).
    #[must_use]
    pub fn chance_of_changes(&self, settings: &ChangeSettings) -> Option<ChanceOfChanges> {
        let candidates = Candidates::new(self);
        let used = self.looked_at().samples;
        if !self.is_testable() || used.len() < 2 * LEAST || candidates.list.is_empty() {
            return None;
        }
        let edges = every(&used, used.len().div_ceil(EDGES));
        let levels = Levels::new(self, &candidates, &used, &edges, &settings.borders)?;
        self.chance_by(&candidates, (&levels, &levels.tests()), None, settings)
    }

    /// Draws from what was scanned, or with many samples from fewer of them.
    fn chance_by(
        &self,
        candidates: &Candidates,
        (levels, tests): (&Levels, &Tests),
        seen: Option<&[f64]>,
        settings: &ChangeSettings,
    ) -> Option<ChanceOfChanges> {
        let (used, borders) = (self.looked_at().samples, &settings.borders);
        let thin = thinned(&used, borders);
        // With few samples the scan itself is small enough to be simulated.
        let scope = scope(candidates, &used, levels);
        if thin.len() == used.len() {
            let of = (levels, tests);
            return Some(ChanceOfChanges::simulate(scope, of, seen, settings));
        }
        let fewer = Levels::of(Design::new(self, candidates, &thin, &thin, borders)?);
        let of = (&fewer, &fewer.tests());
        Some(ChanceOfChanges::simulate(scope, of, seen, settings))
    }

    fn scan(&self, settings: &ChangeSettings) -> Option<ChangeScan> {
        let candidates = Candidates::new(self);
        let borders = &settings.borders;
        let used = self.looked_at().samples;
        if used.len() < 2 * LEAST || candidates.list.is_empty() {
            return None;
        }
        let stride = used.len().div_ceil(EDGES);
        let edges = every(&used, stride);
        let levels = Levels::new(self, &candidates, &used, &edges, borders)?;
        let design = &levels.designs[0];
        let tests = levels.tests();
        let found = levels.best_that_lasted(&tests, &levels.seen());
        let seen: Vec<f64> = found
            .iter()
            .map(|f| f.as_ref().map_or(0.0, |f| f.score))
            .collect();
        let scope = scope(&candidates, &used, &levels);
        let known = settings.known.as_ref();
        let known = known.filter(|known| known.holds_for(&scope));
        let simulate = || self.chance_by(&candidates, (&levels, &tests), Some(&seen), settings);
        let mut chance = known.cloned().or_else(simulate)?;
        let mut changes: Vec<(usize, Change)> = Vec::new();
        for (k, found) in found.iter().enumerate() {
            if let Some(found) = found {
                let (quantile, at) = (chance.quantiles[k], &levels.designs[found.level]);
                changes.push((k, change((&candidates, k), found, at, quantile)));
            }
        }
        changes.sort_by(by_excess);
        let scanned = Scanned {
            candidates: &candidates,
            samples: &used,
            edges: &edges,
            borders,
            design,
        };
        let memory = self.raise_for_memory(&mut changes, &found, &scanned, &mut chance);
        self.refine(&mut changes, &found, &scanned, &chance);
        for (k, change) in &mut changes {
            let wider = memory.get(k).map_or(1.0, |memory| memory.sqrt());
            change.sigma.iter_mut().for_each(|sigma| *sigma *= wider);
        }
        leave_what_is_simpler(&mut changes);
        Some(ChangeScan {
            changes: changes.into_iter().map(|(_, c)| c).collect(),
            threshold: chance.threshold,
            cost_per_row: design.cost / design.rows,
            with_rejected: false,
            scatter: None,
        })
    }
}

fn scope(candidates: &Candidates, used: &[usize], levels: &Levels) -> Scope {
    Scope {
        moved: candidates.list.iter().map(|c| c.moved).collect(),
        samples: used.len(),
        levels: levels.designs.len(),
    }
}

/// The most significant first.
fn by_excess((_, a): &(usize, Change), (_, b): &(usize, Change)) -> Ordering {
    b.excess.total_cmp(&a.excess).then(a.moved.cmp(&b.moved))
}

/// Whether most of the first few were rejected, and so many that a step can be told.
fn mostly<'a>(rejected: impl Iterator<Item = &'a bool>) -> bool {
    let mut count = 0;
    for (place, rejected) in rejected.enumerate() {
        count += usize::from(*rejected);
        if count >= LEAST && 2 * count > place + 1 {
            return true;
        }
    }
    false
}

fn change(
    (candidates, k): (&Candidates, usize),
    best: &Best,
    design: &Design,
    quantile: f64,
) -> Change {
    let Best { found, score, .. } = best;
    let (first, end) = design.samples_of(&found.after);
    // Noise as found: s² = (F − Δ) / ν. N would make the jumps of ten poses look three times as certain as they are.
    let s2 = (design.cost - found.gain) / design.freedom(found.jump.len());
    Change {
        moved: candidates.list[k].moved,
        joints: candidates.joints_of(k),
        first,
        end,
        also: design.also(&found.after),
        score: *score,
        excess: score - quantile,
        explains: found.gain / design.cost,
        jump: found.jump.clone(),
        sigma: found
            .variance
            .iter()
            .map(|v| (v * s2.max(0.0)).sqrt())
            .collect(),
    }
}
