//! The measurements of one table, in whichever forms it can give.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use calib_checks::rigid_body::{Template, body_poses, rigid_groups};
use calib_cor::Pose;
use calib_recording::{Poses, ReadOptions};
use nalgebra::{Isometry3, Matrix3, Point3};

use crate::error::FitError;
use crate::{TableRequest, Track, data, noise, usage};

/// What the estimators are given.
pub(crate) struct Table {
    pub file: PathBuf,
    /// Row numbers of the file, for messages.
    pub rows: Vec<u64>,
    /// Where there are only bodies, the origin of the body.
    pub markers: Vec<Track>,
    /// `markers` is no more than the body's origin.
    pub origin_only: bool,
    /// The markers keep their distances.
    pub rigid: bool,
    /// One rigid body: that of the table, or the markers as one.
    pub body: Option<Vec<Option<Pose>>>,
    /// Both sides of the joint.
    pub pair: Option<[Vec<Option<Pose>>; 2]>,
    /// Covariance of every marker in every row, m²; empty where none are stated.
    pub covariances: Vec<Vec<Matrix3<f64>>>,
    /// How many readings each row is worth; empty where all are alike.
    pub weights: Vec<f64>,
    /// Joint angle of every row, rad; empty where no joint was named.
    pub angles: Vec<f64>,
    /// Rows that repeated an earlier one to the last digit: a copy is no measurement, and they are left out.
    pub copies: usize,
}

impl Table {
    pub fn read(request: &TableRequest) -> Result<Self, FitError> {
        let measured = request.file.as_ref().ok_or_else(no_table)?;
        let file = measured.name();
        let mut poses = measured.poses(&ReadOptions::default())?;
        let mut weights = measured.weights(request.weights.as_deref(), poses.rows.len())?;
        // Covariances and weights are of the lines as they stand.
        let copies = match request.covariances.is_none() && weights.is_empty() {
            true => leave_out_copies(&mut poses),
            false => 0,
        };
        let angles = match &request.joint {
            Some(joint) => keep_rows_with(file, &mut poses, &mut weights, joint)?,
            None => Vec::new(),
        };
        let pair = match (request.parent.is_empty(), request.child.is_empty()) {
            (false, false) => Some([
                side(file, &poses, &request.parent, request.sigma_m)?,
                side(file, &poses, &request.child, request.sigma_m)?,
            ]),
            (true, true) => None,
            _ => {
                return Err(usage(
                    "one side of the joint is missing",
                    "give both --parent and --child",
                ));
            }
        };
        let wanted = |name: &String| request.only.is_empty() || request.only.contains(name);
        for name in &request.only {
            if !poses.markers.contains_key(name) && !poses.bodies.contains_key(name) {
                return Err(data(
                    file,
                    format!("has no marker or body `{name}`"),
                    it_has(poses.markers.keys().chain(poses.bodies.keys())),
                ));
            }
        }
        let markers: Vec<Track> = poses
            .markers
            .iter()
            .filter(|(name, _)| wanted(name))
            .map(|(name, track)| (name.clone(), track.clone()))
            .collect();
        let bodies: Vec<&String> = poses.bodies.keys().filter(|n| wanted(n)).collect();
        let groups = rigid(&markers, request.sigma_m);
        // Two markers make no body: each has a sphere or a circle of its own.
        if markers.len() >= 3 && groups.len() > 1 && request.only.is_empty() && pair.is_none() {
            return Err(several_bodies(file, &markers, &groups));
        }
        let body = match bodies.as_slice() {
            [only] => Some(as_poses(&poses.bodies[*only])),
            [] if markers.len() >= 3 && groups.len() == 1 => poses_of_markers(file, &markers).ok(),
            _ => None,
        };
        if markers.is_empty() && body.is_none() && pair.is_none() {
            return Err(data(
                file,
                format!("has {} bodies and no markers to choose from", bodies.len()),
                "name one body with --use-only",
            ));
        }
        // A sphere needs points: the origin of a body is one.
        let origin = || -> Option<Track> {
            let track = body.as_ref()?.iter();
            let points = track.map(|p| p.map(|p| Point3::from(p.translation)));
            Some(((*bodies.first()?).clone(), points.collect()))
        };
        let origin_only = markers.is_empty();
        let markers = if origin_only {
            origin().into_iter().collect()
        } else {
            markers
        };
        let covariances = noise::covariances(request, &markers, &poses.rows)?;
        Ok(Self {
            file: file.to_path_buf(),
            rows: poses.rows,
            markers,
            origin_only,
            rigid: groups.len() <= 1,
            body,
            pair,
            covariances,
            weights,
            angles,
            copies,
        })
    }

    /// Why an estimator cannot take these data.
    pub fn wrong_input(&self, id: &str, error: &dyn std::error::Error, list: &str) -> FitError {
        if self.rigid {
            return usage(
                format!("`{id}`: {error}"),
                format!("see `{list} --list`; bodies of two sides need --parent and --child"),
            );
        }
        data(
            &self.file,
            format!("`{id}` needs a rigid body, and these markers move against each other"),
            "name the markers of one body with --use-only, or both sides of the joint with --parent and --child",
        )
    }

    pub fn tracks(&self) -> Vec<Vec<Option<Point3<f64>>>> {
        self.markers.iter().map(|(_, t)| t.clone()).collect()
    }
}

/// Leaves out rows in which all markers and bodies are where they were in an earlier one, to the last digit; how many there were.
fn leave_out_copies(poses: &mut Poses) -> usize {
    let rows = poses.rows.len();
    let mut seen = BTreeSet::new();
    let new: Vec<bool> = (0..rows)
        .map(|i| {
            let markers = poses
                .markers
                .values()
                .map(|t| t[i].map(|p| bits(&p.coords)));
            let bodies = poses.bodies.values().map(|t| {
                let both =
                    |p: Isometry3<f64>| (bits(&p.translation.vector), bits(&p.rotation.coords));
                t[i].map(both)
            });
            let row = (markers.collect::<Vec<_>>(), bodies.collect::<Vec<_>>());
            let lost = row.0.iter().all(Option::is_none) && row.1.iter().all(Option::is_none);
            lost || seen.insert(row)
        })
        .collect();
    let copies = new.iter().filter(|new| !**new).count();
    if copies > 0 {
        keep(&mut poses.rows, &new);
        poses.markers.values_mut().for_each(|t| keep(t, &new));
        poses.bodies.values_mut().for_each(|t| keep(t, &new));
        poses.joints.values_mut().for_each(|t| keep(t, &new));
    }
    copies
}

fn bits<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> Vec<u64> {
    numbers.into_iter().map(|x| x.to_bits()).collect()
}

/// The elements of the rows that are kept.
fn keep<T>(track: &mut Vec<T>, rows: &[bool]) {
    let mut rows = rows.iter();
    track.retain(|_| rows.next().is_some_and(|kept| *kept));
}

/// The rows in which a joint's angle is known, and the angles, rad.
fn keep_rows_with(
    file: &Path,
    poses: &mut Poses,
    weights: &mut Vec<f64>,
    joint: &str,
) -> Result<Vec<f64>, FitError> {
    let column = poses.joints.get(joint).cloned().ok_or_else(|| {
        data(
            file,
            format!("has no joint `{joint}`"),
            it_has(poses.joints.keys()),
        )
    })?;
    let known: Vec<bool> = column.iter().map(Option::is_some).collect();
    keep(&mut poses.rows, &known);
    keep(weights, &known);
    for track in poses.markers.values_mut() {
        keep(track, &known);
    }
    for track in poses.bodies.values_mut() {
        keep(track, &known);
    }
    Ok(column.into_iter().flatten().collect())
}

fn rigid(markers: &[Track], sigma: Option<f64>) -> Vec<Vec<usize>> {
    let tracks: Vec<&[Option<Point3<f64>>]> = markers.iter().map(|(_, t)| t.as_slice()).collect();
    rigid_groups(&tracks, sigma)
}

/// Refuses the table, and names the group that moves most: most likely the one that was meant.
fn several_bodies(file: &Path, markers: &[Track], groups: &[Vec<usize>]) -> FitError {
    let names = |group: &[usize]| -> String {
        let names: Vec<&str> = group.iter().map(|&m| markers[m].0.as_str()).collect();
        names.join(",")
    };
    let listed: Vec<String> = groups.iter().map(|g| format!("{{{}}}", names(g))).collect();
    let moving = groups
        .iter()
        .max_by(|a, b| travel(markers, a).total_cmp(&travel(markers, b)))
        .map_or_else(String::new, |group| names(group));
    data(
        file,
        format!(
            "its markers move against each other, in {} groups: {}",
            groups.len(),
            listed.join(" ")
        ),
        format!(
            "say which of them belong to the moving body (--use-only {moving} moves most), or both sides of the joint (--parent, --child)"
        ),
    )
}

/// How far the markers of a group go from their mean place, m² a marker and row.
fn travel(markers: &[Track], group: &[usize]) -> f64 {
    let of = |&m: &usize| -> f64 {
        let seen: Vec<&Point3<f64>> = markers[m].1.iter().flatten().collect();
        let n = seen.len().max(1) as f64;
        let mean = seen
            .iter()
            .map(|p| p.coords)
            .sum::<nalgebra::Vector3<f64>>()
            / n;
        let squares = seen.iter().map(|p| (p.coords - mean).norm_squared());
        squares.sum::<f64>() / n
    };
    group.iter().map(of).sum::<f64>() / group.len().max(1) as f64
}

/// A request without a file.
pub(crate) fn no_table() -> FitError {
    usage(
        "no table was given",
        "name a CSV of points or poses, or --list the estimators",
    )
}

/// What a table has instead of what was asked for.
pub(crate) fn it_has<'a>(names: impl Iterator<Item = &'a String>) -> String {
    let names: Vec<String> = names.map(|n| format!("`{n}`")).collect();
    if names.is_empty() {
        "it has none".to_owned()
    } else {
        format!("it has {}", names.join(", "))
    }
}

fn as_poses(track: &[Option<Isometry3<f64>>]) -> Vec<Option<Pose>> {
    track.iter().map(|p| p.map(Pose::from)).collect()
}

fn poses_of_markers(file: &Path, markers: &[Track]) -> Result<Vec<Option<Pose>>, FitError> {
    let names: Vec<String> = markers.iter().map(|(n, _)| n.clone()).collect();
    let tracks: Vec<&[Option<Point3<f64>>]> = markers.iter().map(|(_, t)| t.as_slice()).collect();
    let no_body = |error: calib_checks::rigid_body::NotABody| {
        data(
            file,
            error.to_string(),
            "give the markers of one rigid body",
        )
    };
    let template = Template::learn(&names, &tracks).map_err(no_body)?;
    let poses = body_poses(&names, &tracks, Some(template), None).map_err(no_body)?;
    Ok(as_poses(&poses.track()))
}

/// One side of a joint: a body of the table, or its markers as one.
fn side(
    file: &Path,
    poses: &Poses,
    names: &[String],
    sigma: Option<f64>,
) -> Result<Vec<Option<Pose>>, FitError> {
    if let [body] = names
        && let Some(track) = poses.bodies.get(body)
    {
        return Ok(as_poses(track));
    }
    let mut markers = Vec::new();
    for name in names {
        let track = poses.markers.get(name).ok_or_else(|| {
            data(
                file,
                format!("has no marker `{name}`"),
                it_has(poses.markers.keys()),
            )
        })?;
        markers.push((name.clone(), track.clone()));
    }
    let groups = rigid(&markers, sigma);
    if groups.len() > 1 {
        return Err(several_bodies(file, &markers, &groups));
    }
    poses_of_markers(file, &markers)
}
