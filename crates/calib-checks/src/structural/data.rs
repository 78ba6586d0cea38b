//! What the engine is given: readings, measured points or poses, and what is claimed about them.

use nalgebra::{Isometry3, Point3};

use super::chain::Chain;
use super::ids::{BodyIndex, JointIndex, LinkIndex, RecordingIndex};

/// What the tracker reports of a body.
#[derive(Debug, Clone, PartialEq)]
pub enum Measured {
    /// Marker positions in the tracker frame, m; `[row][marker]`, `None` where lost.
    Markers(Vec<Vec<Option<Point3<f64>>>>),
    /// `tracker_from_body`; one per row, `None` where lost.
    Poses {
        /// One per row.
        tracker_from_body: Vec<Option<Isometry3<f64>>>,
        /// Standard deviation of a position coordinate, m.
        sigma_position: f64,
        /// Standard deviation of the orientation, rad.
        sigma_orientation: f64,
    },
}

impl Measured {
    /// Markers of the body; a pose counts as one.
    pub(super) fn markers(&self) -> usize {
        match self {
            Self::Markers(rows) => rows.first().map_or(0, Vec::len),
            Self::Poses { .. } => 1,
        }
    }

    /// Whether anything of the body was seen in a row.
    ///
    /// # Panics
    /// Without such a row.
    #[must_use]
    pub fn seen(&self, row: usize) -> bool {
        match self {
            Self::Markers(rows) => rows[row].iter().any(Option::is_some),
            Self::Poses {
                tracker_from_body, ..
            } => tracker_from_body[row].is_some(),
        }
    }
}

/// A tracked body and the link that it is said to be mounted on.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    // CLAIM: the body is bolted to this link.
    /// The link that carries it.
    pub link: LinkIndex,
    /// What was measured.
    pub measured: Measured,
    /// Which mount each recording has: recordings with equal numbers share the marker positions in the link.
    /// Empty: one mount throughout.
    pub mounts: Vec<u32>,
}

/// The whole input: nominal robot, readings, bodies.
#[derive(Debug, Clone, PartialEq)]
pub struct Data {
    /// Nominal kinematics, declared couplings and gains included.
    pub chain: Chain,
    /// `[row][joint]`, rad or m, one entry per joint of the chain; `None` where there is no value. A joint without any value
    /// in a recording is taken as 0 there and listed in the outcome; a row that lacks a single value is not used.
    pub readings: Vec<Vec<Option<f64>>>,
    /// The recording of each row. Rows of a recording stand in the order in which they were measured.
    pub recording: Vec<RecordingIndex>,
    /// `[row]`: how fast each joint moved, rad/s or m/s, one entry per joint; `None` where it is not known. Empty: nowhere.
    pub rates: Vec<Option<Vec<f64>>>,
    /// Bodies; each has one sample per row.
    pub bodies: Vec<Body>,
}

/// The input contradicts itself.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DataError {
    /// Lists of rows have different lengths.
    #[error("{found} rows where the readings have {expected}")]
    RowCount {
        /// Rows of the readings.
        expected: usize,
        /// Rows of the other list.
        found: usize,
    },
    /// A row has not one reading per joint.
    #[error("row {row} has {found} readings, the chain has {expected} joints")]
    ReadingCount {
        /// Row.
        row: usize,
        /// Joints of the chain.
        expected: usize,
        /// Readings of the row.
        found: usize,
    },
    /// Rows of a body differ in their number of markers.
    #[error("body {body:?} has {found} markers in row {row} and {expected} in the first")]
    MarkerCount {
        /// Body.
        body: BodyIndex,
        /// Row.
        row: usize,
        /// Markers of the first row.
        expected: usize,
        /// Markers of this row.
        found: usize,
    },
    /// A body is claimed to be on a link that does not exist.
    #[error("body {body:?} is mounted on link {link:?}, which the chain does not have")]
    UnknownLink {
        /// Body.
        body: BodyIndex,
        /// The claimed link.
        link: LinkIndex,
    },
    /// A reading, a point or a standard deviation is not a finite number (or a deviation is not positive).
    #[error("row {row} holds a non-finite value or a standard deviation that is not positive")]
    NotFinite {
        /// Row; 0 for a standard deviation.
        row: usize,
    },
    /// Nothing was measured.
    #[error("no body has a sample")]
    Empty,
}

impl Data {
    /// Number of recordings: one more than the largest index.
    #[must_use]
    pub fn recordings(&self) -> usize {
        self.recording.iter().map(|r| r.0 + 1).max().unwrap_or(0)
    }

    /// Joint columns that are empty in a whole recording and are therefore taken as 0.
    #[must_use]
    pub fn assumed_zero(&self) -> Vec<(JointIndex, RecordingIndex)> {
        let relevant = self.relevant_joints();
        let mut seen = vec![vec![false; self.chain.joints.len()]; self.recordings()];
        for (row, recording) in self.readings.iter().zip(&self.recording) {
            for (j, reading) in row.iter().enumerate() {
                seen[recording.0][j] |= reading.is_some();
            }
        }
        let mut present = vec![false; self.recordings()];
        self.recording.iter().for_each(|r| present[r.0] = true);
        let mut missing = Vec::new();
        for joint in relevant {
            for r in (0..seen.len()).filter(|&r| present[r]) {
                if !seen[r][joint.0] {
                    missing.push((joint, RecordingIndex(r)));
                }
            }
        }
        missing
    }

    /// The joints whose readings move a body.
    #[must_use]
    pub fn relevant_joints(&self) -> Vec<JointIndex> {
        let mut joints: Vec<JointIndex> = self
            .bodies
            .iter()
            .flat_map(|body| self.chain.readings_of(body.link))
            .collect();
        joints.sort_unstable();
        joints.dedup();
        joints
    }

    /// The joints whose readings move a body, and which were read in motion.
    pub(crate) fn moving_joints(&self) -> Vec<JointIndex> {
        let moves = |joint: &JointIndex| {
            let mut rates = self.rates.iter().flatten();
            rates.any(|of_row| of_row.get(joint.0).is_some_and(|rate| *rate != 0.0))
        };
        self.relevant_joints().into_iter().filter(moves).collect()
    }

    /// A joint and those that it carries which were read in motion; the joint first.
    #[must_use]
    pub fn moving_with(&self, joint: JointIndex) -> Vec<JointIndex> {
        let moving = self.moving_joints();
        let carried = self.chain.carried(joint).into_iter();
        let others = carried.filter(|other| *other != joint && moving.contains(other));
        std::iter::once(joint).chain(others).collect()
    }

    /// The mount of a body in a recording.
    #[must_use]
    pub fn mount(&self, body: BodyIndex, recording: RecordingIndex) -> u32 {
        self.bodies[body.0]
            .mounts
            .get(recording.0)
            .copied()
            .unwrap_or(0)
    }

    pub(crate) fn check(&self) -> Result<(), DataError> {
        let rows = self.readings.len();
        let same = |found: usize| {
            if found == rows {
                Ok(())
            } else {
                Err(DataError::RowCount {
                    expected: rows,
                    found,
                })
            }
        };
        same(self.recording.len())?;
        if !self.rates.is_empty() {
            same(self.rates.len())?;
        }
        for (row, readings) in self.readings.iter().enumerate() {
            if readings.len() != self.chain.joints.len() {
                let expected = self.chain.joints.len();
                return Err(DataError::ReadingCount {
                    row,
                    expected,
                    found: readings.len(),
                });
            }
            let rates = self.rates.get(row).and_then(Option::as_ref);
            let rates = rates.into_iter().flatten();
            let numbers = readings.iter().flatten().chain(rates);
            if numbers.copied().any(|q| !q.is_finite()) {
                return Err(DataError::NotFinite { row });
            }
        }
        let mut any = false;
        for (b, body) in self.bodies.iter().enumerate() {
            let at = BodyIndex(b);
            if body.link.0 >= self.chain.links {
                return Err(DataError::UnknownLink {
                    body: at,
                    link: body.link,
                });
            }
            match &body.measured {
                Measured::Markers(points) => {
                    same(points.len())?;
                    any |= check_markers(at, points)?;
                }
                Measured::Poses {
                    tracker_from_body,
                    sigma_position,
                    sigma_orientation,
                } => {
                    same(tracker_from_body.len())?;
                    let positive = |s: &f64| s.is_finite() && *s > 0.0;
                    if !positive(sigma_position) || !positive(sigma_orientation) {
                        return Err(DataError::NotFinite { row: 0 });
                    }
                    for (row, pose) in tracker_from_body.iter().enumerate() {
                        let Some(pose) = pose else { continue };
                        any = true;
                        let numbers = pose
                            .translation
                            .vector
                            .iter()
                            .chain(pose.rotation.coords.iter());
                        if !numbers.copied().all(f64::is_finite) {
                            return Err(DataError::NotFinite { row });
                        }
                    }
                }
            }
        }
        if any { Ok(()) } else { Err(DataError::Empty) }
    }

    /// A copy with some of the rows, by index, in the order given.
    #[must_use]
    pub fn select(&self, rows: &[usize]) -> Data {
        let bodies = self.bodies.iter().map(|body| Body {
            link: body.link,
            mounts: body.mounts.clone(),
            measured: match &body.measured {
                Measured::Markers(points) => {
                    Measured::Markers(rows.iter().map(|&i| points[i].clone()).collect())
                }
                Measured::Poses {
                    tracker_from_body,
                    sigma_position,
                    sigma_orientation,
                } => Measured::Poses {
                    tracker_from_body: rows.iter().map(|&i| tracker_from_body[i]).collect(),
                    sigma_position: *sigma_position,
                    sigma_orientation: *sigma_orientation,
                },
            },
        });
        Data {
            chain: self.chain.clone(),
            readings: rows.iter().map(|&i| self.readings[i].clone()).collect(),
            recording: rows.iter().map(|&i| self.recording[i]).collect(),
            rates: rows
                .iter()
                .filter_map(|&i| self.rates.get(i).cloned())
                .collect(),
            bodies: bodies.collect(),
        }
    }
}

fn check_markers(body: BodyIndex, points: &[Vec<Option<Point3<f64>>>]) -> Result<bool, DataError> {
    let expected = points.first().map_or(0, Vec::len);
    let mut any = false;
    for (row, samples) in points.iter().enumerate() {
        if samples.len() != expected {
            return Err(DataError::MarkerCount {
                body,
                row,
                expected,
                found: samples.len(),
            });
        }
        for point in samples.iter().flatten() {
            any = true;
            if !point.iter().copied().all(f64::is_finite) {
                return Err(DataError::NotFinite { row });
            }
        }
    }
    Ok(any)
}
