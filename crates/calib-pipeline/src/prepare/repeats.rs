//! Frames of one pose: successive rows whose joint values stay within the jitter of encoders at rest become one row, the mean of joint values
//! and of what was tracked.
//!
//! Ten frames of a pose share the error of the robot's posture. As ten rows they would count it as ten independent
//! ones, and every σ would come out too small. Copies of a row are a special case: they agree in everything. Rows that
//! return to a posture later are new measurements and stay. Of a slow motion neighbors are merged: their mean is as good a pose.

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_geometry::mean::chordal_mean;
use calib_recording::Poses;
use nalgebra::{
    Isometry3, Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6,
};

use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::row_noise::RowNoise;
use crate::prepare::slides::scales;

/// Joint values of a robot at rest stay within this, rad, or m where the robot is large: two steps of an encoder of 16 bits, 0.011°.
pub(crate) const JITTER: f64 = 2e-4;
/// Frames of a robot at rest agree to this, m. Where they do not, the joint values are not those of the rows.
const AT_REST: f64 = 5e-3;
/// Measured twice, a place differs by more than this, m: what is closer was copied and rounded.
const COPIED: f64 = 1e-6;

/// Merges the frames of every posture; a finding for each recording that had some.
pub fn merge(inputs: &mut Inputs) -> Vec<Finding> {
    let found = repeated(inputs);
    let mut findings = Vec::new();
    for Repeated {
        recording,
        groups,
        finding,
    } in found
    {
        if let Some(loaded) = inputs.recordings.get_mut(&recording) {
            merge_rows(loaded, &groups);
        }
        findings.push(finding);
        let place = |row: usize| groups.iter().position(|g| g.contains(&row)).unwrap_or(0);
        let excluded = inputs.excluded.iter_mut();
        for out in excluded.filter(|out| out.recording == recording) {
            out.row = place(out.row);
        }
        let taken_out = std::mem::take(&mut inputs.taken_out).into_iter();
        inputs.taken_out = taken_out
            .map(|(of, row, subject)| {
                let row = if of == recording { place(row) } else { row };
                (of, row, subject)
            })
            .collect();
    }
    findings
}

/// What [`merge`] would find, of recordings that stay as they are.
pub fn found(inputs: &Inputs) -> Vec<Finding> {
    let found = repeated(inputs).into_iter();
    found.map(|repeated| repeated.finding).collect()
}

/// A recording with several frames of a posture.
struct Repeated {
    recording: String,
    /// Its rows, together where they are of one posture.
    groups: Vec<Vec<usize>>,
    finding: Finding,
}

/// The recordings that have several frames of a posture.
fn repeated(inputs: &Inputs) -> Vec<Repeated> {
    let scales = scales(inputs);
    let of = |(name, loaded): (&String, &Loaded)| {
        if loaded.alignment.is_some() || !loaded.shapes.is_empty() {
            return None;
        }
        let groups = postures(loaded, &scales);
        if groups.len() == loaded.q.len() {
            return None;
        }
        let poses = groups.iter().filter(|group| shows(loaded, group[0]));
        let finding = Finding::new(catalog::FRAMES_MERGED, Subject::recording(name.clone()))
            .with("rows", Fact::count(loaded.q.len()))
            .with("poses", Fact::count(poses.count()))
            .with_some("copies", copies(loaded, &groups));
        Some(Repeated {
            recording: name.clone(),
            groups,
            finding,
        })
    };
    inputs.recordings.iter().filter_map(of).collect()
}

/// Successive rows in which every joint stays within the jitter, where the bodies stood still meanwhile. A row that shows nothing is one of its own,
/// and ends no posture.
fn postures(loaded: &Loaded, scales: &[f64]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    // Group of the posture, and smallest and largest value of every joint in it.
    let mut posture: Option<(usize, Vec<(f64, f64)>)> = None;
    for (row, q) in loaded.q.iter().enumerate() {
        if !shows(loaded, row) {
            groups.push(vec![row]);
            continue;
        }
        let own: Vec<(f64, f64)> = q.iter().flatten().map(|&q| (q, q)).collect();
        let goes_on = posture.as_mut().filter(|(group, span)| {
            let within = |joint: usize| {
                let ((least, most), (q, _)) = (span[joint], own[joint]);
                most.max(q) - least.min(q) <= JITTER * scales[joint]
            };
            let rests = !own.is_empty() && span.len() == own.len();
            rests && (0..own.len()).all(within) && at_rest(loaded, groups[*group][0], row)
        });
        match goes_on {
            Some((group, span)) => {
                groups[*group].push(row);
                for ((least, most), (q, _)) in span.iter_mut().zip(own) {
                    (*least, *most) = (least.min(q), most.max(q));
                }
            }
            None => {
                posture = Some((groups.len(), own));
                groups.push(vec![row]);
            }
        }
    }
    groups
}

/// Rows that repeat the row before in everything that was tracked.
fn copies(loaded: &Loaded, groups: &[Vec<usize>]) -> Option<Fact> {
    let pairs = groups.iter().flat_map(|group| group.windows(2));
    let count = pairs
        .filter(|pair| agree(loaded, pair[0], pair[1], COPIED))
        .count();
    (count > 0).then(|| Fact::count(count))
}

/// Whether anything was tracked in a row.
fn shows(loaded: &Loaded, row: usize) -> bool {
    let mut markers = loaded.poses.markers.values();
    let mut bodies = loaded.poses.bodies.values();
    markers.any(|track| track[row].is_some()) || bodies.any(|track| track[row].is_some())
}

/// Whether the body stood still between two rows.
fn at_rest(loaded: &Loaded, a: usize, b: usize) -> bool {
    agree(loaded, a, b, AT_REST)
}

/// Whether everything that both rows show is in the same place to within `tolerance`, m.
fn agree(loaded: &Loaded, a: usize, b: usize, tolerance: f64) -> bool {
    let near = |a: Vector3<f64>, b: Vector3<f64>| (a - b).norm() < tolerance;
    let markers = loaded
        .poses
        .markers
        .values()
        .all(|track| match (track[a], track[b]) {
            (Some(a), Some(b)) => near(a.coords, b.coords),
            _ => true,
        });
    let bodies = loaded
        .poses
        .bodies
        .values()
        .all(|track| match (track[a], track[b]) {
            (Some(a), Some(b)) => near(a.translation.vector, b.translation.vector),
            _ => true,
        });
    markers && bodies
}

fn merge_rows(loaded: &mut Loaded, groups: &[Vec<usize>]) {
    let firsts: Vec<usize> = groups.iter().map(|group| group[0]).collect();
    let all = &loaded.poses;
    loaded.row_noise = frame_noise(all, groups);
    let mut kept = all.select(&firsts);
    for (name, track) in &all.markers {
        let means = groups.iter().map(|group| mean_point(&frames(track, group)));
        kept.markers.insert(name.clone(), means.collect());
    }
    for (name, track) in &all.bodies {
        let means = groups.iter().map(|group| mean_pose(&frames(track, group)));
        kept.bodies.insert(name.clone(), means.collect());
    }
    loaded.q = groups
        .iter()
        .map(|group| mean_values(group.iter().map(|row| loaded.q[*row].as_ref())))
        .collect();
    loaded.poses = kept;
}

/// The noise of single frames about the means of their postures.
fn frame_noise(poses: &Poses, groups: &[Vec<usize>]) -> RowNoise {
    let several = || groups.iter().filter(|group| group.len() > 1);
    let markers = poses.markers.values().map(|track| {
        let scatter = several().map(|group| scatter_of_points(&frames(track, group)));
        scatter.collect::<Vec<_>>()
    });
    let bodies = poses.bodies.values().map(|track| {
        let scatter = several().map(|group| scatter_of_poses(&frames(track, group)));
        scatter.collect::<Vec<_>>()
    });
    let (markers, bodies): (Vec<_>, Vec<_>) = (markers.collect(), bodies.collect());
    RowNoise::of(markers.iter(), bodies.iter())
}

/// Covariance of points about their mean, m².
fn scatter_of_points(seen: &[Point3<f64>]) -> Option<Matrix3<f64>> {
    let mean = mean_point(seen).filter(|_| seen.len() > 1)?;
    let squares = seen.iter().map(|p| (p - mean) * (p - mean).transpose());
    Some(squares.sum::<Matrix3<f64>>() / (seen.len() - 1) as f64)
}

/// Covariance of poses about their mean, rotation (rad) first.
fn scatter_of_poses(seen: &[Isometry3<f64>]) -> Option<Matrix6<f64>> {
    let mean = mean_pose(seen).filter(|_| seen.len() > 1)?;
    let squares = seen.iter().map(|pose| {
        let turned = (mean.rotation.inverse() * pose.rotation).scaled_axis();
        let moved = pose.translation.vector - mean.translation.vector;
        let off = Vector6::from_fn(|i, _| if i < 3 { turned[i] } else { moved[i - 3] });
        off * off.transpose()
    });
    Some(squares.sum::<Matrix6<f64>>() / (seen.len() - 1) as f64)
}

/// What these rows show.
fn frames<T: Copy>(track: &[Option<T>], rows: &[usize]) -> Vec<T> {
    rows.iter().filter_map(|row| track[*row]).collect()
}

/// Of rows that all have joint values, or of a single one.
fn mean_values<'a>(rows: impl Iterator<Item = Option<&'a Vec<f64>>> + Clone) -> Option<Vec<f64>> {
    let first = rows.clone().next()??;
    let count = rows.clone().count() as f64;
    // About the first: equal values keep their last bit.
    let mean = |joint: usize| {
        let off = rows.clone().flatten().map(|q| q[joint] - first[joint]);
        first[joint] + off.sum::<f64>() / count
    };
    Some((0..first.len()).map(mean).collect())
}

fn mean_point(seen: &[Point3<f64>]) -> Option<Point3<f64>> {
    let sum: Vector3<f64> = seen.iter().map(|p| p.coords).sum();
    (!seen.is_empty()).then(|| Point3::from(sum / seen.len() as f64))
}

fn mean_pose(seen: &[Isometry3<f64>]) -> Option<Isometry3<f64>> {
    let rotations: Vec<UnitQuaternion<f64>> = seen.iter().map(|x| x.rotation).collect();
    let sum: Vector3<f64> = seen.iter().map(|x| x.translation.vector).sum();
    let rotation = chordal_mean(&rotations).ok()?;
    Some(Isometry3::from_parts(
        Translation3::from(sum / seen.len() as f64),
        rotation,
    ))
}
