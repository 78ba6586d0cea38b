//! Hyper with the terms of order 1/n: for few samples.
//!
//! ```text
//! ξ = (|x|², x, 1_p),   M = mean ξξᵀ,   V = ∇ξ ∇ξᵀ,   e = (3, 0, …)   with (ξ, u) = 0 on the sphere                 (1)
//! N = mean (V + ξeᵀ + eξᵀ) − n⁻² Σ ( tr(M⁻V) ξξᵀ + (ξ, M⁻ξ) V + V M⁻ξξᵀ + ξξᵀM⁻V ),     M u = λ N u              (2)
//! ```
//!
//! The first term of N is `(5T − 3P)/2`, [`crate::algebraic`]'s Hyper; the second takes off what is left of the bias at order σ²/n.
//! M⁻ inverts M but for its weakest direction, so the fit depends on the unit: points are centered and divided by their
//! rms distance first. Rangarajan & Kanatani 2009 (HyperLS), here in three dimensions and for several markers.

use calib_estimator::factor::Factor;
use calib_estimator::measured::Cloud;
use calib_geometry::decompose::{pencil_eigen, symmetric_eigen};
use nalgebra::{DMatrix, DVector, Vector3};

use crate::{
    algebraic::{Algebraic, solve},
    options::{COMMON, EstimatorInfo},
    outcome::Outcome,
    sphere::{Candidate, judge, prepare},
};
use calib_estimator::{EstimatorError, Input, InputKind, Options, cloud_of};

/// What `hyper_n` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "hyper_n",
    name: "sphere fit without second-order bias, for few samples",
    input: InputKind::Points,
    options: COMMON,
    summary: "hyper with the terms of order 1/n",
    source: "Rangarajan & Kanatani 2009 (HyperLS)",
    fit,
};

/// HyperLS on all markers of `input`.
///
/// # Errors
/// [`EstimatorError`] for data that are non-finite or of another kind.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    const ID: &str = "hyper_n";
    options.check()?;
    let cloud = cloud_of(input, options)?;
    let factor = match prepare(ID, &cloud, false) {
        Ok(factor) => factor,
        Err(answer) => return Ok(answer),
    };
    let (center, radii) = hyper_least_squares(&cloud, &factor);
    let candidate = Candidate {
        estimator: ID,
        center,
        radii,
        radius_bias: 0.0,
        weights: Vec::new(),
        absolute: false,
        known_bias: Vector3::zeros(),
        rejected: Vec::new(),
    };
    Ok(judge(&cloud, &factor, candidate, options))
}

/// (2) around the common centroid, in units of the rms distance.
fn hyper_least_squares(cloud: &Cloud, factor: &Factor) -> (Vector3<f64>, Vec<f64>) {
    if cloud.points.len() <= cloud.markers() + 3 {
        // As many samples as unknowns: an exact fit has no bias, and N vanishes on it.
        return solve(cloud, factor, Algebraic::Hyper);
    }
    let n = cloud.total(0..cloud.points.len());
    let scale = factor.mean_square.sqrt();
    let size = 4 + cloud.markers();
    // Rows of ξ, and the gradient of its first four entries.
    let rows: Vec<(f64, Vector3<f64>, DVector<f64>)> = (0..cloud.markers())
        .flat_map(|p| {
            cloud.range(p).map(move |k| {
                let y = cloud.points[k] / scale;
                let mut xi = DVector::zeros(size);
                xi[0] = y.norm_squared();
                xi.fixed_rows_mut::<3>(1).copy_from(&y);
                xi[4 + p] = 1.0;
                (cloud.weight(k), y, xi)
            })
        })
        .collect();
    let mut moment = DMatrix::zeros(size, size);
    let mut mean = DVector::zeros(size);
    // A row of weight w has the noise σ²/w: what is linear in noise and weight counts rows, not weights.
    for (w, _, xi) in &rows {
        moment += xi * xi.transpose() * (*w / n);
        mean += xi / n;
    }
    // Ascending: the first is the sphere that nearly holds.
    let eigen = symmetric_eigen(&moment);
    let largest = eigen.values[size - 1];
    let floor = f64::EPSILON * largest;
    let mut inverse = DMatrix::zeros(size, size);
    for k in 1..size {
        let v = eigen.vectors.column(k);
        inverse += v * v.transpose() / eigen.values[k].max(floor);
    }
    let mut constraint = DMatrix::zeros(size, size);
    for k in 0..size {
        constraint[(0, k)] += 3.0 * mean[k];
        constraint[(k, 0)] += 3.0 * mean[k];
    }
    for (w, y, xi) in &rows {
        let mut v = DMatrix::zeros(size, size);
        v[(0, 0)] = 4.0 * y.norm_squared();
        for k in 0..3 {
            v[(0, 1 + k)] = 2.0 * y[k];
            v[(1 + k, 0)] = 2.0 * y[k];
            v[(1 + k, 1 + k)] = 1.0;
        }
        let seen = &inverse * xi;
        let cross = (&v * &seen) * xi.transpose();
        let trace = inverse.component_mul(&v).sum();
        let share = xi.dot(&seen);
        constraint += &v / n;
        constraint -=
            (xi * xi.transpose() * trace + &v * share + &cross + cross.transpose()) * (*w / n / n);
    }
    let table = DMatrix::from_fn(rows.len(), size, |i, j| {
        rows[i].2[j] * (rows[i].0 / n).sqrt()
    });
    let pairs = pencil_eigen(&table, &constraint);
    let Some(u) = pairs
        .iter()
        .min_by(|a, b| a.lambda.abs().total_cmp(&b.lambda.abs()))
        .map(|pair| &pair.u)
    else {
        return solve(cloud, factor, Algebraic::Hyper);
    };
    let b = Vector3::new(u[1], u[2], u[3]);
    let m = b * (-0.5 / u[0]);
    let radii: Vec<f64> = (0..cloud.markers())
        .map(|p| (m.norm_squared() - u[4 + p] / u[0]).max(0.0).sqrt() * scale)
        .collect();
    let center = m * scale;
    if radii.iter().all(|r| *r > 0.0 && r.is_finite()) && center.iter().all(|x| x.is_finite()) {
        (center, radii)
    } else {
        // A plane, or no sphere at all: the form without 1/n is never worse there.
        solve(cloud, factor, Algebraic::Hyper)
    }
}
