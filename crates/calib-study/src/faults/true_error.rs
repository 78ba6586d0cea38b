//! The true error of a calibrated robot at new poses, and whether its stated uncertainty covers it.

use calib_pipeline::formulate::kinematics::Calibration;
use calib_pipeline::formulate::solved::Solved;
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::case::{Case, Seen};

/// Error of a result at new poses.
pub(super) struct Error {
    pub rms_m: f64,
    pub worst_z: Option<f64>,
    pub covered: Option<f64>,
}

/// χ² with three degrees of freedom that is exceeded once in 1 000 sets of 24 postures, taken as independent: 99.996 %.
const CHI2_OF_THREE: f64 = 22.8;

/// How much wider an interval of a 3-vector is where its noise is known to so many degrees of freedom only, as the report says:
/// the quantile of F(3, ν) over that of χ²(3)/3, both by the cube root (Paulson 1942). Less than four say nothing of such a quantile.
fn wider(freedom: f64) -> f64 {
    /// Normal quantile of 99.996 %.
    const Z: f64 = 3.944;
    let quantile = |b: f64| {
        let (a, one_b) = (2.0 / 27.0, 1.0 - b);
        let (one_a, square) = (1.0 - a, one_b * one_b - Z * Z * b);
        let root = a * one_b * one_b + b * one_a * one_a - Z * Z * a * b;
        if square <= 0.0 {
            return f64::INFINITY;
        }
        ((one_a * one_b + Z * root.max(0.0).sqrt()) / square).powi(3)
    };
    let known = 2.0 / (9.0 * freedom.max(f64::MIN_POSITIVE));
    quantile(known) / quantile(0.0)
}

/// The calibrated robot against the truth at new poses; z is the largest χ² over its threshold.
pub(super) fn error(case: &Case, solved: &Solved, widened: f64) -> Error {
    let mut worst: Option<f64> = None;
    let (mut covered, mut postures) = (0.0, 0.0);
    for (q, seen) in case.truth() {
        let off = off(case, &solved.robot, &q, &seen);
        let framed = body_frame(&seen).and(off.first());
        let Some(chi2) = framed.and_then(|off| chi2(solved, &q, off)) else {
            continue;
        };
        let freedom = solved.fit.as_ref();
        let freedom = freedom.map_or(0.0, |f| f.solution.degrees_of_freedom);
        postures += 1.0;
        covered += if chi2 <= region(freedom) { 1.0 } else { 0.0 };
        let z = chi2 / (CHI2_OF_THREE * wider(freedom) * widened);
        worst = Some(worst.map_or(z, |w| w.max(z)));
    }
    Error {
        rms_m: rms(case, &solved.robot),
        worst_z: worst,
        covered: (postures > 0.0).then(|| covered / postures),
    }
}

/// χ² of a 3-vector that 95 % do not exceed, where its noise is known to so many degrees of freedom.
fn region(freedom: f64) -> f64 {
    let f = FisherSnedecor::new(3.0, freedom.max(1.0));
    f.map_or(f64::INFINITY, |f| 3.0 * f.inverse_cdf(0.95))
}

/// rms error of a robot at new poses, m.
pub(super) fn rms(case: &Case, robot: &Calibration) -> f64 {
    let truth = case.truth();
    let squares: Vec<f64> = truth
        .iter()
        .flat_map(|(q, seen)| off(case, robot, q, seen))
        .map(|off| off.norm_squared())
        .collect();
    if squares.is_empty() {
        return f64::INFINITY;
    }
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// How far the body's frame is off, or where it has none each of its markers.
fn off(case: &Case, robot: &Calibration, q: &[f64], seen: &Seen) -> Vec<Vector3<f64>> {
    let links = robot.root_from_link(q);
    let link = links[robot.model.links().len() - 1 - usize::from(case.wrong_link())];
    let tracker_from_link = robot.tracker_from_root * link;
    if let (Some(mount), Some(truth)) = (robot.mounts.get("tip"), body_frame(seen)) {
        let found = (tracker_from_link * mount).translation.vector;
        return vec![found - truth.translation.vector];
    }
    let points = robot.points.get("tip");
    let truth = seen.points.iter().enumerate();
    truth
        .filter_map(|(i, truth)| {
            let p = points?.get(&format!("tip_{}", i + 1))?;
            Some(tracker_from_link * p - truth)
        })
        .collect()
}

/// ‖e‖² in the covariance that the fit states for the body's position at readings.
fn chi2(solved: &Solved, q: &[f64], off: &Vector3<f64>) -> Option<f64> {
    let fit = solved.fit.as_ref()?;
    let mut at = calib_core::Configuration::zero();
    for (j, edge) in fit.formulation.joints.iter().enumerate() {
        if let Some(edge) = edge {
            at = at.with(*edge, q[j]);
        }
    }
    let body = *fit.formulation.bodies.get("tip")?;
    let derived = fit
        .solution
        .relative_pose(fit.formulation.tracker, body, &at)
        .ok()?;
    let own: Matrix3<f64> = derived.covariance?.fixed_view::<3, 3>(3, 3).into();
    let turn = derived.pose.rotation.to_rotation_matrix();
    let covariance = turn.matrix() * own * turn.matrix().transpose();
    Some(off.dot(&covariance.cholesky()?.solve(off)))
}

/// The body's frame as `calib` defines it: origin at the first marker, +x through the second, the third at y > 0.
fn body_frame(seen: &Seen) -> Option<Isometry3<f64>> {
    match seen.points[..] {
        [] => Some(seen.body),
        [a, b, c, ..] => Some(calib_frame(&a, &b, &c)),
        _ => None,
    }
}

fn calib_frame(a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>) -> Isometry3<f64> {
    let x = (b - a).normalize();
    let z = x.cross(&(c - a)).normalize();
    let basis = Matrix3::from_columns(&[x, z.cross(&x), z]);
    let turn = nalgebra::UnitQuaternion::from_matrix(&basis);
    Isometry3::from_parts(a.coords.into(), turn)
}
