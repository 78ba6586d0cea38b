//! Long tables of static poses, as laser trackers and coordinate measuring machines are used: each row is one point in one
//! pose. The rows of a pose have its name and may stand anywhere; its joint positions may stand in all of them or in the first.

use super::Rows;
use crate::error::{Placed, Problem};
use crate::model::JointUnit;
use std::collections::BTreeMap;

/// Readings of a joint that stands still agree to this, rad; poses of a calibration differ by more.
const SAME_ANGLE: f64 = 1e-3;
/// The same for prismatic joints, m.
const SAME_LENGTH: f64 = 1e-4;

/// What is known of the poses of a long table.
#[derive(Default)]
pub(super) struct PoseRows {
    /// Name of the row's pose.
    pub(super) name: String,
    /// Sample by name.
    samples: BTreeMap<String, usize>,
    /// Line by stream and sample.
    points: BTreeMap<(usize, usize), u64>,
}

impl Rows<'_> {
    /// Finds the row's sample by the name of its pose; whether it exists already.
    pub(super) fn named_pose(&mut self, line: u64, column: usize) -> Placed<bool> {
        if self.poses.name.is_empty() {
            let problem = Problem::Unexpected {
                found: String::new(),
                expected: "the name or number of a pose in every row".to_string(),
            };
            return Err((self.at(line, column), problem));
        }
        if let Some(sample) = self.poses.samples.get(&self.poses.name) {
            self.sample = *sample;
            return Ok(true);
        }
        let new = self.timeline.rows.len();
        self.poses.samples.insert(self.poses.name.clone(), new);
        Ok(false)
    }

    /// A further row of a sample has its joint positions, or none.
    pub(super) fn same_robot(&mut self, line: u64) -> Placed<()> {
        let sample = self.sample;
        for (i, (name, unit, slot)) in self.layout.joints.iter().enumerate() {
            let value = self.values[*slot];
            let known = &mut self.joints[i][sample];
            let tolerance = match unit {
                JointUnit::Angle => SAME_ANGLE,
                JointUnit::Length => SAME_LENGTH,
            };
            match known {
                _ if value.is_nan() => {}
                None => *known = Some(value),
                Some(known) if (*known - value).abs() <= tolerance => {}
                Some(_) => {
                    let problem = Problem::PoseTwice {
                        pose: match self.layout.pose {
                            Some(_) => self.poses.name.clone(),
                            None => self.frame.unwrap_or_default().to_string(),
                        },
                        joint: name.clone(),
                        first: self.timeline.rows[sample],
                    };
                    let column = self.layout.slots[*slot].column;
                    return Err((self.at(line, column), problem));
                }
            }
        }
        let torques = self.layout.torques.iter().zip(&mut self.torques);
        let warm = self.layout.temperatures.iter().zip(&mut self.temperatures);
        for ((_, slot), stream) in torques.chain(warm) {
            let value = self.values[*slot];
            if !value.is_nan() {
                stream[sample].get_or_insert(value);
            }
        }
        Ok(())
    }

    /// A point is measured once in a pose.
    pub(super) fn once_per_pose(&mut self, line: u64, stream: usize) -> Placed<()> {
        let Some(first) = self.poses.points.insert((stream, self.sample), line) else {
            return Ok(());
        };
        let problem = Problem::PointTwice {
            name: self.entity.clone(),
            pose: self.poses.name.clone(),
            first,
        };
        Err((
            self.at(line, self.layout.entity.unwrap_or_default()),
            problem,
        ))
    }
}
