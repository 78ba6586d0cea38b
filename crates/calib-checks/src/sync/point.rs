//! The offset between two clocks from one marker, which has no angular speed.
//!
//! A marker at m on its link is seen at p = R₀ (t(q) + R(q) m) + t₀. Where R₀, m and t₀ are unknown, p is a linear function of the
//! link's position and of the nine numbers of its rotation, whatever they are:
//!
//! ```text
//! p(t) = A x(τ),   x = (1, t(q), R(q)),   A of 3 × 13 free numbers                                    (1)
//! ```
//!
//! So no registration is needed, and small errors of the kinematics do no harm. The share of the marker's motion that (1)
//! leaves is smallest at the offset; Gauss-Newton in (δ, ρ), A being eliminated, follows.

use std::ops::Range;

use nalgebra::{Isometry3, Matrix2, Point3, SMatrix, Vector2, Vector3};

use super::offset::{BLOCKS, ClockMap, OF_BLOCKS, OffsetOutcome, OffsetSettings};
use super::rigid::{Regressors, Rigid, SIZE, about_mean, as_rigid, ridged_inverse};
use crate::statistics::median;

/// Positions at times of one clock; lost samples are left out.
#[derive(Clone, Debug, Default)]
pub struct PointTrack {
    t: Vec<f64>,
    points: Vec<Point3<f64>>,
}

/// Poses of a link at times of one clock.
#[derive(Clone, Debug, Default)]
pub struct LinkTrack {
    t: Vec<f64>,
    x: Vec<Regressors>,
    step: f64,
}

/// A marker must move by this, m rms: far above any noise. What nominal kinematics leave of the motion is limited by [`MAX_LEFT`], for small robots and
/// large ones.
const MIN_MOTION: f64 = 5e-3;
/// Samples in common, at least: four for each number of a row of A.
const MIN_SAMPLES: usize = 4 * SIZE;
/// Samples that the search looks at, evenly over all; those of the refinement.
const SEARCHED: usize = 400;
const REFINED: usize = 3000;
/// Step of the search, s: a robot's motion takes several of them to change.
const SEARCH_STEP: f64 = 0.05;
/// Share of the squared motion that (1) may leave: nominal robots leave less than a hundredth of it.
const MAX_LEFT: f64 = 0.1;
/// A second minimum that leaves less than this many times the best makes the answer ambiguous.
const CLEARLY: f64 = 4.0;
/// Minima closer than this, s, are one.
const APART: f64 = 0.5;
/// σ of an offset, s, from which it is asked with rigid R₀, m and t₀ too.
const UNSURE: f64 = 0.01;
/// Longest gap, in units of the median step, over which poses are interpolated.
const MAX_GAP: f64 = 5.0;
/// Half of the time of difference quotients, s.
const HALF: f64 = 0.02;
/// Steps of Gauss-Newton; four are usual.
const MAX_STEPS: usize = 20;

impl PointTrack {
    /// A track of the samples that are there, in order of time.
    pub fn new(samples: impl IntoIterator<Item = (f64, Option<Point3<f64>>)>) -> Self {
        let mut track = Self::default();
        for (t, point) in samples {
            if let Some(point) = point.filter(|_| track.t.last().is_none_or(|&last| t > last)) {
                track.t.push(t);
                track.points.push(point);
            }
        }
        track
    }

    /// Every n-th sample, at most `count`.
    fn thinned(&self, count: usize) -> Vec<(f64, Point3<f64>)> {
        let step = self.t.len().div_ceil(count).max(1);
        let all = self.t.iter().copied().zip(self.points.iter().copied());
        all.step_by(step).collect()
    }
}

impl LinkTrack {
    /// A track of the samples that are there, in order of time.
    pub fn new(samples: impl IntoIterator<Item = (f64, Option<Isometry3<f64>>)>) -> Self {
        let mut track = Self::default();
        for (t, pose) in samples {
            if let Some(pose) = pose.filter(|_| track.t.last().is_none_or(|&last| t > last)) {
                track.t.push(t);
                let rotation = pose.rotation.to_rotation_matrix();
                let numbers = pose
                    .translation
                    .vector
                    .iter()
                    .chain(rotation.matrix().iter());
                track.x.push(Regressors::from_iterator(
                    std::iter::once(1.0).chain(numbers.copied()),
                ));
            }
        }
        let steps = track.t.windows(2).map(|w| w[1] - w[0]).collect();
        track.step = median(steps).unwrap_or(0.0);
        track
    }

    fn at(&self, t: f64) -> Option<Regressors> {
        let after = self.t.partition_point(|&known| known <= t);
        let i = after.checked_sub(1)?;
        if self.t[i] == t {
            return Some(self.x[i]);
        }
        let gap = self.t.get(after)? - self.t[i];
        let share = (t - self.t[i]) / gap;
        (gap <= MAX_GAP * self.step).then(|| self.x[i] * (1.0 - share) + self.x[after] * share)
    }

    /// ∂x/∂t.
    fn rate(&self, t: f64) -> Option<Regressors> {
        let half = HALF.max(self.step);
        Some((self.at(t + half)? - self.at(t - half)?) / (2.0 * half))
    }
}

/// What A of equation (1) may be.
#[derive(Clone, Copy)]
enum How {
    /// Any numbers.
    Free,
    /// Those of rigid R₀, m and t₀.
    Rigid,
}

/// What takes out of a column what changes of A explain.
enum Explains {
    Free(Box<Projection>),
    Rigid(Box<Rigid>),
}

impl Explains {
    fn left(&self, column: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        match self {
            Self::Free(free) => free.left(column),
            Self::Rigid(rigid) => rigid.left(column),
        }
    }
}

/// Least squares of columns in x.
struct Projection {
    rows: Vec<Regressors>,
    inverse: SMatrix<f64, SIZE, SIZE>,
}

impl Projection {
    fn new(rows: Vec<Regressors>) -> Option<Self> {
        let mut normal = SMatrix::<f64, SIZE, SIZE>::zeros();
        for x in &rows {
            normal += x * x.transpose();
        }
        Some(Self {
            inverse: ridged_inverse(&normal)?,
            rows,
        })
    }

    /// A of equation (1) for these right sides, transposed.
    fn fit(&self, y: &[Vector3<f64>]) -> SMatrix<f64, SIZE, 3> {
        let mut right = SMatrix::<f64, SIZE, 3>::zeros();
        for (x, y) in self.rows.iter().zip(y) {
            right += x * y.transpose();
        }
        self.inverse * right
    }

    /// What (1) leaves of them.
    fn left(&self, y: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let a = self.fit(y);
        let rows = self.rows.iter().zip(y);
        rows.map(|(x, y)| y - a.transpose() * x).collect()
    }
}

/// x and the place of the marker at the times that both have in common at an offset.
fn common(
    seen: &[(f64, Point3<f64>)],
    link: &LinkTrack,
    offset: f64,
) -> (Vec<Regressors>, Vec<Vector3<f64>>) {
    let common = seen.iter();
    common
        .filter_map(|(t, p)| Some((link.at(t - offset)?, p.coords)))
        .unzip()
}

/// Share of the squared motion of `seen` that (1) leaves at an offset, for its degrees of freedom.
fn left_at(seen: &[(f64, Point3<f64>)], link: &LinkTrack, offset: f64) -> Option<f64> {
    let (x, y) = common(seen, link, offset);
    let n = y.len();
    if n < MIN_SAMPLES || 2 * n < seen.len() {
        return None;
    }
    let squares = |of: &[Vector3<f64>]| of.iter().map(Vector3::norm_squared).sum::<f64>();
    let total = squares(&about_mean(&y));
    let left = squares(&Projection::new(x)?.left(&y));
    (total > 0.0).then(|| left / total * (n - 1) as f64 / (n - SIZE) as f64)
}

/// The map between two clocks from a marker's motion and that of its link: `a` from the tracker, `b` from the robot.
pub fn clock_offset_of_point(
    a: &PointTrack,
    b: &LinkTrack,
    settings: &OffsetSettings,
) -> OffsetOutcome {
    if a.t.len() < MIN_SAMPLES || b.t.len() < MIN_SAMPLES {
        return OffsetOutcome::TooShort;
    }
    let positions: Vec<Vector3<f64>> = a.points.iter().map(|p| p.coords).collect();
    let squares: f64 = about_mean(&positions)
        .iter()
        .map(Vector3::norm_squared)
        .sum();
    let motion = (squares / positions.len() as f64).sqrt();
    if motion < MIN_MOTION {
        return OffsetOutcome::NotMoved {
            motion,
            needed: MIN_MOTION,
        };
    }
    let seen = a.thinned(SEARCHED);
    // Beyond, the two have no time in common.
    let in_common = |at: fn(&[f64], &[f64]) -> f64| at(&a.t, &b.t);
    let least = in_common(|a, b| a[0] - b[b.len() - 1]).max(-settings.max_offset);
    let most = in_common(|a, b| a[a.len() - 1] - b[0]).min(settings.max_offset);
    let steps = ((least / SEARCH_STEP).ceil() as i64)..=((most / SEARCH_STEP).floor() as i64);
    let searched: Vec<(f64, f64)> = steps
        .map(|k| k as f64 * SEARCH_STEP)
        .filter_map(|offset| Some((offset, left_at(&seen, b, offset)?)))
        .collect();
    let mut minima: Vec<(f64, f64)> = searched
        .windows(3)
        .filter(|w| w[1].1 <= w[0].1 && w[1].1 < w[2].1)
        .map(|w| w[1])
        .collect();
    minima.sort_by(|a, b| a.1.total_cmp(&b.1));
    let Some(&(_, left)) = minima.first() else {
        return OffsetOutcome::TooShort;
    };
    let correlation = |left: f64| (1.0 - left).max(0.0).sqrt();
    if left > MAX_LEFT {
        return OffsetOutcome::NoMatch {
            correlation: correlation(left),
            needed: correlation(MAX_LEFT),
        };
    }
    let minima = apart(minima);
    let asked = minima.iter().filter(|m| m.1 < CLEARLY * left).count();
    // A slow motion is like another one up to A; as a rigid motion it is not.
    let minima = match asked {
        1 => minima,
        _ => as_rigid(&minima[..asked], |offset| common(&seen, b, offset)),
    };
    let (offset, left) = minima[0];
    let second = minima.get(1);
    let ratio = second.map_or(0.0, |m| correlation(m.1) / correlation(left));
    // A robot that is not the URDF's moves like neither.
    let alike = |m: &&(f64, f64)| asked > 1 && (m.1 < CLEARLY * left || left > MAX_LEFT);
    if let Some(second) = second.filter(alike) {
        return OffsetOutcome::Ambiguous {
            first: offset,
            second: second.0,
            ratio,
        };
    }
    let start = ClockMap {
        offset,
        drift: 0.0,
        reference: b.t.iter().sum::<f64>() / b.t.len() as f64,
        offset_sigma: 0.0,
        drift_sigma: 0.0,
        correlation: correlation(left),
        second: ratio,
    };
    let seen = a.thinned(REFINED);
    // Free numbers explain errors of the kinematics, and the more of a slow motion's offset.
    let free = refine(&seen, b, start, How::Free);
    match free {
        OffsetOutcome::Found(map) if map.offset_sigma < UNSURE => free,
        _ => match (refine(&seen, b, start, How::Rigid), &free) {
            (OffsetOutcome::Found(rigid), OffsetOutcome::Found(map))
                if map.offset_sigma <= rigid.offset_sigma =>
            {
                free
            }
            (found @ OffsetOutcome::Found(_), _) => found,
            _ => free,
        },
    }
}

/// Minima, best first, without those that are closer than [`APART`] to a better one.
fn apart(minima: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for minimum in minima {
        if kept.iter().all(|known| (known.0 - minimum.0).abs() > APART) {
            kept.push(minimum);
        }
    }
    kept
}

/// Samples in common at one map, in order of time.
#[derive(Default)]
struct Common {
    x: Vec<Regressors>,
    /// ∂x/∂t, and τ − τ̄, s.
    rates: Vec<(Regressors, f64)>,
    y: Vec<Vector3<f64>>,
}

impl Common {
    fn of(seen: &[(f64, Point3<f64>)], link: &LinkTrack, map: &ClockMap) -> Self {
        let mut common = Self::default();
        for (t, point) in seen {
            let tau = map.to_b(*t);
            if let (Some(at), Some(rate)) = (link.at(tau), link.rate(tau)) {
                common.x.push(at);
                common.rates.push((rate, tau - map.reference));
                common.y.push(point.coords);
            }
        }
        common
    }

    /// A step of Gauss-Newton in (δ, ρ) with A eliminated, without the samples of `out`.
    fn change(&self, out: &Range<usize>, how: How) -> Option<Vector2<f64>> {
        let kept: Vec<usize> = (0..self.y.len()).filter(|i| !out.contains(i)).collect();
        if kept.len() < MIN_SAMPLES {
            return None;
        }
        let y: Vec<Vector3<f64>> = kept.iter().map(|&i| self.y[i]).collect();
        let x: Vec<Regressors> = kept.iter().map(|&i| self.x[i]).collect();
        let (a, projection) = match how {
            How::Free => {
                let projection = Projection::new(x)?;
                let a = projection.fit(&y).transpose();
                (a, Explains::Free(Box::new(projection)))
            }
            How::Rigid => {
                let rigid = Rigid::new(&x, &y)?;
                (rigid.a(), Explains::Rigid(Box::new(rigid)))
            }
        };
        let left: Vec<Vector3<f64>> = match &projection {
            Explains::Free(free) => free.left(&y),
            Explains::Rigid(rigid) => rigid.residuals(&y),
        };
        // y − A x(τ): ∂/∂δ = A x', ∂/∂ρ = A x' (τ − τ̄), of which x explains a part.
        let rates = || kept.iter().map(|&i| self.rates[i]);
        let of_offset: Vec<Vector3<f64>> = rates().map(|(rate, _)| a * rate).collect();
        let of_drift = rates().zip(&of_offset).map(|((_, at), v)| v * at);
        let of_drift: Vec<Vector3<f64>> = of_drift.collect();
        let (of_offset, of_drift) = (projection.left(&of_offset), projection.left(&of_drift));
        let mut normal = Matrix2::zeros();
        let mut right = Vector2::zeros();
        for ((offset, drift), left) in of_offset.iter().zip(&of_drift).zip(&left) {
            let across = offset.dot(drift);
            normal += Matrix2::new(offset.norm_squared(), across, across, drift.norm_squared());
            right -= Vector2::new(offset.dot(left), drift.dot(left));
        }
        solve(&normal, &right)
    }

    /// Variances of offset and drift by the answers without one block of time each, A being found again.
    fn spread(&self, how: How) -> Option<Vector2<f64>> {
        let n = self.y.len();
        let edge = |k: usize| k * n / BLOCKS;
        let answers = (0..BLOCKS).map(|k| self.change(&(edge(k)..edge(k + 1)), how));
        let answers: Vec<Vector2<f64>> = answers.collect::<Option<_>>()?;
        let squares: Vector2<f64> = answers.iter().map(|c| c.component_mul(c)).sum();
        Some(squares * OF_BLOCKS)
    }
}

/// Gauss-Newton in (δ, ρ).
fn refine(
    seen: &[(f64, Point3<f64>)],
    link: &LinkTrack,
    mut map: ClockMap,
    how: How,
) -> OffsetOutcome {
    for _ in 0..MAX_STEPS {
        let common = Common::of(seen, link, &map);
        let Some(change) = common.change(&(0..0), how) else {
            return OffsetOutcome::TooShort;
        };
        map.offset += change[0];
        map.drift += change[1];
        if change[0].abs() < 1e-7 && change[1].abs() < 1e-9 {
            let Some(spread) = common.spread(how) else {
                return OffsetOutcome::TooShort;
            };
            map.offset_sigma = spread[0].sqrt();
            map.drift_sigma = spread[1].sqrt();
            return OffsetOutcome::Found(map);
        }
    }
    OffsetOutcome::NoMatch {
        correlation: map.correlation,
        needed: 1.0,
    }
}

fn solve(normal: &Matrix2<f64>, right: &Vector2<f64>) -> Option<Vector2<f64>> {
    let scale = normal
        .diagonal()
        .map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scale = Matrix2::from_diagonal(&scale);
    let inverse = (scale * normal * scale).try_inverse()?;
    Some(scale * inverse * scale * right)
}
