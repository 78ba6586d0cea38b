//! A recording being made: which pose is next, whether it is held, which rows are written.

mod ended;
mod follow;
mod hold;
mod keys;
mod plan;
mod record;
mod rows;
mod summary;
mod waits;

pub use ended::{CaptureError, Ended, Key};
pub use plan::{Moved, Plan, Watched, WatchedKind};
pub use summary::Summary;

use std::collections::BTreeSet;

use crate::table::Mark;
use crate::{
    Arrival, Frame, JointListener, JointSource, Order, Planner, Screen, Step, StillSettings,
    Stillness, Table, TableError, Unit,
};
use hold::Hold;
use waits::Waits;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// The robot is moving to the pose.
    Going,
    /// It has arrived; wait until it is still.
    Settling,
    /// Rows have been taken since this time, s.
    Holding(f64),
    /// A free pose was held; wait until the robot moves.
    Leaving,
    /// Nothing is held: every frame is a row.
    Continuous,
}

/// Visibility of one body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sight {
    frames: u64,
    lost: u64,
    lost_since: Option<f64>,
}

/// The pose that was held last, and where the file ended before it.
#[derive(Clone, Copy, Debug)]
struct Last {
    step: usize,
    hold: u64,
    before: Mark,
}

/// A recording being made.
#[derive(Debug)]
pub struct Session<'a> {
    plan: Plan,
    /// Decides which poses are still to come, where it is not the guide.
    planner: Option<Box<dyn Planner + 'a>>,
    table: Table,
    order: Order,
    still: Stillness,
    phase: Phase,
    step: usize,
    /// Requested poses that are in the file, counted from 0.
    done: BTreeSet<usize>,
    /// Poses of one's own choice in the file.
    free: u64,
    /// This pose counts with what is seen of it: the operator said so.
    as_it_is: bool,
    hold: Hold,
    last: Option<Last>,
    waits: Option<Waits>,
    sights: Vec<Sight>,
    covered: Vec<Option<(f64, f64)>>,
    held: usize,
    foreign: u64,
    unlabeled: bool,
    last_host: Option<f64>,
    rate: Option<f64>,
    restarted: bool,
    too_old: u64,
    /// Targets of the pose that was held or passed last.
    before: Option<Vec<f64>>,
    /// How often the hold of this pose started over.
    started_over: usize,
    /// Since when a body is hidden in this pose, s, and whether that was said.
    hidden_since: Option<f64>,
    said_hidden: bool,
    /// What was asked of a planned recording is reached.
    reached: bool,
}

impl Session<'_> {
    /// A session that writes to `table`; poses that the table already holds are not requested again.
    pub fn new(plan: Plan, table: Table) -> Self {
        let numbers: BTreeSet<u64> = table.held.iter().filter_map(|h| h.parse().ok()).collect();
        let place = |number: &u64| usize::try_from(number.checked_sub(1)?).ok();
        let sights = vec![Sight::default(); plan.watched.len()];
        let covered = vec![None; plan.columns.len()];
        let mut session = Session {
            done: numbers.iter().filter_map(place).collect(),
            free: numbers.last().copied().unwrap_or(0),
            phase: Phase::Settling,
            plan,
            planner: None,
            table,
            order: Order::default(),
            still: Stillness::new(StillSettings::default()),
            step: 0,
            as_it_is: false,
            hold: Hold::default(),
            last: None,
            waits: None,
            sights,
            covered,
            held: 0,
            foreign: 0,
            unlabeled: false,
            last_host: None,
            rate: None,
            restarted: false,
            too_old: 0,
            before: None,
            started_over: 0,
            hidden_since: None,
            said_hidden: false,
            reached: false,
        };
        session.step = session.next_missing(0);
        session.phase = session.first_phase();
        session
    }

    fn is_guided(&self) -> bool {
        self.planner.is_some() || !self.plan.guide.steps.is_empty()
    }

    fn first_phase(&self) -> Phase {
        match (self.plan.continuous, self.is_guided()) {
            (true, _) => Phase::Continuous,
            (false, true) => Phase::Going,
            (false, false) => Phase::Settling,
        }
    }

    /// The first requested pose from here on that the file does not have.
    fn next_missing(&self, from: usize) -> usize {
        let steps = self.plan.guide.steps.len();
        (from..steps)
            .find(|s| !self.done.contains(s))
            .unwrap_or(steps)
    }

    /// Requested poses of the guide that the file does not have, counted from 1.
    pub fn missing(&self) -> Vec<usize> {
        if self.planner.is_some() {
            return Vec::new();
        }
        let steps = 0..self.plan.guide.steps.len();
        steps
            .filter(|s| !self.done.contains(s))
            .map(|s| s + 1)
            .collect()
    }

    /// Number of the hold that comes next.
    fn number(&self) -> u64 {
        if self.is_guided() && self.planner.is_none() {
            self.step as u64 + 1
        } else {
            self.free + 1
        }
    }

    /// The requested pose.
    pub fn step(&self) -> Option<&Step> {
        self.plan.guide.steps.get(self.step)
    }

    /// Whether all poses were held.
    pub fn is_finished(&self) -> bool {
        self.is_guided() && (self.reached || self.step >= self.plan.guide.steps.len())
    }

    /// A datagram or report that could not be used.
    pub fn foreign(&mut self, why: &str, screen: &mut dyn Screen) {
        self.foreign += 1;
        if self.foreign == 1 {
            screen.line(&format!("ignored: {why} (further ones are only counted)"));
        }
    }

    /// What was recorded of a hold that did not become one: nothing is written of it, but where all motion is.
    fn give_up_hold(&mut self) -> Result<(), TableError> {
        let hold = std::mem::take(&mut self.hold);
        if self.plan.all {
            let now = self.last_host.unwrap_or(0.0);
            for row in hold.rows {
                self.table.row(&row.text(None), now)?;
            }
        }
        Ok(())
    }

    fn next(&mut self, screen: &mut dyn Screen) {
        (self.as_it_is, self.started_over) = (false, 0);
        (self.hidden_since, self.said_hidden) = (None, false);
        self.phase = if self.planner.is_some() {
            self.follow();
            Phase::Going
        } else if self.is_guided() {
            self.step = self.next_missing(self.step + 1);
            Phase::Going
        } else {
            Phase::Leaving
        };
        if !self.reached {
            self.announce(screen);
        }
    }

    /// Value of a column now, rad or m.
    fn joint(&self, column: usize, host: f64, listener: Option<&JointListener>) -> Option<f64> {
        let joint = &self.plan.columns[column];
        if joint.fixed.is_some() {
            return joint.fixed;
        }
        match self.plan.joints {
            JointSource::Udp(_) => listener?.value(&joint.name, host),
            // The target is the position only while the pose is held.
            JointSource::Targets if matches!(self.phase, Phase::Holding(_)) => {
                let guided = self.plan.guide.joints.iter().position(|&j| j == column)?;
                self.step()?.targets.get(guided).copied()
            }
            JointSource::Targets => None,
        }
    }

    /// Whether all guided joints are at their targets, as measured.
    fn is_there(&self, host: f64, listener: Option<&JointListener>) -> bool {
        let Some(step) = self.step() else {
            return self.plan.guide.steps.is_empty();
        };
        let guided = self.plan.guide.joints.iter().zip(&step.targets);
        matches!(self.plan.joints, JointSource::Udp(_))
            && guided.into_iter().all(|(&column, target)| {
                self.joint(column, host, listener)
                    .is_some_and(|q| (q - target).abs() <= self.near(column))
            })
    }

    /// How near the joint of a column must come to its target, rad or m.
    fn near(&self, column: usize) -> f64 {
        let (angle, length) = self.plan.near;
        match self.plan.columns[column].unit {
            Unit::Angle => angle,
            Unit::Length => length,
        }
    }

    /// Processes a frame that arrived at this time of this computer, s.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn frame(
        &mut self,
        frame: &Frame,
        host: f64,
        listener: Option<&JointListener>,
        screen: &mut dyn Screen,
    ) -> Result<(), TableError> {
        let device = match self.order.arrives(frame) {
            Arrival::InOrder { device } => device,
            Arrival::Late => return Ok(()),
            Arrival::Restarted => {
                self.restarted = true;
                return Ok(());
            }
        };
        if let Some(last) = self.last_host.replace(host)
            && host > last
        {
            let now = 1.0 / (host - last);
            self.rate = Some(self.rate.map_or(now, |rate| rate + 0.05 * (now - rate)));
        }
        let t = device.unwrap_or(host);
        if self.table.last_time.is_some_and(|last| t < last) {
            // The continued file has later times than the tracker's clock now.
            self.too_old += 1;
            self.restarted = true;
            return Ok(());
        }
        let recorded = usize::from(self.plan.watched.iter().any(|w| w.from == "marker"));
        if frame.unlabeled > recorded && !std::mem::replace(&mut self.unlabeled, true) {
            screen.line(
                "Markers that belong to no body are not recorded, because their numbers change. Define bodies in the tracker, or leave one such marker in view: --map NAME=marker.",
            );
        }
        self.see(frame, host);
        let names: Vec<&str> = self.plan.watched.iter().map(|w| w.from.as_str()).collect();
        let quiet = self.still.sees(t, frame, &names);
        self.advance(quiet, frame, (host, listener), screen)?;
        match self.phase {
            Phase::Holding(since) => {
                let row = self.row(frame, t, host, listener);
                let at = 0..self.plan.columns.len();
                let joints: Vec<_> = at.map(|c| self.joint(c, host, listener)).collect();
                self.hold.take(&self.plan, frame, &joints, row);
                let moving = self.hold.moving(&self.plan);
                let moving = moving.map(|(joint, far)| (joint.name.clone(), joint.unit.shown(far)));
                if let Some((joint, far)) = moving {
                    let why = format!("  {joint} moved by {far}: the hold starts over.");
                    self.starts_over(&why, screen);
                    self.give_up_hold()?;
                    self.phase = Phase::Settling;
                } else if host - since >= self.plan.hold {
                    self.end_hold(host - since, host, screen)?;
                }
            }
            Phase::Continuous => {
                let row = self.row(frame, t, host, listener);
                self.table.row(&row.text(None), host)?;
            }
            _ if self.plan.all => {
                let row = self.row(frame, t, host, listener);
                self.table.row(&row.text(None), host)?;
            }
            _ => {}
        }
        Ok(())
    }

    /// A pose was held for as long as asked: it counts where the swept bodies were seen.
    fn end_hold(
        &mut self,
        lasted: f64,
        host: f64,
        screen: &mut dyn Screen,
    ) -> Result<(), TableError> {
        let lost = self.hold.lost(&self.plan, self.unseen());
        if !lost.is_empty() && !self.as_it_is {
            let names: Vec<&str> = lost.iter().map(|moved| moved.name.as_str()).collect();
            let why = format!(
                "  {} was lost: the hold is repeated when it is seen (k Enter = count the pose as it is, s Enter = skip it).",
                names.join(", ")
            );
            self.starts_over(&why, screen);
            self.phase = Phase::Settling;
            return self.give_up_hold();
        }
        self.report_pose(lasted, screen);
        let number = self.number();
        let before = self.table.mark()?;
        let held = self.hold.held(&self.plan);
        for row in std::mem::take(&mut self.hold).rows {
            self.table.row(&row.text(Some(number)), host)?;
        }
        self.table.flush()?;
        self.last = Some(Last {
            step: self.step,
            hold: number,
            before,
        });
        self.held += 1;
        self.before = self.step().map(|step| step.targets.clone());
        if self.is_guided() && self.planner.is_none() {
            self.done.insert(self.step);
        } else {
            self.free = number;
        }
        self.planned_on(held, screen);
        self.next(screen);
        Ok(())
    }

    fn see(&mut self, frame: &Frame, host: f64) {
        for (watched, sight) in self.plan.watched.iter().zip(&mut self.sights) {
            let seen = watched.is_in(frame);
            sight.frames += 1;
            sight.lost += u64::from(!seen);
            sight.lost_since = match (seen, sight.lost_since) {
                (true, _) => None,
                (false, since) => since.or(Some(host)),
            };
        }
    }

    /// Moved bodies that need not be seen in the requested pose.
    fn unseen(&self) -> &[usize] {
        self.step().map_or(&[], |step| &step.unseen)
    }

    /// Moved bodies that are hidden in this frame and should not be.
    fn hidden(&self, frame: &Frame) -> Vec<String> {
        let unseen = self.unseen();
        let moved = self.plan.moved.iter().enumerate();
        moved
            .filter(|(place, moved)| !unseen.contains(place) && !moved.is_in(&self.plan, frame))
            .map(|(_, moved)| moved.name.clone())
            .collect()
    }

    fn advance(
        &mut self,
        quiet: Option<f64>,
        frame: &Frame,
        (host, listener): (f64, Option<&JointListener>),
        screen: &mut dyn Screen,
    ) -> Result<(), TableError> {
        if self.is_finished() || self.phase == Phase::Continuous {
            return Ok(());
        }
        match self.phase {
            Phase::Going if self.is_there(host, listener) && self.is_passing() => {
                self.pass(screen);
            }
            Phase::Going if self.is_there(host, listener) => self.phase = Phase::Settling,
            Phase::Leaving if quiet.is_none() => self.phase = Phase::Settling,
            _ => {}
        }
        let measured = matches!(self.plan.joints, JointSource::Udp(_));
        let hidden = self.hidden(frame);
        if self.phase == Phase::Settling {
            self.say_hidden(&hidden, host, screen);
        }
        match (self.phase, quiet) {
            // The measured joints have left the target: the robot was only passing.
            (Phase::Holding(_) | Phase::Settling, _)
                if measured && self.step().is_some() && !self.is_there(host, listener) =>
            {
                self.give_up_hold()?;
                self.phase = Phase::Going;
            }
            (Phase::Settling, Some(_)) if hidden.is_empty() || self.as_it_is => {
                self.phase = Phase::Holding(host);
            }
            (Phase::Holding(_), None) => {
                self.starts_over("  The robot moved: the hold starts over.", screen);
                self.give_up_hold()?;
                self.phase = Phase::Settling;
            }
            _ => {}
        }
        self.waits = self.waiting(quiet, hidden, host, listener);
        Ok(())
    }
}
