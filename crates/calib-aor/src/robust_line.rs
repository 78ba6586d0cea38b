//! A common line for circles with outliers: least trimmed squares, then a gate by chance.
//!
//! ```text
//! d² = (h − h_p)² + (ρ − r_p)²           h along the line, ρ its distance; h_p, r_p: medians of marker p      (1)
//! minimize Σ of the ⌈¾ n⌉ least d²        from seeded subsets            (Rousseeuw & Van Driessen 1999)
//! rejected where P(F(2, ν) > d²/2σ²) < 0.01/n,   then the line of maximum likelihood of the others
//! ```
//!
//! Up to a quarter of the samples may be anywhere. Of clean recordings one in a hundred loses a sample.

use calib_estimator::{
    EstimatorError, Input, InputKind, Options, Verdict, chance::f_tail, cloud_of, measured::Cloud,
};
use calib_geometry::statistics;

use crate::{
    circles::{Axis, Free, minimize_line},
    judge::{judge, prepare},
    line_ml::common_line,
    options::{EstimatorInfo, RANDOM},
    outcome::{AorEstimate, Known, Outcome},
    plane,
};

/// What `robust_line` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "robust_line",
    name: "common line with outliers",
    input: InputKind::Points,
    options: RANDOM,
    summary: "least trimmed squares over random subsets, then maximum likelihood of the samples that belong",
    source: "Rousseeuw & Van Driessen 1999",
    fit,
};

const ID: &str = "robust_line";
/// Fewest samples in which an outlier shows, for each marker; one circle has six unknowns.
const FEWEST: usize = 8;
/// Part of the samples that are taken for good at first.
const GOOD: f64 = 0.75;
/// Samples of a subset, for each marker: three determine a circle.
const SUBSET: usize = 4;
/// Rounds of refitting to the least residuals, and of rejecting.
const ROUNDS: usize = 10;
/// Subsets that are followed to their end.
const FOLLOWED: usize = 8;
/// Probability that a clean recording loses a sample.
const FAMILYWISE: f64 = 0.01;
/// Median of χ²(2).
const MEDIAN: f64 = 1.386;

/// The line that most samples share.
///
/// # Errors
/// [`EstimatorError`] for data that are non-finite or of another kind.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let cloud = cloud_of(input, options)?;
    if let Err(answer) = prepare(ID, &cloud) {
        return Ok(answer);
    }
    let keep = kept(&cloud, options);
    let left = cloud.select(&keep);
    let factor = match prepare(ID, &left) {
        Ok(factor) => factor,
        Err(answer) => return Ok(answer),
    };
    let Some(candidate) = common_line(ID, &left, &factor) else {
        return Ok(Outcome::none(
            ID,
            Verdict::Diverged,
            "the estimate diverged: the arcs of the circles are straight within the noise".into(),
            Known::Nothing,
        ));
    };
    let mut rejected: Vec<usize> = (0..keep.len())
        .filter(|&k| !keep[k])
        .map(|k| cloud.labels[k].1)
        .collect();
    rejected.sort_unstable();
    rejected.dedup();
    Ok(match judge(&left, &factor, candidate, options) {
        Outcome::Estimate(e) => Outcome::Estimate(Box::new(AorEstimate { rejected, ..*e })),
        none @ Outcome::NotObservable(_) => none,
    })
}

/// The samples that belong.
fn kept(cloud: &Cloud, options: &Options) -> Vec<bool> {
    let n = cloud.points.len();
    let all = vec![true; n];
    if n < FEWEST * cloud.markers() {
        return all;
    }
    let Some(mut keep) = trimmed(cloud, options) else {
        return all;
    };
    for _ in 0..ROUNDS {
        let Some(squares) = squares_of(cloud, &keep) else {
            return all;
        };
        let next = within(&squares, &keep, cloud.markers());
        if next.iter().filter(|k| **k).count() < n / 2 {
            return all;
        }
        if next == keep {
            break;
        }
        keep = next;
    }
    keep
}

/// The samples of least trimmed squares; `None` where no subset has a line.
fn trimmed(cloud: &Cloud, options: &Options) -> Option<Vec<bool>> {
    let n = cloud.points.len();
    let good = (GOOD * n as f64).ceil() as usize;
    let least = |squares: &[f64]| -> (f64, Vec<bool>) {
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| squares[*a].total_cmp(&squares[*b]));
        let mut keep = vec![false; n];
        let sum = order[..good].iter().map(|&k| squares[k]).sum();
        order[..good].iter().for_each(|&k| keep[k] = true);
        (sum, keep)
    };
    let mut state = options.seed;
    let mut starts = vec![vec![true; n]];
    starts.extend((0..options.subsets).map(|_| subset(cloud, &mut state)));
    let mut found: Vec<(f64, Vec<bool>)> = starts
        .iter()
        .filter_map(|keep| Some(least(&squares_of(cloud, keep)?)))
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(FOLLOWED);
    for best in &mut found {
        for _ in 0..ROUNDS {
            match squares_of(cloud, &best.1).map(|squares| least(&squares)) {
                Some(next) if next.0 < best.0 => *best = next,
                _ => break,
            }
        }
    }
    let best = found.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, keep)| keep)
}

/// Some samples of every marker, the same on every machine (SplitMix64, Steele, Lea & Flood 2014).
fn subset(cloud: &Cloud, state: &mut u64) -> Vec<bool> {
    let mut keep = vec![false; cloud.points.len()];
    for p in 0..cloud.markers() {
        let range = cloud.range(p);
        let wanted = SUBSET.min(range.len());
        let mut chosen = 0;
        while chosen < wanted {
            *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = *state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            let k = range.start + ((z ^ (z >> 31)) % range.len() as u64) as usize;
            chosen += usize::from(!std::mem::replace(&mut keep[k], true));
        }
    }
    keep
}

/// (1) of every sample about the line of those that are kept.
fn squares_of(cloud: &Cloud, keep: &[bool]) -> Option<Vec<f64>> {
    let left = cloud.select(keep);
    if left.markers() < cloud.markers() {
        return None;
    }
    let factor = prepare(ID, &left).ok()?;
    let start = plane::start(&left, &factor, &Options::default());
    let (axis, _) = minimize_line(&left, start, Free::Line, factor.s[0])?;
    let axis = Axis {
        point: axis.point + left.origin - cloud.origin,
        ..axis
    };
    let mut squares = vec![0.0; cloud.points.len()];
    for p in 0..cloud.markers() {
        let places: Vec<[f64; 2]> = cloud
            .marker(p)
            .iter()
            .map(|x| {
                let d = x - axis.point;
                let h = d.dot(&axis.frame.n);
                [h, (d - axis.frame.n * h).norm()]
            })
            .collect();
        let middle = [0, 1].map(|k| median(cloud.range(p), |i| places[i][k], keep));
        for (k, place) in cloud.range(p).zip(&places) {
            let off = [place[0] - middle[0], place[1] - middle[1]];
            squares[k] = (off[0] * off[0] + off[1] * off[1]) * cloud.weight(k);
        }
    }
    Some(squares)
}

/// Median over the kept samples of a marker; `of` counts from its first.
fn median(range: std::ops::Range<usize>, of: impl Fn(usize) -> f64, keep: &[bool]) -> f64 {
    let first = range.start;
    // The mean of the middle two: heights change their sign with the direction.
    let values = range.filter(|&k| keep[k]).map(|k| of(k - first));
    statistics::median(values.collect()).unwrap_or(0.0)
}

/// The samples that are no surprise for the noise of those that are kept.
fn within(squares: &[f64], keep: &[bool], markers: usize) -> Vec<bool> {
    let n = squares.len();
    let kept: Vec<f64> = (0..n).filter(|&k| keep[k]).map(|k| squares[k]).collect();
    let freedom = (2.0 * kept.len() as f64 - 4.0 - 2.0 * markers as f64).max(1.0);
    let middle = statistics::upper_median(&mut squares.to_vec()).unwrap_or(0.0);
    // Those of least squares show too little noise: the median of all bears a half of them wrong.
    let mean = kept.iter().sum::<f64>() / freedom;
    let variance = (middle / MEDIAN).max(mean).max(f64::MIN_POSITIVE);
    squares
        .iter()
        .map(|d2| f_tail(d2 / 2.0 / variance, 2.0, freedom) * n as f64 >= FAMILYWISE)
        .collect()
}
