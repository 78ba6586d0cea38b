//! The pose that is being held: its rows wait until the whole hold is good, so that no part of one is in the file.

use super::plan::{Moved, Plan};
use crate::{Frame, Held, JointColumn, JointSource, Unit};

/// A frame's row, but for the number of its hold.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Row {
    /// Columns before the hold's.
    pub before: String,
    /// Columns after it.
    pub after: String,
}

impl Row {
    /// With the number of a hold, or without.
    pub(super) fn text(&self, hold: Option<u64>) -> String {
        let hold = hold.map_or_else(String::new, |number| number.to_string());
        format!("{},{hold}{}", self.before, self.after)
    }
}

/// The rows of a hold, and how often each thing was seen in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Hold {
    pub rows: Vec<Row>,
    /// Frames in which each body or marker of the plan was seen.
    seen: Vec<u64>,
    /// Frames in which each moved body was seen.
    moved: Vec<u64>,
    /// The values of each joint column.
    joints: Vec<Values>,
}

/// Values of a joint in a hold, rad or m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Values {
    sum: f64,
    count: u64,
    range: Option<(f64, f64)>,
}

impl Values {
    fn take(&mut self, q: f64) {
        let (low, high) = self.range.unwrap_or((q, q));
        self.range = Some((low.min(q), high.max(q)));
        self.sum += q;
        self.count += 1;
    }
}

/// Range of a measured joint within a hold, rad and m: more is a motion, whatever the tracker sees of it.
const STILL: (f64, f64) = (5e-3, 2e-3);

/// A moved body must be seen in this share of a hold: its median is then of the pose, whatever the rest shows.
const ENOUGH: f64 = 0.5;

impl Hold {
    /// Takes a frame.
    pub(super) fn take(&mut self, plan: &Plan, frame: &Frame, joints: &[Option<f64>], row: Row) {
        self.rows.push(row);
        self.joints.resize(joints.len(), Values::default());
        for (values, q) in self.joints.iter_mut().zip(joints) {
            if let Some(q) = q {
                values.take(*q);
            }
        }
        self.seen.resize(plan.watched.len(), 0);
        self.moved.resize(plan.moved.len(), 0);
        for (watched, seen) in plan.watched.iter().zip(&mut self.seen) {
            *seen += u64::from(watched.is_in(frame));
        }
        for (moved, seen) in plan.moved.iter().zip(&mut self.moved) {
            *seen += u64::from(moved.is_in(plan, frame));
        }
    }

    /// Moved bodies that were not seen often enough, but for those that need not be seen.
    pub(super) fn lost<'p>(&self, plan: &'p Plan, unseen: &[usize]) -> Vec<&'p Moved> {
        let each = plan.moved.iter().zip(&self.moved).enumerate();
        each.filter(|(place, (_, seen))| !unseen.contains(place) && !self.is_enough(**seen))
            .map(|(_, (moved, _))| moved)
            .collect()
    }

    /// The measured joint that moved most in the hold, and how far, rad or m.
    pub(super) fn moving<'p>(&self, plan: &'p Plan) -> Option<(&'p JointColumn, f64)> {
        if plan.joints == JointSource::Targets {
            return None;
        }
        let each = plan.columns.iter().zip(&self.joints);
        let far = each.filter_map(|(column, values)| {
            let (low, high) = values.range?;
            let still = match column.unit {
                Unit::Angle => STILL.0,
                Unit::Length => STILL.1,
            };
            let far = high - low;
            (far > still).then_some((far / still, (column, far)))
        });
        let most = far.max_by(|a, b| a.0.total_cmp(&b.0));
        most.map(|(_, moved)| moved)
    }

    fn is_enough(&self, seen: u64) -> bool {
        seen as f64 >= ENOUGH * self.rows.len() as f64
    }

    /// What the hold says, by name.
    pub(super) fn held(&self, plan: &Plan) -> Held {
        let joints = plan.columns.iter().zip(&self.joints);
        let means = joints.filter(|(_, values)| values.count > 0);
        let seen = plan.watched.iter().zip(&self.seen);
        let seen = seen.filter(|(_, seen)| self.is_enough(**seen));
        Held {
            joints: means
                .map(|(column, values)| (column.name.clone(), values.sum / values.count as f64))
                .collect(),
            seen: seen.map(|(watched, _)| watched.name.clone()).collect(),
        }
    }

    /// Share of the frames without each body or marker that was lost in some.
    pub(super) fn shares_lost<'p>(&self, plan: &'p Plan) -> Vec<(&'p str, f64)> {
        let frames = self.rows.len() as u64;
        let each = plan.watched.iter().zip(&self.seen);
        each.filter(|(_, seen)| **seen < frames)
            .map(|(w, seen)| (w.name.as_str(), (frames - seen) as f64 / frames as f64))
            .collect()
    }
}
