//! The place of a change among all samples, and the size of a step that turns much. The scan is linear, and 5° are no longer small: what was
//! read and seen after the step is corrected by what was found, and what is left is asked for again, until it is little.
//!
//! ```text
//! q_s ← q_s + δ,  y_s ← T exp(−δ) T⁻¹ y_s   for s ∈ S,      δ = −I⁻¹ U there,   exp(ĉ) ← exp(ĉ) exp(δ)
//! ```
//!
//! T is the pose of what moved as the fit has it: of a body, or of the reference about the middle of what it sees.

use calib_geometry::se3;
use nalgebra::{Isometry3, Translation3, Vector3};

use super::columns::{Candidates, Pattern};
use super::levels::Best;
use super::sums::{Design, Found};
use super::{Change, Moved, change};
use crate::analysis::solution::Solution;
use crate::graph::axis::Axis;
use crate::graph::edge::EdgeKind;
use crate::graph::ids::EdgeId;
use crate::graph::measurement::MeasurementKind;
use crate::model::cache::{State, tabulate};
use crate::model::path::Derivatives;
use crate::solve::equations::Workspace;

/// A step that turns by less is linear, rad (0.3°): it is off by 4 µm at 0.3 m.
const TURNED: f64 = 5e-3;

/// Rounds: each leaves what is quadratic in the last.
const ROUNDS: usize = 6;
/// A round that changes the size by less of its standard deviation is the last.
const LITTLE: f64 = 0.05;

/// A scan that was made.
pub(super) struct Scanned<'a> {
    pub candidates: &'a Candidates,
    pub samples: &'a [usize],
    pub edges: &'a [usize],
    pub borders: &'a [usize],
    pub design: &'a Design,
}

/// A scan of all samples around a place that was found among some.
pub(super) struct Near {
    samples: Vec<usize>,
    edges: Vec<usize>,
    design: Design,
    pub best: Best,
}

impl Near {
    pub fn scanned<'a>(&'a self, coarse: &Scanned<'a>) -> Scanned<'a> {
        Scanned {
            samples: &self.samples,
            edges: &self.edges,
            design: &self.design,
            ..*coarse
        }
    }
}

impl Solution {
    /// The sample between two that were looked at; `None` where all were, and for what is no step.
    pub(super) fn near(&self, coarse: &Scanned<'_>, candidate: usize, best: &Best) -> Option<Near> {
        let Scanned {
            candidates,
            borders,
            design,
            ..
        } = *coarse;
        let looked_at_all = coarse.edges.len() == coarse.samples.len();
        if looked_at_all || candidates.list[candidate].pattern != Pattern::Step {
            return None;
        }
        let edges = design.finer(&best.found.after, &self.used_samples());
        let mut samples = [coarse.samples, &edges[..]].concat();
        samples.sort_unstable();
        samples.dedup();
        let fine = Design::new(self, candidates, &samples, &edges, borders)?;
        let found = fine.best_near(candidate, design, &best.found.after)?;
        let score = fine.score(found.gain);
        Some(Near {
            samples,
            edges,
            design: fine,
            best: Best {
                found,
                level: 0,
                score,
            },
        })
    }

    /// A step as it is without linearization; `None` for what is no step or turns little, and where it does not converge.
    pub(super) fn exact_step(
        &self,
        scanned: &Scanned<'_>,
        candidate: usize,
        best: &Best,
        quantile: f64,
    ) -> Option<Change> {
        let what = scanned.candidates.list[candidate].moved;
        let joints = scanned.candidates.joints_of(candidate);
        if best.level != 0 || turned(&joints, &best.found.jump, self) < TURNED {
            return None;
        }
        let design = scanned.design;
        let mut corrected = self.clone();
        let mut found = best.found.clone();
        let mut size = vec![0.0; found.jump.len()];
        for _ in 0..ROUNDS {
            let inside = |sample: usize| design.contains(&best.found.after, sample);
            match what {
                Moved::Joint(_) | Moved::Zeros => {
                    for ((edge, by), size) in joints.iter().zip(&found.jump).zip(&mut size) {
                        *size += by;
                        shift_readings(&mut corrected, *edge, *by, &inside);
                    }
                    corrected.model.trig = tabulate(&corrected.model.problem);
                }
                Moved::Body(_) | Moved::Reference(_) => {
                    let step = pose_of(&found.jump);
                    size = vector_of(&(pose_of(&size) * step));
                    let back = step.inverse();
                    self.correct_seen(&mut corrected, scanned.candidates, (what, &back), &inside);
                }
                Moved::Drift(_) | Moved::Settling(_) | Moved::Scale(_) => return None,
            }
            let here = Design::new(
                &corrected,
                scanned.candidates,
                scanned.samples,
                scanned.edges,
                scanned.borders,
            )?;
            found = here.tested(candidate, &best.found.after, &here.u[candidate])?;
            let level = (here.cost / here.freedom(size.len())).max(0.0);
            let mut steps = found.jump.iter().zip(&found.variance);
            if steps.all(|(step, variance)| step.powi(2) < LITTLE.powi(2) * variance * level) {
                let exact = Best {
                    score: design.score(design.cost - here.cost),
                    found: Found {
                        gain: design.cost - here.cost,
                        jump: size,
                        ..found
                    },
                    level: 0,
                };
                let of = (scanned.candidates, candidate);
                return Some(change(of, &exact, design, quantile));
            }
        }
        None
    }

    /// What was seen of a body, or from a reference, in some samples, moved back.
    fn correct_seen(
        &self,
        corrected: &mut Self,
        candidates: &Candidates,
        (what, back): (Moved, &Isometry3<f64>),
        inside: &dyn Fn(usize) -> bool,
    ) {
        corrected.forget_rows();
        let model = &self.model;
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &self.values);
        let state = State::new(&model.problem, &work.cache, &self.values);
        for (m, measurement) in corrected
            .model
            .problem
            .measurements_mut()
            .iter_mut()
            .enumerate()
        {
            let mut buffer = model.paths[m].buffer();
            // from_from_to · back · to_from_from about the middle of its markers for a body, about the middle of what is seen for a reference
            let mut around = |sample: usize| match what {
                Moved::Body(frame) if measurement.to == frame => {
                    let at = model.paths[m].evaluate(state, sample, Derivatives::None, &mut buffer);
                    let middle = Translation3::from(candidates.body_middle(frame));
                    let at = at.isometry() * middle;
                    Some(at * back * at.inverse())
                }
                Moved::Reference(frame) if measurement.from == frame => {
                    let middle = Translation3::from(candidates.middle(frame));
                    Some(middle * back * middle.inverse())
                }
                _ => None,
            };
            match &mut measurement.kind {
                MeasurementKind::Markers(markers) => {
                    let seen = markers.observations.iter_mut();
                    for o in seen.filter(|o| inside(o.sample)) {
                        if let Some(moved) = around(o.sample) {
                            o.position = moved * o.position;
                        }
                    }
                }
                MeasurementKind::Poses(poses) => {
                    let seen = poses.observations.iter_mut();
                    for o in seen.filter(|o| inside(o.sample)) {
                        if let Some(moved) = around(o.sample) {
                            o.pose = moved * o.pose;
                        }
                    }
                }
                _ => {}
            }
        }
    }
}

fn shift_readings(of: &mut Solution, edge: EdgeId, by: f64, inside: &dyn Fn(usize) -> bool) {
    of.forget_rows();
    let problem = &mut of.model.problem;
    if let EdgeKind::Joint(joint) = &mut problem.edges[edge.index()].kind {
        let readings = joint.q.iter_mut().enumerate();
        readings
            .filter(|(sample, _)| inside(*sample))
            .for_each(|(_, q)| *q += by);
    }
}

/// Angle of a jump, rad; `joints`: whose steps it holds, the largest of which counts.
pub(super) fn turned(joints: &[EdgeId], jump: &[f64], of: &Solution) -> f64 {
    if joints.is_empty() {
        let turn = &jump[..3.min(jump.len())];
        return turn.iter().map(|x| x * x).sum::<f64>().sqrt();
    }
    let turns = |edge: &EdgeId| match &of.model.problem.edges[edge.index()].kind {
        EdgeKind::Joint(joint) => matches!(joint.axis, Axis::Revolute(_)),
        _ => false,
    };
    let steps = joints.iter().zip(jump).filter(|(edge, _)| turns(edge));
    steps.map(|(_, step)| step.abs()).fold(0.0, f64::max)
}

fn pose_of(jump: &[f64]) -> Isometry3<f64> {
    let part = |first: usize| Vector3::from_column_slice(&jump[first..first + 3]);
    se3::exp(&se3::Twist::new(part(0), part(3)))
}

fn vector_of(pose: &Isometry3<f64>) -> Vec<f64> {
    se3::log(pose).0.iter().copied().collect()
}
