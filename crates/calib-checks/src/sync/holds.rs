//! Intervals in which nothing moves, and one pose for each of them.

use crate::statistics::{robust_range_limit, written_step};
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_geometry::{mean::chordal_mean, se3};
use calib_recording::Poses;
use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;

/// When something stands still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoldSettings {
    /// Shortest hold, s. Default 0.5: arms ring for a few tenths of a second.
    pub min_duration: f64,
    /// Window in which everything must stay together, s. Default 0.2.
    pub window: f64,
    /// Range of a joint within the window, rad or m. Default 1e-3: 5 mrad/s.
    pub joint_range: f64,
    /// Range of a marker or body within the window, m. Default 1e-3: ten σ of a usual tracker. Where more noise is seen while the joints
    /// stand still, nine times that.
    pub point_range: f64,
    /// Range of a body's angle within the window, rad. Default 0.01, or as of a point.
    pub turn_range: f64,
    /// Part of each hold that is dropped at its start. Default 0.2.
    pub drop_start: f64,
}

impl Default for HoldSettings {
    fn default() -> Self {
        HoldSettings {
            min_duration: 0.5,
            window: 0.2,
            joint_range: 1e-3,
            point_range: 1e-3,
            turn_range: 0.01,
            drop_start: 0.2,
        }
    }
}

/// One hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Hold {
    /// Rows (from 0) that count, the start already dropped.
    pub rows: std::ops::Range<usize>,
    /// Time of the first and last of them, s.
    pub span: (f64, f64),
}

/// Static poses made of holds.
#[derive(Clone, Debug, Default)]
pub struct StaticPoses {
    /// One row per hold; `rows` are those of the holds' first samples.
    pub poses: Poses,
    /// Marker → covariance of one sample within each hold, m² (`None` below four samples). Divide by the number of
    /// samples for the mean only where their noise is independent; trackers' noise often is not.
    pub marker_covariance: BTreeMap<String, Vec<Option<Matrix3<f64>>>>,
    /// Body → covariance of one sample in the body frame, `[ω; v]`.
    pub body_covariance: BTreeMap<String, Vec<Option<Matrix6<f64>>>>,
    /// Marker or body → step that its positions were rounded to when they were written, m; 0 where none shows.
    pub written_step: BTreeMap<String, f64>,
    /// Holds that drift although they passed the thresholds.
    pub findings: Vec<Finding>,
}

/// The holds of a table with time; empty without time.
///
/// A hold ends where rows are missing for longer than the window (nobody saw whether it moved), and where the table
/// says so itself: in a column `hold`, as recorded live, each text is a hold of its own.
pub fn holds(poses: &Poses, settings: &HoldSettings) -> Vec<Hold> {
    let Some(t) = &poses.t else { return Vec::new() };
    let mut joints = Vec::new();
    for q in poses.joints.values() {
        joints.push((q.clone(), settings.joint_range));
    }
    let resting = quiet(t, &joints, settings.window);
    let mut channels: Vec<Channel> = Vec::new();
    for mut group in tracked(poses, settings) {
        // Of the noise of an angle, an entry of R shows more in one posture than in another: the noise of a group is its largest.
        let noises = group.iter().map(|(values, _)| noise(values, &resting));
        let seen = SPREAD * noises.fold(0.0, f64::max);
        group
            .iter_mut()
            .for_each(|(_, limit)| *limit = limit.max(seen));
        channels.extend(group);
    }
    channels.extend(joints);
    let quiet = quiet(t, &channels, settings.window);
    let names = poses.labels.get("hold");
    let apart = |end: usize| {
        t[end] - t[end - 1] > settings.window
            || names.is_some_and(|names| names[end] != names[end - 1])
    };
    let mut found = Vec::new();
    let mut start = 0;
    for end in 1..=t.len() {
        if end < t.len() && quiet[end] == quiet[start] && !apart(end) {
            continue;
        }
        if quiet[start] && t[end - 1] - t[start] >= settings.min_duration {
            let after = t[start] + settings.drop_start * (t[end - 1] - t[start]);
            let first = (start..end).find(|&i| t[i] >= after).unwrap_or(start);
            found.push(Hold {
                rows: first..end,
                span: (t[first], t[end - 1]),
            });
        }
        start = end;
    }
    found
}

/// Values that must stand still, with the limit of their range.
type Channel = (Vec<Option<f64>>, f64);

/// The range of noise within a window, in units of its σ: twenty samples exceed it in one window of 10⁷.
const SPREAD: f64 = 9.0;

/// Fewest second differences that tell a noise.
const ENOUGH: usize = 20;

/// Rows about which all channels stand still within the window.
fn quiet(t: &[f64], channels: &[Channel], window: f64) -> Vec<bool> {
    let mut quiet = vec![false; t.len()];
    let (mut from, mut to) = (0, 0);
    for i in 0..t.len() {
        while t[i] - t[from] > window / 2.0 {
            from += 1;
        }
        while to + 1 < t.len() && t[to + 1] - t[i] <= window / 2.0 {
            to += 1;
        }
        quiet[i] = channels
            .iter()
            .all(|(values, limit)| range(&values[from..=to]).is_none_or(|range| range <= *limit));
    }
    quiet
}

/// σ of a channel while the joints rest, from the median of its second differences, which a slow drift does not enter. 0 where too few are known,
/// or where the joints rest everywhere (none are recorded).
fn noise(values: &[Option<f64>], resting: &[bool]) -> f64 {
    /// Median of |z| of a normal variable.
    const MIDDLE: f64 = 0.674_5;
    if resting.iter().all(|rest| *rest) {
        return 0.0;
    }
    let at_rest =
        (1..values.len().max(1) - 1).filter(|&i| resting[i - 1] && resting[i] && resting[i + 1]);
    let differences =
        at_rest.filter_map(|i| Some((values[i - 1]? - 2.0 * values[i]? + values[i + 1]?).abs()));
    let differences: Vec<f64> = differences.collect();
    if differences.len() < ENOUGH {
        return 0.0;
    }
    crate::statistics::median(differences).unwrap_or(0.0) / (MIDDLE * 6f64.sqrt())
}

/// The coordinates of every marker and body, and the entries of every body's R, each with its limit.
fn tracked(poses: &Poses, settings: &HoldSettings) -> Vec<Vec<Channel>> {
    let mut groups: Vec<Vec<Channel>> = Vec::new();
    for track in poses.markers.values() {
        // What stands still may be written as two neighboring multiples of the step.
        let limit = settings.point_range + step_of_points(track);
        let axis = |axis: usize| (track.iter().map(|p| p.map(|p| p[axis])).collect(), limit);
        groups.push((0..3).map(axis).collect());
    }
    for track in poses.bodies.values() {
        let limit = settings.point_range + step_of_poses(track);
        let axis = |axis: usize| {
            let values = track.iter().map(|p| p.map(|p| p.translation.vector[axis]));
            (values.collect(), limit)
        };
        groups.push((0..3).map(axis).collect());
        // The nine entries of R change by at most the angle.
        let entry = |at: usize| {
            let of = |p: &Isometry3<f64>| p.rotation.to_rotation_matrix()[(at / 3, at % 3)];
            let values = track.iter().map(|p| p.as_ref().map(of));
            (values.collect(), settings.turn_range)
        };
        groups.push((0..9).map(entry).collect());
    }
    groups
}

fn step_of_points(track: &[Option<Point3<f64>>]) -> f64 {
    written_step(track.iter().flatten().flat_map(|p| p.iter().copied()))
}

fn step_of_poses(track: &[Option<Isometry3<f64>>]) -> f64 {
    let places = track.iter().flatten().map(|p| &p.translation.vector);
    written_step(places.flat_map(|p| p.iter().copied()))
}

fn range(values: &[Option<f64>]) -> Option<f64> {
    let range = values
        .iter()
        .flatten()
        .fold(None, |range: Option<(f64, f64)>, &v| {
            Some(range.map_or((v, v), |(low, high)| (low.min(v), high.max(v))))
        });
    range.map(|(low, high)| high - low)
}

/// One pose per hold: medians of joints and marker coordinates, chordal mean and median translation of bodies, with the
/// empirical covariance of the samples. A hold whose halves differ by more than noise gets a finding.
pub fn static_poses(poses: &Poses, holds: &[Hold]) -> StaticPoses {
    let mut out = StaticPoses::default();
    let first: Vec<usize> = holds.iter().map(|hold| hold.rows.start).collect();
    out.poses.rows = first.iter().map(|&i| poses.rows[i]).collect();
    out.poses.joint_units = poses.joint_units.clone();
    out.poses.labels = poses
        .labels
        .iter()
        .map(|(name, texts)| {
            (
                name.clone(),
                first.iter().map(|&i| texts[i].clone()).collect(),
            )
        })
        .collect();
    let scalars = |all: &BTreeMap<String, Vec<Option<f64>>>| {
        all.iter()
            .map(|(name, values)| {
                (
                    name.clone(),
                    holds
                        .iter()
                        .map(|hold| middle(values[hold.rows.clone()].iter().flatten().copied()))
                        .collect(),
                )
            })
            .collect()
    };
    out.poses.joints = scalars(&poses.joints);
    out.poses.torques = scalars(&poses.torques);
    out.poses.temperatures = scalars(&poses.temperatures);
    for (name, track) in &poses.markers {
        let (mut means, mut covariances) = (Vec::new(), Vec::new());
        let step = step_of_points(track);
        out.written_step.insert(name.clone(), step);
        for hold in holds {
            let points: Vec<Vector3<f64>> = track[hold.rows.clone()]
                .iter()
                .flatten()
                .map(|p| p.coords)
                .collect();
            means.push(middle_point(&points).map(Point3::from));
            covariances.push(covariance3(&points));
            out.findings
                .extend(drift(Subject::marker(name), poses, hold, (&points, step)));
        }
        out.poses.markers.insert(name.clone(), means);
        out.marker_covariance.insert(name.clone(), covariances);
    }
    for (name, track) in &poses.bodies {
        let (mut means, mut covariances) = (Vec::new(), Vec::new());
        let step = step_of_poses(track);
        out.written_step.insert(name.clone(), step);
        for hold in holds {
            let seen: Vec<Isometry3<f64>> =
                track[hold.rows.clone()].iter().flatten().copied().collect();
            let points: Vec<Vector3<f64>> = seen.iter().map(|p| p.translation.vector).collect();
            let rotations: Vec<UnitQuaternion<f64>> = seen.iter().map(|p| p.rotation).collect();
            let mean = middle_point(&points)
                .zip(chordal_mean(&rotations).ok())
                .map(|(t, r)| Isometry3::from_parts(Translation3::from(t), r));
            covariances.push(mean.and_then(|mean| covariance6(&mean, &seen)));
            means.push(mean);
            out.findings
                .extend(drift(Subject::body(name), poses, hold, (&points, step)));
        }
        out.poses.bodies.insert(name.clone(), means);
        out.body_covariance.insert(name.clone(), covariances);
    }
    out
}

fn middle(values: impl Iterator<Item = f64>) -> Option<f64> {
    crate::statistics::median(values.collect())
}

fn middle_point(points: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    let axis = |k: usize| middle(points.iter().map(|p| p[k]));
    Some(Vector3::new(axis(0)?, axis(1)?, axis(2)?))
}

fn covariance3(points: &[Vector3<f64>]) -> Option<Matrix3<f64>> {
    let n = points.len() as f64;
    let mean = points.iter().sum::<Vector3<f64>>() / n;
    (points.len() >= 4).then(|| {
        points
            .iter()
            .map(|p| (p - mean) * (p - mean).transpose())
            .sum::<Matrix3<f64>>()
            / (n - 1.0)
    })
}

fn covariance6(mean: &Isometry3<f64>, poses: &[Isometry3<f64>]) -> Option<Matrix6<f64>> {
    let xi = poses
        .iter()
        .map(|pose| se3::log(&(mean.inverse() * pose)).0);
    (poses.len() >= 7).then(|| {
        xi.map(|xi| xi * xi.transpose()).sum::<Matrix6<f64>>() / (poses.len() as f64 - 1.0)
    })
}

/// The means of both halves differ by more than the scatter and the step of the written positions explain.
fn drift(
    subject: Subject,
    poses: &Poses,
    hold: &Hold,
    (points, step): (&[Vector3<f64>], f64),
) -> Option<Finding> {
    let covariance = covariance3(points)?;
    let half = points.len() / 2;
    let mean = |part: &[Vector3<f64>]| part.iter().sum::<Vector3<f64>>() / part.len() as f64;
    let off = mean(&points[half..]) - mean(&points[..half]);
    // Scatter within the halves, from successive differences, which a slow drift does not enter: E|Δ|² = 2·tr Σ.
    let steps: f64 = points
        .windows(2)
        .map(|w| (w[1] - w[0]).norm_squared())
        .sum::<f64>()
        / (points.len() - 1) as f64;
    let sigma = (steps / 2.0 / 3.0)
        .sqrt()
        .min((covariance.trace() / 3.0).sqrt());
    // Where noise is far below the step, the least motion over the middle of two multiples moves each coordinate by a step.
    let expected = robust_range_limit(sigma, half) + 3.0_f64.sqrt() * step;
    (half >= 5 && off.norm() > expected).then(|| {
        Finding::of_kind(catalog::UNSETTLED_ROWS, "drift", subject)
            .with("drift", Fact::meters(off.norm()))
            .with("time", Fact::seconds(hold.span.0))
            .with("limit", Fact::meters(expected))
            .at_rows(hold.rows.clone().map(|i| poses.rows[i]))
    })
}
