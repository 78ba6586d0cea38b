//! Where the robot stands and how the bodies sit, from closed forms with the nominal robot: start values for the
//! solver, and the "nominal" baseline.
//!
//! A body whose mount is known gives `tracker_from_root` by averaging. Otherwise every tracked point p of an unknown
//! place on its link obeys, with the nominal `root_from_link = (R_i, t_i)`,
//!
//! ```text
//! z_i = R (R_i p + t_i) + t          linear in R, t and B_jkl = R_jk p_l                      (1)
//! ```
//!
//! Three small least-squares problems (one per coordinate of z) give R (projected onto SO(3)), t and p. Few rows leave (1) open; where
//! the least residual over all rotations is much smaller, that rotation is taken.

use std::collections::{BTreeMap, BTreeSet};

use calib_checks::structural::{PointRows, registration, registrations};
use calib_geometry::decompose::solve_least_squares;
use calib_geometry::{mean, so3};
use calib_profile::{Body, BodyKind, Usage};
use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3,
};

use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;

/// Start values.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// `tracker_from_root`.
    pub tracker_from_root: Isometry3<f64>,
    /// `link_from_body` of bodies with a frame.
    pub mounts: BTreeMap<String, Isometry3<f64>>,
    /// Points on their link, of bodies without a frame, by body and marker.
    pub points: BTreeMap<String, BTreeMap<String, Point3<f64>>>,
}

/// A tracked point: its track against the motion of its link.
struct Tracked {
    /// (root_from_link, position in the tracker) per row.
    rows: Vec<(Isometry3<f64>, Point3<f64>)>,
}

/// Relative singular value under which (1) leaves a direction open; LM decides about it later.
const RANK: f64 = 1e-8;

/// Arm at which the orientation of a body counts beside its position, m: bodies are about as large.
const ARM: f64 = 0.1;

/// The linear start is kept up to this many times the least residual: the fit's own steps find the way from there.
const MUCH: f64 = 2.0;

/// Another place of the robot is asked for up to this many times the least residual, or up to what errors of the robot explain of small motions, m.
const LIKE: f64 = 3.0;
const EXPLAINED: f64 = 3e-3;
/// It is turned by this much at the least, rad.
const ANOTHER: f64 = 0.2;
/// As many are asked for.
const MOST_OTHERS: usize = 4;

/// Start values from all fitted recordings.
#[must_use]
pub fn start(inputs: &Inputs, tracks: &BTreeMap<String, BodyTrack>) -> Start {
    let measured = inputs.robot.profile.tracker.from_root.as_ref();
    let tracker_from_root = measured
        .map(|measured| measured.pose)
        .or_else(|| from_known_mounts(inputs, tracks))
        .unwrap_or_else(|| from_points(inputs, tracks));
    start_at(inputs, tracks, tracker_from_root)
}

/// Start values of another place of the robot that the recordings may mean as well, the best first: each leaves less than those around it, and little
/// more than the best. Points that move by little more than errors of the robot explain leave several.
#[must_use]
pub fn others(inputs: &Inputs, tracks: &BTreeMap<String, BodyTrack>, start: &Start) -> Vec<Start> {
    let profile = &inputs.robot.profile;
    let is_stated =
        profile.tracker.from_root.is_some() || profile.bodies.values().any(|b| b.mount.is_some());
    // A body whose orientation is seen turns as the robot turns it in one place only.
    let turns = |(name, body): (&String, &Body)| {
        let has_frame = body.kind == BodyKind::Pose || tracks[name].template.is_some();
        let mut joints = inputs.robot.model.chain_to_root(body.link).into_iter();
        has_frame && joints.any(|joint| inputs.robot.model.joint(joint).kind.turns())
    };
    if is_stated || profile.bodies.iter().any(turns) {
        return Vec::new();
    }
    let all = registrations(&point_rows(inputs, tracks));
    let Some(&(_, least)) = all.first() else {
        return Vec::new();
    };
    let most = f64::max(LIKE * least, EXPLAINED);
    let is_other = |place: &Isometry3<f64>| is_another(&start.tracker_from_root, place);
    all.iter()
        .filter(|(place, rms)| *rms < most && is_other(place))
        .take(MOST_OTHERS)
        .map(|(place, _)| start_at(inputs, tracks, *place))
        .collect()
}

/// Start values of the place, of several, that a fit has taken.
#[must_use]
pub fn start_near(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    near: &Isometry3<f64>,
) -> Start {
    let first = start(inputs, tracks);
    match is_another(&first.tracker_from_root, near) {
        true => start_at(inputs, tracks, *near),
        false => first,
    }
}

/// Whether a place is another minimum, and not the same one beside what errors of the robot do to it.
#[must_use]
pub fn is_another(first: &Isometry3<f64>, place: &Isometry3<f64>) -> bool {
    (first.rotation.inverse() * place.rotation).angle() > ANOTHER
}

/// Start values where the robot stands there.
fn start_at(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    tracker_from_root: Isometry3<f64>,
) -> Start {
    let mut start = Start {
        tracker_from_root,
        mounts: BTreeMap::new(),
        points: BTreeMap::new(),
    };
    for (name, body) in &inputs.robot.profile.bodies {
        if let Some(mount) = body.mount {
            start.mounts.insert(name.clone(), mount);
            continue;
        }
        let poses: Vec<Isometry3<f64>> = body_rows(inputs, &tracks[name], body.link)
            .map(|(root_from_link, tracker_from_body)| {
                (tracker_from_root * root_from_link).inverse() * tracker_from_body
            })
            .collect();
        if let Some(mount) = mean_pose(&poses) {
            start.mounts.insert(name.clone(), mount);
        }
        if let BodyKind::Markers { names, .. } = &body.kind
            && tracks[name].template.is_none()
        {
            let points = names.iter().filter_map(|marker| {
                let rows = marker_rows(inputs, marker, body.link).rows;
                let n = rows.len() as f64;
                let on_link = rows.iter().map(|(root_from_link, z)| {
                    (tracker_from_root * root_from_link)
                        .inverse_transform_point(z)
                        .coords
                });
                let sum: Vector3<f64> = on_link.sum();
                (n > 0.0).then(|| (marker.clone(), Point3::from(sum / n)))
            });
            start.points.insert(name.clone(), points.collect());
        }
    }
    start
}

/// Mean of poses: position average and chordal rotation mean; `None` for no or contradicting rotations.
#[must_use]
pub fn mean_pose(poses: &[Isometry3<f64>]) -> Option<Isometry3<f64>> {
    let rotations: Vec<UnitQuaternion<f64>> = poses.iter().map(|p| p.rotation).collect();
    let rotation = mean::chordal_mean(&rotations).ok()?;
    let position = poses
        .iter()
        .map(|p| p.translation.vector)
        .sum::<Vector3<f64>>()
        / poses.len() as f64;
    Some(Isometry3::from_parts(
        Translation3::from(position),
        rotation,
    ))
}

/// (root_from_link, tracker_from_body) of every fitted row that shows the body.
fn body_rows<'a>(
    inputs: &'a Inputs,
    track: &'a BodyTrack,
    link: calib_urdf::LinkId,
) -> impl Iterator<Item = (Isometry3<f64>, Isometry3<f64>)> + 'a {
    let fitted = inputs
        .recordings
        .values()
        .filter(|r| r.spec.usage != Usage::Validation);
    fitted.flat_map(move |r| {
        let poses = track.in_recording(&r.name);
        r.q.iter().zip(poses).filter_map(move |(q, pose)| {
            let root_from_link = inputs.robot.model.root_from_link(q.as_ref()?, link);
            Some((root_from_link, (*pose)?))
        })
    })
}

fn marker_rows(inputs: &Inputs, marker: &str, link: calib_urdf::LinkId) -> Tracked {
    let mut rows = Vec::new();
    for r in inputs
        .recordings
        .values()
        .filter(|r| r.spec.usage != Usage::Validation)
    {
        let Some(track) = r.poses.markers.get(marker) else {
            continue;
        };
        for (q, z) in r.q.iter().zip(track) {
            if let (Some(q), Some(z)) = (q, z) {
                rows.push((inputs.robot.model.root_from_link(q, link), *z));
            }
        }
    }
    Tracked { rows }
}

fn from_known_mounts(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
) -> Option<Isometry3<f64>> {
    let mut poses = Vec::new();
    for (name, body) in &inputs.robot.profile.bodies {
        let Some(mount) = body.mount else { continue };
        poses.extend(body_rows(inputs, &tracks[name], body.link).map(
            |(root_from_link, tracker_from_body)| {
                tracker_from_body * (root_from_link * mount).inverse()
            },
        ));
    }
    mean_pose(&poses)
}

/// Where the root of the nominal robot is by these bodies alone; `None` where they do not show it.
#[must_use]
pub fn registered(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    bodies: &BTreeSet<&str>,
) -> Option<Isometry3<f64>> {
    let (tracked, mut points) = tracked_points(inputs, tracks, |name| bodies.contains(name));
    let linear = solve_points(&tracked).unwrap_or_else(Isometry3::identity);
    points.extend(tracked.into_iter().map(|t| t.rows));
    Some(registration(&points, &linear)?.tracker_from_root)
}

fn from_points(inputs: &Inputs, tracks: &BTreeMap<String, BodyTrack>) -> Isometry3<f64> {
    let (tracked, mut points) = tracked_points(inputs, tracks, |_| true);
    let linear = solve_points(&tracked).unwrap_or_else(Isometry3::identity);
    points.extend(tracked.into_iter().map(|t| t.rows));
    let best = registration(&points, &linear);
    let best = best.filter(|found| found.rms_of_other > MUCH * found.rms);
    best.map_or(linear, |found| found.tracker_from_root)
}

/// The rows of all points.
fn point_rows(inputs: &Inputs, tracks: &BTreeMap<String, BodyTrack>) -> Vec<PointRows> {
    let (tracked, mut points) = tracked_points(inputs, tracks, |_| true);
    points.extend(tracked.into_iter().map(|t| t.rows));
    points
}

/// Markers and the positions of poses; and the ends of three arms of every pose, which count for its orientation.
fn tracked_points(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    of: impl Fn(&str) -> bool,
) -> (Vec<Tracked>, Vec<PointRows>) {
    let mut tracked = Vec::new();
    let mut points: Vec<PointRows> = Vec::new();
    for (name, body) in inputs.robot.profile.bodies.iter().filter(|b| of(b.0)) {
        match &body.kind {
            BodyKind::Markers { names, .. } if tracks[name].template.is_none() => {
                tracked.extend(
                    names
                        .iter()
                        .map(|marker| marker_rows(inputs, marker, body.link)),
                );
            }
            _ => {
                let rows: PointRows = body_rows(inputs, &tracks[name], body.link)
                    .map(|(root_from_link, body)| {
                        (root_from_link, Point3::from(body.translation.vector))
                    })
                    .collect();
                for axis in 0..3 {
                    let arm = Point3::from(Vector3::ith(axis, ARM));
                    let rows = body_rows(inputs, &tracks[name], body.link);
                    points.push(rows.map(|(link, body)| (link, body * arm)).collect());
                }
                tracked.push(Tracked { rows });
            }
        }
    }
    (tracked, points)
}

/// Eq. (1) over all tracked points, which share R and t.
fn solve_points(tracked: &[Tracked]) -> Option<Isometry3<f64>> {
    let rows: usize = tracked.iter().map(|t| t.rows.len()).sum();
    // Per coordinate j: R_j1..3, t_j, and B_jkl (9) per point.
    let columns = 4 + 9 * tracked.len();
    if rows == 0 {
        return None;
    }
    // Relative to the mean position, so that t does not swamp the rest.
    let mean_z = tracked
        .iter()
        .flat_map(|t| &t.rows)
        .map(|(_, z)| z.coords)
        .sum::<Vector3<f64>>()
        / rows as f64;
    let mut a = DMatrix::zeros(rows, columns);
    let mut z = [
        DVector::zeros(rows),
        DVector::zeros(rows),
        DVector::zeros(rows),
    ];
    let mut row = 0;
    for (k, point) in tracked.iter().enumerate() {
        for (root_from_link, seen) in &point.rows {
            let r = root_from_link.rotation.to_rotation_matrix();
            for c in 0..3 {
                a[(row, c)] = root_from_link.translation.vector[c];
                for l in 0..3 {
                    a[(row, 4 + 9 * k + 3 * c + l)] = r[(c, l)];
                }
                z[c][row] = seen[c] - mean_z[c];
            }
            a[(row, 3)] = 1.0;
            row += 1;
        }
    }
    let solutions: Vec<DVector<f64>> = z
        .iter()
        .map(|z| solve_least_squares(&a, z, RANK).x)
        .collect();
    let linear = Matrix3::from_fn(|j, k| solutions[j][k]);
    // Points far from the robot's root carry R in B as well: B_jkl = R_jk p_l.
    let mut evidence = linear;
    for point in 0..tracked.len() {
        let b = |j: usize, k: usize, l: usize| solutions[j][4 + 9 * point + 3 * k + l];
        // p_l up to the scale of R: project on the current guess of R where there is one.
        if let Some(r) = so3::nearest_rotation(&evidence) {
            let r = r.to_rotation_matrix();
            let p = Vector3::from_fn(|l, _| {
                (0..9)
                    .map(|i| r[(i / 3, i % 3)] * b(i / 3, i % 3, l))
                    .sum::<f64>()
                    / 3.0
            });
            evidence += Matrix3::from_fn(|j, k| (0..3).map(|l| b(j, k, l) * p[l]).sum());
        }
    }
    let rotation = so3::nearest_rotation(&evidence)?;
    let r = rotation.to_rotation_matrix();
    // With R known the rest is linear: z − R t_i = (R R_i) p + t.
    let mut a = DMatrix::zeros(3 * rows, 3 + 3 * tracked.len());
    let mut b = DVector::zeros(3 * rows);
    let mut row = 0;
    for (k, point) in tracked.iter().enumerate() {
        for (root_from_link, seen) in &point.rows {
            let turned = r.matrix() * root_from_link.rotation.to_rotation_matrix().matrix();
            let rest = seen.coords - rotation * root_from_link.translation.vector;
            for j in 0..3 {
                a[(row, j)] = 1.0;
                for l in 0..3 {
                    a[(row, 3 + 3 * k + l)] = turned[(j, l)];
                }
                b[row] = rest[j];
                row += 1;
            }
        }
    }
    let x = solve_least_squares(&a, &b, RANK).x;
    Some(Isometry3::from_parts(
        Translation3::new(x[0], x[1], x[2]),
        rotation,
    ))
}
