//! The plain view that estimators take: one row per static pose, or per sample of one clock.

use crate::model::{
    BodyStream, Filled, JointStream, JointUnit, MarkerSample, MarkerStream, Recording,
    TemperatureStream, Timeline, TorqueStream,
};
use nalgebra::{Isometry3, Point3};
use std::collections::BTreeMap;

/// A table of `n` rows: every vector in it has `rows.len()` entries, `None` = lost or not given. SI.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Poses {
    /// Where each row stands in its file: line number from 1 of our own tables, frame number of a tracker's file.
    pub rows: Vec<u64>,
    /// Time, s, when the rows have one.
    pub t: Option<Vec<f64>>,
    /// When each row arrived at the recording computer, s by its clock; see [`Timeline::received`].
    pub received: Option<Vec<f64>>,
    /// Joint positions, rad or m as [`joint_units`](Self::joint_units) says.
    pub joints: BTreeMap<String, Vec<Option<f64>>>,
    /// Angle or length, for every joint.
    pub joint_units: BTreeMap<String, JointUnit>,
    /// Joint torques, N·m.
    pub torques: BTreeMap<String, Vec<Option<f64>>>,
    /// Temperatures of the links before joints, °C; [`WHOLE_ROBOT`](crate::WHOLE_ROBOT): of all of them.
    pub temperatures: BTreeMap<String, Vec<Option<f64>>>,
    /// `tracker_from_body`.
    pub bodies: BTreeMap<String, Vec<Option<Isometry3<f64>>>>,
    /// Marker points in the tracker's frame, m.
    pub markers: BTreeMap<String, Vec<Option<Point3<f64>>>>,
    /// Text columns: `trial`, `group`, … .
    pub labels: BTreeMap<String, Vec<String>>,
}

/// Why a recording has no single table.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotOneTable {
    /// The streams do not share their sampling instants.
    #[error("the recording has {} clocks or rates ({}); synchronize them or choose one", .clocks.len(), .clocks.join(", "))]
    SeveralTimelines {
        /// The clocks.
        clocks: Vec<String>,
    },
    /// Two streams have the same name.
    #[error("`{name}` is the name of two streams")]
    NameTwice {
        /// The name.
        name: String,
    },
}

impl Poses {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// No rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The rows at these indices (from 0), in this order; indices outside are skipped.
    pub fn select(&self, indices: &[usize]) -> Poses {
        let kept: Vec<usize> = indices
            .iter()
            .copied()
            .filter(|&i| i < self.len())
            .collect();
        fn pick<T: Clone>(all: &[T], kept: &[usize]) -> Vec<T> {
            kept.iter().filter_map(|&i| all.get(i).cloned()).collect()
        }
        fn pick_each<T: Clone>(
            all: &BTreeMap<String, Vec<T>>,
            kept: &[usize],
        ) -> BTreeMap<String, Vec<T>> {
            all.iter()
                .map(|(name, values)| (name.clone(), pick(values, kept)))
                .collect()
        }
        Poses {
            rows: pick(&self.rows, &kept),
            t: self.t.as_ref().map(|t| pick(t, &kept)),
            received: self.received.as_ref().map(|t| pick(t, &kept)),
            joints: pick_each(&self.joints, &kept),
            joint_units: self.joint_units.clone(),
            torques: pick_each(&self.torques, &kept),
            temperatures: pick_each(&self.temperatures, &kept),
            bodies: pick_each(&self.bodies, &kept),
            markers: pick_each(&self.markers, &kept),
            labels: pick_each(&self.labels, &kept),
        }
    }

    /// Row indices per text of a label column, texts in order of first occurrence. Without that column: one
    /// group with an empty name.
    pub fn groups(&self, label: &str) -> Vec<(String, Vec<usize>)> {
        let Some(texts) = self.labels.get(label) else {
            return vec![(String::new(), (0..self.len()).collect())];
        };
        let mut position: BTreeMap<&str, usize> = BTreeMap::new();
        let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
        for (row, text) in texts.iter().enumerate() {
            let at = *position.entry(text).or_insert_with(|| {
                groups.push((text.clone(), Vec::new()));
                groups.len() - 1
            });
            groups[at].1.push(row);
        }
        groups
    }

    /// The joint names of this table, for messages.
    pub fn joint_names(&self) -> Vec<&str> {
        self.joints.keys().map(String::as_str).collect()
    }

    /// The same data as a recording with one timeline.
    pub fn into_recording(self) -> Recording {
        let Poses {
            rows,
            t,
            received,
            joints,
            joint_units,
            torques,
            temperatures,
            bodies,
            markers,
            labels,
        } = self;
        let clock = if t.is_some() { "t_s" } else { "static poses" };
        Recording {
            meta: Default::default(),
            timelines: vec![Timeline {
                clock: clock.to_string(),
                rows,
                t,
                received,
                labels,
            }],
            joints: joints
                .into_iter()
                .map(|(name, q)| {
                    let unit = joint_units.get(&name).copied().unwrap_or(JointUnit::Angle);
                    JointStream {
                        name,
                        timeline: 0,
                        unit,
                        q,
                    }
                })
                .collect(),
            torques: torques
                .into_iter()
                .map(|(name, torque)| TorqueStream {
                    name,
                    timeline: 0,
                    torque,
                })
                .collect(),
            temperatures: temperatures
                .into_iter()
                .map(|(name, celsius)| TemperatureStream {
                    name,
                    timeline: 0,
                    celsius,
                })
                .collect(),
            bodies: bodies
                .into_iter()
                .map(|(name, tracker_from_body)| BodyStream {
                    name,
                    timeline: 0,
                    tracker_from_body,
                    quality: Vec::new(),
                    covariance: Vec::new(),
                })
                .collect(),
            markers: markers
                .into_iter()
                .map(|(name, points)| MarkerStream {
                    name,
                    body: None,
                    unlabeled: false,
                    timeline: 0,
                    samples: points
                        .into_iter()
                        .map(|point| point.map_or(MarkerSample::Lost, MarkerSample::Measured))
                        .collect(),
                })
                .collect(),
        }
    }
}

impl Recording {
    /// The table, when all streams share one timeline (always so for files of static poses).
    ///
    /// # Errors
    /// [`NotOneTable`] when they do not, or when a name occurs twice.
    pub fn poses(&self, filled: Filled) -> Result<Poses, NotOneTable> {
        match self.timelines.as_slice() {
            [] => Ok(Poses::default()),
            [_] => self.poses_of(0, filled),
            several => Err(NotOneTable::SeveralTimelines {
                clocks: several
                    .iter()
                    .map(|timeline| timeline.clock.clone())
                    .collect(),
            }),
        }
    }

    /// The table of the streams on one timeline; empty when there is no such timeline.
    ///
    /// # Errors
    /// [`NotOneTable::NameTwice`].
    pub fn poses_of(&self, timeline: usize, filled: Filled) -> Result<Poses, NotOneTable> {
        let Some(instants) = self.timelines.get(timeline) else {
            return Ok(Poses::default());
        };
        let mut poses = Poses {
            rows: instants.rows.clone(),
            t: instants.t.clone(),
            received: instants.received.clone(),
            labels: instants.labels.clone(),
            ..Poses::default()
        };
        fn add<T>(map: &mut BTreeMap<String, T>, name: &str, value: T) -> Result<(), NotOneTable> {
            match map.insert(name.to_string(), value) {
                None => Ok(()),
                Some(_) => Err(NotOneTable::NameTwice {
                    name: name.to_string(),
                }),
            }
        }
        for joint in self
            .joints
            .iter()
            .filter(|joint| joint.timeline == timeline)
        {
            add(&mut poses.joints, &joint.name, joint.q.clone())?;
            poses.joint_units.insert(joint.name.clone(), joint.unit);
        }
        for torque in self
            .torques
            .iter()
            .filter(|torque| torque.timeline == timeline)
        {
            add(&mut poses.torques, &torque.name, torque.torque.clone())?;
        }
        for warm in self.temperatures.iter().filter(|t| t.timeline == timeline) {
            add(&mut poses.temperatures, &warm.name, warm.celsius.clone())?;
        }
        for body in self.bodies.iter().filter(|body| body.timeline == timeline) {
            add(
                &mut poses.bodies,
                &body.name,
                body.tracker_from_body.clone(),
            )?;
        }
        for marker in self
            .markers
            .iter()
            .filter(|marker| marker.timeline == timeline)
        {
            let points = marker
                .samples
                .iter()
                .map(|sample| sample.point(filled))
                .collect();
            add(&mut poses.markers, &marker.name, points)?;
        }
        Ok(poses)
    }
}
