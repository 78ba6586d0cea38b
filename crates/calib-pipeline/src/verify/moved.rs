//! Did the tracker or a body move between the fitted recordings and a held-out one?
//!
//! Held-out errors of a robot that is right are small; of one that is wrong they differ from posture to posture. Errors that one motion
//! explains are neither: the frame moved.
//!
//! ```text
//! none      e = p_i − s_i                                            p predicted, s seen
//! tracker   e = T p_i − s_i,   T ∈ SE(3) the same for all bodies      6 unknowns
//! body      e = m_k − (tracker_from_link_i)⁻¹ s_ik                    one place m_k per point of the body on its link
//! joint     e = p_i + c ∂p_i/∂q_j − s_i                               1 unknown: tells what is not distinguishable
//! r² = Σ|e|² / (3N − unknowns),   named where r(none) / r(best) ≥ 3                                       (1)
//! ```

use std::collections::BTreeMap;

use calib_finding::{About, Fact, Finding, Severity, Subject, catalog};
use calib_geometry::registration::rigid_registration;
use calib_profile::{Body, BodyKind, Usage};
use calib_urdf::JointId;
use nalgebra::{Isometry3, Point3, Vector3};

use crate::formulate::kinematics::Calibration;
use crate::prepare::conditions::{Conditions, conditions};
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

/// r(none) / r(best) of (1) from which a motion is named: over ten times the variance.
const NAMED: f64 = 3.0;
/// What comes within this factor of the best is named beside it.
const ALIKE: f64 = 1.5;
/// Fewer postures than this are explained by any motion.
const POSTURES: usize = 5;
/// Errors beyond this many times the median under a hypothesis are gross outliers of the tracker.
const GROSS: f64 = 5.0;
/// Arms that stand for the orientation of a body that is measured as a pose, m: of the size of a tracking body.
const ARM: f64 = 0.1;
/// Step of a joint in difference quotients, rad or m.
const STEP: f64 = 1e-5;

/// One point of a body, as it was seen and as it should have been.
struct Seen<'a> {
    row: usize,
    body: &'a str,
    /// Number of the point on its body.
    point: usize,
    tracker_from_link: Isometry3<f64>,
    predicted: Point3<f64>,
    seen: Point3<f64>,
}

/// What may have moved.
#[derive(Debug, Clone, PartialEq)]
enum Motion {
    Tracker,
    Body(String),
    Joint(JointId),
}

/// A motion that was tried.
struct Tried {
    motion: Motion,
    /// r of (1), m, and of the same points without a motion.
    left: f64,
    none: f64,
    /// Where the middle of what was seen went, m, and its σ.
    shift: f64,
    sigma: f64,
    /// Rotation, where it is determined, rad.
    angle: Option<f64>,
}

/// Findings about held-out recordings before which something moved.
#[must_use]
pub fn moved(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    robot: &Calibration,
) -> Vec<Finding> {
    let recordings = inputs.recordings.values();
    let held_out = recordings.filter(|r| r.spec.usage == Usage::Validation);
    // One cause, one finding: the recordings that it holds in are listed.
    let mut found: Vec<(Tried, Vec<Tried>, Vec<&str>)> = Vec::new();
    for loaded in held_out {
        let Some((best, rivals)) = explained(inputs, tracks, robot, loaded) else {
            continue;
        };
        match found.iter_mut().find(|f| f.0.motion == best.motion) {
            Some(same) => {
                same.2.push(&loaded.name);
                if best.none > same.0.none {
                    (same.0, same.1) = (best, rivals);
                }
            }
            None => found.push((best, rivals, vec![&loaded.name])),
        }
    }
    let findings = found.into_iter();
    findings
        .filter_map(|(best, rivals, names)| finding(inputs, &best, &rivals, &names))
        .collect()
}

fn finding(
    inputs: &Inputs,
    best: &Tried,
    rivals: &[Tried],
    recordings: &[&str],
) -> Option<Finding> {
    let code = |motion: &Motion| match motion {
        Motion::Tracker => Some("moved(tracker)".to_owned()),
        Motion::Body(name) => Some(format!("remounted({name})")),
        Motion::Joint(_) => None,
    };
    let joint = |tried: &Tried| match tried.motion {
        Motion::Joint(joint) => Some(inputs.robot.model.joint(joint).name.clone()),
        _ => None,
    };
    let finding = match &best.motion {
        Motion::Tracker => Finding::of_kind(catalog::TRACKER_MOVED, "held_out", About::Tracker),
        Motion::Body(name) => {
            let subject = Subject::body(name.clone());
            Finding::of_kind(catalog::BODY_REMOUNTED, "held_out", subject)
                .with("body", Fact::name(name.clone()))
        }
        Motion::Joint(_) => return None,
    };
    let names = |all: Vec<String>| (!all.is_empty()).then(|| Fact::names(all));
    let mut finding = finding
        .with("recordings", Fact::names(recordings.iter().copied()))
        .with("none", Fact::meters(best.none))
        .with("best", Fact::meters(best.left))
        .with("distance", Fact::meters(best.shift))
        .with("sigma", Fact::meters(best.sigma))
        .with_some("angle", best.angle.map(Fact::radians))
        .with_some(
            "equivalent",
            names(rivals.iter().filter_map(|r| code(&r.motion)).collect()),
        )
        .with_some("joints", names(rivals.iter().filter_map(joint).collect()));
    finding.subject.recordings = recordings.iter().map(|name| (*name).to_owned()).collect();
    let limit = inputs.robot.profile.solve.limits.held_out_rms;
    let harmless = limit.is_some_and(|limit| best.none * 3.0_f64.sqrt() < limit);
    Some(if harmless {
        finding.with_severity(Severity::Warning)
    } else {
        finding
    })
}

/// The motion that explains the errors of a recording, and those that are as good.
fn explained(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    robot: &Calibration,
    loaded: &Loaded,
) -> Option<(Tried, Vec<Tried>)> {
    let under = conditions(loaded, &inputs.robot, inputs.robot.profile.solve.load);
    let view = View {
        inputs,
        tracks,
        robot,
        loaded,
        under: &under,
    };
    let points = view.points(None);
    let mut rows: Vec<usize> = points.iter().map(|p| p.row).collect();
    rows.dedup();
    if rows.len() < POSTURES {
        return None;
    }
    let mut bodies: Vec<&str> = points.iter().map(|p| p.body).collect();
    bodies.sort_unstable();
    bodies.dedup();
    let mut tried: Vec<Tried> = std::iter::once(tracker(&points))
        .chain(bodies.into_iter().map(|body| remounted(&points, body)))
        .flatten()
        .collect();
    tried.sort_by(|a, b| a.left.total_cmp(&b.left));
    if tried.is_empty() {
        return None;
    }
    let best = tried.remove(0);
    if best.none < NAMED * best.left {
        return None;
    }
    let joints = inputs.robot.model.independent_joints();
    tried.extend(joints.filter_map(|joint| view.zero_changed(&points, joint)));
    // One number that explains more than six is the cause, and neither tracker nor body moved.
    if tried
        .iter()
        .any(|t| matches!(t.motion, Motion::Joint(_)) && ALIKE * t.left < best.left)
    {
        return None;
    }
    tried.retain(|t| t.left < ALIKE * best.left);
    Some((best, tried))
}

/// One held-out recording, and the robot that predicts it.
struct View<'a> {
    inputs: &'a Inputs,
    tracks: &'a BTreeMap<String, BodyTrack>,
    robot: &'a Calibration,
    loaded: &'a Loaded,
    under: &'a [Conditions],
}

impl<'a> View<'a> {
    /// All points, in the order of the rows; with a joint moved by [`STEP`].
    fn points(&self, moved: Option<JointId>) -> Vec<Seen<'a>> {
        let mut out = Vec::new();
        for (row, q) in self.loaded.q.iter().enumerate() {
            let Some(mut q) = q.clone() else { continue };
            if let Some(joint) = moved {
                q[joint.index()] += STEP;
            }
            let root_from_link = self.robot.root_from_link_under(&q, &self.under[row]);
            for (name, body) in &self.inputs.robot.profile.bodies {
                let tracker_from_link =
                    self.robot.tracker_from_root * root_from_link[body.link.index()];
                for (point, on_link, seen) in self.of_body(name, body, row) {
                    out.push(Seen {
                        row,
                        body: name,
                        point,
                        tracker_from_link,
                        predicted: tracker_from_link * on_link,
                        seen,
                    });
                }
            }
        }
        out
    }

    /// Points of a body in a row: number, place on the link, where it was seen.
    fn of_body(
        &self,
        name: &str,
        body: &Body,
        row: usize,
    ) -> Vec<(usize, Point3<f64>, Point3<f64>)> {
        let track = &self.tracks[name];
        match &body.kind {
            BodyKind::Markers { names, .. } if !track.is_computed() => {
                let fitted = self.robot.points.get(name);
                let of_marker = |(k, marker): (usize, &String)| {
                    let known = fitted.and_then(|p| p.get(marker)).copied();
                    let on_link = known.or_else(|| {
                        let template = track.template.as_ref()?;
                        Some(self.robot.mounts.get(name)? * template.points.get(k)?)
                    });
                    let seen = self.loaded.poses.markers.get(marker)?[row]?;
                    Some((k, on_link?, seen))
                };
                names.iter().enumerate().filter_map(of_marker).collect()
            }
            _ => {
                let seen = track.in_recording(&self.loaded.name).get(row);
                let Some((mount, seen)) = self.robot.mounts.get(name).zip(seen.copied().flatten())
                else {
                    return Vec::new();
                };
                let arms = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
                let arms = arms.map(|arm| Point3::from(arm * ARM));
                let of_arm = |(k, arm): (usize, &Point3<f64>)| (k, mount * arm, seen * arm);
                arms.iter().enumerate().map(of_arm).collect()
            }
        }
    }

    fn zero_changed(&self, points: &[Seen<'_>], joint: JointId) -> Option<Tried> {
        let slopes: Vec<Vector3<f64>> = points
            .iter()
            .zip(self.points(Some(joint)))
            .map(|(a, b)| (b.predicted - a.predicted) / STEP)
            .collect();
        let fit = |kept: &[bool]| -> Option<Vec<Vector3<f64>>> {
            let of_kept = || {
                points
                    .iter()
                    .zip(&slopes)
                    .zip(kept)
                    .filter(|(_, kept)| **kept)
            };
            let size: f64 = of_kept().map(|((_, d), _)| d.norm_squared()).sum();
            let along: f64 = of_kept()
                .map(|((p, d), _)| d.dot(&(p.predicted - p.seen)))
                .sum();
            let step = (size > 0.0).then(|| -along / size)?;
            let error = |(p, d): (&Seen<'_>, &Vector3<f64>)| p.predicted - p.seen + d * step;
            Some(points.iter().zip(&slopes).map(error).collect())
        };
        let (left, none, _) = robustly(points, 1, fit)?;
        Some(Tried {
            motion: Motion::Joint(joint),
            left,
            none,
            shift: 0.0,
            sigma: 0.0,
            angle: None,
        })
    }
}

/// T of (1).
fn tracker(points: &[Seen<'_>]) -> Option<Tried> {
    let motion = |kept: &[bool]| -> Option<Isometry3<f64>> {
        let pairs = points.iter().zip(kept).filter(|(_, kept)| **kept);
        let (from, to): (Vec<_>, Vec<_>) = pairs.map(|(p, _)| (p.predicted, p.seen)).unzip();
        Some(rigid_registration(&from, &to, None).ok()?.b_from_a)
    };
    let (left, none, kept) = robustly(points, 6, |kept| {
        let t = motion(kept)?;
        Some(points.iter().map(|p| t * p.predicted - p.seen).collect())
    })?;
    let t = motion(&kept)?;
    let middle = points
        .iter()
        .map(|p| p.predicted.coords)
        .sum::<Vector3<f64>>()
        / points.len() as f64;
    let middle = Point3::from(middle);
    Some(Tried {
        motion: Motion::Tracker,
        left,
        none,
        shift: (t * middle - middle).norm(),
        sigma: sigma(points, left),
        angle: Some(t.rotation.angle()),
    })
}

/// The m_k of (1), for the points of one body; those of the others stay.
fn remounted(points: &[Seen<'_>], body: &str) -> Option<Tried> {
    let own = || points.iter().filter(|p| p.body == body);
    let count = own().map(|p| p.point + 1).max()?;
    let on_link = |p: &Seen<'_>, at: &Point3<f64>| p.tracker_from_link.inverse_transform_point(at);
    // Seen minus predicted place of every point on the link, mean over the rows.
    let places = |kept: &[bool]| -> Vec<(Vector3<f64>, Vector3<f64>, usize)> {
        let mut sums = vec![(Vector3::zeros(), Vector3::zeros(), 0); count];
        for (p, _) in points
            .iter()
            .zip(kept)
            .filter(|(p, kept)| **kept && p.body == body)
        {
            let sum = &mut sums[p.point];
            sum.0 += on_link(p, &p.predicted).coords;
            sum.1 += on_link(p, &p.seen).coords;
            sum.2 += 1;
        }
        sums
    };
    let (left, none, kept) = robustly(points, 3 * count, |kept| {
        let sums = places(kept);
        let error = |p: &Seen<'_>| {
            let moved = sums.get(p.point).filter(|s| p.body == body && s.2 > 0);
            let moved = moved.map_or_else(Vector3::zeros, |s| (s.1 - s.0) / s.2 as f64);
            p.predicted - p.seen + p.tracker_from_link.rotation * moved
        };
        Some(points.iter().map(error).collect())
    })?;
    let sums = places(&kept);
    let known = || sums.iter().filter(|s| s.2 > 0);
    let (from, to): (Vec<_>, Vec<_>) = known()
        .map(|s| {
            (
                Point3::from(s.0 / s.2 as f64),
                Point3::from(s.1 / s.2 as f64),
            )
        })
        .unzip();
    let shift = from
        .iter()
        .zip(&to)
        .map(|(a, b)| b - a)
        .sum::<Vector3<f64>>()
        / known().count().max(1) as f64;
    let turned = rigid_registration(&from, &to, None).ok();
    Some(Tried {
        motion: Motion::Body(body.to_owned()),
        left,
        none,
        shift: shift.norm(),
        sigma: sigma(points, left),
        angle: turned.map(|t| t.b_from_a.rotation.angle()),
    })
}

/// σ of a mean over the postures, m: points of one posture share its error.
fn sigma(points: &[Seen<'_>], left: f64) -> f64 {
    let mut rows: Vec<usize> = points.iter().map(|p| p.row).collect();
    rows.dedup();
    left * (3.0 / rows.len().max(1) as f64).sqrt()
}

/// r of (1) with and without a motion, and the points that it was computed from: gross outliers under the motion are left out.
fn robustly(
    points: &[Seen<'_>],
    unknowns: usize,
    fit: impl Fn(&[bool]) -> Option<Vec<Vector3<f64>>>,
) -> Option<(f64, f64, Vec<bool>)> {
    /// Rounds of leaving out.
    const ROUNDS: usize = 3;
    let mut kept = vec![true; points.len()];
    let mut errors = fit(&kept)?;
    for _ in 0..ROUNDS {
        let mut lengths: Vec<f64> = errors.iter().map(Vector3::norm).collect();
        let each = lengths.clone();
        lengths.sort_by(f64::total_cmp);
        let gross = GROSS * lengths[lengths.len() / 2];
        kept = each.iter().map(|e| *e <= gross).collect();
        errors = fit(&kept)?;
    }
    let count = kept.iter().filter(|k| **k).count();
    let freedom = (3 * count).checked_sub(unknowns).filter(|f| *f > 0)?;
    let sum = |errors: &mut dyn Iterator<Item = f64>| -> f64 {
        errors.zip(&kept).filter(|(_, k)| **k).map(|(e, _)| e).sum()
    };
    let left = sum(&mut errors.iter().map(Vector3::norm_squared));
    let none = sum(&mut points.iter().map(|p| (p.predicted - p.seen).norm_squared()));
    let r = |sum: f64, freedom: usize| (sum / freedom as f64).sqrt();
    Some((r(left, freedom), r(none, 3 * count), kept))
}
