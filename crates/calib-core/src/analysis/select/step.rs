//! One step of the selection: what could be added, and which of it to try first.

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::analysis::compare::{mean_and_error, paired};
use crate::analysis::score::{Scored, Tested};
use crate::analysis::select::less::Less;
use crate::analysis::select::linear::{Beside, Extended, Fitted, Linear, Losses};
use crate::analysis::select::{Part, SelectionRule};

/// Differences of information criteria up to 2 decide nothing (Burnham & Anderson 2002).
pub(super) const EQUAL: f64 = 2.0;

/// A part with the columns that it adds.
#[derive(Debug, Clone)]
pub(super) struct Addition {
    /// Place among the parts.
    pub part: usize,
    pub columns: Vec<usize>,
}

/// A part that the score test asks for.
#[derive(Debug, Clone)]
pub(super) struct Candidate {
    pub part: usize,
    pub columns: Vec<usize>,
    pub tested: Tested,
    /// p after correction for what else was tested.
    pub p_corrected: f64,
    /// Losses per sample, each predicted from the others.
    pub losses: Losses,
    /// Mean loss that it saves, relative to that without it, and its standard error.
    pub gain: (f64, f64),
}

impl Tested {
    /// What χ² loses less what chance alone would take, 2 a parameter (Akaike).
    fn evidence(&self) -> f64 {
        self.chi2 - 2.0 * self.rank as f64
    }
}

impl Candidate {
    /// Whether the score test proposes it.
    pub(super) fn is_proposed(&self, rule: &SelectionRule) -> bool {
        self.p_corrected <= rule.significance
    }

    /// What χ² loses less what chance alone would take, 2 a parameter (Akaike).
    pub(super) fn evidence(&self) -> f64 {
        self.tested.evidence()
    }

    /// Whether a linearized fit predicts better with it.
    pub(super) fn predicts_better(&self) -> bool {
        self.gain.0 > self.gain.1
    }
}

/// How many parts were found before, and which probability counts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stage {
    pub found: usize,
    pub significance: f64,
    /// Parts that are looked at in every sample at most, those with the least probability by chance.
    pub most: usize,
}

impl Stage {
    /// Everything is looked at.
    pub(super) const ALL: Self = Self {
        found: 0,
        significance: 1.0,
        most: usize::MAX,
    };

    /// After so many parts were found.
    pub(super) fn after(found: usize, rule: &SelectionRule) -> Self {
        /// The best of so many by the sums is the best of all by the samples, but for the noise of both.
        const MOST: usize = 32;
        Self {
            found,
            significance: rule.significance,
            most: MOST,
        }
    }
}

/// Parts looked at in every sample although the score test does not ask for them: for the report.
const SHOWN: usize = 8;

/// Every part that can be tested and may be asked for, the smallest mean loss first, and how many could be tested.
pub(super) fn candidates(
    linear: &Linear<'_>,
    active: &[usize],
    additions: &[Addition],
    stage: Stage,
) -> Option<(Vec<Candidate>, usize)> {
    let fitted = linear.fit(active.to_vec())?;
    let tests = Tests::of(&fitted);
    // Without the samples: z² is at most what the sums say.
    let tested = tests.by_sums(additions).into_iter();
    let mut first: Vec<(f64, usize)> = tested.map(|(i, tested)| (tested.p_value, i)).collect();
    let count = first.len();
    // p m / (k + 1), k parts found before: the share of false ones stays the same (Benjamini & Hochberg 1995).
    let factor = count as f64 / (stage.found + 1) as f64;
    first.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let kept = first.iter().enumerate();
    let asked = |p: f64| p * factor <= stage.significance;
    let kept = kept.filter(|(place, (p, _))| *place < SHOWN || (*place < stage.most && asked(*p)));
    let looked_at: Vec<Addition> = kept.map(|(_, (_, i))| additions[*i].clone()).collect();
    let (beside, blocks) = blocks(&fitted, &looked_at);
    let Extended { base, with } = fitted.extended(&beside, &blocks);
    let mut out = Vec::new();
    for ((addition, block), (losses, clusters)) in looked_at.iter().zip(&blocks).zip(with) {
        let Some(tested) = tests.of_block(&beside, block, Some(&clusters)) else {
            continue;
        };
        out.push(Candidate {
            part: addition.part,
            columns: addition.columns.clone(),
            tested,
            p_corrected: (tested.p_value * factor).min(1.0),
            gain: relative(paired(&base, &losses), &base),
            losses,
        });
    }
    out.sort_by(|a, b| b.gain.0.total_cmp(&a.gain.0).then(a.part.cmp(&b.part)));
    Some((out, count))
}

/// Score tests beside one model.
struct Tests<'a> {
    fitted: &'a Fitted<'a>,
    excess: f64,
    samples: usize,
}

impl<'a> Tests<'a> {
    fn of(fitted: &'a Fitted<'a>) -> Self {
        Self {
            excess: fitted.excess(),
            samples: fitted.linear.samples.len(),
            fitted,
        }
    }

    /// `None` where a block cannot be tested, or a physical limit forbids it.
    fn of_block(
        &self,
        beside: &Beside,
        block: &[usize],
        clusters: Option<&DMatrix<f64>>,
    ) -> Option<Tested> {
        let (u, information, raw) = beside.part(block);
        if let &[place] = block {
            let change = -u[0] / information[(0, 0)];
            if !self.fitted.linear.allows(beside.columns[place], change) {
                return None;
            }
        }
        let scored = Scored {
            u: &u,
            information: &information,
            raw: &raw,
            clusters,
            excess: self.excess,
            samples: self.samples,
        };
        let mut tested = scored.test()?;
        tested.p_value = tail(tested.rank, tested.z2, self.samples);
        Some(tested)
    }

    /// What the sums alone say, by place among the additions.
    fn by_sums(&self, additions: &[Addition]) -> Vec<(usize, Tested)> {
        let (beside, blocks) = blocks(self.fitted, additions);
        let each = blocks.iter().enumerate();
        each.filter_map(|(i, block)| Some((i, self.of_block(&beside, block, None)?)))
            .collect()
    }
}

/// Evidence of each addition that can be tested, by place.
pub(super) fn evidence(fitted: &Fitted<'_>, additions: &[Addition]) -> Vec<(usize, f64)> {
    let tested = Tests::of(fitted).by_sums(additions).into_iter();
    tested.map(|(i, tested)| (i, tested.evidence())).collect()
}

/// What a model's predictions owe to some of its columns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Saved {
    pub part: usize,
    /// Mean loss that they save, relative to that without them, and its standard error.
    pub gain: (f64, f64),
}

impl Saved {
    /// Whether the model predicts better with them.
    pub(super) fn predicts_better(&self) -> bool {
        self.gain.0 > self.gain.1
    }
}

/// What each of these sets of a model's columns saves; those that cannot be tested are left out.
pub(super) fn saved(fitted: &Fitted<'_>, sets: &[Addition]) -> Vec<Saved> {
    let testable = |set: &Addition| {
        let less = fitted.less(&set.columns)?;
        let allowed = match set.columns[..] {
            [column] => fitted.linear.allows(column, less.moved[0]),
            _ => true,
        };
        (allowed && is_seen(&less)).then_some(less)
    };
    let less: Vec<Option<Less>> = sets.iter().map(testable).collect();
    let (with, without) = fitted.losses_without(&less);
    let each = sets.iter().zip(without).filter_map(|(set, without)| {
        let without = without?;
        Some(Saved {
            part: set.part,
            gain: relative(paired(&without, &with), &without),
        })
    });
    each.collect()
}

/// Whether the rest of the model does not imitate all of the columns.
fn is_seen(less: &Less) -> bool {
    let scored = Scored {
        u: &less.moved,
        information: &less.by_data,
        raw: &less.raw,
        clusters: None,
        excess: 1.0,
        samples: 1,
    };
    scored.test().is_some()
}

/// All columns of additions, and the places of each.
fn blocks(fitted: &Fitted<'_>, additions: &[Addition]) -> (Beside, Vec<Vec<usize>>) {
    let mut columns: Vec<usize> = additions.iter().flat_map(|a| a.columns.clone()).collect();
    columns.sort_unstable();
    columns.dedup();
    let place = |column: &usize| columns.binary_search(column).unwrap_or(0);
    let blocks = additions
        .iter()
        .map(|a| a.columns.iter().map(place).collect())
        .collect();
    (fitted.beside(columns.clone()), blocks)
}

fn relative((gain, error): (f64, f64), base: &[Option<f64>]) -> (f64, f64) {
    let (mean, _) = mean_and_error(&base.iter().filter_map(|l| *l).collect::<Vec<f64>>());
    let scale = if mean > 0.0 { 1.0 / mean } else { 0.0 };
    (gain * scale, error * scale)
}

/// Probability of so large a z² by chance: F(r, n − r), since what is tested against is found from n samples.
fn tail(rank: usize, z2: f64, samples: usize) -> f64 {
    let freedom = samples.saturating_sub(rank).max(1) as f64;
    let rank = rank as f64;
    FisherSnedecor::new(rank, freedom).map_or(1.0, |f| f.sf(z2 / rank))
}

/// Places, among `proposed`, of those that explain what the first explains: they predict alike, and nothing is left for them once the
/// first is in the model.
pub(super) fn alternatives(
    linear: &Linear<'_>,
    active: &[usize],
    proposed: &[&Candidate],
    rule: &SelectionRule,
) -> Vec<usize> {
    let Some((first, others)) = proposed.split_first() else {
        return Vec::new();
    };
    let alike: Vec<usize> = (1..=others.len())
        .filter(|&i| {
            let (worse, error) = paired(&proposed[i].losses, &first.losses);
            worse <= error
        })
        .collect();
    if alike.is_empty() {
        return alike;
    }
    let with = joined(active, &first.columns);
    let rest: Vec<Addition> = alike
        .iter()
        .map(|&i| Addition {
            part: i,
            columns: without(&proposed[i].columns, &with),
        })
        .filter(|a| !a.columns.is_empty())
        .collect();
    let again = candidates(linear, &with, &rest, Stage::ALL);
    let again = again.map_or_else(Vec::new, |(found, _)| found);
    let still = |i: usize| {
        let found = again.iter().find(|c| c.part == i);
        found.is_some_and(|c| c.tested.p_value <= rule.significance && c.predicts_better())
    };
    alike.into_iter().filter(|&i| !still(i)).collect()
}

/// Columns that are not among `known`, which is sorted.
pub(super) fn without(columns: &[usize], known: &[usize]) -> Vec<usize> {
    let new = columns.iter().filter(|c| known.binary_search(c).is_err());
    new.copied().collect()
}

/// What can be added to a model with these columns.
pub(super) fn additions(columns_of: &[Vec<usize>], active: &[usize]) -> Vec<Addition> {
    let each = columns_of
        .iter()
        .enumerate()
        .map(|(part, columns)| Addition {
            part,
            columns: without(columns, active),
        });
    let mut out: Vec<Addition> = each.filter(|a| !a.columns.is_empty()).collect();
    // What is left of a group may be one of its members.
    let mut seen: Vec<Vec<usize>> = Vec::new();
    out.retain(|a| {
        let new = !seen.contains(&a.columns);
        if new {
            seen.push(a.columns.clone());
        }
        new
    });
    out
}

/// The part to try first: the one that predicts best, or of those that explain the same the one with the most evidence, or a simpler or
/// more common one with as much; and the others.
pub(super) fn simplest<'a>(
    linear: &Linear<'_>,
    active: &[usize],
    proposed: &[&'a Candidate],
    parts: &[Part],
    rule: &SelectionRule,
) -> Option<(&'a Candidate, Vec<usize>)> {
    let mut alike: Vec<&Candidate> = vec![*proposed.first()?];
    let others = alternatives(linear, active, proposed, rule);
    alike.extend(others.into_iter().map(|i| proposed[i]));
    let most = alike.iter().map(|c| c.evidence()).fold(f64::MIN, f64::max);
    let order = |c: &&&Candidate| (c.columns.len(), parts[c.part].place, c.part);
    let equal = alike.iter().filter(|c| c.evidence() >= most - EQUAL);
    let chosen = *equal.min_by_key(order)?;
    let rest = alike.iter().filter(|c| c.part != chosen.part);
    Some((chosen, rest.map(|c| c.part).collect()))
}

/// Both, sorted.
fn joined(a: &[usize], b: &[usize]) -> Vec<usize> {
    let mut both: Vec<usize> = a.iter().chain(b).copied().collect();
    both.sort_unstable();
    both.dedup();
    both
}
