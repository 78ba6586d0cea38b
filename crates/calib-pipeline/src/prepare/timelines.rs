//! The timelines of tracker and robot: one recording of two files, the tracker's table, and the offset of the clocks.

use std::collections::BTreeMap;

use calib_checks::model::alignment;
use calib_checks::rigid_body::{Template, body_poses};
use calib_checks::sync::{
    ClockMap, LinkTrack, OffsetOutcome, OffsetSettings, PointTrack, RotationTrack, clock_offset,
    clock_offset_of_point,
};
use calib_finding::{About, Fact, Finding, catalog};
use calib_geometry::statistics::median;
use calib_profile::{BodyKind, RecordingSpec, Timing};
use calib_recording::{Filled, Poses, Recording};
use calib_urdf::LinkId;
use nalgebra::{Isometry3, Point3};

use crate::error::{NotATrack, RowsDiffer};
use crate::prepare::aligned::SAME_TIME;
use crate::prepare::inputs::RobotProfile;
use crate::prepare::streams::{Scalars, interpolated_body, interpolated_point};

/// The recording with the streams of the robot's own file added, under clocks of their own.
#[must_use]
pub fn with_robot_log(mut tracker: Recording, robot: Recording) -> Recording {
    let first = tracker.timelines.len();
    // The log's own joints count, not copies that the tracker's file may have.
    if !robot.joints.is_empty() {
        tracker.joints.clear();
    }
    tracker
        .timelines
        .extend(robot.timelines.into_iter().map(|mut line| {
            line.clock = format!("robot's file: {}", line.clock);
            line
        }));
    tracker.joints.extend(robot.joints.into_iter().map(|mut s| {
        s.timeline += first;
        s
    }));
    tracker
        .torques
        .extend(robot.torques.into_iter().map(|mut s| {
            s.timeline += first;
            s
        }));
    let temperatures = robot.temperatures.into_iter().map(|mut s| {
        s.timeline += first;
        s
    });
    tracker.temperatures.extend(temperatures);
    tracker.meta.conversions.extend(robot.meta.conversions);
    tracker.meta.findings.extend(robot.meta.findings);
    let columns = robot.meta.joint_columns;
    tracker.meta.joint_columns.extend(columns);
    let inverse = robot.meta.inverse_bodies;
    tracker.meta.inverse_bodies.extend(inverse);
    tracker
}

/// The recording with the joints of the robot's own file, whose rows are the tracker's: both have one row for every posture.
///
/// # Errors
/// [`RowsDiffer`] where the files have not the same number of rows, or columns that name the rows disagree.
pub fn with_robot_rows(tracker: Recording, robot: Recording) -> Result<Recording, RowsDiffer> {
    let (Some(of_tracker), Some(of_robot)) = (
        tracker_timeline(&tracker),
        robot.joints.first().map(|s| s.timeline),
    ) else {
        return Err(RowsDiffer::Nothing);
    };
    let (lines, joints) = (&tracker.timelines[of_tracker], &robot.timelines[of_robot]);
    if lines.len() != joints.len() {
        return Err(RowsDiffer::Count {
            tracker: lines.len(),
            robot: joints.len(),
        });
    }
    for (label, texts) in &lines.labels {
        let others = joints.labels.get(label).into_iter().flatten();
        let pairs = texts.iter().zip(others).zip(&lines.rows);
        let differ = |((a, b), _): &((&String, &String), &u64)| a != b;
        if let Some(((tracker, robot), row)) = pairs.into_iter().find(differ) {
            return Err(RowsDiffer::Label {
                label: label.clone(),
                row: *row,
                tracker: tracker.clone(),
                robot: robot.clone(),
            });
        }
    }
    let first = tracker.timelines.len();
    let mut joined = with_robot_log(tracker, robot);
    let to = |line: &mut usize| {
        if *line == first + of_robot {
            *line = of_tracker;
        }
    };
    joined.joints.iter_mut().for_each(|s| to(&mut s.timeline));
    joined.torques.iter_mut().for_each(|s| to(&mut s.timeline));
    let temperatures = joined.temperatures.iter_mut();
    temperatures.for_each(|s| to(&mut s.timeline));
    joined.timelines.truncate(first);
    Ok(joined)
}

/// The time line with most samples among those of markers and bodies.
#[must_use]
pub fn tracker_timeline(recording: &Recording) -> Option<usize> {
    let markers = recording.markers.iter().map(|m| m.timeline);
    let bodies = recording.bodies.iter().map(|b| b.timeline);
    markers.chain(bodies).max_by_key(|&line| {
        let samples = recording
            .timelines
            .get(line)
            .map_or(0, calib_recording::Timeline::len);
        (samples, std::cmp::Reverse(line))
    })
}

/// Markers and bodies at the tracker's times; streams on another line of the same device are interpolated.
pub(crate) fn tracker_table(
    recording: &Recording,
    line: usize,
    times: &[f64],
) -> Result<Poses, NotATrack> {
    let own = &recording.timelines[line];
    let mut poses = Poses {
        rows: own.rows.clone(),
        t: Some(times.to_vec()),
        labels: own.labels.clone(),
        ..Poses::default()
    };
    let no_time = |stream: &str| NotATrack::NoTime {
        stream: stream.to_owned(),
    };
    let twice = |stream: &str| NotATrack::NameTwice {
        stream: stream.to_owned(),
    };
    for marker in &recording.markers {
        let points: Vec<Option<Point3<f64>>> = marker
            .samples
            .iter()
            .map(|s| s.point(Filled::Exclude))
            .collect();
        let track = if marker.timeline == line {
            points
        } else {
            let known = recording.timelines.get(marker.timeline);
            let t = known
                .and_then(|l| l.t.as_ref())
                .ok_or_else(|| no_time(&marker.name))?;
            times
                .iter()
                .map(|&at| interpolated_point(t, &points, at))
                .collect()
        };
        if poses.markers.insert(marker.name.clone(), track).is_some() {
            return Err(twice(&marker.name));
        }
    }
    for body in &recording.bodies {
        let track: Vec<Option<Isometry3<f64>>> = if body.timeline == line {
            body.tracker_from_body.clone()
        } else {
            let known = recording.timelines.get(body.timeline);
            let t = known
                .and_then(|l| l.t.as_ref())
                .ok_or_else(|| no_time(&body.name))?;
            let at = |&at: &f64| interpolated_body(t, &body.tracker_from_body, at);
            times.iter().map(at).collect()
        };
        if poses.bodies.insert(body.name.clone(), track).is_some() {
            return Err(twice(&body.name));
        }
    }
    Ok(poses)
}

/// σ of an offset by angular speed, s, from which places are asked too: a fit starts well from it.
const SURE: f64 = 5e-3;
/// Two offsets agree within so many σ of their difference.
const AGREE: f64 = 4.0;

/// Equation (1) from the body that tells it best, by its angular speed; where none tells it well, as of a robot that hardly turns, by the places
/// of markers and bodies. Else why not.
pub(crate) fn estimate(
    robot: &RobotProfile,
    spec: &RecordingSpec,
    timing: &Timing,
    table: &Poses,
    joints: &BTreeMap<String, Scalars>,
) -> Result<(String, ClockMap), Box<Finding>> {
    let settings = OffsetSettings {
        max_offset: timing.max_offset,
        ..OffsetSettings::default()
    };
    let mut turning = Vec::new();
    let mut links = Vec::new();
    for (name, body) in &robot.profile.bodies {
        let link = link_poses(robot, spec, joints, body.link);
        if let Some(seen) = orientation(table, name, &body.kind) {
            let poses = link.iter().copied();
            let link = RotationTrack::new(poses.map(|(t, pose)| (t, pose.map(|p| p.rotation))));
            turning.push((name.clone(), clock_offset(&seen, &link, &settings)));
        }
        links.push((name, &body.kind, link));
    }
    let told = (!turning.is_empty()).then(|| best(turning));
    let sure = |(_, map): &(String, ClockMap)| map.offset_sigma < SURE;
    if let Some(Ok(found)) = told.as_ref().filter(|told| told.as_ref().is_ok_and(sure)) {
        return Ok(found.clone());
    }
    let mut moving = Vec::new();
    for (name, kind, link) in links {
        let link = LinkTrack::new(link);
        for seen in points(table, name, kind) {
            let outcome = clock_offset_of_point(&seen, &link, &settings);
            moving.push((name.clone(), outcome));
        }
    }
    let moving = best(moving);
    if let Some(Ok(of_turn)) = told {
        let agrees = |map: &ClockMap| {
            let sigma = map.offset_sigma.hypot(of_turn.1.offset_sigma);
            map.offset_sigma < of_turn.1.offset_sigma
                && (map.offset - of_turn.1.offset).abs() < AGREE * sigma
        };
        return Ok(moving
            .ok()
            .filter(|(_, map)| agrees(map))
            .unwrap_or(of_turn));
    }
    moving.map_err(|of_points| {
        let why = told.and_then(Result::err).unwrap_or(of_points);
        let short = why.facts.get("kind").and_then(Fact::word) == Some("too_short");
        let apart = short.then(|| apart(table, joints, timing.max_offset));
        apart.flatten().map_or(why, Box::new)
    })
}

/// Offsets (s) at which tracker and robot have half of the shorter recording in common, least and largest; `None`: one has no times.
#[must_use]
pub fn overlapping_offsets(
    tracker: &[f64],
    joints: &BTreeMap<String, Scalars>,
) -> Option<(f64, f64)> {
    let longest = joints.values().max_by_key(|j| j.t.len())?;
    let ends = |t: &[f64]| Some((*t.first()?, *t.last()?));
    let (a, b) = (ends(tracker)?, ends(&longest.t)?);
    let half = 0.5 * (a.1 - a.0).min(b.1 - b.0);
    Some((a.0 - b.1 + half, a.1 - b.0 - half))
}

/// The clocks are further apart than is looked for.
fn apart(table: &Poses, joints: &BTreeMap<String, Scalars>, searched: f64) -> Option<Finding> {
    let (least, most) = overlapping_offsets(table.t.as_deref()?, joints)?;
    if least <= searched && most >= -searched {
        return None;
    }
    let needed = least.abs().max(most.abs()).ceil();
    Some(
        Finding::of_kind(catalog::CLOCK_LAG, "apart", About::Clocks)
            .with("searched", Fact::seconds(searched))
            .with("least", Fact::seconds(least))
            .with("most", Fact::seconds(most))
            .with("needed", Fact::count(needed as usize)),
    )
}

/// The answer with the smallest σ, or the most telling refusal.
fn best(outcomes: Vec<(String, OffsetOutcome)>) -> Result<(String, ClockMap), Box<Finding>> {
    let mut best: Option<(String, ClockMap)> = None;
    let mut worst: Option<OffsetOutcome> = None;
    for (name, outcome) in outcomes {
        match outcome {
            OffsetOutcome::Found(map) => {
                let better =
                    |(_, known): &(String, ClockMap)| map.offset_sigma < known.offset_sigma;
                if best.as_ref().is_none_or(better) {
                    best = Some((name, map));
                }
            }
            // A body that hardly moves says nothing; one that moves and does not fit says why.
            OffsetOutcome::NotExcited { .. }
            | OffsetOutcome::NotMoved { .. }
            | OffsetOutcome::TooShort => worst = worst.or(Some(outcome)),
            _ => worst = Some(outcome),
        }
    }
    let outcome = worst.unwrap_or(OffsetOutcome::TooShort);
    best.ok_or_else(|| {
        Box::new(
            alignment(&outcome, SAME_TIME).unwrap_or_else(|| {
                Finding::of_kind(catalog::CLOCK_LAG, "too_short", About::Clocks)
            }),
        )
    })
}

/// Poses of a link by the nominal robot at the times of the longest stream of joints.
fn link_poses(
    robot: &RobotProfile,
    spec: &RecordingSpec,
    joints: &BTreeMap<String, Scalars>,
    link: LinkId,
) -> Vec<(f64, Option<Isometry3<f64>>)> {
    let longest = joints.values().max_by_key(|j| j.t.len());
    let times: &[f64] = longest.map_or(&[], |j| &j.t);
    let pose = |t: f64| {
        let mut q = robot.model.zero_positions();
        for (joint, value) in &spec.hold {
            q[joint.index()] = *value;
        }
        for (joint, stream) in joints {
            let id = robot.model.joint_id(joint).ok()?;
            q[id.index()] = stream.at(t)?;
        }
        Some(robot.model.root_from_link(&q, link))
    };
    let mut track: Vec<_> = times.iter().map(|&t| (t, pose(t))).collect();
    blank_hung(&mut track);
    track
}

/// Poses that repeat while a step of so many usual ones follows are those of a log that hung: a robot that was at rest sets out slowly.
const HUNG: f64 = 5.0;

/// Takes poses out that repeat those of a log that hung: the motion went on, and its speed is not theirs.
fn blank_hung(track: &mut [(f64, Option<Isometry3<f64>>)]) {
    let step = |a: &Option<Isometry3<f64>>, b: &Option<Isometry3<f64>>| {
        let motion = a.as_ref()?.inv_mul(b.as_ref()?);
        Some(motion.rotation.angle() + motion.translation.vector.norm())
    };
    let steps: Vec<Option<f64>> = track.windows(2).map(|w| step(&w[0].1, &w[1].1)).collect();
    let same: Vec<bool> = track
        .windows(2)
        .map(|w| w[0].1.is_some() && w[0].1 == w[1].1)
        .collect();
    let moving = steps.iter().zip(&same).filter(|(_, same)| !**same);
    let Some(usual) = median(moving.filter_map(|(step, _)| *step).collect()) else {
        return;
    };
    let mut first = 0;
    for k in 0..same.len() {
        if same[k] {
            continue;
        }
        if steps[k].is_some_and(|step| step > HUNG * usual) {
            for (_, pose) in &mut track[first + 1..=k] {
                *pose = None;
            }
        }
        first = k + 1;
    }
}

/// The places that tell the motion of a body over the tracker's time: those of its markers, or of its origin.
fn points(table: &Poses, name: &str, kind: &BodyKind) -> Vec<PointTrack> {
    let Some(times) = &table.t else {
        return Vec::new();
    };
    let track = |seen: &mut dyn Iterator<Item = Option<Point3<f64>>>| {
        PointTrack::new(times.iter().copied().zip(seen))
    };
    match kind {
        BodyKind::Pose => {
            let origin = |pose: &Isometry3<f64>| Point3::from(pose.translation.vector);
            let seen = table.bodies.get(name).into_iter();
            seen.map(|of| track(&mut of.iter().map(|pose| pose.as_ref().map(origin))))
                .collect()
        }
        BodyKind::Markers { names, .. } => {
            let seen = names.iter().filter_map(|name| table.markers.get(name));
            seen.map(|of| track(&mut of.iter().copied())).collect()
        }
    }
}

/// A body's orientation over the tracker's time, where it has one.
fn orientation(table: &Poses, name: &str, kind: &BodyKind) -> Option<RotationTrack> {
    let track = match kind {
        BodyKind::Pose => table.bodies.get(name)?.clone(),
        BodyKind::Markers { names, template } => {
            let tracks: Option<Vec<&[Option<Point3<f64>>]>> = names
                .iter()
                .map(|m| table.markers.get(m).map(Vec::as_slice))
                .collect();
            let given = template
                .as_ref()
                .and_then(|points| Template::given(names.clone(), points.clone()).ok());
            body_poses(names, &tracks?, given, None).ok()?.track()
        }
    };
    let times = table.t.as_ref()?;
    let turned = track.iter().map(|pose| pose.map(|p| p.rotation));
    Some(RotationTrack::new(times.iter().copied().zip(turned)))
}
