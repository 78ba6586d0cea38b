//! What the operator reads: the pose that was held, the state now, the whole recording.

use super::{Phase, Session};
use crate::guide::shown_range;
use crate::{JointSource, Order, Screen};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Statistics of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Rows in the file.
    pub rows: u64,
    /// Poses held in this session.
    pub poses: usize,
    /// Poses in the file.
    pub in_file: usize,
    /// Requested poses that the file does not have, counted from 1.
    pub missing: Vec<usize>,
    /// Frames recorded, missing, dropped because they were late.
    pub frames: (u64, u64, u64),
    /// Datagrams or reports that are not from the tracker or cannot be read.
    pub foreign: u64,
    /// By body: fraction of the frames in which it was lost.
    pub lost: BTreeMap<String, f64>,
    /// By guided joint: lowest and highest value recorded, rad or m.
    pub covered: BTreeMap<String, (f64, f64)>,
}

impl Session<'_> {
    /// Announces the next pose.
    pub fn announce(&self, screen: &mut dyn Screen) {
        let guide = &self.plan.guide;
        if let Some(step) = self.step() {
            let how = match (self.plan.joints, step.through) {
                (JointSource::Targets, _) => "move there, then press Enter",
                (JointSource::Udp(_), false) => "move there and hold still",
                (JointSource::Udp(_), true) => "move through it",
            };
            let pose = match step.through {
                true => "on the way, not recorded".to_owned(),
                false => format!("pose {}/{}", self.number(), self.listed()),
            };
            screen.line(&format!("{pose}: {}; {how}", self.motion()));
            if step.blocked {
                screen.line("  The straight motion may touch something: move there by hand or with a motion planner.");
            }
        } else if self.plan.continuous {
            screen.line("Every frame is recorded: move the robot slowly through its range.");
        } else if guide.steps.is_empty() && self.held == 0 {
            screen.line(&format!(
                "Free poses: hold each pose for {:.1} s.",
                self.plan.hold
            ));
        }
    }

    pub(super) fn report_pose(&self, held: f64, screen: &mut dyn Screen) {
        let rows = self.hold.rows.len();
        let mut text = format!(
            "  held {held:.1} s: {rows} row{}",
            if rows == 1 { "" } else { "s" }
        );
        for (name, share) in self.hold.shares_lost(&self.plan) {
            let _ = write!(text, "; {name} lost in {:.0} % of them", 100.0 * share);
        }
        screen.line(&text);
    }

    /// The current state in one line, at this time of this computer, s.
    pub fn status(&self, now: f64) -> String {
        let mut text = match self.listed() {
            _ if self.plan.continuous => format!("{} rows", self.table.rows),
            0 => format!("pose {}", self.number()),
            n => format!("pose {}/{n}", self.number().min(n as u64)),
        };
        let doing = match (&self.waits, self.phase) {
            (_, Phase::Holding(since)) => {
                format!("held {:.1}/{:.1} s", now - since, self.plan.hold)
            }
            (Some(waits), _) => waits.to_string(),
            (None, Phase::Going) => "moving".to_string(),
            (None, Phase::Settling) => "settling".to_string(),
            (None, Phase::Leaving) => "move to the next pose".to_string(),
            (None, Phase::Continuous) => "recording".to_string(),
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
            text.push_str(" · all visible");
        } else {
            let _ = write!(text, " · LOST {}", lost.join(", "));
        }
        let Order { missing, late, .. } = self.order;
        if missing + late + self.foreign > 0 {
            let _ = write!(
                text,
                " · missing {missing} late {late} ignored {}",
                self.foreign
            );
        }
        text
    }

    /// Statistics so far.
    pub fn summary(&self) -> Summary {
        let lost = self.plan.watched.iter().zip(&self.sights);
        let guided = self.plan.guide.joints.iter();
        Summary {
            rows: self.table.rows,
            poses: self.held,
            in_file: if self.is_guided() && self.planner.is_none() {
                self.done.len()
            } else {
                self.free as usize
            },
            missing: self.missing(),
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

    /// Shows what was recorded.
    pub fn report(&self, screen: &mut dyn Screen) {
        let summary = self.summary();
        let rows = summary.rows;
        let of = match self.listed() {
            0 => String::new(),
            n => format!(" of {n}"),
        };
        if self.plan.continuous {
            screen.line(&format!("{rows} rows in the file"));
        } else {
            screen.line(&format!(
                "{rows} rows and {}{of} poses in the file, {} of them from this session",
                summary.in_file, summary.poses
            ));
        }
        // The tracker's clock of this file does not go on.
        let how = match self.restarted {
            true => "Record them in a new file.",
            false => "Repeat the command with `--append` to record them.",
        };
        let to_come = self.listed().saturating_sub(summary.in_file);
        if self.planner.is_some() && to_come > 0 && !self.reached {
            screen.line(&format!(
                "{to_come} poses of the plan are still to come. {how}"
            ));
        }
        if !summary.missing.is_empty() {
            screen.line(&format!(
                "missing: pose {}. {how}",
                ranges(&summary.missing)
            ));
        }
        let (taken, missing, late) = summary.frames;
        screen.line(&format!(
            "frames: {taken} received, {missing} missing, {late} late or duplicate (dropped), {} not readable",
            summary.foreign
        ));
        for (&column, &(low, high)) in self.plan.guide.joints.iter().zip(&self.plan.guide.ranges) {
            let joint = &self.plan.columns[column];
            let requested = shown_range(joint.unit, low, high);
            match self.covered[column] {
                Some((from, to)) => {
                    let part = (to.min(high) - from.max(low)).max(0.0) / (high - low).max(1e-12);
                    screen.line(&format!(
                        "  {}: {} of {requested} ({:.0} %)",
                        joint.name,
                        shown_range(joint.unit, from, to),
                        100.0 * part
                    ));
                }
                None => screen.line(&format!("  {}: no data in {requested}", joint.name)),
            }
        }
        for (name, lost) in &summary.lost {
            screen.line(&format!(
                "  {name}: lost in {:.1} % of the frames",
                100.0 * lost
            ));
        }
    }
}

/// `2, 5..9`, of ascending numbers.
fn ranges(numbers: &[usize]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b);
    let texts: Vec<String> = runs
        .map(|run| match run {
            [only] => only.to_string(),
            [first, second] => format!("{first}, {second}"),
            [first, .., last] => format!("{first}..{last}"),
            [] => String::new(),
        })
        .collect();
    texts.join(", ")
}
