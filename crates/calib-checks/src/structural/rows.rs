//! Rows that deviate from the registration of all others: which of their samples, and as what motion of the whole body.
//!
//! With p_k the predicted and s_k the seen points of a body in a row, means p̄ and s̄,
//!
//! ```text
//! R = argmin over SO(3) of Σ |(s_k − s̄) − R (p_k − p̄)|²,   angle |log R|,   shift |s̄ − p̄|
//! ```

use calib_geometry::so3;
use nalgebra::{Matrix3, Vector3};

use super::data::{Data, DataError, Measured};
use super::ids::{BodyIndex, SampleIndex};
use super::scan::{Fit, Scan};
use super::screen::screen;

/// Points that span a plane, from which an orientation follows.
const ENOUGH_POINTS: usize = 3;

/// A body in a row in which at least one sample is a gross outlier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Row of the input.
    pub row: usize,
    /// Body.
    pub body: BodyIndex,
    /// Samples of the body in this row: markers, or 1 for a pose.
    pub seen: usize,
    /// Gross outliers among them.
    pub off: usize,
    /// Root mean square distance from the prediction, m.
    pub distance: f64,
    /// Rotation of the pattern against the prediction, rad; `None` for fewer than three points.
    pub angle: Option<f64>,
    /// Displacement of the pattern's centroid, m.
    pub shift: f64,
    /// What the rotation and the displacement leave, rms, m.
    pub bent: f64,
}

impl Deviation {
    /// Most samples of the body are off: the row as a whole deviates, not one marker.
    #[must_use]
    pub fn whole(&self) -> bool {
        3 * self.off >= 2 * self.seen
    }
}

/// Deviating rows, and the scale that they are measured by.
#[derive(Debug, Clone, PartialEq)]
pub struct Deviations {
    /// Robust standard deviation of a residual coordinate, m; nominal errors are part of it.
    pub scale: f64,
    /// In the order of rows and bodies.
    pub rows: Vec<Deviation>,
}

/// The rows that deviate from the registration of the data as they are.
///
/// # Errors
/// [`DataError`] when the input contradicts itself.
pub fn deviations(data: &Data) -> Result<Deviations, DataError> {
    data.check()?;
    let screened = screen(data, &[]);
    let scan = Scan::new(data, &screened.samples);
    let fit = scan.fit(None);
    // The same layout with the outliers, whose places are compared with the prediction.
    let all = Scan::new(data, &[]);
    let mut rows: Vec<Deviation> = Vec::new();
    for sample in &screened.samples {
        match rows.last_mut() {
            Some(last) if (last.row, last.body) == (sample.row, sample.body) => last.off += 1,
            _ => rows.extend(deviation(&all, &fit, sample)),
        }
    }
    Ok(Deviations {
        scale: screened.scale,
        rows,
    })
}

fn deviation(scan: &Scan<'_>, fit: &Fit, sample: &SampleIndex) -> Option<Deviation> {
    let (i, n) = (sample.row, scan.channels.len());
    let pairs: Vec<(Vector3<f64>, Vector3<f64>)> = (0..n)
        .filter(|&k| scan.channels[k].body == sample.body.0 && scan.weights[i * n + k] > 0.0)
        .map(|k| (scan.predicted(fit, i, k).0, scan.seen(fit, i, k)))
        .collect();
    let count = pairs.len() as f64;
    let pose = matches!(
        scan.data.bodies[sample.body.0].measured,
        Measured::Poses { .. }
    );
    let from: Vector3<f64> = pairs.iter().map(|p| p.0).sum::<Vector3<f64>>() / count;
    let to: Vector3<f64> = pairs.iter().map(|p| p.1).sum::<Vector3<f64>>() / count;
    let spread: Matrix3<f64> = pairs
        .iter()
        .map(|(p, s)| (s - to) * (p - from).transpose())
        .sum();
    let turned = (pairs.len() >= ENOUGH_POINTS)
        .then(|| so3::nearest_rotation(&spread))
        .flatten();
    let rms = |sum: f64| (sum / count).sqrt();
    let left = |(p, s): &(Vector3<f64>, Vector3<f64>)| {
        let moved = turned.map_or(p - from, |r| r * (p - from));
        (s - to - moved).norm_squared()
    };
    (count > 0.0).then(|| Deviation {
        row: i,
        body: sample.body,
        seen: if pose { 1 } else { pairs.len() },
        off: 1,
        distance: rms(pairs.iter().map(|(p, s)| (s - p).norm_squared()).sum()),
        angle: turned.map(|r| r.angle()),
        shift: (to - from).norm(),
        bent: rms(pairs.iter().map(left).sum()),
    })
}
