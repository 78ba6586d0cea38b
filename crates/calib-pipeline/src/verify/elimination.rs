//! Which of several causes explain the residuals, each beside the others.
//!
//! Causes are taken one after another, the one that stands out most beside those taken so far; then each that explains nothing
//! beside the others is given up, and each is exchanged for one that stands out more in its place. One mistake leaves traces in the tests of many effects, and of changes: beside the cause they vanish.

use calib_core::Contest;

/// Fall of T from that of a cause within which another explains the data as well in its place (log-likelihood difference 3).
const AS_GOOD: f64 = 6.0;
/// What each further direction takes of T by chance, and once more.
const PER_DIRECTION: f64 = 2.0;

/// A cause of which the data are asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Asked {
    /// T that chance does not reach.
    pub least: f64,
    /// Share of what the others leave that it explains at least.
    pub share: f64,
    /// Part of a cause's T from which it is as good in its place.
    pub part: f64,
    /// Share of the cost that it leaves by being linearized: what explains less beside it may be no more than that.
    pub linearized: f64,
}

/// The causes that hold, with what is as good in the place of each.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Held {
    /// Numbers of the causes, the first taken first.
    pub causes: Vec<usize>,
    /// For each of them: others that explain the data as well in its place.
    pub alike: Vec<Vec<usize>>,
}

/// The one of `count` that is not among `taken` and has the most, where that is above 0.
fn most(count: usize, taken: &[usize], has: impl Fn(usize) -> f64) -> Option<usize> {
    let all = (0..count).filter(|k| !taken.contains(k));
    let found = all
        .map(|k| (k, has(k)))
        .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
    found.filter(|(_, most)| *most > 0.0).map(|(k, _)| k)
}

/// Takes and gives up causes.
pub(super) fn eliminated(contest: &Contest, asked: &[Asked]) -> Held {
    // By how much T exceeds what is asked; nothing where it explains too little.
    let excess = |one: usize, beside: &[usize]| {
        let (score, directions) = contest.score(one, beside);
        let with: Vec<usize> = beside.iter().copied().chain([one]).collect();
        let (before, after) = (contest.explains(beside), contest.explains(&with));
        let share = (after - before) / (1.0 - before).max(f64::MIN_POSITIVE);
        let linearized = beside.iter().map(|k| asked[*k].linearized);
        let is_real = linearized.fold(0.0, f64::max) < after - before;
        match directions > 0 && share > asked[one].share && is_real {
            true => score - asked[one].least,
            false => f64::NEG_INFINITY,
        }
    };
    let others = |all: &[usize], but: usize| -> Vec<usize> {
        all.iter().copied().filter(|k| *k != but).collect()
    };
    let mut causes: Vec<usize> = Vec::new();
    // A step of a body can hide that several effects together explain it: each cause is also tried against those left out.
    for _ in 0..asked.len() {
        while let Some(next) = most(asked.len(), &causes, |k| excess(k, &causes)) {
            causes.push(next);
        }
        let least = |causes: &[usize]| {
            let all = causes.iter().map(|k| (*k, excess(*k, &others(causes, *k))));
            all.min_by(|a, b| a.1.total_cmp(&b.1))
        };
        while let Some((worst, _)) = least(&causes).filter(|(_, excess)| *excess <= 0.0) {
            causes.retain(|k| *k != worst);
        }
        let better = causes.iter().find_map(|own| {
            let rest = others(&causes, *own);
            let now = excess(*own, &rest);
            let next = most(asked.len(), &causes, |k| excess(k, &rest))?;
            (excess(next, &rest) > now).then_some((*own, next))
        });
        let Some((own, next)) = better else { break };
        causes.retain(|k| *k != own);
        causes.push(next);
    }
    let alike = |&own: &usize| -> Vec<usize> {
        let rest = others(&causes, own);
        let of = |k: usize| {
            let (score, directions) = contest.score(k, &rest);
            score - PER_DIRECTION * directions.saturating_sub(1) as f64
        };
        let best = of(own);
        let good = |k: &usize| of(*k) > (best - AS_GOOD).min(asked[*k].part * best).max(0.0);
        let all = (0..asked.len()).filter(|k| !causes.contains(k));
        all.filter(good).collect()
    };
    let alike = causes.iter().map(alike).collect();
    Held { causes, alike }
}
