//! Samples that are off their body, told by the distances to its other markers, which no motion changes.
//!
//! ```text
//! s_jk = q₈₀(|d_jk − median d_jk|) / 1.28       over the rows that show both
//! d_jk of a row is wrong where   |d_jk − median d_jk| > max(8 s_jk, 8 √2 σ, 0.4 mm)                    (1)
//! ```
//!
//! In a row with wrong distances the markers with most of them leave, until none is left.
//!
//! A mean over the rows gives a marker that was taken for another one its full weight: nine samples of 160 that were off by 10 to 70 mm turned
//! the learned frame of a body by 4°. Where a marker is often off, its scatter s is large, and nothing is left out: the body is not rigid.

use calib_geometry::pairs::is_compared;
use nalgebra::Point3;

use crate::statistics::median;

/// Gaussian distances stay within this many σ.
const SIGMAS: f64 = 8.0;
/// Deviation of a distance that is never gross, m: refraction and calibration of good trackers.
const SMALLEST: f64 = 4e-4;
/// Φ⁻¹(0.9): the 80 % quantile of |x| of a Gaussian, which gross errors in a tenth of the samples of each marker hardly move.
const QUANTILE: f64 = 1.2816;
/// Fewer distances have no scatter to speak of.
const FEWEST: usize = 5;
/// Rows with a gross sample are the exception; otherwise the shape is another one in this recording.
const MOST: f64 = 0.34;

/// Usual distances of the markers of a body, and how far they stray.
#[derive(Debug, Clone, PartialEq)]
pub struct Distances {
    /// Marker, other marker, median (m), largest deviation that is not gross (m).
    pairs: Vec<(usize, usize, f64, f64)>,
}

type Track = [Option<Point3<f64>>];

impl Distances {
    /// Of marker tracks, one entry per row, m; `sigma`: noise of a coordinate, m, where it is stated.
    #[must_use]
    pub fn of(tracks: &[&Track], sigma: Option<f64>) -> Self {
        let mut pairs = Vec::new();
        for j in 0..tracks.len() {
            for k in (0..j).filter(|k| is_compared(j, *k, tracks.len())) {
                let both = tracks[j].iter().zip(tracks[k]);
                let all: Vec<f64> = both
                    .filter_map(|(a, b)| Some((a.as_ref()? - b.as_ref()?).norm()))
                    .collect();
                let Some(middle) = median(all.clone()).filter(|_| all.len() >= FEWEST) else {
                    continue;
                };
                let mut off: Vec<f64> = all.iter().map(|d| (d - middle).abs()).collect();
                off.sort_by(f64::total_cmp);
                let scatter = off[(off.len() - 1) * 4 / 5] / QUANTILE;
                let noise = sigma.unwrap_or(0.0) * std::f64::consts::SQRT_2;
                let limit = (SIGMAS * scatter.max(noise)).max(SMALLEST);
                pairs.push((j, k, middle, limit));
            }
        }
        Self { pairs }
    }

    /// The tracks of one recording without its gross samples (1).
    #[must_use]
    pub fn without_gross(&self, tracks: &[&Track]) -> Vec<Vec<Option<Point3<f64>>>> {
        let mut kept: Vec<Vec<Option<Point3<f64>>>> = tracks.iter().map(|t| t.to_vec()).collect();
        let rows = tracks.iter().map(|track| track.len()).min().unwrap_or(0);
        let mut spoiled = 0;
        for row in 0..rows {
            let gross = self.gross(tracks, row);
            spoiled += usize::from(!gross.is_empty());
            for marker in gross {
                kept[marker][row] = None;
            }
        }
        if spoiled as f64 > MOST * rows as f64 {
            return tracks.iter().map(|t| t.to_vec()).collect();
        }
        kept
    }

    /// Markers of a row that leave, those with most wrong distances first, until no distance is wrong.
    fn gross(&self, tracks: &[&Track], row: usize) -> Vec<usize> {
        let is_wrong = |&&(j, k, middle, limit): &&(usize, usize, f64, f64)| {
            let seen = tracks[j][row].zip(tracks[k][row]);
            seen.is_some_and(|(a, b)| ((a - b).norm() - middle).abs() > limit)
        };
        let mut wrong: Vec<(usize, usize)> = self
            .pairs
            .iter()
            .filter(is_wrong)
            .map(|(j, k, ..)| (*j, *k))
            .collect();
        let mut gross = Vec::new();
        while !wrong.is_empty() {
            let mut count = vec![0_usize; tracks.len()];
            for &(j, k) in &wrong {
                count[j] += 1;
                count[k] += 1;
            }
            let most = count.iter().copied().max().unwrap_or(0);
            let worst: Vec<usize> = (0..count.len()).filter(|&m| count[m] == most).collect();
            wrong.retain(|(j, k)| !worst.contains(j) && !worst.contains(k));
            gross.extend(worst);
        }
        gross
    }
}
