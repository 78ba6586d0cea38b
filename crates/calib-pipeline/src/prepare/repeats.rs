//! Frames of one pose: successive rows with equal joint values become one row, the mean of what was tracked.
//!
//! Ten frames of a pose share the error of the robot's posture. As ten rows they would count it as ten independent
//! ones, and every σ would come out too small. Copies of a row are a special case: they agree in everything. Rows that
//! return to a posture later are new measurements and stay.

use std::ops::Range;

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_geometry::mean::chordal_mean;
use calib_profile::Usage;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::prepare::inputs::{Inputs, Loaded};

/// Joint values that agree to this are one posture: below the resolution of any encoder, rad or m.
const EQUAL: f64 = 1e-7;
/// Frames of a robot at rest agree to this, m. Where they do not, the joint values are not those of the rows.
const AT_REST: f64 = 5e-3;
/// Measured twice, a place differs by more than this, m: what is closer was copied and rounded.
const COPIED: f64 = 1e-6;

/// Merges the frames of every posture in the recordings that are fitted; a finding for each recording that had some.
pub fn merge(inputs: &mut Inputs) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut moved = Vec::new();
    for loaded in inputs.recordings.values_mut() {
        let fitted = loaded.spec.usage != Usage::Validation;
        if !fitted || loaded.alignment.is_some() || !loaded.shapes.is_empty() {
            continue;
        }
        let groups = postures(loaded);
        if groups.len() == loaded.q.len() {
            continue;
        }
        findings.push(
            Finding::new(
                catalog::FRAMES_MERGED,
                Subject::recording(loaded.name.clone()),
            )
            .with("rows", Fact::count(loaded.q.len()))
            .with("poses", Fact::count(groups.len()))
            .with_some("copies", copies(loaded, &groups)),
        );
        merge_rows(loaded, &groups);
        moved.push((loaded.name.clone(), groups));
    }
    for (recording, groups) in moved {
        for out in inputs
            .excluded
            .iter_mut()
            .filter(|e| e.recording == recording)
        {
            out.row = groups
                .iter()
                .position(|g| g.contains(&out.row))
                .unwrap_or(0);
        }
    }
    findings
}

/// Successive rows with equal joint values, where the bodies stood still meanwhile.
fn postures(loaded: &Loaded) -> Vec<Range<usize>> {
    let equal = |a: usize, b: usize| match (&loaded.q[a], &loaded.q[b]) {
        (Some(a), Some(b)) => a.iter().zip(b).all(|(a, b)| (a - b).abs() <= EQUAL),
        _ => false,
    };
    let mut groups: Vec<Range<usize>> = Vec::new();
    for row in 0..loaded.q.len() {
        match groups.last_mut() {
            Some(group) if equal(group.start, row) && at_rest(loaded, group.start, row) => {
                group.end = row + 1
            }
            _ => groups.push(row..row + 1),
        }
    }
    groups
}

/// Rows that repeat the row before in everything that was tracked.
fn copies(loaded: &Loaded, groups: &[Range<usize>]) -> Option<Fact> {
    let rows = groups.iter().flat_map(|group| group.start + 1..group.end);
    let count = rows
        .filter(|&row| agree(loaded, row - 1, row, COPIED))
        .count();
    (count > 0).then(|| Fact::count(count))
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

fn merge_rows(loaded: &mut Loaded, groups: &[Range<usize>]) {
    let firsts: Vec<usize> = groups.iter().map(|g| g.start).collect();
    let all = &loaded.poses;
    let mut kept = all.select(&firsts);
    for (name, track) in &all.markers {
        kept.markers.insert(
            name.clone(),
            groups
                .iter()
                .map(|g| mean_point(&track[g.clone()]))
                .collect(),
        );
    }
    for (name, track) in &all.bodies {
        kept.bodies.insert(
            name.clone(),
            groups
                .iter()
                .map(|g| mean_pose(&track[g.clone()]))
                .collect(),
        );
    }
    loaded.q = firsts.iter().map(|row| loaded.q[*row].clone()).collect();
    loaded.poses = kept;
}

fn mean_point(frames: &[Option<Point3<f64>>]) -> Option<Point3<f64>> {
    let seen: Vec<Vector3<f64>> = frames.iter().flatten().map(|p| p.coords).collect();
    let sum: Vector3<f64> = seen.iter().sum();
    (!seen.is_empty()).then(|| Point3::from(sum / seen.len() as f64))
}

fn mean_pose(frames: &[Option<Isometry3<f64>>]) -> Option<Isometry3<f64>> {
    let seen: Vec<&Isometry3<f64>> = frames.iter().flatten().collect();
    let rotations: Vec<UnitQuaternion<f64>> = seen.iter().map(|x| x.rotation).collect();
    let sum: Vector3<f64> = seen.iter().map(|x| x.translation.vector).sum();
    let rotation = chordal_mean(&rotations).ok()?;
    Some(Isometry3::from_parts(
        Translation3::from(sum / seen.len() as f64),
        rotation,
    ))
}
