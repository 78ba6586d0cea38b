//! Task postures from where the tool is to be: inverse kinematics from many starts.
//!
//! ```text
//! e(q) = [p_goal − p(q);  ℓ log(R(q)ᵀ R_goal)]                  the second part where the goal has an orientation          (1)
//! Δq = Jᵀ (J Jᵀ + λ² 1)⁻¹ e,   J = −∂e/∂q by differences,   q ← q + Δq, cut at the ranges                              (2)
//! ```
//!
//! Lengths m, angles rad, ℓ = 0.3 m per rad. Of the starts, postures that fill the joint ranges, those nearest to the goal are tried first. The robot is the nominal
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
/// Postures that starts are chosen from, and how many are tried.
const FILLING: usize = 1024;
const STARTS: usize = 24;
/// Steps from one start.
const STEPS: usize = 60;
/// λ of equation (2), m: steps near singular postures stay short.
const DAMPING: f64 = 1e-3;
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
            nearest_mm: why.nearest * 1e3,
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
    /// How near the tool comes by equation (1), m.
    nearest: f64,
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
        let mut starts = self.joints.postures(FILLING, SEED);
        starts.sort_by_cached_key(|q| ordered(self.error(q).norm()));
        let mut missed = Missed {
            nearest: f64::INFINITY,
            touching: false,
        };
        for start in starts.into_iter().take(STARTS) {
            let (q, left) = self.approach(start);
            missed.nearest = missed.nearest.min(left);
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

    /// Equation (2) from a start: where it ends, and |e| there.
    fn approach(&self, mut q: Vec<f64>) -> (Vec<f64>, f64) {
        let mut e = self.error(&q);
        for _ in 0..STEPS {
            if e.norm() < 0.1 * THERE {
                break;
            }
            let mut j = DMatrix::zeros(e.len(), self.joints.moved.len());
            for (column, m) in self.joints.moved.iter().enumerate() {
                let mut moved = q.clone();
                moved[m.joint.index()] += STEP;
                j.set_column(column, &((&e - self.error(&moved)) / STEP));
            }
            let damped =
                &j * j.transpose() + DMatrix::identity(e.len(), e.len()) * (DAMPING * DAMPING);
            let Some(step) = damped.cholesky().map(|root| j.transpose() * root.solve(&e)) else {
                break;
            };
            let mut next = q.clone();
            for (m, by) in self.joints.moved.iter().zip(step.iter()) {
                let at = &mut next[m.joint.index()];
                *at = (*at + by).clamp(m.low, m.high);
            }
            if next == q {
                break;
            }
            q = next;
            e = self.error(&q);
        }
        (q, e.norm())
    }
}

/// A length that is not negative as a key to sort by.
fn ordered(length: f64) -> u64 {
    length.to_bits()
}
