//! The frame of a joint by maximum likelihood of the poses that belong: gross errors are found and rejected.
//!
//! ```text
//! d_i² = w_i (|u_i|² / s_t² + |φ_i|² / s_r²)   u, φ: residuals of pose i in position and in orientation      (1)
//! choose: of the frames of random subsets those with the least  ln med |u|² + ln med |φ|²                   (2)
//! trim:   the frame of the three quarters with the least d², until (2) no longer falls                      (3)
//! keep:   n P(F(6, ν) ≥ d_i²/6) ≥ 1 %  about the frame of the kept poses, until they stay the same        (4)
//! ```
//!
//! s² is the larger of what the median of all poses and what the kept ones show, so that wrong poses do not widen it and the
//! trimming does not narrow it. The answer is [`crate::frame_ml`]'s on the kept poses; where none is rejected it is the same to
//! the last digit. Of fewer than eight poses none is rejected, nor where more than a third would be, nor where the residuals have no
//! gap: a joint whose angles do not belong to the motion is no gross error of rows, and the verdict says so.

use calib_estimator::{EstimatorError, FrameSample, Input, InputKind, Options, chance::f_tail};

use calib_geometry::statistics::upper_median;
use nalgebra::Vector3;

use crate::{
    frame::{FrameEstimate, FrameOutcome, squares},
    frame_ml::{self, Residuals},
    options::{FRAMED_RANDOM, FrameInfo},
};

/// What `robust_frame` is and needs.
pub(crate) const INFO: FrameInfo = FrameInfo {
    id: "robust_frame",
    name: "both axes by maximum likelihood, with outliers",
    input: InputKind::TwoJoints,
    options: FRAMED_RANDOM,
    summary: "least trimmed squares over random subsets, then frame_ml of the poses that belong",
    source: "Rousseeuw & Van Driessen 1999",
    fit,
};

const ID: &str = "robust_frame";
/// Fewest poses in which a gross error shows: the frame has 12 unknowns, and two good poses determine it.
const FEWEST: usize = 8;
/// Part of the poses that are taken for good at first.
const GOOD: f64 = 0.75;
/// Part of the poses that must be left: more than a third of wrong poses is not gross errors of rows.
const LEFT: f64 = 2.0 / 3.0;
/// Poses of a subset: two are the least, five rarely leave an axis still.
const SUBSET: usize = 5;
/// Gross errors stand apart: of all poses this part at the most may be rejected and yet belong at [`WIDER`] times the noise.
const NEAR: f64 = 0.05;
/// A gross error is more than twice as far off as the noise reaches.
const WIDER: f64 = 2.0;
/// Subsets, at the most: one without errors at a third of wrong poses with probability 1 − 10⁻⁶.
const SUBSETS: usize = 100;
/// Subsets that are followed to their end.
const FOLLOWED: usize = 4;
/// Rounds of trimming, and of rejecting.
const ROUNDS: usize = 10;
/// Probability that a clean recording loses a pose.
const FAMILYWISE: f64 = 0.01;
/// Median of χ²(3).
const MEDIAN: f64 = 2.366;
/// Noise that a subset is fitted with, as a part of the motion and in rad: only their ratio matters there, and little.
const SUBSET_NOISE: f64 = 0.01;
/// Residuals below this part of the motion (rad) are rounding.
const EXACT: f64 = 1e-9;

/// The maximum-likelihood frame of the poses that belong, on [`Input::TwoJoints`].
///
/// # Errors
/// [`EstimatorError`] for poses that are no rotations, numbers that are not finite, unusable options, or another kind of data.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<FrameOutcome, EstimatorError> {
    let Input::TwoJoints { samples, .. } = *input else {
        return Err(input.wrong(InputKind::TwoJoints));
    };
    let all = frame_ml::fit(samples, Residuals::Poses, options)?;
    let seen: Vec<usize> = (0..samples.len())
        .filter(|&k| samples[k].seen().is_some_and(|_| samples[k].weight > 0.0))
        .collect();
    let search = Search {
        samples,
        motion: motion(samples, &seen),
        seen,
        options,
    };
    let keep = search.kept();
    if keep.len() == search.seen.len() {
        return Ok(named(all, Vec::new()));
    }
    let rejected = search.seen.iter().copied().filter(|k| !keep.contains(k));
    let outcome = frame_ml::fit(&search.only(&keep), Residuals::Poses, options)?;
    Ok(named(outcome, rejected.collect()))
}

/// The outcome under this estimator's name.
fn named(outcome: FrameOutcome, rejected: Vec<usize>) -> FrameOutcome {
    match outcome {
        FrameOutcome::Estimate(e) => FrameOutcome::Estimate(Box::new(FrameEstimate {
            estimator: ID,
            rejected,
            ..*e
        })),
        FrameOutcome::NotObservable(mut why) => {
            why.estimator = ID;
            FrameOutcome::NotObservable(why)
        }
    }
}

/// Root mean square distance of the positions from their mean.
fn motion(samples: &[FrameSample], seen: &[usize]) -> f64 {
    let places = || {
        let pose = |&k: &usize| samples[k].seen().map(|p| p.translation);
        seen.iter().filter_map(pose)
    };
    let n = seen.len().max(1) as f64;
    let mean = places().sum::<Vector3<f64>>() / n;
    (places().map(|p| (p - mean).norm_squared()).sum::<f64>() / n).sqrt()
}

struct Search<'a> {
    samples: &'a [FrameSample],
    /// Rows with a pose and a weight.
    seen: Vec<usize>,
    motion: f64,
    options: &'a Options,
}

impl Search<'_> {
    /// The rows to keep: all where none is gross.
    fn kept(&self) -> Vec<usize> {
        let n = self.seen.len();
        let all = self.seen.clone();
        if n < FEWEST {
            return all;
        }
        let Some(mut keep) = self.trimmed() else {
            return all;
        };
        for _ in 0..ROUNDS {
            let Some(next) = self.within(&keep, 1.0) else {
                return all;
            };
            if next.len() < (LEFT * n as f64).ceil() as usize {
                return all;
            }
            if next == keep {
                break;
            }
            keep = next;
        }
        let near = self
            .within(&keep, WIDER)
            .map_or(0, |wider| wider.len().saturating_sub(keep.len()));
        if near > 1 + (NEAR * n as f64) as usize {
            return all;
        }
        keep
    }

    /// (2) and (3): three quarters of the rows; `None` where no subset has a frame.
    fn trimmed(&self) -> Option<Vec<usize>> {
        let mut state = self.options.seed;
        let mut found: Vec<Trimmed> = (0..self.options.subsets.min(SUBSETS))
            .filter_map(|_| self.least(&self.drawn(&mut state)))
            .collect();
        found.sort_by(|a, b| a.spread.total_cmp(&b.spread));
        found.truncate(FOLLOWED);
        for best in &mut found {
            for _ in 0..ROUNDS {
                match self.least(&best.rows) {
                    Some(next) if next.spread < best.spread => *best = next,
                    _ => break,
                }
            }
        }
        let best = found
            .into_iter()
            .min_by(|a, b| a.spread.total_cmp(&b.spread));
        best.map(|t| t.rows)
    }

    /// The rows with the least (1) about the frame of some rows.
    fn least(&self, rows: &[usize]) -> Option<Trimmed> {
        let noise = Options {
            sigma_t: Some(SUBSET_NOISE * self.motion.max(f64::MIN_POSITIVE)),
            sigma_r: Some(SUBSET_NOISE),
            ..self.options.clone()
        };
        let squares = self.squares(rows, &noise)?;
        let [t2, r2] = [0, 1].map(|k| self.floored(k, median(&squares, k)));
        let d2 = |i: usize| squares[i][0] / t2 + squares[i][1] / r2;
        let mut order: Vec<usize> = (0..squares.len()).collect();
        order.sort_by(|&a, &b| d2(a).total_cmp(&d2(b)));
        order.truncate((GOOD * squares.len() as f64).ceil() as usize);
        order.sort_unstable();
        Some(Trimmed {
            spread: t2.ln() + r2.ln(),
            rows: order.into_iter().map(|i| self.seen[i]).collect(),
        })
    }

    /// (4): the rows that are no surprise for so many times the noise of those that are kept.
    fn within(&self, keep: &[usize], times: f64) -> Option<Vec<usize>> {
        let squares = self.squares(keep, self.options)?;
        let freedom = (3.0 * keep.len() as f64 - 6.0).max(1.0);
        let [t2, r2] = [0, 1].map(|k| {
            let rows = self.seen.iter().zip(&squares);
            let kept: f64 = rows
                .filter(|(row, _)| keep.contains(row))
                .map(|(_, square)| square[k])
                .sum();
            self.floored(k, (median(&squares, k) / MEDIAN).max(kept / freedom))
        });
        let n = squares.len() as f64;
        let rows = self.seen.iter().zip(&squares);
        let belongs = |square: &[f64; 2]| {
            let d2 = square[0] / t2 + square[1] / r2;
            n * f_tail(d2 / (6.0 * times * times), 6.0, freedom) >= FAMILYWISE
        };
        let next = rows.filter(|(_, square)| belongs(square));
        Some(next.map(|(row, _)| *row).collect())
    }

    /// Weighted squares of u and φ of every seen row about the frame of some rows.
    fn squares(&self, rows: &[usize], options: &Options) -> Option<Vec<[f64; 2]>> {
        let outcome = frame_ml::fit(&self.only(rows), Residuals::Poses, options).ok()?;
        let frame = outcome.estimate()?;
        let joint_from_body = frame.body_from_joint.inverse();
        let square = |&k: &usize| {
            let sample = &self.samples[k];
            squares(
                sample,
                options.axes,
                &frame.world_from_joint,
                &joint_from_body,
            )
            .map(|square| square.map(|s| s * sample.weight))
        };
        self.seen.iter().map(square).collect()
    }

    /// A variance that is no rounding: of positions (0) or orientations (1).
    fn floored(&self, kind: usize, variance: f64) -> f64 {
        let scale = if kind == 0 { self.motion } else { 1.0 };
        variance.max((EXACT * scale).powi(2)).max(f64::MIN_POSITIVE)
    }

    fn only(&self, rows: &[usize]) -> Vec<FrameSample> {
        rows.iter().map(|&k| self.samples[k]).collect()
    }

    /// Rows of a subset, the same on every machine (SplitMix64, Steele, Lea & Flood 2014).
    fn drawn(&self, state: &mut u64) -> Vec<usize> {
        let mut rows: Vec<usize> = Vec::with_capacity(SUBSET);
        while rows.len() < SUBSET {
            *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = *state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            let row = self.seen[((z ^ (z >> 31)) % self.seen.len() as u64) as usize];
            if !rows.contains(&row) {
                rows.push(row);
            }
        }
        rows
    }
}

/// Rows and the spread (2) that they were chosen by.
struct Trimmed {
    spread: f64,
    rows: Vec<usize>,
}

/// Upper median of one kind of squares.
fn median(squares: &[[f64; 2]], kind: usize) -> f64 {
    let mut values: Vec<f64> = squares.iter().map(|s| s[kind]).collect();
    upper_median(&mut values).unwrap_or(0.0)
}
