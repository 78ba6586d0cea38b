//! The hot spot: a point of the body that stays at the center.

use calib_estimator::{
    EstimatorError, Options,
    measured::{Pose, RowWeights},
};
use calib_geometry::decompose::symmetric_eigen_small;
use nalgebra::{Matrix3, Vector3};

use super::{
    Model,
    choice::{choose, no_choice, rejected},
};
use crate::{hotspot, hotspot_ml, outcome::Outcome, seeded::Seeded};

struct HotSpots<'a> {
    /// Row, pose and weight.
    poses: Vec<(usize, &'a Pose, f64)>,
}

impl Model for HotSpots<'_> {
    type Estimate = (Vector3<f64>, Vector3<f64>);
    const COMPONENTS: usize = 3;

    fn unknowns(&self) -> usize {
        6
    }

    fn samples(&self) -> usize {
        self.poses.len()
    }

    fn place(&self, k: usize) -> Vector3<f64> {
        self.poses[k].1.translation
    }

    fn center(&self, (center, body_point): &Self::Estimate) -> (Vector3<f64>, f64) {
        (*center, body_point.norm())
    }

    fn subset_fit(&self, random: &mut Seeded) -> Option<Self::Estimate> {
        let chosen = random.subset::<3>(self.samples());
        solve(chosen.iter().map(|&k| (self.poses[k].1, self.poses[k].2)))
    }

    fn square(&self, (center, body_point): &Self::Estimate, k: usize) -> f64 {
        let (_, pose, w) = self.poses[k];
        w * (pose.transform(body_point) - center).norm_squared()
    }

    /// Two poses about different axes determine a center, and each has three components: no single one decides.
    fn influence(&self, _: &Self::Estimate, _: &[bool]) -> Vec<(usize, f64, f64)> {
        Vec::new()
    }

    fn weighted(&self, _: &Self::Estimate, weights: &[f64]) -> Option<Self::Estimate> {
        solve(
            self.poses
                .iter()
                .zip(weights)
                .map(|((_, pose, own), w)| (*pose, own * w)),
        )
    }
}

/// Weighted linear hot spot; `None` where the rotations share an axis.
fn solve<'a>(
    poses: impl Iterator<Item = (&'a Pose, f64)> + Clone,
) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let (mut total, mut mean_r, mut mean_t) = (0.0, Matrix3::zeros(), Vector3::zeros());
    for (pose, w) in poses.clone() {
        total += w;
        mean_r += pose.rotation * w;
        mean_t += pose.translation * w;
    }
    mean_r /= total;
    mean_t /= total;
    let (mut m, mut b) = (Matrix3::zeros(), Vector3::zeros());
    for (pose, w) in poses {
        let d = pose.rotation - mean_r;
        m += d.tr_mul(&d) * w;
        b -= d.tr_mul(&(pose.translation - mean_t)) * w;
    }
    let eigen = symmetric_eigen_small(&m);
    // A shared axis to within 10⁻⁵ rad: what it determines is rounding.
    if eigen.values[0] <= 1e-10 * eigen.values[2] {
        return None;
    }
    let p: Vector3<f64> = (0..3)
        .map(|k| {
            let v = eigen.vectors.column(k);
            v * (v.dot(&b) / eigen.values[k])
        })
        .sum();
    let center = mean_r * p + mean_t;
    center.iter().all(|x| x.is_finite()).then_some((center, p))
}

/// The hot spot of the poses that belong.
pub(super) fn fit(
    estimator: &'static str,
    poses: &[Option<Pose>],
    options: &Options,
    reweight: bool,
) -> Result<Outcome, EstimatorError> {
    if let Err(answer) = hotspot::prepare(estimator, poses, options)? {
        return Ok(answer);
    }
    let weights = RowWeights(&options.weights);
    let seen: Vec<(usize, &Pose, f64)> = poses
        .iter()
        .enumerate()
        .filter_map(|(row, p)| Some((row, p.as_ref()?, weights.of(row))))
        .filter(|(.., w)| *w > 0.0)
        .collect();
    let model = HotSpots { poses: seen };
    let choice = match choose(&model, options, reweight) {
        Ok(choice) => choice,
        Err(why) => return Ok(no_choice(estimator, model.samples(), &why)),
    };
    let mut kept = poses.to_vec();
    for (k, (row, ..)) in model.poses.iter().enumerate() {
        if !choice.keep[k] {
            kept[*row] = None;
        }
    }
    let out = rejected(&choice, |k| (0, model.poses[k].0));
    if reweight {
        hotspot_ml::fit_poses(estimator, &kept, options, out)
    } else {
        hotspot::linear(estimator, &kept, options, out, |sums, _| sums.body_point(0))
    }
}
