//! How well a loop closes: the two ways around it, sample by sample.
//!
//! ```text
//! E_s = left_s⁻¹ · right_s,   e_t = |t(E_s)| (m),   e_θ = angle of R(E_s) (rad)                 (1)
//! ```
//!
//! ⟨e_t, e_θ⟩ are the means over the samples.

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

/// Mean, standard deviation, largest and rms of a set of norms.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Sample standard deviation (n − 1); 0 for fewer than two.
    pub std: f64,
    /// Largest.
    pub max: f64,
    /// Root mean square.
    pub rms: f64,
}

impl Spread {
    /// Of norms; all zero when there are none.
    #[must_use]
    pub fn of(norms: &[f64]) -> Self {
        let n = norms.len() as f64;
        if norms.is_empty() {
            return Self::default();
        }
        let mean = norms.iter().sum::<f64>() / n;
        let rms = (norms.iter().map(|x| x * x).sum::<f64>() / n).sqrt();
        let variance = if norms.len() < 2 {
            0.0
        } else {
            norms.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0)
        };
        Self {
            mean,
            std: variance.sqrt(),
            max: norms.iter().copied().fold(0.0, f64::max),
            rms,
        }
    }
}

/// Closure errors over the samples of one loop.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ClosureStatistics {
    /// Number of samples.
    pub samples: usize,
    /// e_t, m.
    pub translation: Spread,
    /// e_θ, rad.
    pub rotation: Spread,
}

impl ClosureStatistics {
    /// Equation (1) over pairs of `a_from_b`, one by each way around the loop; swapping the sides
    /// changes nothing.
    #[must_use]
    pub fn of(pairs: &[(Isometry3<f64>, Isometry3<f64>)]) -> Self {
        let errors: Vec<(f64, f64)> = pairs
            .iter()
            .map(|(left, right)| {
                let e = left.inverse() * right;
                (e.translation.vector.norm(), e.rotation.angle())
            })
            .collect();
        Self {
            samples: pairs.len(),
            translation: Spread::of(&errors.iter().map(|e| e.0).collect::<Vec<_>>()),
            rotation: Spread::of(&errors.iter().map(|e| e.1).collect::<Vec<_>>()),
        }
    }
}
