//! A recording being made: which pose is next, whether it is held, which rows are written.

use crate::guide::shown_range;
use crate::{
    Arrival, Frame, Guide, Input, JointColumn, JointListener, JointSource, Order, Screen, Source,
    SourceError, Step, StillSettings, Stillness, Table, TableError, Unit,
};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

/// Body or marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WatchedKind {
    /// Position and rotation.
    Body,
    /// Position only.
    Marker,
}

/// A body or marker that gets columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Watched {
    /// Its name in the profile, and in the file.
    pub name: String,
    /// The tracker's name for it.
    pub from: String,
    /// What is written of it.
    pub kind: WatchedKind,
}

/// What is recorded, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Joint columns.
    pub columns: Vec<JointColumn>,
    /// Where their values come from.
    pub joints: JointSource,
    /// The poses asked for.
    pub guide: Guide,
    /// Bodies and markers.
    pub watched: Vec<Watched>,
    /// How long a pose is recorded, s.
    pub hold: f64,
    /// How near a measured joint must be to its target, rad or m.
    pub near: (f64, f64),
    /// Rows also while the robot moves.
    pub all: bool,
    /// Give up when nothing comes for this long, s.
    pub patience: f64,
    /// End after this long, s.
    pub longest: Option<f64>,
}

impl Plan {
    /// The file's header line.
    pub fn header(&self) -> String {
        let mut header = String::from("frame,t_s,host_s,hold");
        for column in &self.columns {
            let _ = write!(header, ",{}", column.header());
        }
        for watched in &self.watched {
            let parts: &[&str] = match watched.kind {
                WatchedKind::Body => &["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"],
                WatchedKind::Marker => &["x_m", "y_m", "z_m"],
            };
            for part in parts {
                let _ = write!(header, ",{}.{part}", watched.name);
            }
        }
        header
    }
}

/// What the person says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// The robot is at the pose.
    There,
    /// Leave this pose out.
    Skip,
    /// End the recording.
    Quit,
}

/// Why a recording ended. All that was recorded is in the file in every case.
#[derive(Clone, Debug, PartialEq)]
pub enum Ended {
    /// All poses were held.
    Finished,
    /// The person ended it.
    Quit,
    /// The time was over.
    TimeIsOver,
    /// Nothing came from the tracker for so long, s.
    Silent(f64),
    /// The tracker ended the connection.
    Closed,
    /// The tracker's counter or clock went back.
    Restarted,
    /// Poses wait to be confirmed, and standard input has ended.
    NobodyThere,
}

impl Ended {
    /// Whether it ended as wanted.
    pub fn is_good(&self) -> bool {
        matches!(self, Ended::Finished | Ended::Quit | Ended::TimeIsOver)
    }
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Ended::Finished => f.write_str("all poses recorded"),
            Ended::Quit => f.write_str("ended by you"),
            Ended::TimeIsOver => f.write_str("the time is over"),
            Ended::Silent(s) => write!(
                f,
                "nothing came from the tracker for {s:.0} s: is it measuring, does it send to this computer and port, is a firewall in the way?"
            ),
            Ended::Closed => f.write_str("the tracker's server ended the connection"),
            Ended::Restarted => f.write_str(
                "the tracker's counter or clock went back: it was restarted; go on in a new file",
            ),
            Ended::NobodyThere => f.write_str(
                "standard input has ended, so nobody can say that the robot is at the pose; let the robot send its joints (--joints udp:PORT)",
            ),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// The robot is on its way.
    Going,
    /// It should be there; wait until it is still.
    Settling,
    /// Rows are written since this time, s.
    Holding(f64),
    /// A free pose was held; wait until the robot moves on.
    Leaving,
}

/// What was seen of one body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sight {
    frames: u64,
    lost: u64,
    lost_since: Option<f64>,
    /// In this pose.
    pose_frames: u64,
    pose_lost: u64,
}

/// Figures of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Rows in the file.
    pub rows: u64,
    /// Poses held.
    pub poses: usize,
    /// Frames taken, never arrived, dropped because late.
    pub frames: (u64, u64, u64),
    /// Datagrams or reports that are not ours or cannot be read.
    pub foreign: u64,
    /// By body: share of the frames in which it was lost.
    pub lost: BTreeMap<String, f64>,
    /// By guided joint: lowest and highest value recorded, rad or m.
    pub covered: BTreeMap<String, (f64, f64)>,
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
    unlabelled: bool,
    last_host: Option<f64>,
    rate: Option<f64>,
    restarted: bool,
    too_old: u64,
}

impl Session {
    /// Begins; with a file that is gone on with, the poses that it has are left out.
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
            unlabelled: false,
            last_host: None,
            rate: None,
            restarted: false,
            too_old: 0,
        }
    }

    /// The pose that is asked for.
    pub fn step(&self) -> Option<&Step> {
        self.plan.guide.steps.get(self.step)
    }

    /// Whether all poses were held.
    pub fn is_finished(&self) -> bool {
        !self.plan.guide.steps.is_empty() && self.step >= self.plan.guide.steps.len()
    }

    /// Says what comes next.
    pub fn announce(&self, screen: &mut dyn Screen) {
        let guide = &self.plan.guide;
        if let Some(step) = self.step() {
            let how = match self.plan.joints {
                JointSource::Targets => "go there, then press Enter",
                JointSource::Udp(_) => "go there and hold",
            };
            screen.line(&format!(
                "pose {}/{}: {}; {how}",
                self.step + 1,
                guide.steps.len(),
                guide.shown(step, &self.plan.columns)
            ));
        } else if guide.steps.is_empty() && self.held == 0 {
            screen.line(&format!(
                "poses of your choice: hold each for {:.1} s",
                self.plan.hold
            ));
        }
    }

    /// A datagram or report that could not be used.
    pub fn foreign(&mut self, why: &str, screen: &mut dyn Screen) {
        self.foreign += 1;
        if self.foreign == 1 {
            screen.line(&format!("not used: {why} (further ones are only counted)"));
        }
    }

    /// What the person said.
    pub fn key(&mut self, key: Key, screen: &mut dyn Screen) {
        match (key, self.phase) {
            (Key::There, Phase::Going) => self.phase = Phase::Settling,
            (Key::Skip, _) if !self.plan.guide.steps.is_empty() => {
                screen.line("  left out");
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
            // The target is where the robot is only while the pose is held.
            JointSource::Targets if matches!(self.phase, Phase::Holding(_)) => {
                let guided = self.plan.guide.joints.iter().position(|&j| j == column)?;
                self.step()?.targets.get(guided).copied()
            }
            JointSource::Targets => None,
        }
    }

    /// Whether all guided joints are measured at their targets.
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

    /// Takes a frame that arrived at this time of this computer, s.
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
            // The file that is gone on with has later times than the tracker's clock now.
            self.too_old += 1;
            self.restarted = true;
            return Ok(());
        }
        if frame.unlabelled > 0 && !std::mem::replace(&mut self.unlabelled, true) {
            screen.line(
                "markers without a body are not recorded: their numbers change; make bodies of them",
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
                screen.line("  it moved: hold again");
                self.phase = Phase::Settling;
            }
            // Measured joints that have left the target: the robot was only passing.
            (Phase::Holding(_) | Phase::Settling, _)
                if measured && self.step().is_some() && !self.is_there(host, listener) =>
            {
                self.phase = Phase::Going;
            }
            _ => {}
        }
    }

    fn row(
        &mut self,
        frame: &Frame,
        t: f64,
        host: f64,
        holding: bool,
        listener: Option<&JointListener>,
    ) -> String {
        let mut row = String::new();
        let number = frame.number.unwrap_or(self.order.taken);
        let _ = write!(row, "{number},{t:.6},{host:.6},");
        if holding {
            let _ = write!(row, "{}", self.next_hold);
        }
        for column in 0..self.plan.columns.len() {
            row.push(',');
            if let Some(q) = self.joint(column, host, listener) {
                let _ = write!(row, "{:.6}", self.plan.columns[column].written(q));
                let (low, high) = self.covered[column].unwrap_or((q, q));
                self.covered[column] = Some((low.min(q), high.max(q)));
            }
        }
        for watched in &self.plan.watched {
            match watched.kind {
                WatchedKind::Body => match frame.bodies.get(&watched.from) {
                    Some(pose) => {
                        let p = pose.translation.vector;
                        let q = pose.rotation.coords;
                        let q = if q[3] < 0.0 { -q } else { q };
                        let _ = write!(
                            row,
                            ",{:.7},{:.7},{:.7},{:.9},{:.9},{:.9},{:.9}",
                            p[0], p[1], p[2], q[0], q[1], q[2], q[3]
                        );
                    }
                    None => row.push_str(",,,,,,,"),
                },
                WatchedKind::Marker => match frame.point(&watched.from) {
                    Some(p) => {
                        let _ = write!(row, ",{:.7},{:.7},{:.7}", p[0], p[1], p[2]);
                    }
                    None => row.push_str(",,,"),
                },
            }
        }
        row
    }

    fn report_pose(&self, held: f64, screen: &mut dyn Screen) {
        let rows = self.rows_of_pose;
        let mut text = format!(
            "  held {held:.1} s: {rows} row{}",
            if rows == 1 { "" } else { "s" }
        );
        for (watched, sight) in self.plan.watched.iter().zip(&self.sights) {
            if sight.pose_lost > 0 {
                let share = 100.0 * sight.pose_lost as f64 / sight.pose_frames.max(1) as f64;
                let _ = write!(text, "; {} lost in {share:.0} % of them", watched.name);
            }
        }
        screen.line(&text);
    }

    /// One line about now, at this time of this computer, s.
    pub fn status(&self, now: f64) -> String {
        let mut text = match self.plan.guide.steps.len() {
            0 => format!("pose {}", self.held + 1),
            n => format!("pose {}/{n}", (self.step + 1).min(n)),
        };
        let doing = match self.phase {
            Phase::Going => "on the way".to_string(),
            Phase::Settling => "settling".to_string(),
            Phase::Holding(since) => format!("held {:.1}/{:.1} s", now - since, self.plan.hold),
            Phase::Leaving => "go on".to_string(),
        };
        let _ = write!(text, " · {doing}");
        if let Some(rate) = self.rate {
            let _ = write!(text, " · {rate:.0} Hz");
        }
        let lost: Vec<String> = self
            .plan
            .watched
            .iter()
            .zip(&self.sights)
            .filter_map(|(w, s)| Some(format!("{} {:.0} s", w.name, now - s.lost_since?)))
            .collect();
        if lost.is_empty() {
            text.push_str(" · all seen");
        } else {
            let _ = write!(text, " · LOST {}", lost.join(", "));
        }
        let Order { missing, late, .. } = self.order;
        if missing + late + self.foreign > 0 {
            let _ = write!(
                text,
                " · missing {missing} late {late} foreign {}",
                self.foreign
            );
        }
        text
    }

    /// Figures so far.
    pub fn summary(&self) -> Summary {
        let lost = self.plan.watched.iter().zip(&self.sights);
        let guided = self.plan.guide.joints.iter();
        Summary {
            rows: self.table.rows,
            poses: self.held,
            frames: (self.order.taken, self.order.missing, self.order.late),
            foreign: self.foreign,
            lost: lost
                .map(|(w, s)| (w.name.clone(), s.lost as f64 / s.frames.max(1) as f64))
                .collect(),
            covered: guided
                .filter_map(|&j| Some((self.plan.columns[j].name.clone(), self.covered[j]?)))
                .collect(),
        }
    }

    /// What was recorded, for a person.
    pub fn report(&self, screen: &mut dyn Screen) {
        let summary = self.summary();
        let of = match self.plan.guide.steps.len() {
            0 => String::new(),
            n => format!(" of {n}"),
        };
        screen.line(&format!(
            "{} rows in the file; poses held now: {}{of}",
            summary.rows, summary.poses
        ));
        let (taken, missing, late) = summary.frames;
        screen.line(&format!(
            "frames: {taken} taken, {missing} never arrived, {late} late or twice (dropped), {} not readable",
            summary.foreign
        ));
        for (&column, &(low, high)) in self.plan.guide.joints.iter().zip(&self.plan.guide.ranges) {
            let joint = &self.plan.columns[column];
            let asked = shown_range(joint.unit, low, high);
            match self.covered[column] {
                Some((from, to)) => {
                    let part = (to.min(high) - from.max(low)).max(0.0) / (high - low).max(1e-12);
                    screen.line(&format!(
                        "  {}: {} of {asked} ({:.0} %)",
                        joint.name,
                        shown_range(joint.unit, from, to),
                        100.0 * part
                    ));
                }
                None => screen.line(&format!("  {}: nothing of {asked}", joint.name)),
            }
        }
        for (name, lost) in &summary.lost {
            screen.line(&format!(
                "  {name}: lost in {:.1} % of the frames",
                100.0 * lost
            ));
        }
    }

    /// Records until there is a reason to end; then everything is on the disk.
    ///
    /// `clock` is the time of this computer, s, never falling; `keys` what the person says.
    ///
    /// # Errors
    /// [`CaptureError`].
    pub fn record(
        &mut self,
        source: &mut Source,
        listener: &mut Option<JointListener>,
        keys: &Receiver<Key>,
        clock: &dyn Fn() -> f64,
        screen: &mut dyn Screen,
    ) -> Result<Ended, CaptureError> {
        let ended = self.until_end(source, listener, keys, clock, screen);
        self.table.flush()?;
        ended
    }

    fn until_end(
        &mut self,
        source: &mut Source,
        listener: &mut Option<JointListener>,
        keys: &Receiver<Key>,
        clock: &dyn Fn() -> f64,
        screen: &mut dyn Screen,
    ) -> Result<Ended, CaptureError> {
        let began = clock();
        let (mut heard, mut told) = (began, began);
        let mut keys_open = true;
        self.announce(screen);
        loop {
            let input = source.next(Duration::from_millis(50))?;
            let now = clock();
            if let Some(listener) = listener {
                listener.take(now);
            }
            match input {
                Input::Frames(frames) => {
                    for frame in &frames {
                        heard = now;
                        self.frame(frame, now, listener.as_ref(), screen)?;
                    }
                }
                Input::Foreign(why) => self.foreign(&why, screen),
                Input::Closed => return Ok(Ended::Closed),
                Input::Nothing => {}
            }
            self.table.tick(now)?;
            while keys_open {
                match keys.try_recv() {
                    Ok(Key::Quit) => return Ok(Ended::Quit),
                    Ok(key) => self.key(key, screen),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => keys_open = false,
                }
            }
            if self.is_finished() {
                return Ok(Ended::Finished);
            }
            if self.restarted {
                return Ok(Ended::Restarted);
            }
            let waits = self.phase == Phase::Going && self.plan.joints == JointSource::Targets;
            if !keys_open && waits {
                return Ok(Ended::NobodyThere);
            }
            if self
                .plan
                .longest
                .is_some_and(|longest| now - began >= longest)
            {
                return Ok(Ended::TimeIsOver);
            }
            let silent = now - heard;
            if silent >= self.plan.patience {
                return Ok(Ended::Silent(silent));
            }
            if silent >= 2.0 && now - told >= 5.0 {
                told = now;
                screen.line(&format!("nothing from the tracker for {silent:.0} s"));
            }
            screen.status(&self.status(now), now);
        }
    }
}

/// Why recording failed. What was recorded before is in the file.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The tracker.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The file.
    #[error(transparent)]
    Table(#[from] TableError),
}
