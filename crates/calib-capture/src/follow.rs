//! Postures that are chosen while they are recorded: the session says what was held, a planner says what comes next.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Debug};

use calib_finding::{Unit, number};

use crate::Step;

/// A hold as it is in the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Held {
    /// Mean of each joint column over the hold, rad or m; without those of which no value arrived.
    pub joints: BTreeMap<String, f64>,
    /// Bodies and markers that were seen in at least half of it.
    pub seen: BTreeSet<String>,
}

/// What the postures so far tell, and what all of them will.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// σ of the task now, m; `None`: not determined yet.
    pub sigma: Option<f64>,
    /// σ expected when the list is done, m.
    pub expected: Option<f64>,
}

impl fmt::Display for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = |sigma: Option<f64>| {
            sigma.map_or_else(
                || "not determined".to_owned(),
                |s| number::plain(s, Unit::Meter),
            )
        };
        let (now, end) = (shown(self.sigma), shown(self.expected));
        write!(f, "σ of the tool: {now} now, {end} expected at the end")
    }
}

/// That the σ that was asked for, m, is reached.
pub fn asked_is_reached(asked: f64) -> String {
    format!(
        "The asked σ of {} is reached.",
        number::plain(asked, Unit::Meter)
    )
}

/// What follows from a hold.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// `None`: these postures determine nothing (they validate).
    pub progress: Option<Progress>,
    /// The σ that was asked for, m, where it is reached now.
    pub reached: Option<f64>,
    /// The postures still to come were chosen again.
    pub replanned: bool,
}

/// Knows which postures are still to come. The first of [`Planner::rest`] is the one that is asked for now.
pub trait Planner: Debug {
    /// Postures still to come.
    fn rest(&self) -> Vec<Step>;
    /// The first was held.
    fn held(&mut self, held: Held) -> Outcome;
    /// The first was only on the way, and was passed.
    fn passed(&mut self);
    /// The posture that was held last is out of the file again and comes first.
    fn forget(&mut self);
    /// The first is not recorded: it is hidden, or the robot cannot take it.
    fn skipped(&mut self);
    /// The posture that would tell most in place of the first; `None` where there is none.
    fn offer(&mut self) -> Option<Step>;
    /// Takes the offered posture in place of the first, or asks for the first later.
    fn instead(&mut self) -> Instead;
}

/// What came of the wish for another posture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instead {
    /// The offered one took the place of the first, which is not asked for again.
    Exchanged,
    /// The first is asked for at the end.
    Later,
    /// There is no other one.
    Nothing,
}
