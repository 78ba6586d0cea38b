//! The choice on all samples.

use std::collections::BTreeSet;

use crate::analysis::select::exact::Fitted;
use crate::analysis::select::linear::Linearization;
use crate::analysis::select::nested::{left_out_rms, nested};
use crate::analysis::select::step::{Candidate, Stage, additions, candidates, simplest};
use crate::analysis::select::task::{EXCHANGES, Task};
use crate::analysis::select::{Selection, SelectionStep, StepOutcome};
use crate::graph::error::Error;
use crate::graph::problem::NoiseModel;

/// Parts, and then groups, that are fitted in full at each step: where the one that promises most predicts no better, the next may.
const TRIES: usize = 3;
/// Parts of the last step that are reported although nothing asks for them.
const REPORTED: usize = 5;

/// [`crate::select`].
pub(super) fn select(task: &Task<'_>, progress: &mut dyn FnMut(usize)) -> Result<Selection, Error> {
    let mut course = Course {
        task,
        chosen: task.first.clone(),
        steps: Vec::new(),
        tested: 0,
        refused: BTreeSet::new(),
        used: BTreeSet::new(),
        fits: 0,
        progress,
    };
    let first = course.fit(task.first, None)?;
    let first = task.renewed(task.first, &first)?.unwrap_or(first);
    let mut last: Option<Fitted> = None;
    for _ in 0..task.rule.steps {
        let current = last.as_ref().unwrap_or(&first);
        let linear = task.linearized(current)?;
        let Some(next) = course.forward(&linear, current)? else {
            break;
        };
        last = Some(match task.renewed(&course.chosen, &next)? {
            // Noise that predicts the poses worse is not taken.
            Some(renewed) if !renewed.against(&next).is_better() => renewed,
            _ => next,
        });
    }
    let mut linear = task.linearized(last.as_ref().unwrap_or(&first))?;
    for _ in 0..EXCHANGES {
        let current = last.as_ref().unwrap_or(&first);
        let Some(next) = course.exchange(&linear, current)? else {
            break;
        };
        linear = task.linearized(&next)?;
        last = Some(next);
    }
    while let Some(next) = course.backward(&linear, last.as_ref().unwrap_or(&first))? {
        linear = task.linearized(&next)?;
        last = Some(next);
    }
    let current = last.as_ref().unwrap_or(&first);
    Ok(Selection {
        unsupported: course.unsupported(&linear),
        nested: nested(task, &linear, &course.chosen),
        rms: first.against(current).rms,
        ranks: (first.rank(), current.rank()),
        values: current.trial.values.0.clone(),
        levels: match current.noise {
            NoiseModel::Joint => current.trial.theta.clone(),
            _ => Vec::new(),
        },
        parts: course.chosen,
        steps: course.steps,
        tested: course.tested,
    })
}

/// The choice so far.
struct Course<'a> {
    task: &'a Task<'a>,
    chosen: BTreeSet<usize>,
    steps: Vec<SelectionStep>,
    tested: usize,
    /// Parts that were fitted in full since the last addition and predict no better.
    refused: BTreeSet<usize>,
    /// Parts that were added once: what is left of a group is not tried again.
    used: BTreeSet<usize>,
    /// Models that were fitted in full.
    fits: usize,
    progress: &'a mut dyn FnMut(usize),
}

/// What was scored, the best prediction first, and how many parts could be tested.
type Scores = (Vec<Candidate>, usize);

/// Parts that were added in one linearization, not yet fitted in full.
struct Batch {
    chosen: BTreeSet<usize>,
    steps: Vec<SelectionStep>,
}

impl Course<'_> {
    fn added(&self) -> usize {
        self.chosen.difference(self.task.first).count()
    }

    fn fit(&mut self, chosen: &BTreeSet<usize>, near: Option<&Fitted>) -> Result<Fitted, Error> {
        let fitted = self.task.fitted(chosen, near)?;
        self.fits += 1;
        (self.progress)(self.fits);
        Ok(fitted)
    }

    /// The model with more parts; `None` where no part makes it better.
    fn forward(
        &mut self,
        linear: &Linearization,
        current: &Fitted,
    ) -> Result<Option<Fitted>, Error> {
        let (batch, found) = self.batch(linear)?;
        if batch.steps.len() > 1 {
            let next = self.fit(&batch.chosen, Some(current))?;
            if current.against(&next).is_better() {
                self.take(batch);
                return Ok(Some(next));
            }
        }
        let (next, found) = self.one_more(linear, current, Some(found))?;
        if next.is_some() {
            return Ok(next);
        }
        if let Some(with_rejected) = self.task.linearized_with_rejected(current)?
            && let (Some(next), _) = self.one_more(&with_rejected, current, None)?
        {
            return Ok(Some(next));
        }
        self.report_rest(&found, current.rms());
        Ok(None)
    }

    fn take(&mut self, batch: Batch) {
        self.chosen = batch.chosen;
        self.refused.clear();
        self.used.extend(batch.steps.iter().map(|s| s.part));
        self.steps.extend(batch.steps);
    }

    /// Parts that each predict better than without them, as long as the linearization holds: weights and outliers are those of
    /// a model whose errors are not much larger.
    fn batch(&self, linearization: &Linearization) -> Result<(Batch, Scores), Error> {
        /// Of the mean square at which it is linearized.
        const LEFT: f64 = 0.3;
        let task = self.task;
        let linear = linearization.all();
        let columns = task.columns(linearization);
        let mut batch = Batch {
            chosen: self.chosen.clone(),
            steps: Vec::new(),
        };
        let mut used = self.used.clone();
        let mut left = 1.0;
        let mut before = None;
        let mut first = None;
        while left > LEFT && batch.steps.len() < task.rule.steps {
            let active = task.active(linearization, &batch.chosen);
            let mut possible = additions(&columns, &active);
            possible.retain(|a| !used.contains(&a.part));
            let stage = Stage::after(self.added() + batch.steps.len(), task.rule);
            let found = candidates(&linear, &active, &possible, stage);
            let scores = found.ok_or(Error::NotEvaluable)?;
            let found = scores.0.clone();
            first.get_or_insert(scores);
            let mut proposed = task.proposed(&found, false);
            proposed.retain(|c| !self.refused.contains(&c.part) && c.predicts_better());
            let Some((part, alike)) = simplest(&linear, &active, &proposed, task.parts, task.rule)
            else {
                break;
            };
            let rms = |chosen: &BTreeSet<usize>| left_out_rms(task, linearization, &linear, chosen);
            let from = before.or_else(|| rms(&batch.chosen)).unwrap_or(0.0);
            batch.chosen.insert(part.part);
            used.insert(part.part);
            let to = rms(&batch.chosen).unwrap_or(from);
            before = Some(to);
            left *= 1.0 - part.gain.0;
            batch.steps.push(SelectionStep {
                rms: (from, to),
                alike,
                ..step_of(part, StepOutcome::Added)
            });
        }
        Ok((batch, first.unwrap_or_default()))
    }

    /// The model with one part more, or the members of one group; and all that was scored, where it is not `known`.
    fn one_more(
        &mut self,
        linear: &Linearization,
        current: &Fitted,
        known: Option<Scores>,
    ) -> Result<(Option<Fitted>, Vec<Candidate>), Error> {
        let task = self.task;
        let all = linear.all();
        let active = task.active(linear, &self.chosen);
        let (found, count) = match known {
            Some(known) => known,
            None => {
                let mut possible = additions(&task.columns(linear), &active);
                possible.retain(|a| !self.used.contains(&a.part));
                let stage = Stage::after(self.added(), task.rule);
                let found = candidates(&all, &active, &possible, stage);
                found.ok_or(Error::NotEvaluable)?
            }
        };
        self.tested = self.tested.max(count);
        for groups in [false, true] {
            for _ in 0..TRIES {
                // Only a fit in full rejects what it cannot explain: it decides, not the linearized prediction.
                let mut proposed = task.proposed(&found, groups);
                proposed.retain(|c| !self.refused.contains(&c.part));
                let Some((part, alike)) = simplest(&all, &active, &proposed, task.parts, task.rule)
                else {
                    break;
                };
                let (with, members) = task.with_part(linear, &all, &self.chosen, part.part);
                let next = self.fit(&with, Some(current))?;
                let compared = current.against(&next);
                let better = compared.is_better();
                let outcome = match better {
                    true => StepOutcome::Added,
                    false => StepOutcome::NoBetter,
                };
                let step = SelectionStep {
                    gain: compared.gain,
                    rms: compared.rms,
                    alike,
                    members,
                    ..step_of(part, outcome)
                };
                if better {
                    let steps = vec![step];
                    self.take(Batch {
                        chosen: with,
                        steps,
                    });
                    return Ok((Some(next), found));
                }
                self.steps.push(step);
                self.refused.insert(part.part);
            }
        }
        Ok((None, found))
    }

    /// What else was scored at the last step, the most significant first.
    fn report_rest(&mut self, found: &[Candidate], rms: f64) {
        let mut rest: Vec<&Candidate> = found
            .iter()
            .filter(|c| !self.refused.contains(&c.part))
            .collect();
        rest.sort_by(|a, b| {
            let p = a.tested.p_value.total_cmp(&b.tested.p_value);
            p.then(a.part.cmp(&b.part))
        });
        for candidate in rest.into_iter().take(REPORTED) {
            let outcome = match candidate.is_proposed(self.task.rule) {
                true => StepOutcome::NoBetter,
                false => StepOutcome::NotSignificant,
            };
            self.steps.push(SelectionStep {
                rms: (rms, rms),
                ..step_of(candidate, outcome)
            });
        }
    }

    /// The model with one part exchanged, where it predicts no worse.
    fn exchange(
        &mut self,
        linear: &Linearization,
        current: &Fitted,
    ) -> Result<Option<Fitted>, Error> {
        let found = self.task.exchange(linear, &linear.all(), &self.chosen);
        let Some((out, into)) = found else {
            return Ok(None);
        };
        let mut with = self.chosen.clone();
        with.remove(&out);
        with.insert(into);
        let next = self.fit(&with, Some(current))?;
        if next.against(current).is_better() {
            return Ok(None);
        }
        self.chosen = with;
        let compared = current.against(&next);
        let of_out = |s: &&mut SelectionStep| s.part == out || s.members.contains(&out);
        if let Some(step) = self.steps.iter_mut().find(of_out) {
            step.exchanged.push((out, into));
            step.rms.1 = compared.rms.1;
        }
        Ok(Some(next))
    }

    /// The model without the added part that it needs least, where it predicts as well.
    fn backward(
        &mut self,
        linear: &Linearization,
        current: &Fitted,
    ) -> Result<Option<Fitted>, Error> {
        let added: Vec<usize> = self.chosen.difference(self.task.first).copied().collect();
        if added.len() < 2 {
            return Ok(None);
        }
        let kept = self.task.kept(linear, &linear.all(), &self.chosen, &added);
        let least = kept
            .into_iter()
            .filter(|c| !c.predicts_better())
            .min_by(|a, b| a.gain.0.total_cmp(&b.gain.0));
        let Some(least) = least else {
            return Ok(None);
        };
        self.chosen.remove(&least.part);
        let chosen = self.chosen.clone();
        let next = self.fit(&chosen, Some(current))?;
        if next.against(current).is_better() {
            self.chosen.insert(least.part);
            return Ok(None);
        }
        for step in &mut self.steps {
            step.members.retain(|m| *m != least.part);
            let own = |e: &(usize, usize)| e.1 == least.part;
            let is_part = step.part == least.part && step.exchanged.is_empty();
            if (is_part || step.exchanged.iter().any(own)) && step.outcome == StepOutcome::Added {
                step.outcome = StepOutcome::Removed;
            }
        }
        Ok(Some(next))
    }

    /// Parts of the first model that its predictions do not need.
    fn unsupported(&self, linear: &Linearization) -> Vec<usize> {
        let first: Vec<usize> = self.task.first.iter().copied().collect();
        let kept = self.task.kept(linear, &linear.all(), &self.chosen, &first);
        let kept = kept.into_iter();
        kept.filter(|c| !c.predicts_better())
            .map(|c| c.part)
            .collect()
    }
}

fn step_of(candidate: &Candidate, outcome: StepOutcome) -> SelectionStep {
    let (gain, error) = candidate.gain;
    SelectionStep {
        part: candidate.part,
        parameters: candidate.columns.len(),
        rank: candidate.tested.rank,
        z2: candidate.tested.z2,
        p_corrected: candidate.p_corrected,
        rms: (0.0, 0.0),
        gain: (gain, error),
        alike: Vec::new(),
        members: Vec::new(),
        exchanged: Vec::new(),
        outcome,
    }
}
