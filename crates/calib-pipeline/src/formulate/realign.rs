//! Joint values at the times that a calibrated robot gives.
//!
//! What the fit finds of the clock of a fitted recording (c₀, c₁ of [`mod@crate::formulate::clock`]) moves the times at which
//! its joint values are taken; the fit that follows starts there, and what is of second order in the offset is gone. A held-out
//! recording has clocks of its own, which the fit does not see. They come from its rows with the robot held fixed:
//!
//! ```text
//! (c₀, c₁) = argmin Σᵢ wᵢ |rᵢ + vᵢ (c₀ + c₁ uᵢ − sᵢ)|²                                                (1)
//! ```
//!
//! rᵢ predicted minus seen at the times shifted by sᵢ, vᵢ = ∂rᵢ/∂t, w of Huber. No row vouches for itself: each of ten
//! parts of the recording is shifted by what the other nine say, so that the held-out errors contain the error of the offset
//! and need no correction for what was estimated.

use std::collections::BTreeMap;

use calib_profile::{BodyKind, Usage};
use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Matrix2, Point3, Vector2, Vector3};

use crate::formulate::clock::{PRIOR, estimates, position};
use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::Calibration;
use crate::prepare::align::HALF_CHORD;
use crate::prepare::aligned::{ClockUnknowns, Refined};
use crate::prepare::conditions::conditions;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

/// Parts of a held-out recording.
const PARTS: usize = 10;
/// Vectors that a held-out recording must have for its clock to be estimated: three for each part.
const VECTORS: usize = 3 * PARTS;
/// Time of difference quotients, s: a robot moves by a tenth of a millimeter.
const STEP: f64 = 1e-4;
/// Huber's constant, for vectors of three.
const HUBER: f64 = 2.5;
/// Rounds of reweighting.
const ROUNDS: usize = 5;

/// Takes the joint values of rows of a motion at the times that `fit` gives, where any of them changes by `least`, s, or for the
/// first time; whether it did.
pub fn realign(
    inputs: &mut Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    fit: &MlFit,
    least: f64,
) -> bool {
    let robot = Robot {
        calibrated: &fit.calibration,
        tracks,
    };
    let mut found: Vec<(String, Refined)> = Vec::new();
    for (name, loaded) in &inputs.recordings {
        let refined = match loaded.spec.usage {
            Usage::Validation => of_held_out(inputs, loaded, &robot),
            _ => of_fitted(loaded, fit),
        };
        found.extend(refined.map(|refined| (name.clone(), refined)));
    }
    let moves = |(name, refined): &(String, Refined)| {
        let loaded = &inputs.recordings[name];
        let known = loaded.alignment.as_ref().and_then(|a| a.refined.as_ref());
        known.is_none_or(|known| {
            let pairs = refined.by_row.iter().zip(&known.by_row);
            pairs
                .into_iter()
                .any(|(new, old)| (new - old).abs() >= least)
        })
    };
    if !found.iter().any(moves) {
        return false;
    }
    let model = inputs.robot.model.clone();
    for (name, refined) in found {
        if let Some(loaded) = inputs.recordings.get_mut(&name) {
            shift(loaded, refined, &model);
        }
    }
    true
}

/// Shift of each row so far, s.
fn so_far(loaded: &Loaded) -> Vec<f64> {
    let refined = loaded.alignment.as_ref().and_then(|a| a.refined.as_ref());
    refined.map_or_else(|| vec![0.0; loaded.q.len()], |r| r.by_row.clone())
}

/// What the fit found, on top of what it started from.
fn of_fitted(loaded: &Loaded, fit: &MlFit) -> Option<Refined> {
    let found = estimates(fit, &loaded.name)?;
    let [c0, c1] = found.map(|(value, _)| value);
    let known = loaded.alignment.as_ref()?.refined.as_ref();
    let [k0, k1] = known.map_or([0.0; 2], |r| r.shift);
    let before = so_far(loaded);
    let by_row = before.iter().enumerate();
    let by_row = by_row.map(|(row, s)| s + c0 + c1 * position(loaded, row).unwrap_or(0.0));
    Some(Refined {
        by_row: by_row.collect(),
        shift: [k0 + c0, k1 + c1],
        sigma: None,
    })
}

/// One vector of equation (1).
struct Vector {
    part: usize,
    u: f64,
    /// rᵢ − vᵢ sᵢ, m.
    left: Vector3<f64>,
    /// vᵢ, m/s.
    rate: Vector3<f64>,
}

impl Vector {
    fn normal(&self, drifts: bool) -> (Matrix2<f64>, Vector2<f64>) {
        let along = Vector2::new(1.0, if drifts { self.u } else { 0.0 });
        let square = self.rate.norm_squared();
        (
            along * along.transpose() * square,
            -along * self.rate.dot(&self.left),
        )
    }

    fn error(&self, c: &Vector2<f64>) -> f64 {
        (self.left + self.rate * (c[0] + c[1] * self.u)).norm()
    }
}

/// Equation (1), part by part.
fn of_held_out(inputs: &Inputs, loaded: &Loaded, robot: &Robot<'_>) -> Option<Refined> {
    let drifts = match loaded.alignment.as_ref()?.unknowns() {
        ClockUnknowns::None => return None,
        ClockUnknowns::Offset => false,
        ClockUnknowns::OffsetAndDrift => true,
    };
    let vectors = vectors(inputs, loaded, robot);
    if vectors.len() < VECTORS {
        return None;
    }
    let (all, by_part) = solved(&vectors, drifts)?;
    // The spread of the answers without one part each.
    let spread = by_part.iter().map(|c| (c - all).component_mul(&(c - all)));
    let spread: Vector2<f64> = spread.sum::<Vector2<f64>>() * ((PARTS - 1) as f64 / PARTS as f64);
    let rows = 0..loaded.q.len();
    let by_row = rows.map(|row| {
        let c = by_part[part(loaded, row)];
        c[0] + c[1] * position(loaded, row).unwrap_or(0.0)
    });
    Some(Refined {
        by_row: by_row.collect(),
        shift: all.into(),
        sigma: Some(spread.map(f64::sqrt).into()),
    })
}

fn part(loaded: &Loaded, row: usize) -> usize {
    row * PARTS / loaded.q.len().max(1)
}

/// c of all rows, and of the rows without each part.
fn solved(vectors: &[Vector], drifts: bool) -> Option<(Vector2<f64>, Vec<Vector2<f64>>)> {
    let mut c = Vector2::zeros();
    let mut weights = vec![1.0; vectors.len()];
    let mut of_parts = vec![(Matrix2::zeros(), Vector2::zeros()); PARTS];
    let mut prior = Matrix2::zeros();
    let sum = |parts: &[(Matrix2<f64>, Vector2<f64>)], without: Option<usize>| {
        let kept = parts
            .iter()
            .enumerate()
            .filter(|(k, _)| Some(*k) != without);
        kept.fold((Matrix2::zeros(), Vector2::zeros()), |a, (_, b)| {
            (a.0 + b.0, a.1 + b.1)
        })
    };
    for _ in 0..ROUNDS {
        of_parts.fill((Matrix2::zeros(), Vector2::zeros()));
        for (vector, weight) in vectors.iter().zip(&weights) {
            let (normal, right) = vector.normal(drifts);
            of_parts[vector.part].0 += normal * *weight;
            of_parts[vector.part].1 += right * *weight;
        }
        let mut errors: Vec<f64> = vectors.iter().map(|v| v.error(&c)).collect();
        errors.sort_by(f64::total_cmp);
        // The median of the norm of three normal numbers is 1.54 σ.
        let scale = errors[errors.len() / 2].max(f64::MIN_POSITIVE) / 1.54;
        prior = Matrix2::identity() * (scale / PRIOR).powi(2);
        let (normal, right) = sum(&of_parts, None);
        c = (normal + prior).try_inverse()? * right;
        for (vector, weight) in vectors.iter().zip(&mut weights) {
            *weight = (HUBER * scale / vector.error(&c).max(f64::MIN_POSITIVE)).min(1.0);
        }
    }
    let without = (0..PARTS).map(|k| {
        let (normal, right) = sum(&of_parts, Some(k));
        Some((normal + prior).try_inverse()? * right)
    });
    Some((c, without.collect::<Option<Vec<_>>>()?))
}

/// rᵢ and vᵢ of every marker, and of every body that is measured as a pose.
fn vectors(inputs: &Inputs, loaded: &Loaded, robot: &Robot<'_>) -> Vec<Vector> {
    let model = &inputs.robot.model;
    let under = conditions(loaded, &inputs.robot, inputs.robot.profile.solve.load);
    let so_far = so_far(loaded);
    let mut out = Vec::new();
    for (row, q) in loaded.q.iter().enumerate() {
        let (Some(q), Some(u)) = (q, position(loaded, row)) else {
            continue;
        };
        let mut later = q.clone();
        for (joint, speeds) in &loaded.velocities {
            let speed = speeds.get(row).copied().flatten();
            if let (Ok(id), Some(speed)) = (model.joint_id(joint), speed) {
                later[id.index()] += speed * STEP;
            }
        }
        let [now, then] =
            [q, &later].map(|q| robot.calibrated.root_from_link_under(q, &under[row]));
        for (link, on_link, seen) in robot.points(inputs, loaded, row) {
            let at = |links: &[Isometry3<f64>]| {
                robot.calibrated.tracker_from_root * (links[link] * on_link)
            };
            let rate = (at(&then) - at(&now)) / STEP;
            out.push(Vector {
                part: part(loaded, row),
                u,
                left: at(&now) - seen - rate * so_far[row],
                rate,
            });
        }
    }
    out
}

/// The robot that is held fixed, and the bodies that the tracker saw on it.
struct Robot<'a> {
    calibrated: &'a Calibration,
    tracks: &'a BTreeMap<String, BodyTrack>,
}

impl Robot<'_> {
    /// Index of the link, place on it and place in the tracker's frame of every point seen in a row.
    fn points(
        &self,
        inputs: &Inputs,
        loaded: &Loaded,
        row: usize,
    ) -> Vec<(usize, Point3<f64>, Point3<f64>)> {
        let mut out = Vec::new();
        for (name, body) in &inputs.robot.profile.bodies {
            let link = body.link.index();
            match &body.kind {
                BodyKind::Markers { names, .. } => {
                    for (i, marker) in names.iter().enumerate() {
                        let seen = loaded.poses.markers.get(marker);
                        let seen = seen.and_then(|track| track.get(row).copied().flatten());
                        let pair = self.on_link(name, i, marker).zip(seen);
                        out.extend(pair.map(|(on_link, seen)| (link, on_link, seen)));
                    }
                }
                BodyKind::Pose => {
                    let seen = loaded.poses.bodies.get(name);
                    let seen = seen.and_then(|track| track.get(row).copied().flatten());
                    let pair = self.calibrated.mounts.get(name).zip(seen);
                    let middle = |pose: &Isometry3<f64>| pose.translation.vector.into();
                    out.extend(pair.map(|(mount, seen)| (link, middle(mount), middle(&seen))));
                }
            }
        }
        out
    }

    /// Where a marker is on its link, by the fit or by the body's template.
    fn on_link(&self, body: &str, i: usize, marker: &str) -> Option<Point3<f64>> {
        let fitted = self.calibrated.points.get(body);
        let fitted = fitted.and_then(|points| points.get(marker));
        fitted.copied().or_else(|| {
            let template = self.tracks.get(body)?.template.as_ref()?;
            Some(self.calibrated.mounts.get(body)? * template.points.get(i)?)
        })
    }
}

/// Takes the joint values at the new times.
fn shift(loaded: &mut Loaded, refined: Refined, model: &RobotModel) {
    let before = so_far(loaded);
    let (Some(alignment), Some(t)) = (&mut loaded.alignment, &loaded.poses.t) else {
        return;
    };
    let change: Vec<f64> = refined
        .by_row
        .iter()
        .zip(&before)
        .map(|(a, b)| a - b)
        .collect();
    for (joint, stream) in alignment.joints.iter() {
        let Ok(id) = model.joint_id(joint) else {
            continue;
        };
        let speeds = loaded.velocities.get_mut(joint);
        let (Some(speeds), Some(values)) = (speeds, loaded.poses.joints.get_mut(joint)) else {
            continue;
        };
        for (row, value) in values.iter_mut().enumerate() {
            let Some(old) = *value else { continue };
            let at = alignment.clocks.at_robot(t[row]) + refined.by_row[row];
            // At the ends of the log only its speed is known.
            let along = speeds[row].unwrap_or(0.0) * change[row];
            let new = stream.smooth_at(at).unwrap_or(old + along);
            *value = Some(new);
            speeds[row] = stream.speed(at, HALF_CHORD).or(speeds[row]);
            if let Some(q) = &mut loaded.q[row] {
                q[id.index()] = new;
            }
        }
    }
    alignment.refined = Some(refined);
}
