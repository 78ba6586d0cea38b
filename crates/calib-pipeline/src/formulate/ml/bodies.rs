//! Bodies: where they are mounted, their markers, and what the tracker says of them.

use std::collections::{BTreeMap, BTreeSet};

use calib_core::{
    Chart, FrameId, GroupId, MarkerObservation, NoiseKind, PointId, PoseNoise, PoseObservation,
    Problem, Role, measurement::Sight,
};
use calib_profile::{BodyKind, Profile};
use nalgebra::{Isometry3, Point3};

use crate::estimate::start::Start;
use crate::formulate::formulation::Formulation;
use crate::formulate::row_levels::row_levels;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::mixed::Mixed;
use crate::prepare::tracks::BodyTrack;

/// Marker noise that estimation starts from where the profile states none, m.
pub(crate) const MARKER_SIGMA: f64 = 0.5e-3;
/// Body position noise that estimation starts from, m.
const BODY_SIGMA: f64 = 0.5e-3;
/// Body orientation noise that estimation starts from, rad (0.2°).
const BODY_SIGMA_RAD: f64 = 3.5e-3;
/// Name of the noise of markers along the line of sight.
pub(crate) const MARKER_ALONG_SIGHT: &str = "marker along sight";
/// Name of the noise of bodies' positions along the line of sight.
pub(crate) const BODY_ALONG_SIGHT: &str = "body position along sight";
/// Name of the noise of bodies' rotations about the line of sight.
pub(crate) const BODY_ABOUT_SIGHT: &str = "body orientation about sight";

pub(super) fn add_bodies(
    formulation: &mut Formulation,
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    start: &Start,
) {
    let profile = &inputs.robot.profile;
    let as_pose =
        |name: &String| profile.bodies[name].kind == BodyKind::Pose || tracks[name].is_computed;
    let levels = levels(formulation, inputs, &as_pose);
    let only = levels.len() == 1;
    for (name, body) in &profile.bodies {
        let Some(link) = formulation.links[body.link.index()] else {
            continue;
        };
        let track = &tracks[name];
        let has_frame = body.kind == BodyKind::Pose || track.template.is_some();
        let frame = if has_frame {
            let frame = formulation.problem.frame(&format!("body {name}"));
            let (value, chart) = match body.mount {
                Some(mount) => (mount, Chart::none()),
                None => (
                    start
                        .mounts
                        .get(name)
                        .copied()
                        .unwrap_or_else(Isometry3::identity),
                    Chart::full(),
                ),
            };
            let mount =
                formulation
                    .problem
                    .unknown(&format!("{name}.mount"), link, frame, value, chart);
            formulation.problem.set_role(mount, Role::Mount, None);
            formulation.mounts.insert(name.clone(), mount);
            formulation.bodies.insert(name.clone(), frame);
            frame
        } else {
            link
        };
        let seen = |level: &Level, formulation: &Formulation| -> Vec<(usize, (String, usize))> {
            let samples = formulation.samples.iter().cloned().enumerate();
            let of_level = |(_, (recording, _)): &(usize, (String, usize))| {
                level.recordings.contains(recording)
            };
            samples.filter(of_level).collect()
        };
        if as_pose(name) {
            for level in &levels {
                let Some(noise) = &level.bodies else { continue };
                let seen = seen(level, formulation).into_iter();
                let poses = seen.filter_map(|at| pose_seen(track, at));
                let poses: Vec<PoseObservation> = poses.collect();
                if only || !poses.is_empty() {
                    let (problem, tracker) = (&mut formulation.problem, formulation.tracker);
                    problem.poses(name, tracker, frame, *noise, poses);
                    if let Some(sight) = level.sight(inputs, name, level.body_sight) {
                        problem.noise_along_sight(sight);
                    }
                }
            }
        } else if let BodyKind::Markers { names, .. } = &body.kind {
            let sigma = body.template_sigma;
            let places = Places {
                track,
                start,
                sigma,
            };
            let points = add_points(&mut formulation.problem, names, &places, name, frame);
            for level in &levels {
                let Some(noise) = level.markers else { continue };
                let mut markers = Vec::new();
                for (sample, (recording, row)) in seen(level, formulation) {
                    let loaded = &inputs.recordings[&recording];
                    let at = (loaded, row, sample);
                    let mixed = loaded.mixed.get(name).and_then(|m| m.get(row)?.as_ref());
                    match mixed {
                        Some(mixed) => {
                            let places = (track, frame, mixed);
                            let problem = &mut formulation.problem;
                            markers.extend(mixed_seen(problem, names, places, at));
                        }
                        None => markers.extend(points.iter().filter_map(|p| marker_seen(p, at))),
                    }
                }
                markers.shrink_to_fit();
                if only || !markers.is_empty() {
                    let (problem, tracker) = (&mut formulation.problem, formulation.tracker);
                    problem.markers(name, tracker, frame, noise, markers);
                    if let Some(sight) = level.sight(inputs, name, level.marker_sight) {
                        problem.noise_along_sight(sight);
                    }
                }
            }
            let points = points.into_iter().collect();
            formulation.points.insert(name.clone(), points);
        }
    }
}

/// Noise that the rows of some recordings have in common.
struct Level {
    /// Their names.
    recordings: BTreeSet<String>,
    /// Of markers, where some body is seen so.
    markers: Option<GroupId>,
    /// Of bodies, where the pose of some is seen.
    bodies: Option<PoseNoise>,
    /// Of markers along the line of sight.
    marker_sight: Option<AtSight>,
    /// Of bodies along the line of sight and about it.
    body_sight: Option<AtSight>,
}

/// Levels along the line of sight, and about it.
#[derive(Clone, Copy)]
struct AtSight {
    along: GroupId,
    about: Option<GroupId>,
}

impl Level {
    /// These levels for a body that has them.
    fn sight(&self, inputs: &Inputs, body: &str, of: Option<AtSight>) -> Option<Sight> {
        let AtSight { along, about } = of?;
        let growth = *inputs.sights.get(body)?;
        Some(Sight {
            along,
            about,
            growth,
        })
    }
}

fn levels(
    formulation: &mut Formulation,
    inputs: &Inputs,
    as_pose: &dyn Fn(&String) -> bool,
) -> Vec<Level> {
    let mut levels = Vec::new();
    for of in row_levels(inputs, &formulation.samples) {
        let profile = &inputs.robot.profile;
        let (markers, bodies) = noise_groups(formulation, profile, as_pose, (&of.name, of.times));
        let has_sight = |pose: bool| {
            let mut names = inputs.sights.keys();
            names.any(|name| as_pose(name) == pose)
        };
        let wanted = [has_sight(false), has_sight(true)];
        let (marker_sight, body_sight) =
            sight_groups(formulation, profile, wanted, (&of.name, of.times));
        levels.push(Level {
            recordings: of.recordings,
            markers,
            bodies,
            marker_sight,
            body_sight,
        });
    }
    // Of all that has no level of its own, the first tells.
    formulation.noise.marker = levels[0].markers;
    if let Some(PoseNoise::Split { position, .. }) = &levels[0].bodies {
        formulation.noise.body_position = Some(*position);
    }
    levels
}

/// A body in one row of a recording, by sample.
fn pose_seen(
    track: &BodyTrack,
    (sample, (recording, row)): (usize, (String, usize)),
) -> Option<PoseObservation> {
    Some(PoseObservation {
        sample,
        pose: (*track.in_recording(&recording).get(row)?)?,
        inverse: track.inverse.contains(&recording),
    })
}

/// A marker in one row.
fn marker_seen(
    (marker, point): &(String, PointId),
    (loaded, row, sample): (&Loaded, usize, usize),
) -> Option<MarkerObservation> {
    let position = loaded.poses.markers.get(marker)?[row]?;
    let shapes = loaded.shapes.get(marker);
    let shape = shapes.and_then(|s| s.get(row).copied().flatten());
    Some(MarkerObservation {
        sample,
        point: *point,
        position,
        shape: shape.map(Box::new),
    })
}

/// The points of a condensed body in a row that does not show all its markers: other points, whose errors are independent there.
fn mixed_seen(
    problem: &mut Problem,
    names: &[String],
    (track, frame, mixed): (&BodyTrack, FrameId, &Mixed),
    (loaded, row, sample): (&Loaded, usize, usize),
) -> Vec<MarkerObservation> {
    let positions = names.iter().map(|m| loaded.poses.markers.get(m)?[row]);
    let positions: Option<Vec<Point3<f64>>> = positions.collect();
    let (Some(positions), Some(template)) = (positions, &track.template) else {
        return Vec::new();
    };
    let places = mixed.of(&template.points);
    let seen = names.iter().zip(places).zip(mixed.of(&positions));
    let one =
        |((name, place), position): ((&String, Point3<f64>), Point3<f64>)| MarkerObservation {
            sample,
            point: problem.known_point(name, frame, place),
            position,
            shape: Some(Box::new(mixed.shape)),
        };
    seen.map(one).collect()
}

/// Noise of markers and of body poses, where some body is seen so; `of` follows its name, and σ begins `times` as high.
fn noise_groups(
    formulation: &mut Formulation,
    profile: &Profile,
    as_pose: &dyn Fn(&String) -> bool,
    (of, times): (&str, f64),
) -> (Option<GroupId>, Option<PoseNoise>) {
    let known = profile.solve.noise.known;
    let tracker = &profile.tracker;
    let uses = |pose: bool| profile.bodies.keys().any(|name| as_pose(name) == pose);
    let problem = &mut formulation.problem;
    let marker_noise = uses(false).then(|| {
        problem.noise_group(
            &format!("marker{of}"),
            NoiseKind::Position,
            times * tracker.marker_sigma.unwrap_or(MARKER_SIGMA),
            !known,
        )
    });
    let body_noise = uses(true).then(|| PoseNoise::Split {
        orientation: problem.noise_group(
            &format!("body orientation{of}"),
            NoiseKind::Orientation,
            times * tracker.body_sigma_rad.unwrap_or(BODY_SIGMA_RAD),
            !known,
        ),
        position: problem.noise_group(
            &format!("body position{of}"),
            NoiseKind::Position,
            times * tracker.body_sigma.unwrap_or(BODY_SIGMA),
            !known,
        ),
    });
    (marker_noise, body_noise)
}

/// The same along the line of sight, of markers and of bodies, where it is `wanted`.
fn sight_groups(
    formulation: &mut Formulation,
    profile: &Profile,
    [of_markers, of_bodies]: [bool; 2],
    (of, times): (&str, f64),
) -> (Option<AtSight>, Option<AtSight>) {
    let known = profile.solve.noise.known;
    let tracker = &profile.tracker;
    let problem = &mut formulation.problem;
    let mut group = |name: &str, kind: NoiseKind, sigma: f64| {
        problem.noise_group(&format!("{name}{of}"), kind, times * sigma, !known)
    };
    let sigma = tracker.sight.marker.or(tracker.marker_sigma);
    let sigma = sigma.unwrap_or(MARKER_SIGMA);
    let markers = of_markers.then(|| AtSight {
        along: group(MARKER_ALONG_SIGHT, NoiseKind::Position, sigma),
        about: None,
    });
    let sigma = tracker.sight.body.or(tracker.body_sigma);
    let sigma = sigma.unwrap_or(BODY_SIGMA);
    let turn = tracker.sight.body_rad.or(tracker.body_sigma_rad);
    let turn = turn.unwrap_or(BODY_SIGMA_RAD);
    let bodies = of_bodies.then(|| AtSight {
        along: group(BODY_ALONG_SIGHT, NoiseKind::Position, sigma),
        about: Some(group(BODY_ABOUT_SIGHT, NoiseKind::Orientation, turn)),
    });
    (markers, bodies)
}

/// What is known of the places of a body's markers.
struct Places<'a> {
    track: &'a BodyTrack,
    start: &'a Start,
    /// Prior σ of the coordinates of a given template, m.
    sigma: Option<f64>,
}

/// Points of a marker body. A given template is known, or estimated with its prior. A learned one is estimated with the fit, held to the frame's
/// convention: first marker at the origin, second on x, the third that is off that line in the xy plane.
fn add_points(
    problem: &mut Problem,
    names: &[String],
    places: &Places<'_>,
    body: &str,
    frame: FrameId,
) -> Vec<(String, PointId)> {
    /// Off the x axis by more than this counts as the marker that defines the plane, m.
    const OFF_AXIS: f64 = 1e-9;
    let Places {
        track,
        start,
        sigma,
    } = *places;
    let mut points = Vec::new();
    let mut plane_defined = false;
    for (i, marker) in names.iter().enumerate() {
        let Some(template) = &track.template else {
            let place = start
                .points
                .get(body)
                .and_then(|p| p.get(marker))
                .copied()
                .unwrap_or_else(Point3::origin);
            points.push((
                marker.clone(),
                problem.unknown_point(marker, frame, place, None),
            ));
            continue;
        };
        let place = template.points[i];
        if let Some(sigma) = sigma.filter(|_| !track.learned) {
            let point = problem.unknown_point(marker, frame, place, Some(sigma));
            points.push((marker.clone(), point));
            continue;
        }
        if !track.learned || i == 0 {
            points.push((marker.clone(), problem.known_point(marker, frame, place)));
            continue;
        }
        let defines_plane =
            i >= 2 && !plane_defined && place.z.abs() < OFF_AXIS && place.y > OFF_AXIS;
        let held: &[usize] = match (i, defines_plane) {
            (1, _) => &[1, 2],
            (_, true) => &[2],
            _ => &[],
        };
        plane_defined |= defines_plane;
        let point = problem.unknown_point(marker, frame, place, None);
        let coordinates = problem.points()[point.index()].parameters;
        for &axis in held {
            if let Some(ids) = coordinates {
                problem.parameter_mut(ids[axis]).fixed = true;
            }
        }
        points.push((marker.clone(), point));
    }
    points
}
