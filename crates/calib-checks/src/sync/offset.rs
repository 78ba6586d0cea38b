//! The offset and drift between two clocks, from angular speed.

use crate::statistics::median;
use calib_geometry::so3;
use nalgebra::{Matrix4, SMatrix, SVector, UnitQuaternion, Vector4};

/// Orientations at times of one clock; lost samples are left out.
#[derive(Clone, Debug, Default)]
pub struct RotationTrack {
    /// Times, s, rising.
    t: Vec<f64>,
    /// Orientation of the body (or link) in any frame that stands still.
    rotation: Vec<UnitQuaternion<f64>>,
}

/// How the offset is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffsetSettings {
    /// Largest offset considered, s. Default 10.
    pub max_offset: f64,
    /// Half of the time over which a turn is measured, s. Default 0.05: long enough for the noise of a marker cluster,
    /// short against a robot's motion.
    pub half_chord: f64,
    /// A second peak this high, in units of the first, makes the answer ambiguous where it leaves less than four times as much of the motion
    /// unexplained. Default 0.9.
    pub ambiguous: f64,
    /// Smallest correlation that counts as the same motion. Default 0.6.
    pub min_correlation: f64,
}

impl Default for OffsetSettings {
    fn default() -> Self {
        OffsetSettings {
            max_offset: 10.0,
            half_chord: 0.05,
            ambiguous: 0.9,
            min_correlation: 0.6,
        }
    }
}

/// `t_a = t_b + offset + drift·(t_b − reference)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockMap {
    /// Offset at the reference time, s.
    pub offset: f64,
    /// Relative rate difference of the clocks (5e-5 = 50 ppm).
    pub drift: f64,
    /// Reference time on clock b, s.
    pub reference: f64,
    /// Standard deviation of the offset, s.
    pub offset_sigma: f64,
    /// Standard deviation of the drift.
    pub drift_sigma: f64,
    /// Correlation of the two angular speeds at the peak.
    pub correlation: f64,
    /// The second peak's correlation in units of the first; 0 where there is none.
    pub second: f64,
}

impl ClockMap {
    /// Time on clock a of the instant `t_b` on clock b.
    pub fn to_a(&self, t_b: f64) -> f64 {
        t_b + self.offset + self.drift * (t_b - self.reference)
    }

    /// Time on clock b of the instant `t_a` on clock a.
    pub fn to_b(&self, t_a: f64) -> f64 {
        (t_a - self.offset + self.drift * self.reference) / (1.0 + self.drift)
    }
}

/// What the data say about the offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OffsetOutcome {
    /// One answer.
    Found(ClockMap),
    /// Two offsets explain the motion nearly as well: it is periodic. Move irregularly once, at the start.
    Ambiguous {
        /// The best, s.
        first: f64,
        /// The other, s.
        second: f64,
        /// Its peak in units of the first.
        ratio: f64,
    },
    /// Not enough rotation.
    NotExcited {
        /// Standard deviation of the angular speed, rad/s, of the calmer track.
        deviation: f64,
        /// What is needed, rad/s.
        needed: f64,
    },
    /// The marker hardly moves.
    NotMoved {
        /// Its motion, m rms.
        motion: f64,
        /// What is needed, m.
        needed: f64,
    },
    /// The two do not move alike at any offset considered.
    NoMatch {
        /// Highest correlation.
        correlation: f64,
        /// What is needed.
        needed: f64,
    },
    /// Too few samples, or the tracks never overlap by half.
    TooShort,
}

/// Angular speed must vary by this, rad/s (1°/s), to be distinguished from a marker cluster's noise.
const MIN_DEVIATION: f64 = 0.02;
/// Samples of a track, at least.
const MIN_SAMPLES: usize = 50;
/// Longest gap, in units of the median step, over which orientations are interpolated.
const MAX_GAP: f64 = 5.0;
/// A second peak that leaves at least this many times as much of the squared speed is another motion.
const CLEARLY: f64 = 4.0;
/// Refinement steps; three are usual.
const MAX_STEPS: usize = 30;
/// Longest grid of the correlation, samples: an hour at 100 Hz is thinned.
const MAX_GRID: usize = 60_000;

impl RotationTrack {
    /// A track of the samples that are there; those that do not come later than the one before are left out.
    pub fn new(samples: impl IntoIterator<Item = (f64, Option<UnitQuaternion<f64>>)>) -> Self {
        let mut track = RotationTrack::default();
        for (t, rotation) in samples {
            if let Some(rotation) =
                rotation.filter(|_| t.is_finite() && track.t.last().is_none_or(|&last| t > last))
            {
                track.t.push(t);
                track.rotation.push(rotation);
            }
        }
        track
    }

    fn step(&self) -> f64 {
        median(self.t.windows(2).map(|w| w[1] - w[0]).collect()).unwrap_or(0.0)
    }

    /// Orientation at `t`, interpolated; `None` outside and in gaps.
    fn at(&self, t: f64, step: f64) -> Option<UnitQuaternion<f64>> {
        let after = self.t.partition_point(|&known| known <= t);
        let (i, j) = (after.checked_sub(1)?, after);
        if self.t[i] == t {
            return Some(self.rotation[i]);
        }
        let gap = self.t.get(j)? - self.t[i];
        let turn = so3::log(&(self.rotation[i].inverse() * self.rotation[j]));
        (gap <= MAX_GAP * step)
            .then(|| self.rotation[i] * so3::exp(&(turn * ((t - self.t[i]) / gap))))
    }

    /// |ω| at `t`, rad/s, over the chord `t ± half`.
    fn speed(&self, t: f64, half: f64, step: f64) -> Option<f64> {
        let (before, after) = (self.at(t - half, step)?, self.at(t + half, step)?);
        Some(before.angle_to(&after) / (2.0 * half))
    }
}

/// The map between two clocks from the same body's motion, seen by both: `a` from the tracker, `b` from the robot.
pub fn clock_offset(
    a: &RotationTrack,
    b: &RotationTrack,
    settings: &OffsetSettings,
) -> OffsetOutcome {
    let (Some(&a_first), Some(&a_last)) = (a.t.first(), a.t.last()) else {
        return OffsetOutcome::TooShort;
    };
    let (Some(&b_first), Some(&b_last)) = (b.t.first(), b.t.last()) else {
        return OffsetOutcome::TooShort;
    };
    if a.t.len() < MIN_SAMPLES || b.t.len() < MIN_SAMPLES {
        return OffsetOutcome::TooShort;
    }
    let (step_a, step_b, half) = (a.step(), b.step(), settings.half_chord);
    // Common grid, as fine as the coarser track.
    let longest = (a_last - a_first).max(b_last - b_first);
    let step = step_a.max(step_b).max(longest / MAX_GRID as f64);
    let grid = |track: &RotationTrack, first: f64, last: f64, own: f64| -> Vec<Option<f64>> {
        let count = ((last - first) / step) as usize + 1;
        (0..count)
            .map(|k| track.speed(first + k as f64 * step, half, own))
            .collect()
    };
    let (speed_a, speed_b) = (
        grid(a, a_first, a_last, step_a),
        grid(b, b_first, b_last, step_b),
    );
    let deviation = deviation(&speed_a).min(deviation(&speed_b));
    if deviation < MIN_DEVIATION {
        return OffsetOutcome::NotExcited {
            deviation,
            needed: MIN_DEVIATION,
        };
    }
    // offset = (a_first − b_first) + lag·step
    let base = a_first - b_first;
    let lags = {
        let low = ((-settings.max_offset - base) / step).ceil() as i64;
        let high = ((settings.max_offset - base) / step).floor() as i64;
        low.max(-(speed_a.len() as i64))..=high.min(speed_b.len() as i64)
    };
    // a[i] is seen at a_first + i·step; on clock b that is b_first + (i − lag)·step … with lag in samples of offset.
    let correlations: Vec<(i64, f64)> = lags
        .filter_map(|lag| Some((lag, correlation(&speed_a, &speed_b, lag)?)))
        .collect();
    let Some(peaks) = peaks(&correlations) else {
        return OffsetOutcome::TooShort;
    };
    let offset = |peak: &Peak| base + peak.lag * step;
    let first = peaks[0];
    if first.height < settings.min_correlation {
        return OffsetOutcome::NoMatch {
            correlation: first.height,
            needed: settings.min_correlation,
        };
    }
    // Postures one after the other at equal intervals correlate when moved by some of them; what is left then is many times as much.
    let left = |peak: &Peak| 1.0 - peak.height * peak.height;
    if let Some(second) = peaks.get(1).filter(|second| {
        second.height > settings.ambiguous * first.height && left(second) < CLEARLY * left(&first)
    }) {
        return OffsetOutcome::Ambiguous {
            first: offset(&first),
            second: offset(second),
            ratio: second.height / first.height,
        };
    }
    let second = peaks
        .get(1)
        .map_or(0.0, |p| p.height.max(0.0) / first.height);
    refine(a, b, settings, offset(&first), (first.height, second))
}

fn deviation(speed: &[Option<f64>]) -> f64 {
    let n = speed.iter().flatten().count().max(1) as f64;
    let mean = speed.iter().flatten().sum::<f64>() / n;
    (speed
        .iter()
        .flatten()
        .map(|s| (s - mean).powi(2))
        .sum::<f64>()
        / n)
        .sqrt()
}

/// Correlation coefficient of a[i + lag] … with b[i]: at offset `base + lag·step` the two are the same instants.
fn correlation(a: &[Option<f64>], b: &[Option<f64>], lag: i64) -> Option<f64> {
    let from = 0.max(-lag) as usize;
    let to = (b.len() as i64).min(a.len() as i64 - lag).max(0) as usize;
    let (mut n, mut sa, mut sb, mut saa, mut sbb, mut sab) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for i in from..to {
        if let (Some(x), Some(y)) = (a[(i as i64 + lag) as usize], b[i]) {
            n += 1.0;
            sa += x;
            sb += y;
            saa += x * x;
            sbb += y * y;
            sab += x * y;
        }
    }
    // Less than half of the shorter track says little.
    if n < 0.5 * a.len().min(b.len()) as f64 || n < MIN_SAMPLES as f64 / 2.0 {
        return None;
    }
    let (va, vb) = (saa - sa * sa / n, sbb - sb * sb / n);
    (va > 0.0 && vb > 0.0).then(|| (sab - sa * sb / n) / (va * vb).sqrt())
}

#[derive(Clone, Copy)]
struct Peak {
    /// In samples, between grid points.
    lag: f64,
    height: f64,
}

/// Local maxima, highest first, by a parabola through three points. A maximum on the border is no peak unless it is all
/// there is.
fn peaks(correlations: &[(i64, f64)]) -> Option<Vec<Peak>> {
    let mut peaks: Vec<Peak> = correlations
        .windows(3)
        .filter(|w| w[1].1 >= w[0].1 && w[1].1 > w[2].1)
        .map(|w| {
            let bend = w[0].1 - 2.0 * w[1].1 + w[2].1;
            let shift = if bend < 0.0 {
                0.5 * (w[0].1 - w[2].1) / bend
            } else {
                0.0
            };
            Peak {
                lag: w[1].0 as f64 + shift,
                height: w[1].1,
            }
        })
        .collect();
    if peaks.is_empty() {
        let (lag, height) = correlations
            .iter()
            .copied()
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        peaks.push(Peak {
            lag: lag as f64,
            height,
        });
    }
    peaks.sort_by(|a, b| b.height.total_cmp(&a.height));
    Some(peaks)
}

/// Least squares of eq. (1) of the module in (δ, ρ, g, c), from the correlation's peak.
fn refine(
    a: &RotationTrack,
    b: &RotationTrack,
    settings: &OffsetSettings,
    start: f64,
    (correlation, second): (f64, f64),
) -> OffsetOutcome {
    let (step_a, step_b, half) = (a.step(), b.step(), settings.half_chord);
    let measured: Vec<(f64, f64)> =
        a.t.iter()
            .filter_map(|&t| Some((t, a.speed(t, half, step_a)?)))
            .collect();
    let reference = b.t.iter().sum::<f64>() / b.t.len() as f64;
    let mut map = ClockMap {
        offset: start,
        drift: 0.0,
        reference,
        offset_sigma: 0.0,
        drift_sigma: 0.0,
        correlation,
        second,
    };
    let (mut gain, mut constant) = (1.0, 0.0);
    let mut rows: Vec<(Vector4<f64>, f64)> = Vec::new();
    for _ in 0..MAX_STEPS {
        rows.clear();
        for &(t, speed) in &measured {
            let tau = map.to_b(t);
            let near = |shift: f64| b.speed(tau + shift, half, step_b);
            let (Some(at), Some(before), Some(after)) =
                (near(0.0), near(-half / 4.0), near(half / 4.0))
            else {
                continue;
            };
            let slope = (after - before) / (half / 2.0);
            // τ = t − δ − ρ(τ − τ̄): ∂s/∂δ = −g·s', ∂s/∂ρ = −g·s'·(τ − τ̄)
            let jacobian = Vector4::new(-gain * slope, -gain * slope * (tau - reference), at, 1.0);
            rows.push((jacobian, speed - gain * at - constant));
        }
        let mut normal = Matrix4::zeros();
        let mut right = Vector4::zeros();
        for (jacobian, residual) in &rows {
            normal += jacobian * jacobian.transpose();
            right += jacobian * *residual;
        }
        // Columns of very different size: scale by the diagonal before inverting.
        let scale = normal
            .diagonal()
            .map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
        let scaled = Matrix4::from_diagonal(&scale) * normal * Matrix4::from_diagonal(&scale);
        let Some(inverse) = scaled.try_inverse().filter(|_| rows.len() >= MIN_SAMPLES) else {
            return OffsetOutcome::TooShort;
        };
        let covariance = Matrix4::from_diagonal(&scale) * inverse * Matrix4::from_diagonal(&scale);
        let change = covariance * right;
        map.offset += change[0];
        map.drift += change[1];
        gain += change[2];
        constant += change[3];
        if change[0].abs() < 1e-7 && change[1].abs() < 1e-9 {
            break;
        }
    }
    let spread = jackknife(&rows);
    map.offset_sigma = spread[(0, 0)].sqrt();
    map.drift_sigma = spread[(1, 1)].sqrt();
    OffsetOutcome::Found(map)
}

/// Blocks of time for the variance: each much longer than a chord and than what a robot takes from one posture to the next,
/// enough of them to estimate a variance from.
pub(super) const BLOCKS: usize = 8;
/// 97.5 % point of Student's t with as many degrees of freedom as blocks but one, in units of the normal one: twice a
/// stated σ covers what it says.
const STUDENT: f64 = 2.365 / 1.960;

/// Variance from the sum of squared changes of an answer without one block each, with (BLOCKS − 1) / BLOCKS of the jackknife.
pub(super) const OF_BLOCKS: f64 = STUDENT * STUDENT * (BLOCKS - 1) as f64 / BLOCKS as f64;

/// Covariance of least squares in `N` unknowns at the minimum, from rows of derivatives and residuals in order of time:
/// the spread of the answers without one block of time each. Neighboring residuals depend on each other, by noise that
/// they share and by errors of the kinematics that last as long as a posture: formulas for independent residuals are
/// wrong either way.
fn jackknife<const N: usize>(rows: &[(SVector<f64, N>, f64)]) -> SMatrix<f64, N, N> {
    let normal_of = |rows: &[(SVector<f64, N>, f64)]| {
        let mut normal = SMatrix::<f64, N, N>::zeros();
        let mut right = SVector::<f64, N>::zeros();
        for (jacobian, residual) in rows {
            normal += jacobian * jacobian.transpose();
            right += jacobian * *residual;
        }
        (normal, right)
    };
    let (normal, right) = normal_of(rows);
    // Columns of very different size: scale by the diagonal before inverting.
    let scale = normal
        .diagonal()
        .map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scale = SMatrix::<f64, N, N>::from_diagonal(&scale);
    let blocks = rows.chunks(rows.len().div_ceil(BLOCKS).max(1));
    let mut squares = SMatrix::<f64, N, N>::zeros();
    for block in blocks {
        let (own, of_block) = normal_of(block);
        let Some(inverse) = (scale * (normal - own) * scale).try_inverse() else {
            return SMatrix::repeat(f64::INFINITY);
        };
        let moved = scale * inverse * scale * (right - of_block);
        squares += moved * moved.transpose();
    }
    squares * OF_BLOCKS
}
