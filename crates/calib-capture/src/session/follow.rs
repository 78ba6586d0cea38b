//! A session whose postures a planner chooses.

use std::collections::BTreeSet;

use super::Session;
use crate::{Held, Instead, Planner, Screen, TableError, asked_is_reached};

/// A body that is hidden for so long in a posture is not only passed by an arm, s.
const HIDDEN: f64 = 3.0;

impl<'a> Session<'a> {
    /// The postures are those of a planner: they replace those of the guide, and holds are counted on from the last one in the file.
    #[must_use]
    pub fn following(mut self, planner: Box<dyn Planner + 'a>) -> Self {
        self.planner = Some(planner);
        self.follow();
        self.phase = self.first_phase();
        self
    }

    /// Takes the postures that are still to come from the planner.
    pub(super) fn follow(&mut self) {
        if let Some(planner) = &self.planner {
            self.plan.guide.steps = planner.rest();
            (self.step, self.done) = (0, BTreeSet::new());
        }
    }

    /// Postures of the list: those in the file and those still to come.
    pub(super) fn listed(&self) -> usize {
        let steps = &self.plan.guide.steps;
        match self.planner {
            Some(_) => self.free as usize + steps.iter().filter(|s| !s.through).count(),
            None => steps.len(),
        }
    }

    /// The robot is at a posture that is only on the way.
    pub(super) fn pass(&mut self, screen: &mut dyn Screen) {
        self.before = self.step().map(|step| step.targets.clone());
        if let Some(planner) = &mut self.planner {
            planner.passed();
        }
        self.next(screen);
    }

    /// Tells the planner what was held, and the operator what follows from it.
    pub(super) fn planned_on(&mut self, held: Held, screen: &mut dyn Screen) {
        let Some(planner) = &mut self.planner else {
            return;
        };
        let outcome = planner.held(held);
        if let Some(progress) = outcome.progress {
            screen.line(&format!("  {progress}"));
        }
        if let Some(asked) = outcome.reached {
            self.reached = true;
            screen.line(&format!("  {}", asked_is_reached(asked)));
        } else if outcome.replanned {
            let left = planner.rest().iter().filter(|s| !s.through).count();
            screen.line(&format!(
                "  The {left} postures still to come were chosen again, from what was seen."
            ));
        }
    }

    /// Says once per posture that a body is hidden in it, and what to do.
    pub(super) fn say_hidden(&mut self, hidden: &[String], host: f64, screen: &mut dyn Screen) {
        if hidden.is_empty() || self.as_it_is {
            self.hidden_since = None;
            return;
        }
        let since = *self.hidden_since.get_or_insert(host);
        if self.planner.is_none() || self.said_hidden || host - since < HIDDEN {
            return;
        }
        self.said_hidden = true;
        let offered = self.planner.as_mut().and_then(|planner| planner.offer());
        let instead = offered.map_or_else(String::new, |step| {
            let at = self.plan.guide.shown(&step, &self.plan.columns);
            format!("n Enter = record the next best posture instead ({at}); ")
        });
        screen.line(&format!(
            "  {} is hidden in this posture. {instead}s Enter = skip it; k Enter = count it as it is.",
            hidden.join(", ")
        ));
    }

    /// Asks for the next best posture in place of this one.
    pub(super) fn instead(&mut self, screen: &mut dyn Screen) -> Result<(), TableError> {
        let first = self.plan.guide.steps.iter().find(|step| !step.through);
        let first = first.map(|step| step.targets.clone()).unwrap_or_default();
        let Some(planner) = &mut self.planner else {
            return Ok(());
        };
        let instead = planner.instead();
        match instead {
            Instead::Exchanged => screen.line("  Another posture takes the place of this one."),
            Instead::Later => screen.line("  This posture is asked for at the end."),
            Instead::Nothing => {
                screen.line("  There is no other posture to offer: s Enter skips this one.");
                return Ok(());
            }
        }
        self.give_up_hold()?;
        if instead == Instead::Exchanged {
            let joints = self.plan.guide.joints.iter().zip(first);
            let named = joints.map(|(&k, q)| (self.plan.columns[k].name.clone(), q));
            self.table.exchanged(&named.collect())?;
        }
        self.next(screen);
        Ok(())
    }

    /// What of a posture differs from the one before: `move a 1.0°, b 2.0°; c stays at 3.0°`.
    pub(super) fn motion(&self) -> String {
        let guide = &self.plan.guide;
        let Some(step) = self.step() else {
            return String::new();
        };
        let before = self.before.as_ref().filter(|_| self.planner.is_some());
        let stays = |k: &usize| {
            let targets = before.map(|b| (b.get(*k), step.targets.get(*k)));
            targets.is_some_and(|(a, b)| a.zip(b).is_some_and(|(a, b)| (a - b).abs() < SAME))
        };
        let (still, moving): (Vec<usize>, Vec<usize>) = (0..guide.joints.len()).partition(stays);
        if still.is_empty() || moving.is_empty() {
            return guide.shown(step, &self.plan.columns);
        }
        let shown = |places: &[usize]| guide.shown_of(step, places, &self.plan.columns);
        format!("{}; unchanged: {}", shown(&moving), shown(&still))
    }
}

/// Targets that differ by less are the same, rad or m.
const SAME: f64 = 1e-6;
