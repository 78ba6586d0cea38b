//! The pose of a body in every row, how certain it is, and how rigid the body was.

use super::learn::{MarkerFit, NotABody, Template, register};
use crate::statistics::median;
use calib_finding::nearest_word;
use calib_recording::Poses;
use nalgebra::{Isometry3, Matrix3, Matrix6, Point3};
use rayon::prelude::*;
use std::ops::AddAssign;

/// One row's pose.
#[derive(Clone, Debug, PartialEq)]
pub struct RowPose {
    /// `tracker_from_body`.
    pub tracker_from_body: Isometry3<f64>,
    /// Markers used.
    pub markers: usize,
    /// Root mean square distance of the markers from the template, m.
    pub rms: f64,
    /// Covariance in the body frame, `[ω; v]`, rad² and m², from [`BodyPoses::sigma`]: eq. (2) of the module.
    /// `None` when σ is not known.
    pub covariance: Option<Matrix6<f64>>,
}

/// Why a row has no pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WithoutPose {
    /// Fewer than three markers were seen.
    TooFewSeen {
        /// Markers seen.
        seen: usize,
    },
    /// Those seen lie on a line.
    OnALine {
        /// Markers seen.
        seen: usize,
    },
}

/// A body over all rows.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyPoses {
    /// Where the markers sit.
    pub template: Template,
    /// A pose, or why there is none, for every row.
    pub rows: Vec<Result<RowPose, WithoutPose>>,
    /// Standard deviation of one marker coordinate, m: given, or estimated from the residuals. `None` when there
    /// is nothing to estimate it from (three markers in one row fit exactly).
    pub sigma: Option<f64>,
    /// How well each marker keeps its place.
    pub fits: Vec<MarkerFit>,
}

impl BodyPoses {
    /// `tracker_from_body` per row; `None` where there is none.
    pub fn track(&self) -> Vec<Option<Isometry3<f64>>> {
        self.rows
            .iter()
            .map(|row| row.as_ref().ok().map(|pose| pose.tracker_from_body))
            .collect()
    }

    /// The marker that moves on the body and by how much (m, [`MarkerFit::wandering`]), if one does by more than
    /// `limit`.
    pub fn moving_marker(&self, limit: f64) -> Option<(&MarkerFit, f64)> {
        let worst = self
            .fits
            .iter()
            .max_by(|a, b| a.wandering.total_cmp(&b.wandering))?;
        (worst.wandering > limit).then_some((worst, worst.wandering))
    }
}

/// Poses of a body from its markers' tracks (as [`Template::learn`]); the template is learned when `template` is
/// `None`, and σ estimated when `sigma` (m, per coordinate) is `None`.
///
/// # Errors
/// [`NotABody`] when the template cannot be learned or a track is missing or has another length.
pub fn body_poses(
    names: &[String],
    tracks: &[&[Option<Point3<f64>>]],
    template: Option<Template>,
    sigma: Option<f64>,
) -> Result<BodyPoses, NotABody> {
    let learned = template.is_none();
    let template = match template {
        Some(template) => template,
        None => Template::learn(names, tracks)?,
    };
    if template.points.len() != tracks.len() {
        return Err(NotABody::TooFewMarkers { got: tracks.len() });
    }
    let n = tracks.iter().map(|track| track.len()).max().unwrap_or(0);
    if let Some(i) = tracks.iter().position(|track| track.len() != n) {
        return Err(NotABody::Length {
            name: template.names[i].clone(),
            got: tracks[i].len(),
            expected: n,
        });
    }
    let mut squares = vec![0.0; tracks.len()];
    let mut seen_rows = vec![0usize; tracks.len()];
    let mut worst = vec![(0.0, 0usize); tracks.len()];
    let mut freedom = if learned {
        6.0 - 3.0 * tracks.len() as f64
    } else {
        0.0
    };
    let mut rows = Vec::with_capacity(n);
    let registered = (0..n).into_par_iter().with_min_len(AT_ONCE);
    let registered: Vec<_> = registered
        .map(|row| registered_row(&template, tracks, row))
        .collect();
    for (row, registered) in registered.into_iter().enumerate() {
        let (pose, distances) = match registered {
            Ok(registered) => registered,
            Err(why) => {
                rows.push(Err(why));
                continue;
            }
        };
        for &(k, distance) in &distances {
            squares[k] += distance * distance;
            seen_rows[k] += 1;
            if distance > worst[k].0 {
                worst[k] = (distance, row);
            }
        }
        freedom += 3.0 * distances.len() as f64 - 6.0;
        rows.push(Ok(pose));
    }
    let total: f64 = squares.iter().sum();
    let sigma = sigma.or_else(|| (freedom > 0.0).then(|| (total / freedom).sqrt()));
    for pose in rows.iter_mut().flatten() {
        let scaled = |unit: Matrix6<f64>| sigma.map(|sigma| symmetric(unit * (sigma * sigma)));
        pose.covariance = pose.covariance.and_then(scaled);
    }
    let wandering = wandering(tracks, n);
    let fits = template
        .names
        .iter()
        .enumerate()
        .map(|(k, name)| MarkerFit {
            name: name.clone(),
            rows: seen_rows[k],
            rms: (squares[k] / seen_rows[k].max(1) as f64).sqrt(),
            worst: worst[k],
            wandering: wandering[k],
        })
        .collect();
    Ok(BodyPoses {
        template,
        rows,
        sigma,
        fits,
    })
}

/// Rows that a thread registers at once: half a millisecond.
const AT_ONCE: usize = 256;

/// The pose of one row, its covariance for σ = 1, and the distance of every marker that was seen, m, by its place.
fn registered_row(
    template: &Template,
    tracks: &[&[Option<Point3<f64>>]],
    row: usize,
) -> Result<(RowPose, Vec<(usize, f64)>), WithoutPose> {
    let seen: Vec<usize> = (0..tracks.len())
        .filter(|&k| tracks[k][row].is_some())
        .collect();
    let from: Vec<Point3<f64>> = seen.iter().map(|&k| template.points[k]).collect();
    let to: Vec<Point3<f64>> = seen.iter().filter_map(|&k| tracks[k][row]).collect();
    let Some(tracker_from_body) = register(&from, &to) else {
        let count = seen.len();
        return Err(if count < 3 {
            WithoutPose::TooFewSeen { seen: count }
        } else {
            WithoutPose::OnALine { seen: count }
        });
    };
    let pairs = from.iter().zip(&to);
    let distances = pairs.map(|(m, p)| (tracker_from_body * m - p).norm());
    let distances: Vec<(usize, f64)> = seen.iter().copied().zip(distances).collect();
    let sum: f64 = distances.iter().map(|(_, d)| d * d).sum();
    let pose = RowPose {
        tracker_from_body,
        markers: seen.len(),
        rms: (sum / seen.len() as f64).sqrt(),
        covariance: information(&from).try_inverse(),
    };
    Ok((pose, distances))
}

/// [`body_poses`] of markers of a table, by name; their order defines the body's frame.
///
/// # Errors
/// As [`body_poses`], and [`NotABody::UnknownMarker`].
pub fn body_from_markers(
    poses: &Poses,
    markers: &[String],
    template: Option<Template>,
    sigma: Option<f64>,
) -> Result<BodyPoses, NotABody> {
    let track = |name: &String| {
        poses.markers.get(name).map(Vec::as_slice).ok_or_else(|| {
            let known: Vec<&str> = poses.markers.keys().map(String::as_str).collect();
            let nearest = nearest_word(name, known.iter().copied()).map(str::to_owned);
            NotABody::UnknownMarker {
                name: name.clone(),
                known: known.join(", "),
                nearest,
            }
        })
    };
    let tracks = markers.iter().map(track).collect::<Result<Vec<_>, _>>()?;
    body_poses(markers, &tracks, template, sigma)
}

/// Σ J_kᵀ J_k with J_k = [ −[m_k]ₓ  I ].
fn information(points: &[Point3<f64>]) -> Matrix6<f64> {
    let mut sum = Matrix6::zeros();
    for m in points {
        let cross = m.coords.cross_matrix();
        sum.fixed_view_mut::<3, 3>(0, 0)
            .add_assign(&(cross.transpose() * cross));
        // (−[m]ₓ)ᵀ·I = [m]ₓ
        sum.fixed_view_mut::<3, 3>(0, 3).add_assign(&cross);
        sum.fixed_view_mut::<3, 3>(3, 0)
            .add_assign(&cross.transpose());
        sum.fixed_view_mut::<3, 3>(3, 3)
            .add_assign(&Matrix3::identity());
    }
    sum
}

fn symmetric(m: Matrix6<f64>) -> Matrix6<f64> {
    (m + m.transpose()) * 0.5
}

/// For each marker the lower median, over the others, of the scatter of their distance. The scatter is σ of a Gaussian
/// from the 80 % quantile: gross outliers in a tenth of the samples of each marker do not count.
fn wandering(tracks: &[&[Option<Point3<f64>>]], rows: usize) -> Vec<f64> {
    /// Φ⁻¹(0.9), the 80 % quantile of |x|.
    const QUANTILE: f64 = 1.2816;
    let count = tracks.len();
    let mut scatters = vec![Vec::new(); count];
    for i in 0..count {
        for j in 0..i {
            let both = (0..rows).filter_map(|row| Some((tracks[i][row]?, tracks[j][row]?)));
            let distances: Vec<f64> = both.map(|(a, b)| (a - b).norm()).collect();
            let Some(middle) = median(distances.clone()).filter(|_| distances.len() >= 2) else {
                continue;
            };
            let mut off: Vec<f64> = distances.iter().map(|d| (d - middle).abs()).collect();
            off.sort_by(f64::total_cmp);
            let scatter = off[(off.len() - 1) * 4 / 5] / QUANTILE;
            scatters[i].push(scatter);
            scatters[j].push(scatter);
        }
    }
    scatters
        .into_iter()
        .map(|mut all: Vec<f64>| {
            all.sort_by(f64::total_cmp);
            all.get(all.len().saturating_sub(1) / 2)
                .copied()
                .unwrap_or(0.0)
        })
        .collect()
}
