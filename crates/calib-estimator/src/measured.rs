//! Measured samples as estimators need them: poses, marker tracks with gaps, and the gathered cloud.
//!
//! Gaps are `None`, never NaN or zero. Everything is checked here once: a number that is not finite or a matrix
//! that is no rotation is an error with its row.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::verdict::Verdict;

/// The entries of RᵀR − I may add up to this much: printed matrices have four or more decimals, and a
/// real scale error or reflection is far larger.
const ROTATION_LIMIT: f64 = 1e-4;

/// `world_from_body` as a matrix and a translation, as trackers print it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// World coordinates of the body's axes, in columns.
    pub rotation: Matrix3<f64>,
    /// Body origin in world coordinates, m.
    pub translation: Vector3<f64>,
}

impl From<Isometry3<f64>> for Pose {
    fn from(world_from_body: Isometry3<f64>) -> Self {
        Self {
            rotation: world_from_body.rotation.to_rotation_matrix().into_inner(),
            translation: world_from_body.translation.vector,
        }
    }
}

impl Pose {
    /// A point of the body, seen from the world.
    #[must_use]
    pub fn transform(&self, p_body: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * p_body + self.translation
    }

    /// RᵀR, once the matrix is known to be a rotation; `row` names it in the error.
    ///
    /// # Errors
    /// [`DataError::NotFinite`], [`DataError::NotRotation`] with the defect.
    #[inline]
    pub fn check(&self, row: usize) -> Result<Matrix3<f64>, DataError> {
        let r = &self.rotation;
        let gram = r.tr_mul(r);
        let defect = (gram - Matrix3::identity()).abs().sum();
        let finite = self.translation.sum().is_finite() && defect.is_finite();
        let determinant = r.determinant();
        // A NaN fails both comparisons.
        if finite && defect <= ROTATION_LIMIT && determinant > 0.0 {
            return Ok(gram);
        }
        if finite {
            Err(DataError::NotRotation {
                row,
                defect,
                determinant,
            })
        } else {
            Err(DataError::NotFinite { marker: 0, row })
        }
    }
}

/// How many single samples each row is worth: its noise variance is σ²/w. Empty: one each. A row of weight 0 counts as lost.
#[derive(Debug, Clone, Copy, Default)]
pub struct RowWeights<'a>(pub &'a [f64]);

impl RowWeights<'_> {
    /// Weight of a row.
    #[inline]
    #[must_use]
    pub fn of(self, row: usize) -> f64 {
        self.0.get(row).copied().unwrap_or(1.0)
    }

    /// # Errors
    /// [`DataError::NotWeight`] for a weight that is negative or not finite, [`DataError::Lengths`] for another number of weights than rows.
    pub fn check(self, rows: usize) -> Result<(), DataError> {
        if self.0.is_empty() {
            return Ok(());
        }
        if self.0.len() != rows {
            return Err(DataError::Lengths {
                what: "weights and rows",
                left: self.0.len(),
                right: rows,
            });
        }
        match self.0.iter().position(|w| !(w.is_finite() && *w >= 0.0)) {
            Some(row) => Err(DataError::NotWeight {
                row,
                weight: self.0[row],
            }),
            None => Ok(()),
        }
    }
}

/// One trajectory for each marker; `None` is a lost sample. Lengths may differ between markers where
/// only spheres are fitted; a rigid body needs simultaneous rows.
pub type Tracks = [Vec<Option<Point3<f64>>>];

/// All seen samples of all markers, marker after marker, relative to their common centroid.
#[derive(Debug, Clone)]
pub struct Cloud {
    /// Centroid of all samples, world.
    pub origin: Vector3<f64>,
    /// Samples minus `origin`.
    pub points: Vec<Vector3<f64>>,
    /// `points[starts[p]..starts[p + 1]]` belong to marker p (of those kept).
    pub starts: Vec<usize>,
    /// (marker, row) of each point in the caller's tables.
    pub labels: Vec<(usize, usize)>,
    /// 3 × 3 covariance of each point, or empty.
    pub covariances: Vec<Matrix3<f64>>,
    /// Weight of each point ([`RowWeights`]), or empty where all are alike.
    pub weights: Vec<f64>,
    /// Largest coordinate magnitude before centering: what rounding is relative to.
    pub magnitude: f64,
}

impl Cloud {
    /// Gathers the samples. Markers seen fewer than twice carry no information and are left out.
    ///
    /// `covariances`: one for each sample, marker × sample, or empty.
    ///
    /// # Errors
    /// [`DataError`] for samples that are not finite and covariances that are none.
    pub fn gather(tracks: &Tracks, covariances: &[Vec<Matrix3<f64>>]) -> Result<Self, DataError> {
        Self::weighted(tracks, covariances, RowWeights::default())
    }

    /// The same with a weight for each row.
    ///
    /// # Errors
    /// As [`Self::gather`]; also for weights that are none.
    pub fn weighted(
        tracks: &Tracks,
        covariances: &[Vec<Matrix3<f64>>],
        weights: RowWeights<'_>,
    ) -> Result<Self, DataError> {
        weights.check(tracks.iter().map(Vec::len).max().unwrap_or(0))?;
        let mut points = Vec::new();
        let mut labels = Vec::new();
        let mut starts = vec![0];
        let mut kept = Vec::new();
        let mut close = |points: &mut Vec<Vector3<f64>>,
                         labels: &mut Vec<(usize, usize)>,
                         kept: &mut Vec<Matrix3<f64>>| {
            let start = starts[starts.len() - 1];
            if points.len() < start + 2 {
                points.truncate(start);
                labels.truncate(start);
                kept.truncate(start);
            } else {
                starts.push(points.len());
            }
        };
        if !covariances.is_empty() && covariances.len() != tracks.len() {
            return Err(DataError::Lengths {
                what: "covariance tables and markers",
                left: covariances.len(),
                right: tracks.len(),
            });
        }
        points.reserve(tracks.iter().map(Vec::len).sum());
        for (marker, track) in tracks.iter().enumerate() {
            let table = covariances.get(marker);
            if let Some(table) = table
                && table.len() != track.len()
            {
                return Err(DataError::Lengths {
                    what: "covariances and samples of a marker",
                    left: table.len(),
                    right: track.len(),
                });
            }
            for (row, sample) in track.iter().enumerate() {
                let Some(p) = sample else { continue };
                if weights.of(row) == 0.0 {
                    continue;
                }
                if !p.iter().all(|x| x.is_finite()) {
                    return Err(DataError::NotFinite { marker, row });
                }
                if let Some(table) = table {
                    if table[row].cholesky().is_none() {
                        return Err(DataError::NotCovariance { marker, row });
                    }
                    kept.push(table[row]);
                }
                points.push(p.coords);
                labels.push((marker, row));
            }
            close(&mut points, &mut labels, &mut kept);
        }
        let of_points = match weights.0 {
            [] => Vec::new(),
            _ => labels
                .iter()
                .map(|l: &(usize, usize)| weights.of(l.1))
                .collect(),
        };
        let mut cloud = Self {
            origin: Vector3::zeros(),
            points,
            starts,
            labels,
            covariances: kept,
            weights: of_points,
            magnitude: 0.0,
        };
        cloud.center();
        Ok(cloud)
    }

    /// The origins of a body's poses as one marker.
    ///
    /// # Errors
    /// [`DataError::NotFinite`].
    pub fn of_origins(poses: &[Option<Pose>]) -> Result<Self, DataError> {
        Self::of_weighted_origins(poses, RowWeights::default())
    }

    /// The same with a weight for each row.
    ///
    /// # Errors
    /// [`DataError::NotFinite`]; also for weights that are none.
    pub fn of_weighted_origins(
        poses: &[Option<Pose>],
        weights: RowWeights<'_>,
    ) -> Result<Self, DataError> {
        let track = poses
            .iter()
            .map(|p| p.as_ref().map(|p| p.translation.into()))
            .collect();
        Self::weighted(&[track], &[], weights)
    }

    fn center(&mut self) {
        let Some(first) = self.points.first().copied() else {
            return;
        };
        self.magnitude = self.points.iter().fold(0.0, |m: f64, p| m.max(p.amax()));
        // Relative to the first point, so that a far origin costs no digits.
        for p in &mut self.points {
            *p -= first;
        }
        let offset = self.centroid();
        self.origin = first + offset;
        for p in &mut self.points {
            *p -= offset;
        }
    }

    /// Weighted mean of all points, relative to the origin.
    fn centroid(&self) -> Vector3<f64> {
        let weighted = self
            .points
            .iter()
            .enumerate()
            .map(|(k, x)| x * self.weight(k));
        weighted.sum::<Vector3<f64>>() / self.total(0..self.points.len()).max(f64::MIN_POSITIVE)
    }

    /// Weight of point k; 1 where all are alike.
    #[inline]
    #[must_use]
    pub fn weight(&self, k: usize) -> f64 {
        self.weights.get(k).copied().unwrap_or(1.0)
    }

    /// Sum of the weights of some points: their number where all are alike.
    #[must_use]
    pub fn total(&self, points: std::ops::Range<usize>) -> f64 {
        match self.weights.as_slice() {
            [] => points.len() as f64,
            weights => weights[points].iter().sum(),
        }
    }

    /// The points of marker p.
    #[must_use]
    pub fn range(&self, p: usize) -> std::ops::Range<usize> {
        self.starts[p]..self.starts[p + 1]
    }

    /// Number of markers kept.
    #[must_use]
    pub fn markers(&self) -> usize {
        self.starts.len() - 1
    }

    /// The rows in which a marker was seen, in the caller's order.
    #[must_use]
    pub fn rows(&self) -> Vec<CloudRow> {
        let count = self.labels.iter().map(|l| l.1 + 1).max().unwrap_or(0);
        let mut rows: Vec<CloudRow> = (0..count)
            .map(|row| CloudRow {
                row,
                markers: Vec::new(),
                weight: 1.0,
            })
            .collect();
        for p in 0..self.markers() {
            for k in self.range(p) {
                let row = &mut rows[self.labels[k].1];
                row.markers.push((p, self.points[k]));
                row.weight = self.weight(k);
            }
        }
        rows.retain(|r| !r.markers.is_empty());
        rows
    }

    /// Samples of marker p, relative to the origin.
    #[must_use]
    pub fn marker(&self, p: usize) -> &[Vector3<f64>] {
        &self.points[self.range(p)]
    }

    /// Samples of marker p with their weights.
    pub fn samples(&self, p: usize) -> impl Iterator<Item = (Vector3<f64>, f64)> + Clone {
        self.range(p).map(|k| (self.points[k], self.weight(k)))
    }

    /// The cloud restricted to points whose flag is set.
    #[must_use]
    pub fn select(&self, keep: &[bool]) -> Self {
        let mut out = Self {
            origin: self.origin,
            points: Vec::with_capacity(self.points.len()),
            starts: vec![0],
            labels: Vec::new(),
            covariances: Vec::new(),
            weights: Vec::new(),
            magnitude: self.magnitude,
        };
        for p in 0..self.markers() {
            let range = self.range(p);
            if range.clone().filter(|&k| keep[k]).count() < 2 {
                continue;
            }
            for k in range.filter(|&k| keep[k]) {
                out.points.push(self.points[k]);
                out.labels.push(self.labels[k]);
                if !self.covariances.is_empty() {
                    out.covariances.push(self.covariances[k]);
                }
                out.weights.extend(self.weights.get(k));
            }
            out.starts.push(out.points.len());
        }
        // The algebraic fits assume the common centroid as origin.
        let shift = out.centroid();
        out.origin += shift;
        for p in &mut out.points {
            *p -= shift;
        }
        out
    }
}

/// What the markers of a body show in one row.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct CloudRow {
    /// Row in the caller's tables.
    pub row: usize,
    /// The markers that were seen (of those kept) and where, relative to the cloud's origin.
    pub markers: Vec<(usize, Vector3<f64>)>,
    /// Weight of the row.
    pub weight: f64,
}

/// Place of the first list that no other one exceeds in length; 0 where there is none.
#[must_use]
pub fn longest<T>(lists: &[Vec<T>]) -> usize {
    (0..lists.len()).fold(0, |best, i| {
        if lists[i].len() > lists[best].len() {
            i
        } else {
            best
        }
    })
}

/// Data that no estimator can read.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DataError {
    /// A weight that is negative or no number.
    #[error("row {row}: the weight {weight} is not a finite number from 0 up")]
    NotWeight {
        /// Row of the weight.
        row: usize,
        /// The weight.
        weight: f64,
    },
    /// NaN or infinity in the data.
    #[error("marker {marker}, row {row}: not a finite number")]
    NotFinite {
        /// Index of the marker (0 for poses).
        marker: usize,
        /// Row of the sample.
        row: usize,
    },
    /// A matrix that is scaled, sheared or reflected.
    #[error("row {row}: not a rotation (RᵀR differs from I by {defect:.1e}, det {determinant:.3})")]
    NotRotation {
        /// Row of the sample.
        row: usize,
        /// Sum of the entries of |RᵀR − I|.
        defect: f64,
        /// Determinant.
        determinant: f64,
    },
    /// A covariance that is not positive definite.
    #[error("marker {marker}, row {row}: the covariance is not positive definite")]
    NotCovariance {
        /// Index of the marker.
        marker: usize,
        /// Row of the sample.
        row: usize,
    },
    /// Two tables that must have the same length do not.
    #[error("{what} differ in number: {left} and {right}")]
    Lengths {
        /// Which tables.
        what: &'static str,
        /// Length of the first.
        left: usize,
        /// Length of the second.
        right: usize,
    },
}

impl DataError {
    /// The verdict word that belongs to this error, for those that describe data.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        match self {
            Self::NotFinite { .. } => Some(Verdict::NotFinite),
            Self::NotRotation { .. } => Some(Verdict::NotRotation),
            Self::NotCovariance { .. } | Self::NotWeight { .. } | Self::Lengths { .. } => None,
        }
    }
}
