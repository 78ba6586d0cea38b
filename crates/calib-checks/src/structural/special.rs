//! Hypotheses that estimate something of their own: where the tracker was moved to, what an empty column should hold.

use calib_geometry::registration::rigid_registration;
use calib_geometry::so3;
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Vector3};

use super::chain::{Chain, Motion, Walk};
use super::correct::open_rows;
use super::data::{Data, Measured};
use super::hypothesis::{Hypothesis, Scope, Scoped};
use super::ids::{JointIndex, LinkIndex, SampleIndex};
use super::scan::{Fit, Scan};

/// Alternations between registration and the estimated part; the residual falls by half or more in each.
const ALTERNATIONS: usize = 12;
/// The same for the readings of a joint: where few other joints move a body, the registration gives way slowly.
const OF_READINGS: usize = 60;
/// Relative fall of the residual below which alternating ends.
const SETTLED: f64 = 1e-3;
/// Readings that leave less than this part of the residual explain it: no other start is tried.
const EXPLAINED: f64 = 0.2;
/// Root mean square of the readings of a start, in half ranges.
const START: f64 = 0.2;
/// Starts per row for an empty column: 30° apart, less than half the width of a basin.
const STARTS: usize = 12;
/// Steps from the best start to the minimum: Newton's method doubles the digits in each.
const STEPS: usize = 8;
/// Half the stroke (m) in which the one place of a prismatic joint is looked for.
const STROKE: f64 = 0.6;

/// [`apply`](super::apply) for the hypotheses of this file.
pub(crate) fn apply(scoped: &Scoped, data: &Data) -> Data {
    match scoped.hypothesis {
        Hypothesis::TrackerMoved => tracker_moved(scoped.scope, data),
        Hypothesis::MissingColumn { joint } => missing_column(scoped.scope, joint, data),
        _ => data.clone(),
    }
}

fn tracker_moved(scope: Scope, data: &Data) -> Data {
    let inside: Vec<bool> = data.recording.iter().map(|r| scope.contains(*r)).collect();
    let mut moved = data.clone();
    let mut last = f64::INFINITY;
    for round in 0..ALTERNATIONS {
        let scan = Scan::new(&moved, &[]);
        let fit = if round == 0 {
            // The first registration does without the rows that may have moved.
            let rows: Vec<usize> = (0..inside.len()).filter(|&i| !inside[i]).collect();
            let rest = data.select(&rows);
            let mut fit = Scan::new(&rest, &[]).fit(None);
            let known = fit.points.len();
            fit.points
                .resize(scan.recordings * scan.channels.len(), Vector3::zeros());
            spread(&scan, &mut fit.points, known, &rest);
            fit
        } else {
            let fit = scan.fit(None);
            if fit.score.rms > last * (1.0 - SETTLED) {
                break;
            }
            last = fit.score.rms;
            fit
        };
        let Some(new_from_old) = motion(&scan, &fit, &inside) else {
            break;
        };
        transform(&mut moved, &inside, &new_from_old);
    }
    moved
}

/// Copies each point to the recordings without samples in the part that was fitted.
fn spread(scan: &Scan<'_>, points: &mut [Vector3<f64>], known: usize, rest: &Data) {
    let n = scan.channels.len();
    for k in 0..n {
        for group in super::channels::mounts(scan.data, scan.channels[k].body, scan.recordings) {
            let source = group.iter().copied().find(|&r| {
                r * n + k < known && rest.recording.iter().any(|recording| recording.0 == r)
            });
            if let Some(source) = source {
                group
                    .iter()
                    .for_each(|&r| points[r * n + k] = points[source * n + k]);
            }
        }
    }
}

/// The motion of the tracked points inside that brings them onto the prediction, in tracker coordinates.
fn motion(scan: &Scan<'_>, fit: &Fit, inside: &[bool]) -> Option<Isometry3<f64>> {
    let n = scan.channels.len();
    let mut pairs = Vec::new();
    for i in (0..inside.len()).filter(|&i| inside[i]) {
        for k in 0..n {
            if scan.weights[i * n + k] > 0.0 {
                let (predicted, _) = scan.predicted(fit, i, k);
                let seen = scan.seen(fit, i, k);
                // tracker coordinates: y = Qᵀ (p − c) + center
                let back = |p: Vector3<f64>| {
                    fit.registration.q.tr_mul(&(p - fit.registration.c)) + fit.center
                };
                pairs.push((back(seen), back(predicted)));
            }
        }
    }
    let count = pairs.len() as f64;
    let sum_from: Vector3<f64> = pairs.iter().map(|p| p.0).sum();
    let sum_to: Vector3<f64> = pairs.iter().map(|p| p.1).sum();
    let (from, to) = (sum_from / count.max(1.0), sum_to / count.max(1.0));
    let spread: Matrix3<f64> = pairs
        .iter()
        .map(|(a, b)| (b - to) * (a - from).transpose())
        .sum();
    let rotation = so3::nearest_rotation(&spread)?;
    Some(Isometry3::from_parts(
        Translation3::from(to - rotation * from),
        rotation,
    ))
}

pub(crate) fn transform(data: &mut Data, inside: &[bool], new_from_old: &Isometry3<f64>) {
    for body in &mut data.bodies {
        for i in (0..inside.len()).filter(|&i| inside[i]) {
            match &mut body.measured {
                Measured::Markers(rows) => {
                    for p in rows[i].iter_mut().flatten() {
                        *p = new_from_old * Point3::from(p.coords);
                    }
                }
                Measured::Poses {
                    tracker_from_body, ..
                } => {
                    if let Some(pose) = &mut tracker_from_body[i] {
                        *pose = new_from_old * *pose;
                    }
                }
            }
        }
    }
}

/// The rigid motion that carries the measurements of `from` onto those of `to`, in tracker coordinates.
pub(crate) fn rigid_motion(scope: Scope, from: &Data, to: &Data) -> Option<Isometry3<f64>> {
    let (mut a, mut b) = (Vec::new(), Vec::new());
    let inside = (0..from.recording.len()).filter(|&i| scope.contains(from.recording[i]));
    for i in inside {
        for (old, new) in from.bodies.iter().zip(&to.bodies) {
            match (&old.measured, &new.measured) {
                (Measured::Markers(old), Measured::Markers(new)) => {
                    for (old, new) in old[i].iter().zip(&new[i]) {
                        if let (Some(old), Some(new)) = (old, new) {
                            a.push(*old);
                            b.push(*new);
                        }
                    }
                }
                (
                    Measured::Poses {
                        tracker_from_body: old,
                        ..
                    },
                    Measured::Poses {
                        tracker_from_body: new,
                        ..
                    },
                ) => {
                    if let (Some(old), Some(new)) = (&old[i], &new[i]) {
                        // new = motion · old
                        return Some(new * old.inverse());
                    }
                }
                _ => {}
            }
        }
    }
    Some(rigid_registration(&a, &b, None).ok()?.b_from_a)
}

/// Where a joint without a column was, row by row.
pub(crate) struct Whereabouts {
    /// Median, rad or m.
    pub(crate) middle: f64,
    /// Median distance from it, rad or m.
    pub(crate) spread: f64,
}

/// The readings that [`apply`] put into an empty column, in short; `None` where it has no rows.
pub(crate) fn whereabouts(
    scope: Scope,
    joint: JointIndex,
    data: &Data,
    filled: &Data,
) -> Option<Whereabouts> {
    let turns = data.chain.turns(joint.0) == Some(true);
    let apart = |a: f64, b: f64| match turns {
        true => (a - b).sin().atan2((a - b).cos()).abs(),
        false => (a - b).abs(),
    };
    let rows = open_rows(scope, joint, data).into_iter();
    let found: Vec<f64> = rows.filter_map(|i| filled.readings[i][joint.0]).collect();
    let median = |from: f64| -> f64 {
        let mut distances: Vec<f64> = found.iter().map(|q| apart(*q, from)).collect();
        distances.sort_by(f64::total_cmp);
        distances[distances.len() / 2]
    };
    let all = found.iter().map(|q| (median(*q), *q));
    let (spread, middle) = all.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Whereabouts { middle, spread })
}

/// Half the range of readings that is searched for an empty column, rad or m.
pub(crate) fn range(data: &Data, joint: JointIndex) -> f64 {
    match data.chain.joints().get(joint.0).map(|j| j.motion) {
        Some(Motion::Prismatic(_)) => STROKE,
        _ => std::f64::consts::PI,
    }
}

/// Whether readings taken from the tracker, at the registration of the data as they are, leave clearly less.
pub(super) fn explains_at_once(scope: Scope, joint: JointIndex, data: &Data) -> bool {
    /// This part of the mean square at most.
    const CLEARLY: f64 = 0.5;
    let scan = Scan::new(data, &[]);
    let fit = scan.fit(None);
    let links: Vec<LinkIndex> = data.bodies.iter().map(|b| b.link).collect();
    let mut walk = Walk::new(&data.chain, &links);
    let range = range(data, joint);
    let mut filled = data.clone();
    for i in open_rows(scope, joint, data) {
        filled.readings[i][joint.0] = Some(best_reading(&scan, &fit, &mut walk, i, joint, range));
    }
    let left = scan.fit_corrected(&filled).score.rms;
    left * left < CLEARLY * fit.score.rms * fit.score.rms
}

fn missing_column(scope: Scope, joint: JointIndex, data: &Data) -> Data {
    let rows = open_rows(scope, joint, data);
    let start = |values: &dyn Fn(usize) -> f64| {
        let mut filled = data.clone();
        rows.iter()
            .for_each(|&i| filled.readings[i][joint.0] = Some(values(i)));
        filled
    };
    let still = start(&|_| 0.0);
    let before = Scan::new(&still, &[]).none().rms;
    let (mut best, mut least) = estimated(still.clone(), joint, &rows, &[]);
    if least < EXPLAINED * before {
        return best;
    }
    // Where few other joints move a body, the registration of a joint at rest holds it there.
    let [first, second] = common_motions(&still);
    let along = START * range(data, joint);
    let turns = data.chain.turns(joint.0) == Some(true);
    let mut starts: Vec<Vec<f64>> = [along, -along]
        .into_iter()
        .map(|scale| first.iter().map(|m| scale * m).collect())
        .collect();
    if turns {
        // Points that go round and round spread along two directions, by the cosine and the sine.
        let angle = |sign: f64| move |(a, b): (&f64, &f64)| (sign * b).atan2(*a);
        for sign in [1.0, -1.0] {
            starts.push(first.iter().zip(&second).map(angle(sign)).collect());
        }
    }
    for values in starts {
        let (filled, rms) = estimated(start(&|i| values[i]), joint, &rows, &[]);
        if rms < least {
            (best, least) = (filled, rms);
        }
    }
    best
}

/// What the residuals of all rows have in common, row by row: the two directions that they spread along most, each with a mean square of 1.
fn common_motions(data: &Data) -> [Vec<f64>; 2] {
    const ROUNDS: usize = 50;
    let scan = Scan::new(data, &[]);
    let fit = scan.fit(None);
    let n = scan.channels.len();
    let rows = data.readings.len();
    let residual = |i: usize, k: usize| match scan.weights[i * n + k] > 0.0 {
        true => scan.residual(&fit, i, k),
        false => Vector3::zeros(),
    };
    let all: Vec<Vector3<f64>> = (0..rows * n).map(|at| residual(at / n, at % n)).collect();
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    // Any start does that is not across the direction.
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let seed = |k: usize| (0..rows).map(move |i| (golden * (i * 2 + k + 1) as f64).fract() - 0.5);
    let mut motions = [0, 1].map(|k| seed(k).collect::<Vec<f64>>());
    for _ in 0..ROUNDS {
        for k in 0..2 {
            let mut across = vec![Vector3::zeros(); n];
            for (at, r) in all.iter().enumerate() {
                across[at % n] += r * motions[k][at / n];
            }
            let along = |i: usize| -> f64 { (0..n).map(|c| all[i * n + c].dot(&across[c])).sum() };
            let mut next: Vec<f64> = (0..rows).map(along).collect();
            if k == 1 {
                let share = dot(&next, &motions[0]) / rows.max(1) as f64;
                next.iter_mut()
                    .zip(&motions[0])
                    .for_each(|(m, first)| *m -= share * first);
            }
            let mean = dot(&next, &next) / rows.max(1) as f64;
            let scale = if mean > 0.0 { mean.sqrt().recip() } else { 0.0 };
            next.iter_mut().for_each(|m| *m *= scale);
            motions[k] = next;
        }
    }
    motions
}

/// The data with the position of a joint in these rows taken from the tracker, beginning at the registration of the rows that are
/// not `screened`: the others are those where it moved.
pub(super) fn estimated_beside(
    mut filled: Data,
    joint: JointIndex,
    rows: &[usize],
    screened: &[SampleIndex],
) -> Data {
    let links: Vec<LinkIndex> = filled.bodies.iter().map(|b| b.link).collect();
    let mut walk = Walk::new(&filled.chain, &links);
    let range = range(&filled, joint);
    let found: Vec<f64> = {
        let fit = Scan::new(&filled, screened).fit(None);
        let scan = Scan::new(&filled, &[]);
        let of_row = |i: &usize| best_reading(&scan, &fit, &mut walk, *i, joint, range);
        rows.iter().map(of_row).collect()
    };
    for (&i, q) in rows.iter().zip(found) {
        filled.readings[i][joint.0] = Some(q);
    }
    estimated(filled, joint, rows, &[]).0
}

/// The data with the position of a joint in these rows taken from the tracker, and the residual of the registration, rms, m.
pub(super) fn estimated(
    mut filled: Data,
    joint: JointIndex,
    rows: &[usize],
    screened: &[SampleIndex],
) -> (Data, f64) {
    let links: Vec<LinkIndex> = filled.bodies.iter().map(|b| b.link).collect();
    let mut walk = Walk::new(&filled.chain, &links);
    let range = range(&filled, joint);
    let mut last = f64::INFINITY;
    for _ in 0..OF_READINGS {
        let found: Vec<f64> = {
            let scan = Scan::new(&filled, screened);
            let fit = scan.fit(None);
            if fit.score.rms > last * (1.0 - SETTLED) {
                break;
            }
            last = fit.score.rms;
            rows.iter()
                .map(|&i| best_reading(&scan, &fit, &mut walk, i, joint, range))
                .collect()
        };
        for (&i, q) in rows.iter().zip(found) {
            filled.readings[i][joint.0] = Some(q);
        }
    }
    (filled, last)
}

/// The reading of one joint that explains a row best.
fn best_reading(
    scan: &Scan<'_>,
    fit: &Fit,
    walk: &mut Walk,
    i: usize,
    joint: JointIndex,
    range: f64,
) -> f64 {
    let n = scan.channels.len();
    let mut readings = scan.readings(i).to_vec();
    let seen: Vec<(usize, Vector3<f64>, Vector3<f64>)> = (0..n)
        .filter(|&k| scan.weights[i * n + k] > 0.0)
        .map(|k| {
            let link = scan.data.bodies[scan.channels[k].body].link;
            let m = fit.points[scan.data.recording[i].0 * n + k];
            (link.0, m, scan.seen(fit, i, k))
        })
        .collect();
    let mut cost = |q: f64| -> f64 {
        readings[joint.0] = q;
        walk.go(&scan.data.chain, &readings);
        let off = |(link, m, seen): &(usize, Vector3<f64>, Vector3<f64>)| {
            let pose = walk.root_from_link[*link];
            (seen - pose.r * m - pose.t).norm_squared()
        };
        seen.iter().map(off).sum()
    };
    if scan.data.chain.turns(joint.0) == Some(false) {
        // The cost of a motion along a line is a parabola.
        let [before, at, after] = [-STROKE, 0.0, STROKE].map(&mut cost);
        let curvature = before + after - 2.0 * at;
        let least = STROKE * 0.5 * (before - after) / curvature;
        return if least.is_finite() { least } else { 0.0 };
    }
    if turns_alone(&scan.data.chain, joint) {
        return Harmonics::of(cost).least();
    }
    let step = 2.0 * range / STARTS as f64;
    let mut best = (cost(0.0), 0.0);
    for s in 0..STARTS {
        let q = -range + step * s as f64;
        let f = cost(q);
        if f < best.0 {
            best = (f, q);
        }
    }
    // Of a joint that others follow: golden-section search around the best start: the cost of one row has one minimum there.
    let (mut low, mut high) = (best.1 - step, best.1 + step);
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    for _ in 0..36 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if cost(a) < cost(b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}

/// A reading turns its own joint by as much, and no other.
fn turns_alone(chain: &Chain, joint: JointIndex) -> bool {
    let terms = chain.joints().iter().enumerate();
    let mut terms = terms.flat_map(|(j, own)| own.law.iter().map(move |term| (j, term)));
    terms.all(|(j, (source, factor))| *source != joint || (j == joint.0 && *factor == 1.0))
}

/// c₀ + c₁ cos q + s₁ sin q + c₂ cos 2q + s₂ sin 2q: points on circles have such squared distances from others.
struct Harmonics {
    first: (f64, f64),
    second: (f64, f64),
}

impl Harmonics {
    /// From the values at five angles.
    fn of(mut value: impl FnMut(f64) -> f64) -> Self {
        const ANGLES: usize = 5;
        let (mut first, mut second) = ((0.0, 0.0), (0.0, 0.0));
        for k in 0..ANGLES {
            let q = std::f64::consts::TAU * k as f64 / ANGLES as f64;
            let share = 2.0 / ANGLES as f64 * value(q);
            let ((sin, cos), (sin2, cos2)) = (q.sin_cos(), (2.0 * q).sin_cos());
            first = (first.0 + share * cos, first.1 + share * sin);
            second = (second.0 + share * cos2, second.1 + share * sin2);
        }
        Self { first, second }
    }

    /// Value without the constant, slope and curvature.
    fn at(&self, q: f64) -> [f64; 3] {
        let ((sin, cos), (sin2, cos2)) = (q.sin_cos(), (2.0 * q).sin_cos());
        let ((c1, s1), (c2, s2)) = (self.first, self.second);
        let (one, two) = (c1 * cos + s1 * sin, c2 * cos2 + s2 * sin2);
        [
            one + two,
            s1 * cos - c1 * sin + 2.0 * (s2 * cos2 - c2 * sin2),
            -one - 4.0 * two,
        ]
    }

    /// Where it is least, in (−π, π].
    fn least(&self) -> f64 {
        /// Squared distances that differ by less, m², differ by rounding.
        const ROUNDING: f64 = 1e-15;
        let amplitude = self.first.0.hypot(self.first.1) + self.second.0.hypot(self.second.1);
        if amplitude < ROUNDING {
            return 0.0;
        }
        let step = std::f64::consts::TAU / STARTS as f64;
        let starts = (0..STARTS).map(|k| step * (k as f64 + 1.0) - std::f64::consts::PI);
        // Points on the axis say nothing.
        let starts = std::iter::once(0.0).chain(starts);
        let value = |q: f64| self.at(q)[0];
        let start = starts.min_by(|a, b| value(*a).total_cmp(&value(*b)));
        let start = start.unwrap_or(0.0);
        let mut q = start;
        for _ in 0..STEPS {
            let [_, slope, curvature] = self.at(q);
            let by = match curvature > 0.0 {
                true => -slope / curvature,
                false => -slope.signum() * 0.25 * step,
            };
            q = (q + by).clamp(start - step, start + step);
        }
        q.sin().atan2(q.cos())
    }
}
