//! Rows that the robust fit left out, and what is wrong with them.
//!
//! Such a row is compared with the motion to its neighbors,
//!
//! ```text
//! e(q_i + f (q_k − q_i)),   k = i ± 1,   f minimizes |e|                                              (1)
//! ```
//!
//! If a fraction f of the way to another row makes the row right, joints and tracker were read at different times, or the
//! robot had not settled. e is the body's pose error, rotation and position in units of what is usual. Where an error of one joint alone leaves clearly
//! less, its reading was wrong.

use calib_geometry::statistics::upper_median;
use std::collections::{BTreeMap, BTreeSet};

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_geometry::so3;
use calib_profile::Usage;
use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Vector6};
use rayon::prelude::*;

use crate::formulate::formulation::MlFit;
use crate::formulate::row_levels::row_levels;
use crate::formulate::standing::{OneJoint, standing};
use crate::formulate::starts::rows_of_no_side;
use crate::prepare::conditions::{Conditions, conditions};
use crate::prepare::excluded::Excluded;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

/// What (1) may leave of a row's squared error: by chance a direction of six takes that much in 1 of 150 rows.
const LEFT: f64 = 0.2;
/// An error of one joint that leaves less of a row than (1), by so many squared units of what is usual, is the better explanation: both have one
/// parameter, and by chance a parameter explains so many in one row of 370.
const BETTER: f64 = 9.0;
/// Largest part of the way to a neighbor: beyond it the row would belong to the other posture.
const LARGEST_FRACTION: f64 = 0.5;
/// A row that is off by this many times the usual is named although no motion explains it.
const FAR_OFF: f64 = 3.0;
/// One joint alone explains a row when it leaves no more than this of the squared error.
const ONE_JOINT_LEFT: f64 = 0.3;
/// Median and σ of the length of a Gaussian 3-vector: √χ²₃(½).
const MEDIAN_OF_THREE: f64 = 1.538;

/// Rows that a fit cannot explain, and what is wrong with them.
#[derive(Debug, Clone, Default)]
pub struct BadRows {
    /// For the report and for `calib check`.
    pub findings: Vec<Finding>,
    /// Rows that lie on the way to a neighbor: joints and tracker were not read at the same time.
    pub unsettled: Vec<Excluded>,
}

/// Whether single rows of a recording are judged. Where rows follow each other in time, a lag is the clock's, and every row has one.
pub(crate) fn is_judged(loaded: &Loaded) -> bool {
    loaded.spec.usage != Usage::Validation && loaded.alignment.is_none()
}

/// What is wrong with the rows that `fit` left out.
#[must_use]
pub fn bad_rows(inputs: &Inputs, tracks: &BTreeMap<String, BodyTrack>, fit: &MlFit) -> BadRows {
    let mut bad = BadRows::default();
    if !fit.solution.status.is_converged() {
        return bad;
    }
    let rejected = rejected_bodies(fit);
    let load = inputs.robot.profile.solve.load;
    let recordings = inputs.recordings.iter();
    let conditions = recordings
        .map(|(name, r)| (name.as_str(), conditions(r, &inputs.robot, load)))
        .collect();
    let of_no_side = rows_of_no_side(inputs);
    let levels = row_levels(inputs, &fit.formulation.samples);
    let bodies = inputs.robot.profile.bodies.keys();
    let is_concerned = |name: &&String| rejected.iter().any(|(.., body)| body == *name);
    for name in bodies.filter(is_concerned) {
        let off = BodyError {
            inputs,
            fit,
            name,
            track: &tracks[name],
            conditions: &conditions,
        };
        // What is usual where the tracker has the same noise, else in all rows.
        let sizes = off.sizes(&rejected);
        let usual: Vec<Option<Usual>> = levels
            .iter()
            .map(|level| usual_of(&sizes, &|r| level.recordings.contains(r)))
            .collect();
        let of_all = usual_of(&sizes, &|_| true);
        for (recording, loaded) in inputs.recordings.iter().filter(|(_, r)| is_judged(r)) {
            let level = levels.iter().position(|l| l.recordings.contains(recording));
            let Some(usual) = level.and_then(|level| usual[level]).or(of_all) else {
                continue;
            };
            let (mut moving, mut others) = (Vec::new(), Vec::new());
            for row in 0..loaded.q.len() {
                if !rejected.contains(&(recording.clone(), row, name.clone())) {
                    continue;
                }
                let of_no_side = of_no_side.contains(&(recording.clone(), row));
                if of_no_side && off.is_usual_on_a_side(loaded, row, usual) {
                    continue;
                }
                match off.between_rows(loaded, row, usual) {
                    Some(on_the_way) => moving.push((row, on_the_way)),
                    None => others.extend(off.far_off(loaded, row, usual).map(|w| (row, w))),
                }
            }
            bad.findings
                .extend(unsettled_finding(recording, name, loaded, &moving));
            let explained: Vec<(usize, OneJoint)> = others
                .iter()
                .filter_map(|(row, off)| Some((*row, off.joint?)))
                .collect();
            let model = &inputs.robot.model;
            if let Some(standing) = standing(model, loaded, &explained) {
                others.retain(|(row, _)| !standing.rows.contains(row));
                bad.findings.push(standing.finding(model, name, loaded));
            }
            bad.findings
                .extend(outlier_finding(model, name, loaded, &others));
            bad.unsettled.extend(moving.iter().map(|(row, _)| Excluded {
                recording: recording.clone(),
                row: *row,
                body: name.clone(),
                cause: calib_report::RejectedFor::OnTheWay,
            }));
        }
    }
    bad
}

/// Recording, row and body where nothing that was seen of the body takes part.
fn rejected_bodies(fit: &MlFit) -> BTreeSet<(String, usize, String)> {
    // (sample, measurement) → observations
    let mut rejected: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for r in &fit.solution.rejected {
        *rejected
            .entry((r.sample, r.measurement.index()))
            .or_default() += 1;
    }
    let measurements = fit.formulation.problem.measurements();
    let mut seen: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for (m, measurement) in measurements.iter().enumerate() {
        if let calib_core::MeasurementKind::Markers(calib_core::measurement::Markers {
            observations,
            ..
        }) = &measurement.kind
        {
            for o in observations {
                *seen.entry((o.sample, m)).or_default() += 1;
            }
        }
    }
    rejected
        .into_iter()
        .filter(|(key, count)| seen.get(key).is_none_or(|all| count >= all))
        .map(|((sample, m), _)| {
            let (recording, row) = &fit.formulation.samples[sample];
            (recording.clone(), *row, measurements[m].name.clone())
        })
        .collect()
}

fn unsettled_finding(
    recording: &str,
    body: &str,
    loaded: &Loaded,
    moving: &[(usize, OnTheWay)],
) -> Option<Finding> {
    let (_, worst) = moving
        .iter()
        .max_by(|a, b| a.1.position.total_cmp(&b.1.position))?;
    let angle = moving.iter().map(|(_, w)| w.angle).fold(0.0, f64::max);
    Some(
        Finding::of_kind(
            catalog::UNSETTLED_ROWS,
            "between",
            Subject::body(body).in_recording(recording),
        )
        .with("count", Fact::count(moving.len()))
        .with("position", Fact::meters(worst.position))
        .with("angle", Fact::radians(angle))
        .with("fraction", Fact::ratio(worst.fraction.abs()))
        .at_rows(moving.iter().map(|(row, _)| loaded.poses.rows[*row])),
    )
}

fn outlier_finding(
    model: &RobotModel,
    body: &str,
    loaded: &Loaded,
    rows: &[(usize, FarOff)],
) -> Option<Finding> {
    let (_, worst) = rows.iter().max_by(|a, b| a.1.ratio.total_cmp(&b.1.ratio))?;
    let joints: BTreeSet<&str> = rows
        .iter()
        .filter_map(|(_, off)| Some(model.joint(off.joint?.joint).name.as_str()))
        .collect();
    let joints = (!joints.is_empty()).then(|| Fact::names(joints));
    Some(
        Finding::of_kind(
            catalog::ROW_OUTLIER,
            "one_body",
            Subject::body(body).in_recording(&loaded.name),
        )
        .with("count", Fact::count(rows.len()))
        .with("position", Fact::meters(worst.position))
        .with("angle", Fact::radians(worst.angle))
        .with("ratio", Fact::ratio(worst.ratio))
        .with_some("joints", joints)
        .at_rows(rows.iter().map(|(row, _)| loaded.poses.rows[*row])),
    )
}

/// A row that is right a part of the way to a neighbor.
struct OnTheWay {
    fraction: f64,
    position: f64,
    angle: f64,
}

/// A row that is far off.
struct FarOff {
    /// In units of the usual.
    ratio: f64,
    position: f64,
    angle: f64,
    /// The joint whose error alone would explain it.
    joint: Option<OneJoint>,
}

/// Usual size of rotation, rad, and position, m, errors per component.
type Usual = (f64, f64);

/// Size of the rotation and the position errors of rows, by recording.
type Sizes<'a> = BTreeMap<&'a String, Vec<(f64, f64)>>;

/// Robust size of the errors of some recordings; `None` below eight of them.
fn usual_of(sizes: &Sizes<'_>, of: &dyn Fn(&String) -> bool) -> Option<Usual> {
    /// Rows from which a median is worth something.
    const ENOUGH: usize = 8;
    let of = sizes.iter().filter(|(recording, _)| of(recording));
    let (mut turns, mut shifts): (Vec<f64>, Vec<f64>) =
        of.flat_map(|(_, rows)| rows).copied().unzip();
    let middle = |all: &mut Vec<f64>| {
        let median = upper_median(all)?;
        (all.len() >= ENOUGH && median > 0.0).then_some(median / MEDIAN_OF_THREE)
    };
    Some((middle(&mut turns)?, middle(&mut shifts)?))
}

/// What one row says of a body and of the joints.
#[derive(Clone, Copy)]
struct SeenRow<'a> {
    seen: &'a Isometry3<f64>,
    q: &'a [f64],
    under: &'a Conditions,
}

/// The pose error of one body under a fit.
struct BodyError<'a> {
    inputs: &'a Inputs,
    fit: &'a MlFit,
    name: &'a str,
    track: &'a BodyTrack,
    /// From which side the joints came and what they held, by recording and row.
    conditions: &'a BTreeMap<&'a str, Vec<Conditions>>,
}

impl<'a> BodyError<'a> {
    /// Predicted ⊟ seen in body axes, `[rad; m]`, at joint positions `q`.
    fn at(&self, row: &SeenRow<'_>, q: &[f64]) -> Option<Vector6<f64>> {
        let robot = &self.fit.calibration;
        let link = self.inputs.robot.profile.bodies[self.name].link;
        let mount = robot.mounts.get(self.name)?;
        let predicted = robot.tracker_from_root
            * robot.root_from_link_under(q, row.under)[link.index()]
            * mount;
        let seen_from_predicted = row.seen.inverse() * predicted;
        let w = so3::log(&seen_from_predicted.rotation);
        let t = seen_from_predicted.translation.vector;
        Some(Vector6::new(w.x, w.y, w.z, t.x, t.y, t.z))
    }

    fn weighted(&self, row: &SeenRow<'_>, q: &[f64], usual: Usual) -> Option<Vector6<f64>> {
        let mut e = self.at(row, q)?;
        for i in 0..3 {
            e[i] /= usual.0;
            e[i + 3] /= usual.1;
        }
        Some(e)
    }

    fn seen(&self, loaded: &'a Loaded, row: usize) -> Option<SeenRow<'a>> {
        Some(SeenRow {
            seen: self.track.in_recording(&loaded.name).get(row)?.as_ref()?,
            q: loaded.q.get(row)?.as_ref()?,
            under: self.conditions.get(loaded.name.as_str())?.get(row)?,
        })
    }

    /// Size of the errors of all rows that take part, rotation and position, by recording.
    fn sizes(&self, rejected: &BTreeSet<(String, usize, String)>) -> Sizes<'a> {
        let of_row = |loaded: &'a Loaded, row: usize| {
            let key = (loaded.name.clone(), row, self.name.to_owned());
            let seen = self
                .seen(loaded, row)
                .filter(|_| !rejected.contains(&key))?;
            let e = self.at(&seen, seen.q)?;
            Some((e.fixed_rows::<3>(0).norm(), e.fixed_rows::<3>(3).norm()))
        };
        let of_recording = |loaded: &'a Loaded| {
            let rows = (0..loaded.q.len()).into_par_iter();
            let sizes = rows.filter_map(|row| of_row(loaded, row)).collect();
            (&loaded.name, sizes)
        };
        fitted(self.inputs).map(of_recording).collect()
    }

    /// Part of the squared error that a step along `direction` leaves, with the step.
    fn explained(&self, row: &SeenRow<'_>, direction: &[f64], usual: Usual) -> Option<(f64, f64)> {
        /// Step of the difference quotient: a thousandth of the way.
        const STEP: f64 = 1e-3;
        let moved = |f: f64| -> Vec<f64> {
            row.q
                .iter()
                .zip(direction)
                .map(|(q, d)| q + f * d)
                .collect()
        };
        let e = self.weighted(row, row.q, usual)?;
        let slope = (self.weighted(row, &moved(STEP), usual)? - e) / STEP;
        let size = slope.norm_squared();
        if size <= 0.0 || e.norm_squared() <= 0.0 {
            return None;
        }
        let step = -slope.dot(&e) / size;
        let left = self.weighted(row, &moved(step), usual)?;
        Some((step, left.norm_squared() / e.norm_squared()))
    }

    /// Equation (1).
    fn between_rows(&self, loaded: &'a Loaded, row: usize, usual: Usual) -> Option<OnTheWay> {
        let seen = self.seen(loaded, row)?;
        let neighbors = [row.checked_sub(1), row.checked_add(1)];
        let best = neighbors
            .into_iter()
            .flatten()
            .filter_map(|k| loaded.q.get(k)?.as_ref())
            .filter_map(|other| {
                let way: Vec<f64> = other.iter().zip(seen.q).map(|(o, q)| o - q).collect();
                self.explained(&seen, &way, usual)
            })
            .filter(|(fraction, left)| *left < LEFT && fraction.abs() < LARGEST_FRACTION)
            .min_by(|a, b| a.1.total_cmp(&b.1))?;
        let size = self.weighted(&seen, seen.q, usual)?.norm_squared();
        let of_one = self.one_joint(&seen, usual);
        if of_one.is_some_and(|of| size * (best.1 - of.left) > BETTER) {
            return None;
        }
        let e = self.at(&seen, seen.q)?;
        Some(OnTheWay {
            fraction: best.0,
            position: e.fixed_rows::<3>(3).norm(),
            angle: e.fixed_rows::<3>(0).norm(),
        })
    }

    /// Whether a row is as good as others if its joints came from sides that nothing tells.
    fn is_usual_on_a_side(&self, loaded: &'a Loaded, row: usize, usual: Usual) -> bool {
        let Some(seen) = self.seen(loaded, row) else {
            return false;
        };
        let joints = 0..seen.under.approach.len();
        let open: Vec<usize> = joints
            .filter(|j| seen.under.approach_of(*j) == 0.0)
            .collect();
        // Joints without backlash, and those beyond the body, do nothing: the best side of one after the other.
        let mut under = seen.under.clone();
        let ratio = |under: &Conditions| {
            let sided = SeenRow { under, ..seen };
            self.ratio(&sided, usual).unwrap_or(f64::INFINITY)
        };
        for _ in 0..2 {
            for &joint in &open {
                let with = |side: f64| {
                    let mut under = under.clone();
                    under.approach[joint] = side;
                    (ratio(&under), under)
                };
                let (below, above) = (with(1.0), with(-1.0));
                under = if below.0 <= above.0 { below.1 } else { above.1 };
            }
        }
        ratio(&under) < FAR_OFF
    }

    /// The error in units of what is usual.
    fn ratio(&self, seen: &SeenRow<'_>, usual: Usual) -> Option<f64> {
        // √χ²₆(½) is what is usual.
        Some(self.weighted(seen, seen.q, usual)?.norm() / 2.313)
    }

    fn far_off(&self, loaded: &'a Loaded, row: usize, usual: Usual) -> Option<FarOff> {
        let seen = self.seen(loaded, row)?;
        let e = self.at(&seen, seen.q)?;
        let ratio = self.ratio(&seen, usual)?;
        if ratio < FAR_OFF {
            return None;
        }
        let joint = self.one_joint(&seen, usual);
        let joint = joint.filter(|of| of.left < ONE_JOINT_LEFT);
        Some(FarOff {
            ratio,
            position: e.fixed_rows::<3>(3).norm(),
            angle: e.fixed_rows::<3>(0).norm(),
            joint,
        })
    }

    /// The joint whose error alone explains a row best.
    fn one_joint(&self, seen: &SeenRow<'_>, usual: Usual) -> Option<OneJoint> {
        let model = &self.inputs.robot.model;
        let link = self.inputs.robot.profile.bodies[self.name].link;
        let joints = model.chain_to_root(link).into_iter();
        let moving = joints.filter(|joint| model.joint(*joint).kind.axis().is_some());
        let left = moving.filter_map(|joint| {
            let mut only = vec![0.0; seen.q.len()];
            only[joint.index()] = 1.0;
            let (step, left) = self.explained(seen, &only, usual)?;
            Some(OneJoint { joint, step, left })
        });
        left.min_by(|a, b| a.left.total_cmp(&b.left))
    }
}

fn fitted(inputs: &Inputs) -> impl Iterator<Item = &Loaded> {
    inputs
        .recordings
        .values()
        .filter(|r| r.spec.usage != Usage::Validation)
}
