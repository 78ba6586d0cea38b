use crate::{JointValue, Outcome};
use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::BTreeSet;

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

/// The same held-out poses with three models.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HeldOut {
    /// Number of errors: one per posture and body (or marker).
    pub n: usize,
    /// Number of robot postures: several bodies may be measured in one.
    #[serde(default)]
    pub postures: usize,
    /// The nominal URDF, mounts and tracker as the profile states them; null when the profile states none.
    pub nominal: Option<ErrorStats>,
    /// The nominal URDF after the best rigid registration of tracker and mounts: a calibration must do better.
    pub registration_only: Option<ErrorStats>,
    /// The calibrated robot.
    pub calibrated: Option<ErrorStats>,
    /// Orientation errors of the same three, where a body's orientation is measured; null where none is.
    #[serde(default)]
    pub orientation: Option<OrientationErrors>,
    /// The quantity: "position of gripM".
    #[serde(default)]
    pub quantity: String,
    /// The error expected on a new pose of the same kind.
    #[serde(default)]
    pub expected: Option<ExpectedError>,
    /// The pose with the largest calibrated error.
    #[serde(default)]
    pub worst: Option<PoseError>,
    /// All poses, in the order of the recording.
    #[serde(default)]
    pub poses: Vec<PoseError>,
}

impl HeldOut {
    /// Summarize the poses: [`ErrorStats`] per model over the poses that have it, the expected error with its 95 % interval, the worst pose.
    #[must_use]
    pub fn from_poses(quantity: impl Into<String>, poses: Vec<PoseError>) -> Self {
        let lengths = |error: fn(&PoseError) -> Option<f64>| {
            poses.iter().filter_map(error).collect::<Vec<_>>()
        };
        let over = |error| ErrorStats::of(&lengths(error));
        let angles = |error| AngleStats::of(&lengths(error));
        let orientation = OrientationErrors {
            nominal: angles(|pose| pose.nominal_rad),
            registration_only: angles(|pose| pose.registration_only_rad),
            calibrated: angles(|pose| pose.calibrated_rad),
        };
        let postures: BTreeSet<&str> = poses.iter().map(|pose| pose.pose.as_str()).collect();
        let calibrated: Vec<f64> = poses.iter().filter_map(|pose| pose.calibrated_m).collect();
        let worst = poses
            .iter()
            .filter(|pose| pose.calibrated_m.is_some_and(f64::is_finite))
            .max_by(|a, b| {
                a.calibrated_m
                    .unwrap_or(0.0)
                    .total_cmp(&b.calibrated_m.unwrap_or(0.0))
            })
            .cloned();
        let vectors: Vec<[f64; 3]> = poses.iter().filter_map(|pose| pose.vector_m).collect();
        let expected = if vectors.len() == calibrated.len() {
            ExpectedError::from_vectors(&vectors, 0.95)
        } else {
            ExpectedError::from_lengths(&calibrated, 0.95)
        };
        Self {
            n: poses.len(),
            postures: postures.len(),
            orientation: (orientation != OrientationErrors::default()).then_some(orientation),
            nominal: over(|pose| pose.nominal_m),
            registration_only: over(|pose| pose.registration_only_m),
            calibrated: ErrorStats::of(&calibrated),
            quantity: quantity.into(),
            expected,
            worst,
            poses,
        }
    }
}

/// One held-out pose.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PoseError {
    /// The posture's label: `check 7`. Errors of one posture share it.
    pub pose: String,
    /// The body or marker whose error it is; empty where there is only one.
    #[serde(default)]
    pub subject: String,
    /// The validation group it belongs to (a torso angle); empty when there is one group.
    pub group: String,
    /// Joint positions.
    pub joints: Vec<JointValue>,
    /// Distance between predicted and observed with the nominal robot, m.
    pub nominal_m: Option<f64>,
    /// The same after registration only, m.
    pub registration_only_m: Option<f64>,
    /// The same with the calibrated robot, m.
    pub calibrated_m: Option<f64>,
    /// predicted − observed with the calibrated robot, in the tracker frame, m.
    pub vector_m: Option<[f64; 3]>,
    /// Angle between predicted and observed orientation with the nominal robot, rad; null where no orientation is measured.
    #[serde(default)]
    pub nominal_rad: Option<f64>,
    /// The same after registration only, rad.
    #[serde(default)]
    pub registration_only_rad: Option<f64>,
    /// The same with the calibrated robot, rad.
    #[serde(default)]
    pub calibrated_rad: Option<f64>,
}

impl PoseError {
    /// Posture and body for people.
    #[must_use]
    pub fn label(&self) -> String {
        if self.subject.is_empty() {
            self.pose.clone()
        } else {
            format!("{} {}", self.pose, self.subject)
        }
    }
}

/// Orientation errors of the same held-out poses under three models.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OrientationErrors {
    /// As [`HeldOut::nominal`].
    pub nominal: Option<AngleStats>,
    /// As [`HeldOut::registration_only`].
    pub registration_only: Option<AngleStats>,
    /// As [`HeldOut::calibrated`].
    pub calibrated: Option<AngleStats>,
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
            p95_m: quantile(&sorted, 0.95),
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

fn sorted_finite(values: &[f64]) -> Option<Vec<f64>> {
    let mut finite: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
    finite.sort_by(f64::total_cmp);
    (!finite.is_empty()).then_some(finite)
}

/// Quantile of sorted values, linear between the order statistics (Hyndman and Fan's type 7).
pub(crate) fn quantile(sorted: &[f64], p: f64) -> f64 {
    let position = p * (sorted.len() - 1) as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (position - below as f64) * (sorted[above] - sorted[below])
}

/// The error to expect on a new pose drawn like the held-out ones.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ExpectedError {
    /// Root mean square over poses, m.
    pub rms_m: f64,
    /// Lower end of the rms' interval, m.
    pub low_m: f64,
    /// Upper end of the rms' interval, m.
    pub high_m: f64,
    /// Confidence of the interval, in (0, 1).
    pub confidence: f64,
}

impl ExpectedError {
    /// From the held-out residual vectors, m: rms of their lengths with a χ² interval; `None` for fewer than two finite ones.
    ///
    /// The squared length of a position error is about `a·χ²_ν` with ν = tr(M)² / tr(M²), M the second moments of the vectors:
    /// 1 where one direction dominates, 3 where none does. n independent poses have nν degrees of freedom:
    ///
    /// ```text
    /// rms · √(nν / χ²_{nν}(1 − α/2))  …  rms · √(nν / χ²_{nν}(α/2))
    /// ```
    ///
    /// Neighboring poses are not independent and make it too narrow.
    #[must_use]
    pub fn from_vectors(errors_m: &[[f64; 3]], confidence: f64) -> Option<Self> {
        let vectors: Vec<Vector3<f64>> = errors_m
            .iter()
            .map(|e| Vector3::from(*e))
            .filter(|e| e.iter().all(|x| x.is_finite()))
            .collect();
        let moments: Matrix3<f64> = vectors.iter().map(|e| e * e.transpose()).sum();
        let squares = (moments * moments).trace();
        let nu = if squares > 0.0 {
            moments.trace().powi(2) / squares
        } else {
            1.0
        };
        let lengths: Vec<f64> = vectors.iter().map(Vector3::norm).collect();
        Self::with_dof(&lengths, nu, confidence)
    }

    /// From lengths alone, m: as if one direction dominated (ν = 1), so the interval is not too narrow without the vectors.
    #[must_use]
    pub fn from_lengths(errors_m: &[f64], confidence: f64) -> Option<Self> {
        Self::with_dof(errors_m, 1.0, confidence)
    }

    fn with_dof(errors_m: &[f64], dof_per_pose: f64, confidence: f64) -> Option<Self> {
        let n = errors_m.iter().filter(|x| x.is_finite()).count();
        let rms = Stats::of(errors_m)?.rms;
        if n < 2 || !(0.0..1.0).contains(&confidence) {
            return None;
        }
        let dof = n as f64 * dof_per_pose;
        let chi_squared = ChiSquared::new(dof).ok()?;
        let tail = (1.0 - confidence) / 2.0;
        let end = |p: f64| rms * (dof / chi_squared.inverse_cdf(p)).sqrt();
        Some(Self {
            rms_m: rms,
            low_m: end(1.0 - tail),
            high_m: end(tail),
            confidence,
        })
    }
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
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn nothing_has_no_statistics() {
        assert_eq!(Stats::of(&[]), None);
        assert_eq!(Stats::of(&[f64::NAN]), None);
        assert_eq!(ErrorStats::of(&[]), None);
        assert_eq!(ExpectedError::from_lengths(&[1.0], 0.95), None);
        assert_eq!(ExpectedError::from_vectors(&[[1.0, 0.0, 0.0]], 0.95), None);
        let held_out = HeldOut::from_poses("tool", vec![PoseError::default()]);
        assert_eq!(
            (held_out.n, held_out.calibrated, held_out.worst),
            (1, None, None)
        );
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

    #[test]
    fn the_worst_pose_is_the_one_with_the_largest_calibrated_error() {
        let pose = |name: &str, error| PoseError {
            pose: name.into(),
            calibrated_m: error,
            nominal_m: Some(1.0),
            ..PoseError::default()
        };
        let held_out = HeldOut::from_poses(
            "tool",
            vec![
                pose("a", Some(1.0)),
                pose("b", Some(3.0)),
                pose("c", Some(f64::NAN)),
                pose("d", None),
            ],
        );
        assert_eq!(held_out.worst.expect("one is worst").pose, "b");
        assert_eq!(held_out.calibrated.expect("two poses").max_m, 3.0);
        assert_eq!(held_out.registration_only, None);
    }

    /// The 95 % interval holds the true rms in 92 to 99.9 % of simulated experiments: round and flat errors, few poses and many.
    #[test]
    fn the_interval_of_the_expected_error_is_honest() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut draw = |sigma: f64| -> f64 {
            let x: f64 = StandardNormal.sample(&mut rng);
            sigma * x
        };
        for axes in [[1.0, 1.0, 1.0], [1.0, 1.0, 0.1], [1.0, 0.1, 0.1]] {
            let truth = axes.iter().map(|a: &f64| a * a).sum::<f64>().sqrt();
            for n in [6, 10, 30] {
                let trials = 2000;
                let mut inside = [0, 0];
                for _ in 0..trials {
                    let vectors: Vec<[f64; 3]> = (0..n).map(|_| axes.map(&mut draw)).collect();
                    let lengths: Vec<f64> =
                        vectors.iter().map(|e| Vector3::from(*e).norm()).collect();
                    let holds =
                        |e: ExpectedError| usize::from(e.low_m <= truth && truth <= e.high_m);
                    inside[0] +=
                        holds(ExpectedError::from_vectors(&vectors, 0.95).expect("enough poses"));
                    inside[1] +=
                        holds(ExpectedError::from_lengths(&lengths, 0.95).expect("enough poses"));
                }
                let coverage = inside.map(|inside| inside as f64 / f64::from(trials));
                assert!(
                    (0.92..0.999).contains(&coverage[0]),
                    "axes {axes:?}, n = {n}: {coverage:?}"
                );
                assert!(coverage[1] >= 0.93, "axes {axes:?}, n = {n}: {coverage:?}");
            }
        }
    }
}
