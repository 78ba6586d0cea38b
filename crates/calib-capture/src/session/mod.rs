//! A recording being made: which pose is next, whether it is held, which rows are written.

mod ended;
mod plan;
mod record;
mod rows;
mod summary;

pub use ended::{CaptureError, Ended, Key};
pub use plan::{Plan, Watched, WatchedKind};
pub use summary::Summary;

use crate::{
    Arrival, Frame, JointListener, JointSource, Order, Screen, Step, StillSettings, Stillness,
    Table, TableError, Unit,
};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// The robot is moving to the pose.
    Going,
    /// It has arrived; wait until it is still.
    Settling,
    /// Rows have been written since this time, s.
    Holding(f64),
    /// A free pose was held; wait until the robot moves.
    Leaving,
}

/// Visibility of one body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sight {
    frames: u64,
    lost: u64,
    lost_since: Option<f64>,
    /// In this pose.
    pose_frames: u64,
    pose_lost: u64,
}

/// A recording being made.
#[derive(Debug)]
pub struct Session {
    plan: Plan,
    table: Table,
    order: Order,
    still: Stillness,
    phase: Phase,
    step: usize,
    next_hold: u64,
    sights: Vec<Sight>,
    covered: Vec<Option<(f64, f64)>>,
    held: usize,
    rows_of_pose: u64,
    foreign: u64,
    unlabeled: bool,
    last_host: Option<f64>,
    rate: Option<f64>,
    restarted: bool,
    too_old: u64,
}

impl Session {
    /// A session that writes to `table`; poses that the table already holds are not requested again.
    pub fn new(plan: Plan, table: Table) -> Self {
        let done: Vec<u64> = table.held.iter().filter_map(|h| h.parse().ok()).collect();
        let last = done.iter().copied().max().unwrap_or(0);
        let sights = vec![Sight::default(); plan.watched.len()];
        let covered = vec![None; plan.columns.len()];
        let step = if plan.guide.steps.is_empty() {
            0
        } else {
            usize::try_from(last).unwrap_or(usize::MAX)
        };
        let phase = if plan.guide.steps.is_empty() {
            Phase::Settling
        } else {
            Phase::Going
        };
        Session {
            plan,
            table,
            order: Order::default(),
            still: Stillness::new(StillSettings::default()),
            phase,
            step,
            next_hold: last + 1,
            sights,
            covered,
            held: 0,
            rows_of_pose: 0,
            foreign: 0,
            unlabeled: false,
            last_host: None,
            rate: None,
            restarted: false,
            too_old: 0,
        }
    }

    /// The requested pose.
    pub fn step(&self) -> Option<&Step> {
        self.plan.guide.steps.get(self.step)
    }

    /// Whether all poses were held.
    pub fn is_finished(&self) -> bool {
        !self.plan.guide.steps.is_empty() && self.step >= self.plan.guide.steps.len()
    }

    /// Announces the next pose.
    pub fn announce(&self, screen: &mut dyn Screen) {
        let guide = &self.plan.guide;
        if let Some(step) = self.step() {
            let how = match self.plan.joints {
                JointSource::Targets => "move there, then press Enter",
                JointSource::Udp(_) => "move there and hold still",
            };
            screen.line(&format!(
                "pose {}/{}: {}; {how}",
                self.step + 1,
                guide.steps.len(),
                guide.shown(step, &self.plan.columns)
            ));
        } else if guide.steps.is_empty() && self.held == 0 {
            screen.line(&format!(
                "Free poses: hold each pose for {:.1} s.",
                self.plan.hold
            ));
        }
    }

    /// A datagram or report that could not be used.
    pub fn foreign(&mut self, why: &str, screen: &mut dyn Screen) {
        self.foreign += 1;
        if self.foreign == 1 {
            screen.line(&format!("ignored: {why} (further ones are only counted)"));
        }
    }

    /// Handles the operator's input.
    pub fn key(&mut self, key: Key, screen: &mut dyn Screen) {
        match (key, self.phase) {
            (Key::There, Phase::Going) => self.phase = Phase::Settling,
            (Key::Skip, _) if !self.plan.guide.steps.is_empty() => {
                screen.line("  skipped");
                self.next(screen);
            }
            _ => {}
        }
    }

    fn next(&mut self, screen: &mut dyn Screen) {
        self.step += 1;
        self.next_hold += 1;
        self.rows_of_pose = 0;
        for sight in &mut self.sights {
            (sight.pose_frames, sight.pose_lost) = (0, 0);
        }
        self.phase = if self.plan.guide.steps.is_empty() {
            Phase::Leaving
        } else {
            Phase::Going
        };
        self.announce(screen);
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
        let (angle, length) = self.plan.near;
        let guided = self.plan.guide.joints.iter().zip(&step.targets);
        matches!(self.plan.joints, JointSource::Udp(_))
            && guided.into_iter().all(|(&column, target)| {
                let near = match self.plan.columns[column].unit {
                    Unit::Angle => angle,
                    Unit::Length => length,
                };
                self.joint(column, host, listener)
                    .is_some_and(|q| (q - target).abs() <= near)
            })
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
        if frame.unlabeled > 0 && !std::mem::replace(&mut self.unlabeled, true) {
            screen.line(
                "Markers that belong to no body are not recorded, because their numbers change. Define bodies in the tracker.",
            );
        }
        self.see(frame, host);
        let names: Vec<&str> = self.plan.watched.iter().map(|w| w.from.as_str()).collect();
        let quiet = self.still.sees(t, frame, &names);
        self.advance(quiet, host, listener, screen);
        let holding = matches!(self.phase, Phase::Holding(_));
        if holding || self.plan.all {
            let row = self.row(frame, t, host, holding, listener);
            self.table.row(&row, host)?;
        }
        if holding {
            self.rows_of_pose += 1;
        }
        if let Phase::Holding(since) = self.phase
            && host - since >= self.plan.hold
        {
            self.report_pose(host - since, screen);
            self.held += 1;
            self.next(screen);
        }
        Ok(())
    }

    fn see(&mut self, frame: &Frame, host: f64) {
        let holding = matches!(self.phase, Phase::Holding(_));
        for (watched, sight) in self.plan.watched.iter().zip(&mut self.sights) {
            let seen = match watched.kind {
                WatchedKind::Body => frame.bodies.contains_key(&watched.from),
                WatchedKind::Marker => frame.point(&watched.from).is_some(),
            };
            sight.frames += 1;
            sight.lost += u64::from(!seen);
            sight.lost_since = match (seen, sight.lost_since) {
                (true, _) => None,
                (false, since) => since.or(Some(host)),
            };
            if holding {
                sight.pose_frames += 1;
                sight.pose_lost += u64::from(!seen);
            }
        }
    }

    fn advance(
        &mut self,
        quiet: Option<f64>,
        host: f64,
        listener: Option<&JointListener>,
        screen: &mut dyn Screen,
    ) {
        if self.is_finished() {
            return;
        }
        match self.phase {
            Phase::Going if self.is_there(host, listener) => self.phase = Phase::Settling,
            Phase::Leaving if quiet.is_none() => self.phase = Phase::Settling,
            _ => {}
        }
        let measured = matches!(self.plan.joints, JointSource::Udp(_));
        match (self.phase, quiet) {
            (Phase::Settling, Some(_)) => self.phase = Phase::Holding(host),
            (Phase::Holding(_), None) => {
                screen.line("  The robot moved: the hold starts over.");
                self.phase = Phase::Settling;
            }
            // The measured joints have left the target: the robot was only passing.
            (Phase::Holding(_) | Phase::Settling, _)
                if measured && self.step().is_some() && !self.is_there(host, listener) =>
            {
                self.phase = Phase::Going;
            }
            _ => {}
        }
    }
}
