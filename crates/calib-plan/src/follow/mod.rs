//! A plan while it is recorded: postures count as they were held and seen, and the rest is chosen again from there.
//!
//! ```text
//! M = M₀ + Σ_held Y_kᵀ Y_k + Σ_rest Y_iᵀ Y_i        Y_k at the joint positions and with the bodies that were recorded     (1)
//! ```
//!
//! σ of the task now is that of the first two parts of (1), the expected one that of all three. Nothing is fitted meanwhile: measured values
//! do not enter (1).

mod rest;

use std::collections::{BTreeMap, BTreeSet};

use calib_urdf::range::resting_positions;

use crate::candidates::{Candidate, Counts};
use crate::error::PlanError;
use crate::known::Known;
use crate::list::Why;
use crate::prepare::{Options, Prepared, prepare};
use crate::write::PlanFile;

/// The rest is chosen again after so many postures.
const AGAIN: usize = 15;
/// Candidates that it is chosen from: the best of 200 is within 5 % of the best of thousands.
const CANDIDATES: usize = 1024;
/// σ of a plan that differs by more than this factor from what it says was made of something else.
const SAME: f64 = 1.1;
/// Postures that are added at once where the σ is not reached at the end of the list, and most of all.
const ADDED: usize = 6;
const MOST: usize = 200;

/// A posture that is still to come.
#[derive(Debug, Clone, PartialEq)]
pub struct Next {
    /// The posture, and what should be seen of it.
    pub candidate: Candidate,
    /// Why.
    pub why: Why,
    /// The straight motion to it is not known to be free.
    pub blocked: bool,
}

impl Next {
    /// Nothing is recorded there.
    #[must_use]
    pub fn is_on_the_way(&self) -> bool {
        self.why == Why::Detour
    }
}

/// What the postures so far tell, and what all of them will; m, `None`: not determined.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Reached {
    /// σ of the task now.
    pub sigma: Option<f64>,
    /// σ of the task at the end of the list.
    pub expected: Option<f64>,
}

/// A plan that is being recorded.
#[derive(Debug)]
pub struct Follow<'a> {
    prepared: Prepared<'a>,
    /// As they were held, with the posture of the list that each was.
    held: Vec<(Candidate, Next)>,
    rest: Vec<Next>,
    /// Where the robot was last.
    at: Option<Vec<f64>>,
    avoided: Vec<Vec<f64>>,
    offered: Option<Next>,
    /// Postures to record, those in the file among them.
    total: usize,
    /// Postures held when the rest was chosen.
    chosen_after: usize,
    /// Whether these postures are fitted; the others validate.
    fitted: bool,
}

/// The options with which a plan was made.
#[must_use]
pub fn options(plan: &PlanFile, known: &Known, sigma: Option<f64>) -> Options {
    let model = &known.robot.model;
    let base = resting_positions(model);
    let task = plan.asked.task.iter();
    let task: Vec<Vec<f64>> = task.map(|q| plan.at(model, &base, q)).collect();
    Options {
        poses: None,
        sigma: sigma.or(plan.asked.sigma_mm.map(|mm| mm * 1e-3)),
        path_time: plan.asked.path_time_s,
        goal: plan.goal,
        of: plan.asked.of.clone(),
        candidates: CANDIDATES,
        task: (!task.is_empty()).then_some(task),
        seed: plan.asked.seed,
    }
}

impl<'a> Follow<'a> {
    /// The postures of a plan that are fitted; `name`: its file.
    ///
    /// # Errors
    /// [`PlanError::Impossible`] and [`PlanError::Outdated`] where the plan was made of something else, and those of
    /// [`plan`](crate::plan::plan).
    pub fn fitted(
        known: &'a Known,
        options: &'a Options,
        plan: &PlanFile,
        name: &str,
    ) -> Result<Self, PlanError> {
        let follow = Self::unchecked(known, options, plan, name)?;
        let reached = follow.reached()?;
        let then = [plan.sigma_before_mm, plan.sigma_after_mm].map(|s| s.map(|mm| mm * 1e-3));
        let now = [reached.sigma, reached.expected];
        let same = |(then, now): (Option<f64>, Option<f64>)| match (then, now) {
            (Some(then), Some(now)) => now < SAME * then && then < SAME * now,
            (then, now) => then.is_none() && now.is_none(),
        };
        if !then.into_iter().zip(now).all(same) {
            return Err(PlanError::Outdated {
                file: name.to_owned(),
                profile: known.robot.file.clone(),
                then,
                now,
            });
        }
        Ok(follow)
    }

    /// The postures of a plan that validate: in the order of the list, and none is exchanged.
    ///
    /// # Errors
    /// As [`Follow::fitted`], but for σ.
    pub fn held_out(
        known: &'a Known,
        options: &'a Options,
        plan: &PlanFile,
        name: &str,
    ) -> Result<Self, PlanError> {
        let mut follow = Self::new(known, options)?;
        let lines = plan.held_out.iter().map(|q| (q, Why::SpaceFilling));
        follow.list(plan, lines, name)?;
        follow.fitted = false;
        follow.route();
        Ok(follow)
    }

    /// The postures of a plan that are fitted where other things are recorded than it was made for.
    ///
    /// # Errors
    /// As [`Follow::held_out`].
    pub fn unchecked(
        known: &'a Known,
        options: &'a Options,
        plan: &PlanFile,
        name: &str,
    ) -> Result<Self, PlanError> {
        let mut follow = Self::new(known, options)?;
        let lines = plan.postures.iter().map(|p| (&p.joints, p.why));
        follow.list(plan, lines, name)?;
        Ok(follow)
    }

    fn new(known: &'a Known, options: &'a Options) -> Result<Self, PlanError> {
        Ok(Self {
            prepared: prepare(known, options)?,
            held: Vec::new(),
            rest: Vec::new(),
            at: None,
            avoided: Vec::new(),
            offered: None,
            total: 0,
            chosen_after: 0,
            fitted: true,
        })
    }

    /// Takes the postures of a file; all must be possible.
    fn list<'p>(
        &mut self,
        plan: &PlanFile,
        lines: impl Iterator<Item = (&'p BTreeMap<String, f64>, Why)>,
        name: &str,
    ) -> Result<(), PlanError> {
        let (model, base) = (&self.prepared.known.robot.model, &self.prepared.joints.base);
        let lines: Vec<(Vec<f64>, Why)> = lines
            .map(|(q, why)| (plan.at(model, base, q), why))
            .collect();
        let impossible = |counts: Counts| PlanError::Impossible {
            file: name.to_owned(),
            profile: self.prepared.known.robot.file.clone(),
            counts: Box::new(counts),
        };
        if let Some(out) = lines.iter().find(|l| !self.prepared.joints.holds(&l.0)) {
            return Err(PlanError::OutsideRanges {
                file: name.to_owned(),
                profile: self.prepared.known.robot.file.clone(),
                joint: self.prepared.outside(&out.0),
            });
        }
        let postures = lines.iter().map(|l| l.0.clone()).collect();
        let (possible, counts) = self.prepared.feasible.clone().all(postures);
        if possible.len() < lines.len() {
            return Err(impossible(counts));
        }
        for (q, why) in lines {
            // Seen in the same units as the candidates.
            if let Ok(candidate) = self.prepared.feasible.candidate(q) {
                let next = Next {
                    candidate,
                    why,
                    blocked: false,
                };
                self.rest.push(next);
            }
        }
        self.total = recorded(&self.rest).count();
        self.flag();
        Ok(())
    }

    /// Goes on with a file: what it has already is no longer asked for, and neither are postures that were exchanged for others.
    pub fn resume(
        &mut self,
        holds: Vec<Candidate>,
        exchanged: &[Vec<f64>],
        near: &dyn Fn(&[f64], &[f64]) -> bool,
    ) {
        for q in exchanged {
            let is_it = |n: &Next| n.why != Why::Detour && near(&n.candidate.q, q);
            if let Some(place) = self.rest.iter().position(is_it) {
                self.rest.remove(place);
            }
            self.avoided.push(q.clone());
        }
        if holds.is_empty() && exchanged.is_empty() {
            return;
        }
        for hold in holds {
            let is_it = |n: &Next| n.why != Why::Detour && near(&n.candidate.q, &hold.q);
            let next = match self.rest.iter().position(is_it) {
                Some(place) => self.rest.remove(place),
                None => Next {
                    candidate: hold.clone(),
                    why: Why::Information,
                    blocked: false,
                },
            };
            self.at = Some(hold.q.clone());
            self.held.push((hold, next));
        }
        if !self.is_due() || !self.choose_again() {
            self.route();
        }
    }

    /// Postures still to come.
    #[must_use]
    pub fn rest(&self) -> &[Next] {
        &self.rest
    }

    /// A posture as it was held: joint positions by name (rad or m), bodies and markers that were seen.
    #[must_use]
    pub fn as_held(&self, joints: &BTreeMap<String, f64>, seen: &BTreeSet<String>) -> Candidate {
        let model = &self.prepared.known.robot.model;
        let mut q = self.prepared.joints.base.clone();
        for (name, value) in joints {
            if let Ok(id) = model.joint_id(name) {
                q[id.index()] = *value;
            }
        }
        let feasible = &self.prepared.feasible;
        let should = feasible.looked_at(&q);
        let subjects = feasible.sight.subjects.iter().zip(should);
        let of = |(subject, should): (&crate::sight::Subject, crate::sight::Seen)| {
            // What should have been hidden and was seen has the usual noise.
            seen.contains(subject.name()).then(|| should.flatten())
        };
        Candidate {
            seen: subjects.map(of).collect(),
            q,
        }
    }

    /// Bodies that should be measured in a posture.
    #[must_use]
    pub fn measured(&self, next: &Next) -> BTreeSet<String> {
        self.prepared.feasible.sight.measured(&next.candidate.seen)
    }

    /// σ of the task now and at the end of the list.
    ///
    /// # Errors
    /// [`PlanError::Pipeline`] where the problem cannot be stated.
    pub fn reached(&self) -> Result<Reached, PlanError> {
        let held = self.held.iter().map(|h| h.0.clone());
        let rest = self.rest.iter().map(|next| {
            let mut candidate = next.candidate.clone();
            if next.why == Why::Detour {
                candidate.seen.fill(None);
            }
            candidate
        });
        let all: Vec<Candidate> = held.chain(rest).collect();
        let (before, after, _) = self.prepared.predicted(&all)?;
        let of = |count: usize| match count.checked_sub(1) {
            Some(last) => after.get(last).copied().flatten(),
            None => before,
        };
        Ok(Reached {
            sigma: of(self.held.len()),
            expected: of(after.len()),
        })
    }

    /// The σ that was asked for, m, where it is reached.
    #[must_use]
    pub fn is_reached(&self, reached: &Reached) -> Option<f64> {
        let asked = self.prepared.options.sigma?;
        reached.sigma.filter(|s| *s <= asked).map(|_| asked)
    }

    /// Whether these postures are fitted.
    #[must_use]
    pub fn is_fitted(&self) -> bool {
        self.fitted
    }

    /// The first posture was held as `held`; whether the rest was chosen again.
    pub fn hold(&mut self, held: Candidate) -> bool {
        if self.rest.is_empty() {
            return false;
        }
        let next = self.rest.remove(0);
        let sight = &self.prepared.feasible.sight;
        let should = self.measured(&next);
        if !sight.measured(&held.seen).is_superset(&should) {
            // What is hidden here is hidden near it.
            self.avoided.push(next.candidate.q.clone());
        }
        self.at = Some(held.q.clone());
        self.held.push((held, next));
        self.offered = None;
        if self.rest.is_empty() && self.is_short() {
            self.total += ADDED;
            return self.choose_again();
        }
        self.is_due() && self.choose_again()
    }

    /// The σ is asked for, not reached, and more postures may help.
    fn is_short(&self) -> bool {
        let reached = self.reached().unwrap_or_default();
        let asked = self.fitted && self.prepared.options.sigma.is_some();
        asked && self.is_reached(&reached).is_none() && self.total < MOST
    }

    fn is_due(&self) -> bool {
        let enough = self.held.len() >= self.chosen_after + AGAIN;
        self.fitted && enough && !self.rest.is_empty()
    }

    /// The first was only on the way.
    pub fn pass(&mut self) {
        if !self.rest.is_empty() {
            self.at = Some(self.rest.remove(0).candidate.q);
        }
    }

    /// The posture that was held last comes again.
    pub fn forget(&mut self) {
        if let Some((_, next)) = self.held.pop() {
            self.at = Some(next.candidate.q.clone());
            self.rest.insert(0, next);
            self.offered = None;
        }
    }

    /// The first is not recorded: it is hidden, or the robot cannot take it.
    pub fn skip(&mut self) {
        if self.rest.is_empty() {
            return;
        }
        let next = self.rest.remove(0);
        self.offered = None;
        if next.why != Why::Detour {
            self.avoided.push(next.candidate.q);
        }
        self.route();
    }
}

/// Postures that are not only on the way.
fn recorded(rest: &[Next]) -> impl Iterator<Item = &Next> {
    rest.iter().filter(|n| n.why != Why::Detour)
}
