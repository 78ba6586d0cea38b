//! Errors on poses that were not fitted.

mod expected;
mod screening;

use std::collections::{BTreeMap, BTreeSet};

use expected::{CONFIDENCE, Posture, interval};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{AngleStats, ErrorStats, JointValue};

pub use expected::ExpectedError;
pub use screening::screen;

/// The same held-out poses with three models.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HeldOut {
    /// Number of errors that count: one per posture and marker, or body whose pose is measured.
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
    /// What the patched URDF predicts without the joint effects that it cannot hold; null where there are none.
    #[serde(default)]
    pub urdf_alone: Option<ErrorStats>,
    /// What the URDF predicts that was fitted to be used without effects; null where there are none.
    #[serde(default)]
    pub urdf_refitted: Option<ErrorStats>,
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
    /// All poses, in the order of the recording, the screened ones included.
    #[serde(default)]
    pub poses: Vec<PoseError>,
    /// Whether no recording was held out and each fitted pose was left out in turn instead.
    #[serde(default)]
    pub left_out: bool,
    /// How many times larger errors of poses left out in turn are expected to be than those of the result, which has all poses;
    /// null where recordings are held out.
    #[serde(default)]
    pub left_out_over_all: Option<f64>,
    /// Errors that were screened out as gross outliers; nothing above counts them.
    #[serde(default)]
    pub screened: usize,
    /// The calibrated robot with the screened errors counted; null where none was screened.
    #[serde(default)]
    pub with_screened: Option<ErrorStats>,
    /// 95 % interval of the calibrated rms orientation error, rad; null where no orientation is measured.
    #[serde(default)]
    pub orientation_interval_rad: Option<[f64; 2]>,
    /// Mean square of the calibrated errors in units of their predicted covariance: about 1 where the stated uncertainty
    /// is right; null where none is predicted.
    #[serde(default)]
    pub z2_per_dof: Option<f64>,
}

impl HeldOut {
    /// Whether the patched URDF gains at least half of what the calibration gains over the untouched one, in mean squares, also without the joint effects
    /// that it cannot hold.
    #[must_use]
    pub fn urdf_alone_gains(&self) -> bool {
        let (Some(alone), Some(untouched)) = (self.urdf_alone, self.registration_only) else {
            return true;
        };
        let with = self.calibrated.map_or(alone.rms_m, |with| with.rms_m);
        let gained = |error: f64| untouched.rms_m.powi(2) - error.powi(2);
        alone.rms_m < untouched.rms_m && gained(alone.rms_m) >= 0.5 * gained(with)
    }

    /// The same of the URDF that was fitted to be used without effects.
    #[must_use]
    pub fn urdf_refitted_gains(&self) -> bool {
        match (self.urdf_refitted, self.registration_only) {
            (Some(refitted), Some(untouched)) => refitted.rms_m < untouched.rms_m,
            _ => false,
        }
    }

    /// The error to expect of some subjects alone, from at least two postures that show them.
    #[must_use]
    pub fn expected_of(&self, is_one: impl Fn(&str) -> bool) -> Option<ExpectedError> {
        let kept = self.poses.iter();
        let kept: Vec<&PoseError> = kept
            .filter(|pose| !pose.screened && is_one(&pose.subject))
            .collect();
        expected(&kept)
    }

    /// Summarize the poses: [`ErrorStats`] per model over the poses that have it, the expected error with its 95 % interval, the worst pose.
    ///
    /// Screened errors are counted and left out of every statistic but `with_screened`.
    #[must_use]
    pub fn from_poses(quantity: impl Into<String>, poses: Vec<PoseError>) -> Self {
        let kept: Vec<&PoseError> = poses.iter().filter(|pose| !pose.screened).collect();
        let values = |of: &[&PoseError], error: fn(&PoseError) -> Option<f64>| {
            of.iter().filter_map(|pose| error(pose)).collect::<Vec<_>>()
        };
        let over = |error| ErrorStats::of(&values(&kept, error));
        let angles = |error| AngleStats::of(&values(&kept, error));
        let orientation = OrientationErrors {
            nominal: angles(|pose| pose.nominal_rad),
            registration_only: angles(|pose| pose.registration_only_rad),
            calibrated: angles(|pose| pose.calibrated_rad),
        };
        let all: Vec<&PoseError> = poses.iter().collect();
        let screened = poses.len() - kept.len();
        let postures: BTreeSet<&str> = kept.iter().map(|pose| pose.pose.as_str()).collect();
        let size = |pose: &PoseError| pose.calibrated_m.filter(|m| m.is_finite());
        let worst = kept
            .iter()
            .filter_map(|pose| Some((size(pose)?, *pose)))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, pose)| pose.clone());
        let of_angles = interval(
            &by_posture(&kept, |pose| pose.calibrated_rad.map(|angle| vec![angle])),
            CONFIDENCE,
        );
        let expected = expected(&kept);
        Self {
            n: kept.len(),
            postures: postures.len(),
            orientation: (orientation != OrientationErrors::default()).then_some(orientation),
            orientation_interval_rad: of_angles.map(|found| [found.low, found.high]),
            nominal: over(|pose| pose.nominal_m),
            registration_only: over(|pose| pose.registration_only_m),
            calibrated: over(|pose| pose.calibrated_m),
            urdf_alone: over(|pose| pose.urdf_alone_m),
            urdf_refitted: over(|pose| pose.urdf_refitted_m),
            with_screened: ErrorStats::of(&values(&all, |pose| pose.calibrated_m))
                .filter(|_| screened > 0),
            screened,
            quantity: quantity.into(),
            expected,
            worst,
            z2_per_dof: z2_per_dof(&kept),
            poses,
            left_out: false,
            left_out_over_all: None,
        }
    }
}

/// The error to expect, from these errors.
fn expected(kept: &[&PoseError]) -> Option<ExpectedError> {
    let found = interval(&by_posture(kept, position), CONFIDENCE)?;
    Some(ExpectedError {
        rms_m: found.rms,
        low_m: found.low,
        high_m: found.high,
        confidence: CONFIDENCE,
        postures: found.postures,
        tracker_m: None,
        degrees_of_freedom: Some(found.freedom).filter(|nu| nu.is_finite()),
    })
}

/// The calibrated error of a pose as a vector; where only its length is known, as if all lay along one line.
fn position(pose: &PoseError) -> Option<Vec<f64>> {
    let length = pose.calibrated_m.filter(|m| m.is_finite())?;
    let vector = pose.vector_m.filter(|v| v.iter().all(|x| x.is_finite()));
    Some(vector.map_or_else(|| vec![length], |v| v.to_vec()))
}

/// The errors by posture and subject, postures in the order in which they come.
fn by_posture<'a>(
    poses: &[&'a PoseError],
    error: impl Fn(&PoseError) -> Option<Vec<f64>>,
) -> Vec<Posture<'a>> {
    let mut places = BTreeMap::new();
    let mut postures: Vec<Posture<'a>> = Vec::new();
    for pose in poses {
        let Some(error) = error(pose) else { continue };
        let place = *places.entry(pose.pose.as_str()).or_insert(postures.len());
        if place == postures.len() {
            postures.push(Posture::new());
        }
        postures[place].insert(&pose.subject, error);
    }
    postures
}

fn z2_per_dof(poses: &[&PoseError]) -> Option<f64> {
    let predicted: Vec<Distance> = poses.iter().filter_map(|pose| pose.distance).collect();
    let rows: usize = predicted.iter().map(|d| d.rows).sum();
    (rows > 0).then(|| predicted.iter().map(|d| d.z * d.z).sum::<f64>() / rows as f64)
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
    /// The same with the patched URDF, without the effects that it cannot hold, m; null where there are none.
    #[serde(default)]
    pub urdf_alone_m: Option<f64>,
    /// The same with the URDF that was fitted to be used without effects, m; null where there are none.
    #[serde(default)]
    pub urdf_refitted_m: Option<f64>,
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
    /// The calibrated error in standard deviations of its prediction; null where none is predicted.
    #[serde(default)]
    pub distance: Option<Distance>,
    /// Screened out as a gross outlier: no statistic counts it.
    #[serde(default)]
    pub screened: bool,
}

/// An error in units of its covariance.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Distance {
    /// √(eᵀ Cov⁻¹ e).
    pub z: f64,
    /// Length of e.
    pub rows: usize,
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

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(name: &str, error: Option<f64>) -> PoseError {
        PoseError {
            pose: name.into(),
            calibrated_m: error,
            nominal_m: Some(1.0),
            ..PoseError::default()
        }
    }

    /// What effects that a URDF cannot hold explain nearly all of, and what they explain little of.
    #[test]
    fn a_urdf_alone_gains_where_it_has_half_of_the_gain() {
        let stats = |rms_m| {
            Some(ErrorStats {
                rms_m,
                ..ErrorStats::default()
            })
        };
        let gains = |untouched, alone, calibrated| {
            HeldOut {
                registration_only: stats(untouched),
                urdf_alone: stats(alone),
                calibrated: stats(calibrated),
                ..HeldOut::default()
            }
            .urdf_alone_gains()
        };
        assert!(gains(1.2, 1.01, 1.0));
        assert!(!gains(0.203, 0.194, 2e-4), "4 % of the error");
        assert!(!gains(1.0, 1.1, 0.5), "worse than the untouched one");
    }

    #[test]
    fn a_pose_without_errors_has_no_statistics() {
        let held_out = HeldOut::from_poses("tool", vec![PoseError::default()]);
        assert_eq!(
            (held_out.n, held_out.calibrated, held_out.worst),
            (1, None, None)
        );
    }

    #[test]
    fn the_worst_pose_is_the_one_with_the_largest_calibrated_error() {
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

    #[test]
    fn screened_errors_are_counted_and_shown_both_ways() {
        let mut poses = vec![
            pose("a", Some(1.0)),
            pose("b", Some(1.0)),
            pose("c", Some(50.0)),
        ];
        poses[2].screened = true;
        let held_out = HeldOut::from_poses("tool", poses);
        assert_eq!(
            (held_out.n, held_out.screened, held_out.poses.len()),
            (2, 1, 3)
        );
        assert_eq!(held_out.calibrated.expect("two").max_m, 1.0);
        assert_eq!(held_out.with_screened.expect("three").max_m, 50.0);
        assert_eq!(held_out.worst.expect("one").calibrated_m, Some(1.0));
    }
}
