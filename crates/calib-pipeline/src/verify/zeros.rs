//! Zeros of joints that changed between the fitted recordings and a held-out one: c_j of (1) in `tried.rs`. What is left is that of the robot
//! with the joints moved by c, not of its linearization.

use calib_geometry::decompose::symmetric_eigen;
use calib_urdf::JointId;
use nalgebra::{DMatrix, DVector, Vector3};

use crate::verify::seen::{Seen, View};
use crate::verify::tried::{Motion, Tried, ZeroStep, robustly, rows};

/// Step of a joint in difference quotients, rad or m.
const STEP: f64 = 1e-5;
/// Linearizations.
const ROUNDS: usize = 3;
/// Part of the errors that the first linearization leaves, at most, where a second one is worth its time.
const WORTH: f64 = 0.7;
/// A direction of all steps with less than this part of the information of the best one is not seen.
const UNSEEN: f64 = 1e-6;

/// `None` where none of the joints moves any of the points.
pub(super) fn zeros_changed(
    view: &View<'_>,
    points: &[Seen<'_>],
    joints: &[JointId],
) -> Option<Tried> {
    let mut steps: Vec<(JointId, f64)> = joints.iter().map(|joint| (*joint, 0.0)).collect();
    let mut at = view.points(&[]);
    let mut found = None;
    for _ in 0..ROUNDS {
        let slopes: Vec<Vec<Vector3<f64>>> = (0..steps.len())
            .map(|j| slopes(view, &at, &steps, j))
            .collect();
        let (_, _, kept) = robustly(points, steps.len(), |kept| {
            let by = further(&at, &slopes, kept)?.0;
            let moved = |i: usize| -> Vector3<f64> {
                let each = slopes.iter().zip(by.iter());
                each.map(|(slopes, by)| slopes[i] * *by).sum()
            };
            let errors = at.iter().enumerate();
            Some(
                errors
                    .map(|(i, p)| p.predicted - p.seen + moved(i))
                    .collect(),
            )
        })?;
        let (by, variance) = further(&at, &slopes, &kept)?;
        let of_joints = steps.iter_mut().zip(by.iter());
        of_joints.for_each(|(step, by)| step.1 += by);
        at = view.points(&steps);
        let applied = |_: &[bool]| Some(at.iter().map(|p| p.predicted - p.seen).collect());
        let (left, none, kept) = robustly(points, steps.len(), applied)?;
        found = Some((left, none, kept, variance));
        // What explains nothing at the first step explains nothing at the second.
        if left > WORTH * none {
            break;
        }
    }
    let (left, none, kept, variance) = found?;
    // Points of one posture share its error.
    let shared = points.len() as f64 / rows(points).max(1) as f64;
    let of_joint = |((joint, by), variance): (&(JointId, f64), &f64)| ZeroStep {
        joint: *joint,
        by: *by,
        sigma: left * (shared * variance).sqrt(),
    };
    let mut steps: Vec<ZeroStep> = steps.iter().zip(variance.iter()).map(of_joint).collect();
    steps.sort_by(|a, b| b.clearness().total_cmp(&a.clearness()));
    let clearest = *steps.first()?;
    Some(Tried {
        motion: match joints {
            [joint] => Motion::Joint(*joint),
            _ => Motion::Zeros,
        },
        left,
        none,
        shift: clearest.by,
        sigma: clearest.sigma,
        steps,
        angle: None,
        kept,
    })
}

/// ∂p/∂q of one of the joints at the steps of all, for every point, m per rad or m.
fn slopes(
    view: &View<'_>,
    at: &[Seen<'_>],
    steps: &[(JointId, f64)],
    of: usize,
) -> Vec<Vector3<f64>> {
    let mut beside = steps.to_vec();
    beside[of].1 += STEP;
    let pairs = at.iter().zip(view.points(&beside));
    pairs
        .map(|(a, b)| (b.predicted - a.predicted) / STEP)
        .collect()
}

/// The steps of joints beyond where the points are predicted, rad or m, and their variances for errors of variance 1; zero in directions that none of the
/// points sees, `None` where these are all.
fn further(
    points: &[Seen<'_>],
    slopes: &[Vec<Vector3<f64>>],
    kept: &[bool],
) -> Option<(DVector<f64>, DVector<f64>)> {
    let n = slopes.len();
    let of_kept = || (0..points.len()).filter(|i| kept[*i]);
    let information = DMatrix::from_fn(n, n, |a, b| {
        of_kept().map(|i| slopes[a][i].dot(&slopes[b][i])).sum()
    });
    let along = DVector::from_fn(n, |a, _| {
        let of_point = |i: usize| slopes[a][i].dot(&(points[i].predicted - points[i].seen));
        of_kept().map(of_point).sum()
    });
    let eigen = symmetric_eigen(&information);
    let most = eigen.values.max();
    if most.is_nan() || most <= 0.0 {
        return None;
    }
    let (mut by, mut variance) = (DVector::zeros(n), DVector::zeros(n));
    for (k, value) in eigen.values.iter().enumerate() {
        if *value > UNSEEN * most {
            let v = eigen.vectors.column(k);
            by.axpy(-v.dot(&along) / value, &v, 1.0);
            variance += v.component_mul(&v) / *value;
        }
    }
    Some((by, variance))
}
