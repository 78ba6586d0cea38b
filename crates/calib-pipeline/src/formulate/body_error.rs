//! The error of a body in one row under a fit, and what explains it.
//!
//! A row that is off is compared with the motion to its neighbors,
//!
//! ```text
//! e(q_i + f (q_k − q_i)),   k = i ± 1,   f minimizes |e|                                              (1)
//! ```
//!
//! e is the error of the body's pose, rotation and position in units of what is usual. Where one or two markers are seen, it is that of their middle.

use std::collections::{BTreeMap, BTreeSet};

use calib_geometry::so3;
use calib_geometry::statistics::upper_median;
use calib_profile::{BodyKind, Usage};
use nalgebra::{Isometry3, Point3, Vector3, Vector6};
use rayon::prelude::*;

use crate::formulate::formulation::MlFit;
use crate::formulate::standing::OneJoint;
use crate::prepare::conditions::Conditions;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

/// An error of one joint that leaves less of a row than (1), by so many squared units of what is usual, is the better explanation: both have one
/// parameter, and by chance a parameter explains so many in one row of 370.
const BETTER: f64 = 9.0;
/// Largest part of the way to a neighbor: beyond it the row would belong to the other posture.
const LARGEST_FRACTION: f64 = 0.5;
/// A row is named where it is off by so many times the largest error of those that take part: no tracker's noise ends as that of Gauss does, and a row
/// just beyond the others is one of them.
const BEYOND: f64 = 1.5;
/// Median and σ of the length of a Gaussian 3-vector: √χ²₃(½).
const MEDIAN_OF_THREE: f64 = 1.538;

/// A row that is right a part of the way to a neighbor.
pub(super) struct OnTheWay {
    pub(super) fraction: f64,
    pub(super) position: f64,
    /// `None` where nothing shows an orientation.
    pub(super) angle: Option<f64>,
}

/// A row that is far off.
pub(super) struct FarOff {
    /// In units of the usual.
    pub(super) ratio: f64,
    pub(super) position: f64,
    /// `None` where nothing shows an orientation.
    pub(super) angle: Option<f64>,
    /// The joint whose error alone would explain it.
    pub(super) joint: Option<OneJoint>,
}

/// Usual size of the errors per component.
#[derive(Clone, Copy)]
pub(super) struct Usual {
    /// Of the rotation, rad; `None` where too few rows show one.
    turn: Option<f64>,
    /// Of the position, m.
    shift: f64,
    /// The largest error of a row that takes part, in units of what is usual.
    largest: f64,
}

impl Usual {
    /// An error in units of what is usual.
    fn ratio(&self, turn: Option<f64>, shift: f64) -> Option<f64> {
        let shift = shift / self.shift;
        Some(match turn {
            Some(turn) => {
                let turn = turn / self.turn?;
                (shift * shift + turn * turn).sqrt() / OF_POSES.median
            }
            None => shift / OF_MARKERS.median,
        })
    }
}

/// Size of the rotation errors, where they are seen, and the position errors of rows, by recording.
type Sizes<'a> = BTreeMap<&'a String, Vec<(Option<f64>, f64)>>;

/// Robust size of the errors of some recordings; `None` below eight of them.
pub(super) fn usual_of(sizes: &Sizes<'_>, of: &dyn Fn(&String) -> bool) -> Option<Usual> {
    /// Rows from which a median is worth something.
    const ENOUGH: usize = 8;
    let of = sizes.iter().filter(|(recording, _)| of(recording));
    let all: Vec<(Option<f64>, f64)> = of.flat_map(|(_, rows)| rows).copied().collect();
    let middle = |mut all: Vec<f64>| {
        let median = upper_median(&mut all)?;
        (all.len() >= ENOUGH && median > 0.0).then_some(median / MEDIAN_OF_THREE)
    };
    let usual = Usual {
        turn: middle(all.iter().filter_map(|(turn, _)| *turn).collect()),
        shift: middle(all.iter().map(|(_, shift)| *shift).collect())?,
        largest: 0.0,
    };
    let ratios = all
        .iter()
        .filter_map(|(turn, shift)| usual.ratio(*turn, *shift));
    let largest = ratios.fold(0.0, f64::max);
    Some(Usual { largest, ..usual })
}

/// What the tracker saw of a body in a row.
#[derive(Clone, PartialEq)]
pub(super) enum Seen {
    /// Its pose.
    Pose(Isometry3<f64>),
    /// Place on the link and in the tracker's frame of each marker, where they show no pose.
    Markers(Vec<(Point3<f64>, Point3<f64>)>),
}

impl Seen {
    /// What would be seen if the tracker had exchanged this body with the `other`; `None` where one has more markers.
    fn as_of(&self, other: &Self) -> Option<Self> {
        match (self, other) {
            (Self::Pose(_), Self::Pose(pose)) => Some(Self::Pose(*pose)),
            (Self::Markers(own), Self::Markers(seen)) if own.len() == seen.len() => {
                let pairs = own.iter().zip(seen);
                let pairs = pairs.map(|((on_link, _), (_, seen))| (*on_link, *seen));
                Some(Self::Markers(pairs.collect()))
            }
            _ => None,
        }
    }

    /// What is usual of such an error.
    fn limits(&self) -> &'static Limits {
        match self {
            Self::Pose(_) => &OF_POSES,
            Self::Markers(_) => &OF_MARKERS,
        }
    }
}

/// What is usual of an error with so many components.
struct Limits {
    /// Median of its length in units of σ: √χ²(½).
    median: f64,
    /// What (1) may leave of its square: by chance a direction takes that much in 1 of 150 rows.
    left: f64,
    /// One joint alone explains a row when it leaves no more than this of the squared error.
    one_joint_left: f64,
    /// A row that is off by this many times the usual is named although no motion explains it.
    far_off: f64,
}

/// Six components.
const OF_POSES: Limits = Limits {
    median: 2.313,
    left: 0.2,
    one_joint_left: 0.3,
    far_off: 3.0,
};
/// Three: of as many directions one takes most of an error by chance, and three joints take all of it.
const OF_MARKERS: Limits = Limits {
    median: MEDIAN_OF_THREE,
    left: 0.013,
    one_joint_left: 0.013,
    far_off: 4.0,
};

/// What one row says of a body and of the joints.
#[derive(Clone)]
pub(super) struct SeenRow<'a> {
    seen: Seen,
    q: &'a [f64],
    under: &'a Conditions,
}

/// The error of one body under a fit.
pub(super) struct BodyError<'a> {
    pub(super) inputs: &'a Inputs,
    pub(super) fit: &'a MlFit,
    pub(super) name: &'a str,
    pub(super) track: &'a BodyTrack,
    /// From which side the joints came and what they held, by recording and row.
    pub(super) conditions: &'a BTreeMap<&'a str, Vec<Conditions>>,
}

impl<'a> BodyError<'a> {
    /// Predicted ⊟ seen in the axes of the body, or of its link where only markers are seen, `[rad; m]`, at joint positions `q`.
    fn at(&self, row: &SeenRow<'_>, q: &[f64]) -> Option<Vector6<f64>> {
        let robot = &self.fit.calibration;
        let link = self.inputs.robot.profile.bodies[self.name].link;
        let tracker_from_link =
            robot.tracker_from_root * robot.root_from_link_under(q, row.under)[link.index()];
        let (w, t) = match &row.seen {
            Seen::Pose(seen) => {
                let predicted = tracker_from_link * robot.mounts.get(self.name)?;
                let seen_from_predicted = seen.inverse() * predicted;
                let w = so3::log(&seen_from_predicted.rotation);
                (w, seen_from_predicted.translation.vector)
            }
            Seen::Markers(pairs) => {
                let off = |(on_link, seen): &(Point3<f64>, Point3<f64>)| {
                    on_link - tracker_from_link.inverse_transform_point(seen)
                };
                let sum: Vector3<f64> = pairs.iter().map(off).sum();
                (Vector3::zeros(), sum / pairs.len() as f64)
            }
        };
        Some(Vector6::new(w.x, w.y, w.z, t.x, t.y, t.z))
    }

    fn weighted(&self, row: &SeenRow<'_>, q: &[f64], usual: Usual) -> Option<Vector6<f64>> {
        let turn = match row.seen {
            Seen::Pose(_) => usual.turn?,
            // There is none.
            Seen::Markers(_) => 1.0,
        };
        let mut e = self.at(row, q)?;
        for i in 0..3 {
            e[i] /= turn;
            e[i + 3] /= usual.shift;
        }
        Some(e)
    }

    pub(super) fn seen(&self, loaded: &'a Loaded, row: usize) -> Option<SeenRow<'a>> {
        let pose = self.track.in_recording(&loaded.name).get(row);
        let seen = match pose.copied().flatten() {
            Some(pose) => Seen::Pose(pose),
            None => self.markers(loaded, row)?,
        };
        Some(SeenRow {
            seen,
            q: loaded.q.get(row)?.as_ref()?,
            under: self.conditions.get(loaded.name.as_str())?.get(row)?,
        })
    }

    /// The markers that are seen in a row; `None` without any.
    fn markers(&self, loaded: &Loaded, row: usize) -> Option<Seen> {
        let robot = &self.fit.calibration;
        let BodyKind::Markers { names, .. } = &self.inputs.robot.profile.bodies[self.name].kind
        else {
            return None;
        };
        let on_link = |i: usize, marker: &String| {
            let fitted = robot.points.get(self.name).and_then(|p| p.get(marker));
            fitted.copied().or_else(|| {
                let template = self.track.template.as_ref()?;
                Some(robot.mounts.get(self.name)? * template.points.get(i)?)
            })
        };
        let pair = |(i, marker): (usize, &String)| {
            let seen = loaded
                .poses
                .markers
                .get(marker)?
                .get(row)
                .copied()
                .flatten();
            on_link(i, marker).zip(seen)
        };
        let pairs: Vec<_> = names.iter().enumerate().filter_map(pair).collect();
        (!pairs.is_empty()).then_some(Seen::Markers(pairs))
    }

    /// Size of the errors of all rows that take part, rotation and position, by recording.
    pub(super) fn sizes(&self, rejected: &BTreeSet<(String, usize, String)>) -> Sizes<'a> {
        let of_row = |loaded: &'a Loaded, row: usize| {
            let key = (loaded.name.clone(), row, self.name.to_owned());
            let seen = self
                .seen(loaded, row)
                .filter(|_| !rejected.contains(&key))?;
            let (shift, turn) = self.size(&seen)?;
            Some((turn, shift))
        };
        let of_recording = |loaded: &'a Loaded| {
            let rows = (0..loaded.q.len()).into_par_iter();
            let sizes = rows.filter_map(|row| of_row(loaded, row)).collect();
            (&loaded.name, sizes)
        };
        fitted(self.inputs).map(of_recording).collect()
    }

    /// Size of the position error, m, and of the rotation, rad, where it is seen.
    fn size(&self, seen: &SeenRow<'_>) -> Option<(f64, Option<f64>)> {
        let e = self.at(seen, seen.q)?;
        let turn = matches!(seen.seen, Seen::Pose(_)).then(|| e.fixed_rows::<3>(0).norm());
        Some((e.fixed_rows::<3>(3).norm(), turn))
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
    pub(super) fn between_rows(
        &self,
        loaded: &'a Loaded,
        row: usize,
        usual: Usual,
    ) -> Option<OnTheWay> {
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
            .filter(|(fraction, left)| {
                *left < seen.seen.limits().left && fraction.abs() < LARGEST_FRACTION
            })
            .min_by(|a, b| a.1.total_cmp(&b.1))?;
        let size = self.weighted(&seen, seen.q, usual)?.norm_squared();
        let of_one = self.one_joint(&seen, usual);
        if of_one.is_some_and(|of| size * (best.1 - of.left) > BETTER) {
            return None;
        }
        let (position, angle) = self.size(&seen)?;
        Some(OnTheWay {
            fraction: best.0,
            position,
            angle,
        })
    }

    /// Whether a row is as good as others if its joints came from sides that nothing tells.
    pub(super) fn is_usual_on_a_side(&self, loaded: &'a Loaded, row: usize, usual: Usual) -> bool {
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
            let sided = SeenRow {
                under,
                ..seen.clone()
            };
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
        ratio(&under) < seen.seen.limits().far_off
    }

    /// Whether the row is far off, and usual where `other`, which is far off in it as well, was seen.
    pub(super) fn is_where(
        &self,
        other: &Self,
        loaded: &'a Loaded,
        row: usize,
        usual: Usual,
    ) -> bool {
        let exchanged = || {
            let (own, theirs) = (self.seen(loaded, row)?, other.seen(loaded, row)?);
            let far_off = own.seen.limits().far_off;
            let seen = own.seen.as_of(&theirs.seen)?;
            let there = self.ratio(
                &SeenRow {
                    seen,
                    ..own.clone()
                },
                usual,
            )?;
            Some(self.ratio(&own, usual)? >= far_off && there < far_off)
        };
        exchanged().unwrap_or(false)
    }

    /// The error in units of what is usual.
    fn ratio(&self, seen: &SeenRow<'_>, usual: Usual) -> Option<f64> {
        let (shift, turn) = self.size(seen)?;
        usual.ratio(turn, shift)
    }

    pub(super) fn far_off(&self, loaded: &'a Loaded, row: usize, usual: Usual) -> Option<FarOff> {
        let seen = self.seen(loaded, row)?;
        let (position, angle) = self.size(&seen)?;
        let ratio = self.ratio(&seen, usual)?;
        if ratio < seen.seen.limits().far_off.max(BEYOND * usual.largest) {
            return None;
        }
        let joint = self.one_joint(&seen, usual);
        let joint = joint.filter(|of| of.left < seen.seen.limits().one_joint_left);
        Some(FarOff {
            ratio,
            position,
            angle,
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
