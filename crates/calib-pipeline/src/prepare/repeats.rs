//! Frames of one pose: successive rows whose joint values stay within the jitter of encoders at rest become one row, the mean of joint values
//! and of what was tracked.
//!
//! Ten frames of a pose share the error of the robot's posture. As ten rows they would count it as ten independent
//! ones, and every σ would come out too small. Copies of a row are a special case: they agree in everything. Rows that
//! return to a posture later are new measurements and stay. Of a slow motion neighbors are merged: their mean is as good a pose.

use std::ops::Range;

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_geometry::mean::chordal_mean;
use calib_profile::Usage;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::prepare::inputs::{Inputs, Loaded};

/// Joint values of a robot at rest stay within this, rad or m: two steps of an encoder of 16 bits, 0.011°.
const JITTER: f64 = 2e-4;
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

/// Successive rows in which every joint stays within the jitter, where the bodies stood still meanwhile.
fn postures(loaded: &Loaded) -> Vec<Range<usize>> {
    let mut groups: Vec<Range<usize>> = Vec::new();
    // Smallest and largest value of every joint in the last group.
    let mut span: Vec<(f64, f64)> = Vec::new();
    for (row, q) in loaded.q.iter().enumerate() {
        let wider = q.as_ref().map(|q| {
            let both = span.iter().zip(q);
            let wider = both.map(|(&(least, most), &q)| (least.min(q), most.max(q)));
            wider.collect::<Vec<_>>()
        });
        let rests = |wider: &Vec<(f64, f64)>| {
            let within = |(least, most): &(f64, f64)| most - least <= JITTER;
            !wider.is_empty() && wider.iter().all(within)
        };
        match (groups.last_mut(), wider) {
            (Some(group), Some(wider)) if rests(&wider) && at_rest(loaded, group.start, row) => {
                group.end = row + 1;
                span = wider;
            }
            _ => {
                groups.push(row..row + 1);
                let own = q.iter().flatten().map(|&q| (q, q));
                span = own.collect();
            }
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
    loaded.q = groups
        .iter()
        .map(|g| mean_values(&loaded.q[g.clone()]))
        .collect();
    loaded.poses = kept;
}

/// Of rows that all have joint values, or of a single one.
fn mean_values(rows: &[Option<Vec<f64>>]) -> Option<Vec<f64>> {
    let first = rows[0].as_ref()?;
    // About the first: equal values keep their last bit.
    let mean = |joint: usize| {
        let off = rows.iter().flatten().map(|q| q[joint] - first[joint]);
        first[joint] + off.sum::<f64>() / rows.len() as f64
    };
    Some((0..first.len()).map(mean).collect())
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
