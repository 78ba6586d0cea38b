//! Spheres about one center, one radius for each marker.

use calib_estimator::{EstimatorError, Input, Options, cloud_of, measured::Cloud};
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

use super::{
    Model,
    choice::{choose, no_choice, rejected},
    evidence::median,
};
use crate::{outcome::Outcome, seeded::Seeded, sphere::prepare, sphere_ml};

struct Spheres<'a> {
    cloud: &'a Cloud,
    marker_of: Vec<usize>,
}

impl Model for Spheres<'_> {
    type Estimate = (Vector3<f64>, Vec<f64>);
    const COMPONENTS: usize = 1;

    fn unknowns(&self) -> usize {
        3 + self.cloud.markers()
    }

    fn samples(&self) -> usize {
        self.cloud.points.len()
    }

    fn place(&self, k: usize) -> Vector3<f64> {
        self.cloud.points[k]
    }

    fn center(&self, (center, radii): &Self::Estimate) -> (Vector3<f64>, f64) {
        (
            *center,
            radii.iter().sum::<f64>() / radii.len().max(1) as f64,
        )
    }

    /// Four samples of one marker give a center; the radii are the medians of the distances.
    fn subset_fit(&self, random: &mut Seeded) -> Option<Self::Estimate> {
        let marker = self.marker_of[random.below(self.samples())];
        let points = self.cloud.marker(marker);
        if points.len() < 4 {
            return None;
        }
        let chosen = random.subset::<4>(points.len());
        // 2 m·x − c = |x|²
        let a = Matrix4::from_fn(|i, j| {
            if j < 3 {
                2.0 * points[chosen[i]][j]
            } else {
                -1.0
            }
        });
        let b = Vector4::from_fn(|i, _| points[chosen[i]].norm_squared());
        let x = a.lu().solve(&b)?;
        let center: Vector3<f64> = x.fixed_rows::<3>(0).into();
        let radii = (0..self.cloud.markers())
            .map(|p| {
                let lengths: Vec<f64> = self
                    .cloud
                    .marker(p)
                    .iter()
                    .map(|x| (x - center).norm())
                    .collect();
                median(&lengths)
            })
            .collect();
        Some((center, radii))
    }

    fn square(&self, (center, radii): &Self::Estimate, k: usize) -> f64 {
        let e = (self.cloud.points[k] - center).norm() - radii[self.marker_of[k]];
        self.cloud.weight(k) * e * e
    }

    /// Unknowns are the center and the radius of each marker, so that a sample's line is `[−u, 0, …, −1, …, 0]`.
    fn influence(&self, (center, _): &Self::Estimate, keep: &[bool]) -> Vec<(usize, f64, f64)> {
        let mut kept: Vec<(usize, Vector3<f64>)> = Vec::new();
        let mut means = vec![(Vector3::zeros(), 0.0); self.cloud.markers()];
        for k in (0..self.samples()).filter(|k| keep[*k]) {
            let u = (self.cloud.points[k] - center)
                .try_normalize(0.0)
                .unwrap_or_default();
            let w = self.cloud.weight(k);
            let (sum, total) = &mut means[self.marker_of[k]];
            *sum += u * w;
            *total += w;
            kept.push((k, u));
        }
        let off = |k: usize, u: &Vector3<f64>| {
            let (sum, total) = means[self.marker_of[k]];
            (u - sum / total, total)
        };
        let information: Matrix3<f64> = kept
            .iter()
            .map(|(k, u)| {
                let d = off(*k, u).0;
                d * (d * self.cloud.weight(*k)).transpose()
            })
            .sum();
        let Some(inverse) = information.cholesky().map(|c| c.inverse()) else {
            return Vec::new();
        };
        kept.iter()
            .map(|(k, u)| {
                let (d, total) = off(*k, u);
                let pull = inverse * d * self.cloud.weight(*k);
                let leverage = self.cloud.weight(*k) / total + d.dot(&pull);
                (*k, (1.0 - leverage).max(0.0), pull.norm())
            })
            .collect()
    }

    fn weighted(&self, (start, _): &Self::Estimate, weights: &[f64]) -> Option<Self::Estimate> {
        let center = sphere_ml::isotropic(self.cloud, *start, weights);
        let radii = sphere_ml::weighted_radii(self.cloud, &center, weights);
        (center.iter().chain(&radii).all(|x| x.is_finite())).then_some((center, radii))
    }
}

/// Spheres of the samples that belong.
pub(super) fn fit(
    estimator: &'static str,
    input: &Input<'_>,
    options: &Options,
    reweight: bool,
) -> Result<Outcome, EstimatorError> {
    let cloud = cloud_of(input, options)?;
    if let Err(answer) = prepare(estimator, &cloud, false) {
        return Ok(answer);
    }
    let marker_of = (0..cloud.markers())
        .flat_map(|p| vec![p; cloud.starts[p + 1] - cloud.starts[p]])
        .collect();
    let model = Spheres {
        cloud: &cloud,
        marker_of,
    };
    let choice = match choose(&model, options, reweight) {
        Ok(choice) => choice,
        Err(why) => return Ok(no_choice(estimator, cloud.points.len(), &why)),
    };
    let out = rejected(&choice, |k| cloud.labels[k]);
    let options = Options {
        significance: (options.significance * (-choice.ln_choices).exp()).max(f64::MIN_POSITIVE),
        ..options.clone()
    };
    Ok(sphere_ml::fit_cloud(
        estimator,
        &cloud.select(&choice.keep),
        &options,
        out,
    ))
}
