//! What is asked, and what follows from it alone: the columns of models, the members of groups, what parts save.

use std::collections::BTreeSet;

use crate::analysis::select::linear::{Linear, Linearization};
use crate::analysis::select::step::{
    Addition, Candidate, EQUAL, Saved, additions, evidence, saved,
};
use crate::analysis::select::{Part, SelectionRule};
use crate::analysis::settings::Settings;
use crate::graph::problem::Problem;

/// Parts that are exchanged at most.
pub(super) const EXCHANGES: usize = 4;

/// What is asked.
pub(super) struct Task<'a> {
    pub problem: &'a Problem,
    pub parts: &'a [Part],
    pub first: &'a BTreeSet<usize>,
    pub settings: &'a Settings,
    pub rule: &'a SelectionRule,
}

impl Task<'_> {
    /// Parameters that any of these parts frees.
    pub(super) fn parameters_of(&self, chosen: &BTreeSet<usize>) -> BTreeSet<usize> {
        let ids = chosen.iter().flat_map(|&part| &self.parts[part].parameters);
        ids.map(|id| id.index()).collect()
    }

    /// Every so many samples is left out.
    pub(super) fn step(&self) -> usize {
        let fitted = self.problem.samples - self.problem.held_out.len();
        fitted.div_ceil(self.rule.samples).max(1)
    }

    /// Columns of each part.
    pub(super) fn columns(&self, linear: &Linearization) -> Vec<Vec<usize>> {
        let of = |part: &Part| linear.columns(part.parameters.iter().map(|id| id.index()));
        self.parts.iter().map(of).collect()
    }

    /// Columns of a model: what no part frees, and what these do.
    pub(super) fn active(&self, linear: &Linearization, chosen: &BTreeSet<usize>) -> Vec<usize> {
        let every: BTreeSet<usize> = (0..self.parts.len()).collect();
        let of_parts = self.parameters_of(&every);
        let chosen = self.parameters_of(chosen);
        let all = 0..self.problem.parameters.len();
        linear.columns(all.filter(|p| chosen.contains(p) || !of_parts.contains(p)))
    }

    /// Parts of which a group consists; a part that is no group is its own only member.
    fn members(&self, part: usize) -> Vec<usize> {
        let own = |of: usize| self.parts[of].parameters.iter().collect::<BTreeSet<_>>();
        let whole = own(part);
        let inside = |p: &usize| *p != part && own(*p).is_subset(&whole);
        let members: Vec<usize> = (0..self.parts.len()).filter(inside).collect();
        match members.len() {
            0 | 1 => vec![part],
            _ => members,
        }
    }

    /// What the score test asks for, the best prediction first: single parts, or groups.
    pub(super) fn proposed<'c>(&self, found: &'c [Candidate], groups: bool) -> Vec<&'c Candidate> {
        let asked = found.iter().filter(|c| c.is_proposed(self.rule));
        asked
            .filter(|c| (self.members(c.part).len() > 1) == groups)
            .collect()
    }

    /// A model with one part more; of a group, the members that save half a standard error, and which these are.
    pub(super) fn with_part(
        &self,
        linearization: &Linearization,
        linear: &Linear<'_>,
        chosen: &BTreeSet<usize>,
        part: usize,
    ) -> (BTreeSet<usize>, Vec<usize>) {
        /// Of the standard error: chance alone reaches it in one of twenty.
        const SAVED: f64 = 0.5;
        let mut with = chosen.clone();
        let mut members: Vec<usize> = self.members(part);
        members.retain(|m| !chosen.contains(m));
        with.extend(&members);
        if members.len() < 2 {
            return (with, Vec::new());
        }
        loop {
            let kept = self.kept(linearization, linear, &with, &members);
            let idle = kept.iter().filter(|c| c.gain.0 <= SAVED * c.gain.1);
            let least = idle.min_by(|a, b| a.gain.0.total_cmp(&b.gain.0));
            let Some(least) = least.filter(|_| members.len() > 1) else {
                return (with, members);
            };
            with.remove(&least.part);
            members.retain(|m| *m != least.part);
        }
    }

    /// The joint that a part belongs to.
    fn joint(&self, part: usize) -> Option<&str> {
        let id = self.parts[part].parameters.first()?;
        self.problem.parameters[id.index()].joint.as_deref()
    }

    /// An added part that another one of its joint explains better now that the rest is known: (out, in).
    pub(super) fn exchange(
        &self,
        linearization: &Linearization,
        linear: &Linear<'_>,
        chosen: &BTreeSet<usize>,
    ) -> Option<(usize, usize)> {
        let columns = self.columns(linearization);
        let whole = linear.fit(self.active(linearization, chosen))?;
        let better = |&part: &usize| {
            let own = self.own(linearization, chosen, part).columns;
            let without = (!own.is_empty()).then(|| whole.without(&own))??;
            let mut possible = additions(&columns, &without.active);
            let joint = self.joint(part);
            possible.retain(|a| {
                a.part == part || (self.joint(a.part) == joint && self.members(a.part).len() == 1)
            });
            let found = evidence(&without, &possible);
            let own = found.iter().find(|(i, _)| possible[*i].part == part)?.1;
            let best = found.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
            let more = best.1 - own;
            (more > EQUAL).then_some((more, (part, possible[best.0].part)))
        };
        let added = chosen.difference(self.first);
        let found = added.filter_map(better);
        found.max_by(|a, b| a.0.total_cmp(&b.0)).map(|f| f.1)
    }

    /// The columns that a model has because of one part alone.
    fn own(
        &self,
        linearization: &Linearization,
        chosen: &BTreeSet<usize>,
        part: usize,
    ) -> Addition {
        let mut rest = chosen.clone();
        rest.remove(&part);
        let others = self.parameters_of(&rest);
        let own = self.parameters_of(&BTreeSet::from([part]));
        let columns = linearization.columns(own.into_iter().filter(|p| !others.contains(p)));
        Addition { part, columns }
    }

    /// What each of some parts of a model saves.
    pub(super) fn kept(
        &self,
        linearization: &Linearization,
        linear: &Linear<'_>,
        chosen: &BTreeSet<usize>,
        parts: &[usize],
    ) -> Vec<Saved> {
        let own = parts
            .iter()
            .map(|&part| self.own(linearization, chosen, part));
        let own: Vec<Addition> = own.filter(|own| !own.columns.is_empty()).collect();
        let fitted = linear.fit(self.active(linearization, chosen));
        fitted.map_or_else(Vec::new, |fitted| saved(&fitted, &own))
    }
}
