//! The rest of a plan that is being recorded: chosen again, exchanged, and the way through it.

use nalgebra::DMatrix;

use super::{Follow, Next, recorded};
use crate::candidates::Candidate;
use crate::compose::{BY_INFORMATION, Listed, in_order, with_detours};
use crate::design::Question;
use crate::list::Why;

/// Candidates nearer than this to a posture that was hidden or not reached, all joint ranges being 1, are not offered.
const AVOIDED: f64 = 0.1;
/// The same posture, read from a file.
const SAME: f64 = 1e-6;

impl Follow<'_> {
    /// The posture that tells most in place of the first that is to be recorded.
    pub fn offer(&mut self) -> Option<&Next> {
        if self.offered.is_none() && self.fitted {
            let first = recorded(&self.rest).next()?;
            let mut taken = self.taken();
            self.avoid(&first.candidate.q, AVOIDED, &mut taken);
            let others: Vec<Candidate> = recorded(&self.rest)
                .skip(1)
                .cloned()
                .map(|n| n.candidate)
                .collect();
            let before = self.information(&others)?;
            let question = Question {
                rows: &self.prepared.rows,
                before: &before,
                criterion: &self.prepared.criterion,
            };
            let best = *question.quick(1, &taken).first()?;
            self.offered = Some(Next {
                candidate: self.prepared.candidates[best].clone(),
                why: Why::Information,
                blocked: false,
            });
        }
        self.offered.as_ref()
    }

    /// Takes the offered posture in place of the first; whether there was one.
    pub fn instead(&mut self) -> bool {
        let Some(offered) = self.offer().cloned() else {
            return false;
        };
        let first = self.rest.iter().position(|n| n.why != Why::Detour);
        if let Some(place) = first {
            let out = std::mem::replace(&mut self.rest[place], offered);
            self.avoided.push(out.candidate.q);
            self.offered = None;
            self.route();
        }
        first.is_some()
    }

    /// Asks for the first at the end; whether there is another one before it.
    pub fn later(&mut self) -> bool {
        if recorded(&self.rest).nth(1).is_none() {
            return false;
        }
        if let Some(place) = self.rest.iter().position(|n| n.why != Why::Detour) {
            let first = self.rest.remove(place);
            self.rest.push(first);
        }
        self.offered = None;
        self.route();
        true
    }

    /// Candidates that are not to be chosen: postures of the list, and what is near to one that was avoided.
    fn taken(&self) -> Vec<usize> {
        let listed = self.held.iter().map(|h| &h.1).chain(&self.rest);
        let mut taken = Vec::new();
        for next in listed {
            self.avoid(&next.candidate.q, SAME, &mut taken);
        }
        for q in &self.avoided {
            self.avoid(q, AVOIDED, &mut taken);
        }
        taken
    }

    /// Adds the candidates that are nearer to a posture than this, all joint ranges being 1.
    fn avoid(&self, q: &[f64], far: f64, taken: &mut Vec<usize>) {
        let all = self.prepared.candidates.iter().enumerate();
        let near = all.filter(|(_, c)| self.prepared.joints.distance(&c.q, q) < far);
        taken.extend(near.map(|(i, _)| i));
        taken.sort_unstable();
        taken.dedup();
    }

    /// Equation (1) with all that was held and some postures of the rest, in the basis.
    fn information(&self, others: &[Candidate]) -> Option<DMatrix<f64>> {
        let held = self.held.iter().map(|h| h.0.clone());
        let all: Vec<Candidate> = held.chain(others.iter().cloned()).collect();
        let mut m = self.prepared.before.clone();
        for y in self.prepared.rows_of(&all).ok()? {
            m.gemm_tr(1.0, &y, &y, 1.0);
        }
        Some(m)
    }

    /// Chooses the postures by information again, beside what was held and the postures that are there for other reasons.
    pub(super) fn choose_again(&mut self) -> bool {
        let kept: Vec<Next> = recorded(&self.rest)
            .filter(|n| n.why != Why::Information)
            .cloned()
            .collect();
        let count = self.total.saturating_sub(self.held.len() + kept.len());
        let beside: Vec<Candidate> = kept.iter().map(|n| n.candidate.clone()).collect();
        let Some(before) = self.information(&beside) else {
            return false;
        };
        // What of the list is given up may be chosen again.
        self.rest = kept;
        let taken = self.taken();
        let prepared = &self.prepared;
        let question = Question {
            rows: &prepared.rows,
            before: &before,
            criterion: &prepared.criterion,
        };
        let chosen = question.quick(count, &taken).into_iter().map(|i| Next {
            candidate: prepared.candidates[i].clone(),
            why: Why::Information,
            blocked: false,
        });
        let (filling, pairs): (Vec<Next>, Vec<Next>) = self
            .rest
            .drain(..)
            .partition(|n| n.why == Why::SpaceFilling);
        let mut rest: Vec<Next> = chosen.chain(filling).collect();
        let candidates: Vec<Candidate> = rest.iter().map(|n| n.candidate.clone()).collect();
        let so_far = self.information(&[]);
        let rows = self.prepared.rows_of(&candidates);
        if let (Some(so_far), Ok(rows)) = (so_far, rows) {
            let first = BY_INFORMATION.saturating_sub(self.held.len());
            let order = in_order(
                &self.prepared,
                (&candidates, &rows),
                &so_far,
                (first, self.at.as_deref()),
            );
            rest = order.into_iter().map(|i| rest[i].clone()).collect();
        }
        rest.extend(pairs);
        self.rest = rest;
        self.chosen_after = self.held.len();
        self.offered = None;
        self.route();
        true
    }

    /// Puts postures on the way where a motion is blocked, from where the robot is.
    pub(super) fn route(&mut self) {
        let mut list: Vec<Listed> = Vec::new();
        if let Some(at) = &self.at {
            let candidate = Candidate {
                q: at.clone(),
                seen: Vec::new(),
            };
            list.push((candidate, Why::Detour, None));
        }
        let begin = list.len();
        list.extend(recorded(&self.rest).map(|n| (n.candidate.clone(), n.why, None)));
        let blocked = with_detours(&self.prepared, &mut list);
        let rest = list.into_iter().enumerate().skip(begin);
        self.rest = rest
            .map(|(place, (candidate, why, _))| Next {
                blocked: blocked.contains(&place),
                candidate,
                why,
            })
            .collect();
    }

    /// Says of each motion of the list whether it is free.
    pub(super) fn flag(&mut self) {
        let feasible = &self.prepared.feasible;
        for k in 1..self.rest.len() {
            let (before, next) = self.rest.split_at_mut(k);
            next[0].blocked = !feasible.clear(&before[k - 1].candidate.q, &next[0].candidate.q);
        }
    }
}
