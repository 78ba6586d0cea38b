//! Task postures from where the tool is to be: inverse kinematics from many starts.
//!
//! ```text
//! e(q) = [p_goal − p(q);  ℓ log(R(q)ᵀ R_goal)]                  the second part where the goal has an orientation          (1)
//! Δq = (JᵀJ + λ 1)⁻¹ Jᵀ e,   J = −∂e/∂q by differences,   q ← q + Δq, cut at the ranges                                 (2)
//! ```
//!
//! Lengths m, angles rad, ℓ = 0.3 m per rad. A step that makes |e| larger is not taken, and λ grows; joints at an end of their range that (2) would move out of it
//! are left out of J. Of the starts, postures that fill the joint ranges, those nearest to the goal are tried first, then others. The robot is the nominal
//! one: a task is where the robot works, and millimeters do not change what is seen there.

use calib_recording::Poses;
use calib_urdf::RobotModel;
use nalgebra::{DMatrix, DVector, Isometry3, Point3, UnitQuaternion, Vector3};

use crate::candidates::Feasible;
use crate::error::PlanError;
use crate::joints::JointBox;

/// Where a point of the robot is to be, in the frame of the robot's root.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goal {
    /// Place, m.
    pub place: Point3<f64>,
    /// Orientation of the link; `None`: any.
    pub orientation: Option<UnitQuaternion<f64>>,
}

/// Point of the robot that is brought somewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tool {
    /// Index of its link.
    pub link: usize,
    /// In the frame of the link, m.
    pub at: Point3<f64>,
}

/// Meters that a radian counts as: about the length of a tool.
const LEVER: f64 = 0.3;
/// Nearer than this is there, m.
const THERE: f64 = 1e-4;
/// Postures that starts are chosen from.
const FILLING: usize = 1024;
/// Starts that are tried: the nearest ones, then others in the order of the sequence.
const STARTS: usize = 256;
/// How many of them are the nearest.
const NEAREST: usize = 32;
/// Steps from one start.
const STEPS: usize = 120;
/// First λ of equation (2), m²: steps near singular postures stay short.
const DAMPING: f64 = 1e-4;
/// A start whose λ grows above is at its nearest place, m².
const STUCK: f64 = 1e6;
/// |e| that is as good as none, m.
const EXACT: f64 = 1e-6;
/// Difference for J, rad or m.
const STEP: f64 = 1e-6;
/// Seed of the starts.
const SEED: u32 = 0x91ac;

/// The places of a table that has one point of the robot in each row.
///
/// # Errors
/// [`PlanError::NotPlaces`] for a table of something else.
pub fn goals(
    poses: &Poses,
    name: &str,
    model: &RobotModel,
    feasible: &Feasible<'_>,
) -> Result<(Tool, Vec<Goal>), PlanError> {
    let wrong = |why: String| PlanError::NotPlaces {
        file: name.to_owned(),
        why,
    };
    let names: Vec<&String> = poses.bodies.keys().chain(poses.markers.keys()).collect();
    let [own] = names[..] else {
        let listed: Vec<&str> = names.iter().map(|n| n.as_str()).collect();
        return Err(wrong(format!(
            "the table has neither joint positions nor the places of one point, but of {}: {}",
            names.len(),
            listed.join(", ")
        )));
    };
    let tool = tool(own, model, feasible).ok_or_else(|| {
        wrong(format!(
            "`{own}` is not a link, body or marker of this robot"
        ))
    })?;
    let goal = |row: usize| {
        let body = poses.bodies.get(own).and_then(|track| track[row]);
        let of_body = body.map(|pose: Isometry3<f64>| Goal {
            place: pose.translation.vector.into(),
            orientation: Some(pose.rotation),
        });
        let marker = poses.markers.get(own).and_then(|track| track[row]);
        let of_marker = marker.map(|place| Goal {
            place,
            orientation: None,
        });
        let goal = of_body.or(of_marker);
        goal.ok_or_else(|| wrong(format!("row {}: the place is missing", row + 1)))
    };
    let goals: Result<Vec<Goal>, _> = (0..poses.len()).map(goal).collect();
    Ok((tool, goals?))
}

/// The point of a link, body or marker.
fn tool(name: &str, model: &RobotModel, feasible: &Feasible<'_>) -> Option<Tool> {
    let subjects = &feasible.sight.subjects;
    let subject = subjects.iter().find(|s| s.name() == name);
    let subject = subject.or_else(|| subjects.iter().find(|s| s.body == name));
    let of_subject = subject.map(|s| Tool {
        link: s.link,
        at: s.at,
    });
    let of_link = || {
        let link = model.link_ids().find(|l| model.link(*l).name == name)?;
        Some(Tool {
            link: link.index(),
            at: Point3::origin(),
        })
    };
    of_subject.or_else(of_link)
}

/// A posture without contact for every place.
///
/// # Errors
/// [`PlanError::PlaceOutOfReach`] for the first place that has none, with how near the tool comes, or what is in the way.
pub fn postures(
    (tool, goals): (Tool, &[Goal]),
    name: &str,
    joints: &JointBox,
    feasible: &Feasible<'_>,
) -> Result<Vec<Vec<f64>>, PlanError> {
    let of = |(row, goal): (usize, &Goal)| {
        let search = Search {
            tool,
            goal: *goal,
            joints,
            feasible,
        };
        search.posture().map_err(|why| PlanError::PlaceOutOfReach {
            file: name.to_owned(),
            row: row + 1,
            nearest_mm: why.nearest.0 * 1e3,
            nearest_deg: why.nearest.1.to_degrees(),
            starts: STARTS,
            oriented: goal.orientation.is_some(),
            touching: why.touching,
        })
    };
    use rayon::prelude::*;
    let found: Vec<_> = goals.par_iter().enumerate().map(of).collect();
    found.into_iter().collect()
}

/// Why a place has no posture.
struct Missed {
    /// How near the tool comes: m, and rad where an orientation is asked for.
    nearest: (f64, f64),
    /// Whether postures were found that touch something.
    touching: bool,
}

struct Search<'a> {
    tool: Tool,
    goal: Goal,
    joints: &'a JointBox,
    feasible: &'a Feasible<'a>,
}

impl Search<'_> {
    fn posture(&self) -> Result<Vec<f64>, Missed> {
        let filling = self.joints.postures(FILLING, SEED);
        let mut order: Vec<usize> = (0..filling.len()).collect();
        order.sort_by_cached_key(|i| ordered(self.error(&filling[*i]).norm()));
        let (near, mut rest) = (order[..NEAREST].to_vec(), order[NEAREST..].to_vec());
        rest.sort_unstable();
        let mut least = f64::INFINITY;
        let mut missed = Missed {
            nearest: (f64::INFINITY, 0.0),
            touching: false,
        };
        for start in near.into_iter().chain(rest).take(STARTS) {
            let (q, e) = self.approach(filling[start].clone());
            let left = e.norm();
            if left < least {
                least = left;
                let turn = e.rows_range(3..).norm() / LEVER;
                missed.nearest = (e.rows(0, 3).norm(), turn);
            }
            if left > THERE {
                continue;
            }
            let placed = self.feasible.model.forward_kinematics(&q);
            let placed = self.feasible.scene.placed(&placed);
            if self.feasible.scene.contact(&placed).is_none() {
                return Ok(q);
            }
            missed.touching = true;
        }
        Err(missed)
    }

    /// Equation (1).
    fn error(&self, q: &[f64]) -> DVector<f64> {
        let link = self.feasible.model.forward_kinematics(q)[self.tool.link];
        let e = self.goal.place - link * self.tool.at;
        let turn = self.goal.orientation.map(|goal| {
            let turn: Vector3<f64> = (link.rotation.inverse() * goal).scaled_axis();
            turn * LEVER
        });
        DVector::from_iterator(
            if turn.is_some() { 6 } else { 3 },
            e.iter().copied().chain(turn.iter().flatten().copied()),
        )
    }

    /// Equation (2) from a start: where it ends, and e there.
    fn approach(&self, mut q: Vec<f64>) -> (Vec<f64>, DVector<f64>) {
        let mut e = self.error(&q);
        let mut damping = DAMPING;
        for _ in 0..STEPS {
            if e.norm() < EXACT || damping > STUCK {
                break;
            }
            let j = self.jacobian(&q, &e);
            let downhill = j.transpose() * &e;
            let free: Vec<usize> = (0..downhill.len())
                .filter(|i| {
                    let (m, at) = (
                        &self.joints.moved[*i],
                        q[self.joints.moved[*i].joint.index()],
                    );
                    !(at <= m.low && downhill[*i] < 0.0 || at >= m.high && downhill[*i] > 0.0)
                })
                .collect();
            if free.is_empty() {
                break;
            }
            let (j, downhill) = (j.select_columns(&free), downhill.select_rows(&free));
            let squared = j.transpose() * &j;
            // λ until a step makes it better.
            while damping <= STUCK {
                let damped = &squared + DMatrix::identity(free.len(), free.len()) * damping;
                let Some(step) = damped.cholesky().map(|root| root.solve(&downhill)) else {
                    damping *= 10.0;
                    continue;
                };
                let mut next = q.clone();
                for (i, by) in free.iter().zip(step.iter()) {
                    let m = &self.joints.moved[*i];
                    let at = &mut next[m.joint.index()];
                    *at = (*at + by).clamp(m.low, m.high);
                }
                let after = self.error(&next);
                if after.norm() < e.norm() {
                    (q, e) = (next, after);
                    damping = (0.2 * damping).max(1e-12);
                    break;
                }
                damping *= 10.0;
            }
        }
        (q, e)
    }

    /// J of equation (2) for the moved joints.
    fn jacobian(&self, q: &[f64], e: &DVector<f64>) -> DMatrix<f64> {
        let mut j = DMatrix::zeros(e.len(), self.joints.moved.len());
        let mut moved = q.to_vec();
        for (column, m) in self.joints.moved.iter().enumerate() {
            let at = m.joint.index();
            moved[at] = q[at] + STEP;
            j.set_column(column, &((e - self.error(&moved)) / STEP));
            moved[at] = q[at];
        }
        j
    }
}

/// A length that is not negative as a key to sort by.
fn ordered(length: f64) -> u64 {
    length.to_bits()
}
