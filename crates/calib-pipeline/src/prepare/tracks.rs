//! Where each tracking body was in every row: its markers, and its pose where it has a frame.

use std::collections::{BTreeMap, BTreeSet};

use calib_checks::rigid_body::{
    BodyPoses, Distances, NotABody, RowPose, Template, body_poses, computed_below,
};
use calib_finding::nearest_word;
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::{Body, BodyKind, Tracker, Usage};
use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

use crate::error::{DataProblem, PipelineError, SeenInstead};
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::levers::position_sigma;

/// One body over all recordings.
#[derive(Debug, Clone)]
pub struct BodyTrack {
    /// Its name.
    pub name: String,
    /// Markers in the body frame, m; `None` for bodies recorded as poses and for one or two markers.
    pub template: Option<Template>,
    /// Whether the template was learned from these recordings rather than given.
    pub learned: bool,
    /// Standard deviation of a marker coordinate about the rigid body, m, where it can be told.
    pub marker_sigma: Option<f64>,
    /// Whether the markers are points of one fitted body: then they are one 6-DoF measurement, not several.
    pub is_computed: bool,
    /// `tracker_from_body` per recording and row; absent recordings do not show the body.
    pub poses: BTreeMap<String, Vec<Option<Isometry3<f64>>>>,
    /// Recordings that state the pose of the tracker in the body: its inverse is what was measured.
    pub inverse: BTreeSet<String>,
}

impl BodyTrack {
    /// How far a predicted `tracker_from_body` is from the one that a recording shows, in the tracker's axes, m: from where the body is, or from
    /// where the body sees the tracker.
    #[must_use]
    pub fn off(
        &self,
        recording: &str,
        predicted: &Isometry3<f64>,
        seen: &Isometry3<f64>,
    ) -> Vector3<f64> {
        if !self.inverse.contains(recording) {
            return predicted.translation.vector - seen.translation.vector;
        }
        let in_body = |pose: &Isometry3<f64>| pose.inverse().translation.vector;
        seen.rotation * (in_body(predicted) - in_body(seen))
    }

    /// The stated σ of a coordinate of where the body is, m; `None` where none is stated. Where the body sees the tracker, its angles have the lever
    /// from there to the body, across which two of three axes lie.
    #[must_use]
    pub fn position_sigma(&self, tracker: &Tracker) -> Option<f64> {
        let inverse = self.inverse.iter();
        position_sigma(
            tracker,
            inverse.flat_map(|r| self.in_recording(r)).flatten(),
        )
    }

    /// Poses in one recording; empty where the body is not in it.
    #[must_use]
    pub fn in_recording(&self, recording: &str) -> &[Option<Isometry3<f64>>] {
        self.poses.get(recording).map_or(&[], Vec::as_slice)
    }
}

/// Tracks of all bodies. Templates are learned from the recordings that are fitted, never from validation.
///
/// # Errors
/// [`PipelineError::Data`] for a body that no fitted recording shows, or whose markers span no frame.
pub fn body_tracks(
    inputs: &Inputs,
    findings: &mut Vec<Finding>,
) -> Result<BTreeMap<String, BodyTrack>, PipelineError> {
    let bodies: Vec<(&String, &Body)> = inputs.robot.profile.bodies.iter().collect();
    let of = |(name, body): &(&String, &Body)| {
        let mut findings = Vec::new();
        let track = body_track(inputs, name, body, &mut findings);
        (track, findings)
    };
    let of_bodies: Vec<_> = bodies.par_iter().map(of).collect();
    let mut tracks = BTreeMap::new();
    for (track, of_body) in of_bodies {
        findings.extend(of_body);
        let track = track?;
        tracks.insert(track.name.clone(), track);
    }
    Ok(tracks)
}

/// Marker tracks of one body over some recordings, one vector per marker, rows one after the other.
pub(super) fn gather(names: &[String], recordings: &[&Loaded]) -> Vec<Vec<Option<Point3<f64>>>> {
    names
        .iter()
        .map(|marker| {
            recordings
                .iter()
                .flat_map(|r| match r.poses.markers.get(marker) {
                    Some(track) => track.clone(),
                    None => vec![None; r.poses.len()],
                })
                .collect()
        })
        .collect()
}

pub(super) fn slices(tracks: &[Vec<Option<Point3<f64>>>]) -> Vec<&[Option<Point3<f64>>]> {
    tracks.iter().map(Vec::as_slice).collect()
}

/// Why no fitted recording shows the body: what the recordings have in its place.
fn seen_instead(inputs: &Inputs, name: &str, body: &Body) -> SeenInstead {
    let own = std::slice::from_ref(&name);
    let markers: Vec<&str> = match &body.kind {
        BodyKind::Pose => Vec::new(),
        BodyKind::Markers { names, .. } => names.iter().map(String::as_str).collect(),
    };
    let wanted = if markers.is_empty() {
        own
    } else {
        &markers[..]
    };
    let samples = |loaded: &Loaded, of: &str| match &body.kind {
        BodyKind::Pose => loaded
            .poses
            .bodies
            .get(of)
            .map(|t| t.iter().flatten().count()),
        BodyKind::Markers { .. } => {
            let track = loaded.poses.markers.get(of);
            track.map(|t| t.iter().flatten().count())
        }
    };
    let shown = |loaded: &&Loaded| wanted.iter().any(|of| samples(loaded, of) > Some(0));
    let recordings = || inputs.recordings.values();
    let held_out: Vec<String> = recordings().filter(shown).map(|r| r.name.clone()).collect();
    if !held_out.is_empty() {
        return SeenInstead::HeldOut {
            recordings: held_out,
        };
    }
    if recordings().any(|r| wanted.iter().any(|of| samples(r, of).is_some())) {
        return SeenInstead::AlwaysLost;
    }
    match &body.kind {
        BodyKind::Pose if recordings().any(|r| r.poses.markers.contains_key(name)) => {
            return SeenInstead::Point;
        }
        BodyKind::Markers { .. } if recordings().any(|r| r.poses.bodies.contains_key(name)) => {
            return SeenInstead::Pose;
        }
        _ => {}
    }
    let declared = &inputs.robot.profile.bodies;
    let known = |other: &&String| {
        let is_marker =
            |b: &Body| matches!(&b.kind, BodyKind::Markers { names, .. } if names.contains(*other));
        declared.contains_key(*other) || declared.values().any(is_marker)
    };
    let others: BTreeSet<&String> = match &body.kind {
        BodyKind::Pose => recordings().flat_map(|r| r.poses.bodies.keys()).collect(),
        BodyKind::Markers { .. } => recordings().flat_map(|r| r.poses.markers.keys()).collect(),
    };
    let names: Vec<String> = others.into_iter().filter(|o| !known(o)).cloned().collect();
    let wanted = wanted.first().copied().unwrap_or(name);
    let meant = nearest_word(wanted, names.iter().map(String::as_str)).map(str::to_owned);
    SeenInstead::Others {
        names,
        wanted: wanted.to_owned(),
        meant,
    }
}

/// A marker that wanders on its body: it is loose or mislabeled.
fn loose_marker(body: &str, all: &BodyPoses, stated: Option<f64>) -> Option<Finding> {
    // The marker that keeps its distances best tells the noise of a coordinate where none is stated.
    let steadiest = all.fits.iter().map(|fit| fit.wandering);
    let steadiest = steadiest.fold(f64::INFINITY, f64::min) / std::f64::consts::SQRT_2;
    let sigma = stated.unwrap_or(steadiest.max(0.0005));
    let limit = (8.0 * sigma).max(0.003);
    let (fit, wander) = all.moving_marker(limit)?;
    Some(
        Finding::new(catalog::BODY_NOT_RIGID, Subject::body(body))
            .with("marker", Fact::name(&fit.name))
            .with("distance", Fact::meters(wander))
            .with("limit", Fact::meters(limit)),
    )
}

/// The poses of a fitted recording, where the same samples of it were registered with all others.
fn registered_already(
    tracks: &[Vec<Option<Point3<f64>>>],
    loaded: &Loaded,
    fitted: &[&Loaded],
    (good, all): (&[Vec<Option<Point3<f64>>>], &BodyPoses),
) -> Option<Vec<Option<Isometry3<f64>>>> {
    let place = fitted.iter().position(|r| r.name == loaded.name)?;
    let first: usize = fitted[..place].iter().map(|r| r.poses.len()).sum();
    let rows = first..first + loaded.poses.len();
    let mut pairs = tracks.iter().zip(good);
    let same = pairs.all(|(own, good)| good.get(rows.clone()) == Some(own.as_slice()));
    let pose = |row: &Result<RowPose, _>| row.as_ref().ok().map(|pose| pose.tracker_from_body);
    same.then(|| all.rows[rows].iter().map(pose).collect())
}

/// The poses of a body that is recorded as such; whether a fitted recording shows it.
fn take_poses(inputs: &Inputs, name: &str, track: &mut BodyTrack) -> bool {
    let mut is_seen = false;
    for (recording, loaded) in &inputs.recordings {
        if let Some(poses) = loaded.poses.bodies.get(name) {
            let is_fitted = loaded.spec.usage != Usage::Validation;
            is_seen |= is_fitted && poses.iter().any(Option::is_some);
            track.poses.insert(recording.clone(), poses.clone());
        }
        if loaded.meta.inverse_bodies.contains(name) {
            track.inverse.insert(recording.clone());
        }
    }
    is_seen
}

fn body_track(
    inputs: &Inputs,
    name: &str,
    body: &Body,
    findings: &mut Vec<Finding>,
) -> Result<BodyTrack, PipelineError> {
    let mut track = BodyTrack {
        name: name.to_owned(),
        template: None,
        learned: false,
        marker_sigma: None,
        is_computed: false,
        poses: BTreeMap::new(),
        inverse: BTreeSet::new(),
    };
    let not_seen = || {
        let problem = DataProblem::BodyNotSeen {
            body: name.to_owned(),
            seen: Box::new(seen_instead(inputs, name, body)),
        };
        PipelineError::data(&inputs.robot.file, problem)
    };
    let names = match &body.kind {
        BodyKind::Pose => {
            return match take_poses(inputs, name, &mut track) {
                true => Ok(track),
                false => Err(not_seen()),
            };
        }
        BodyKind::Markers { names, .. } => names,
    };
    let fitted: Vec<&Loaded> = inputs
        .recordings
        .values()
        .filter(|r| {
            r.spec.usage != Usage::Validation
                && names.iter().any(|m| r.poses.markers.contains_key(m))
        })
        .collect();
    if fitted.is_empty() {
        return Err(not_seen());
    }
    if names.len() < 3 {
        return Ok(track);
    }
    let fail = |why: NotABody| {
        let body = name.to_owned();
        PipelineError::data(&fitted[0].spec.file, DataProblem::NotABody { body, why })
    };
    let given = match &body.kind {
        BodyKind::Markers {
            template: Some(points),
            ..
        } => Some(Template::given(names.clone(), points.clone()).map_err(fail)?),
        _ => None,
    };
    let stated = inputs.robot.profile.tracker.marker_coordinate();
    let gathered = gather(names, &fitted);
    let distances = Distances::of(&slices(&gathered), stated);
    // A sample that is off its body would turn the body's frame in all rows.
    let good = distances.without_gross(&slices(&gathered));
    let all = body_poses(names, &slices(&good), given.clone(), None).map_err(fail)?;
    findings.extend(loose_marker(name, &all, stated));
    for (recording, loaded) in &inputs.recordings {
        if names.iter().any(|m| loaded.poses.markers.contains_key(m)) {
            let tracks = distances.without_gross(&slices(&gather(names, &[loaded])));
            let poses = match registered_already(&tracks, loaded, &fitted, (&good, &all)) {
                Some(poses) => poses,
                None => body_poses(names, &slices(&tracks), Some(all.template.clone()), stated)
                    .map_err(fail)?
                    .track(),
            };
            track.poses.insert(recording.clone(), poses);
        }
    }
    track.learned = given.is_none();
    // Points that stand for many markers scatter less than each of these.
    let of_markers = inputs.condensed.get(name).copied();
    track.marker_sigma = of_markers.unwrap_or(all.sigma);
    let below = computed_below(gathered.iter().flatten().flatten(), stated);
    track.is_computed = track.marker_sigma.is_some_and(|sigma| sigma < below);
    track.template = Some(all.template);
    Ok(track)
}
