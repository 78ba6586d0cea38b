use crate::{HeldOut, Outcome};
use calib_geometry::statistics::quantile_type7;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Errors on data that took no part in the fit.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Verification {
    /// Held-out poses; null when there were none.
    pub held_out: Option<HeldOut>,
    /// Whether the verification could be done at all, and how it ended.
    #[serde(default)]
    pub outcome: Outcome,
    /// Why it was not evaluated; empty otherwise.
    #[serde(default)]
    pub reason: String,
}

/// Angles over poses, rad.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AngleStats {
    /// Mean.
    pub mean_rad: f64,
    /// Root of the mean square.
    pub rms_rad: f64,
    /// 95 % quantile, linearly interpolated.
    pub p95_rad: f64,
    /// Largest.
    pub max_rad: f64,
}

impl AngleStats {
    /// Of angles; `None` without any finite one.
    #[must_use]
    pub fn of(angles_rad: &[f64]) -> Option<Self> {
        let stats = ErrorStats::of(angles_rad)?;
        Some(Self {
            mean_rad: stats.mean_m,
            rms_rad: stats.rms_m,
            p95_rad: stats.p95_m,
            max_rad: stats.max_m,
        })
    }
}

/// Error lengths over poses, m.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ErrorStats {
    /// Mean.
    pub mean_m: f64,
    /// Root of the mean square.
    pub rms_m: f64,
    /// 95 % quantile, linearly interpolated.
    pub p95_m: f64,
    /// Largest.
    pub max_m: f64,
}

impl ErrorStats {
    /// Of error lengths; `None` without any finite one.
    #[must_use]
    pub fn of(errors_m: &[f64]) -> Option<Self> {
        let sorted = sorted_finite(errors_m)?;
        let stats = Stats::of(&sorted)?;
        Some(Self {
            mean_m: stats.mean,
            rms_m: stats.rms,
            p95_m: quantile_type7(&sorted, 0.95)?,
            max_m: stats.max,
        })
    }
}

/// Mean, standard deviation, largest, rms of lengths or angles, in the unit of the key that holds it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Stats {
    /// Mean.
    pub mean: f64,
    /// Standard deviation over the samples (n − 1); 0 for one sample.
    pub std: f64,
    /// Largest.
    pub max: f64,
    /// Root of the mean square.
    pub rms: f64,
}

impl Stats {
    /// Of magnitudes; values that are not finite are skipped; `None` when none is finite.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        let values = sorted_finite(values)?;
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let rms = (values.iter().map(|x| x * x).sum::<f64>() / n).sqrt();
        let squares: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
        let std = if values.len() > 1 {
            (squares / (n - 1.0)).sqrt()
        } else {
            0.0
        };
        Some(Self {
            mean,
            std,
            max: values[values.len() - 1],
            rms,
        })
    }
}

impl Stats {
    /// 95 % interval of the mean of `n` independent values (Student's t); `None` for fewer than two.
    #[must_use]
    pub fn mean_interval(&self, n: usize) -> Option<(f64, f64)> {
        let freedom = n.checked_sub(1).filter(|f| *f > 0)? as f64;
        let t = StudentsT::new(0.0, 1.0, freedom).ok()?.inverse_cdf(0.975);
        let half = t * self.std / (n as f64).sqrt();
        Some((self.mean - half, self.mean + half))
    }
}

pub(crate) fn sorted_finite(values: &[f64]) -> Option<Vec<f64>> {
    let mut finite: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
    finite.sort_by(f64::total_cmp);
    (!finite.is_empty()).then_some(finite)
}

/// A loop of two paths to one frame: measured against forward kinematics.
///
/// `ΔT = measured⁻¹ · kinematic`, e_t its translation, e_θ its rotation angle (the paper's §5.3).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LoopClosure {
    /// The loop's name in the profile.
    pub name: String,
    /// Number of poses.
    pub samples: usize,
    /// ‖e_t‖ over all poses, m. It is the *vector* error: its length does not change with the frame it is expressed in.
    pub translation_m: Stats,
    /// |e_θ| over all poses, rad; null where the orientation is not part of the loop.
    pub rotation_rad: Option<Stats>,
    /// |‖t_measured‖ − ‖t_kinematic‖|, m: the paper's Table 2. A lower bound of the vector error.
    #[serde(default)]
    pub norm_error_m: Option<Stats>,
    /// The same per validation group (a torso angle), the columns of the paper's Table 1.
    #[serde(default)]
    pub groups: Vec<LoopGroup>,
    /// What distinguishes the groups: `torso angle`.
    #[serde(default)]
    pub grouped_by: String,
}

/// One column of the paper's Table 1.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LoopGroup {
    /// The column's heading: `90°`.
    pub name: String,
    /// Number of poses.
    pub samples: usize,
    /// ‖e_t‖, m.
    pub translation_m: Stats,
    /// |e_θ|, rad.
    pub rotation_rad: Option<Stats>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_has_no_statistics() {
        assert_eq!(Stats::of(&[]), None);
        assert_eq!(Stats::of(&[f64::NAN]), None);
        assert_eq!(ErrorStats::of(&[]), None);
    }

    #[test]
    fn statistics_by_hand() {
        let stats = Stats::of(&[3.0, 1.0, 2.0]).expect("three values");
        assert_eq!((stats.mean, stats.std, stats.max), (2.0, 1.0, 3.0));
        assert!((stats.rms - (14.0f64 / 3.0).sqrt()).abs() < 1e-15);
        assert_eq!(Stats::of(&[2.0]).expect("one value").std, 0.0);
        // 0..=20: the 95 % quantile is the value at position 19 of 20.
        let errors: Vec<f64> = (0..=20).map(f64::from).collect();
        assert_eq!(ErrorStats::of(&errors).expect("values").p95_m, 19.0);
    }

    /// t(2 degrees, 97.5 %) = 4.303.
    #[test]
    fn the_interval_of_a_mean_by_hand() {
        let (low, high) = Stats::of(&[1.0, 2.0, 3.0])
            .expect("values")
            .mean_interval(3)
            .expect("three");
        assert!(
            (high - 2.0 - 4.302_653 / 3f64.sqrt()).abs() < 1e-5,
            "{high}"
        );
        assert!((low + high - 4.0).abs() < 1e-12);
        assert_eq!(Stats::default().mean_interval(1), None);
    }
}
