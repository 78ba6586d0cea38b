//! The linear model at the geometry that the data and the priors ask for, and the noise there.
//!
//! Equations: [`continuous`](super::continuous).

use calib_geometry::se3;
use nalgebra::{DVector, Isometry3, Vector3};

use super::Options;
use super::data::Data;
use super::ids::SampleIndex;
use super::linear::{Model, moving_joints, prior_precision, solve};
use super::thinning::thinned;

/// Joint noise against marker noise, (rad/m)²: none, and 0.003° … 0.1° for a marker of 0.3 mm.
const NOISE_RATIOS: [f64; 5] = [0.0, 0.03, 0.3, 3.0, 30.0];
/// A relinearization that moves nothing by more of its prior σ is the last: the next would move a millionth.
const SETTLED: f64 = 1e-3;
/// Rows that give the point of linearization and the noise ratio: what they leave open is of second order, or a grid of
/// factors of ten.
const ROWS: usize = 120;

/// Evenly spaced rows, and what is screened of them.
pub(super) fn fewer(data: &Data, screened: &[SampleIndex]) -> (Data, Vec<SampleIndex>) {
    let rows = thinned(data, ROWS);
    let place = |s: &SampleIndex| {
        let row = rows.binary_search(&s.row).ok()?;
        Some(SampleIndex { row, ..*s })
    };
    (
        data.select(&rows),
        screened.iter().filter_map(place).collect(),
    )
}

/// The noise at one geometry.
#[derive(Debug, Clone, Copy)]
pub(super) struct Noise {
    /// λ.
    pub lambda: f64,
    /// σ of a marker coordinate, m.
    pub sigma: f64,
    /// The restricted likelihood, the geometry integrated over.
    pub log_likelihood: f64,
    /// Coordinates that it is of.
    pub coordinates: f64,
}

/// The noise ratio λ of the largest restricted likelihood, and σ under it.
pub(super) fn noise_ratio(
    data: &Data,
    deviation: &DVector<f64>,
    mut sigma: f64,
    screened: &[SampleIndex],
    options: &Options,
) -> Option<Noise> {
    let model = Model::new(data, &[], screened);
    let mut best: Option<Noise> = None;
    for (lambda, sums) in NOISE_RATIOS.into_iter().zip(model.sums_of(NOISE_RATIOS)) {
        sigma = solve(&model, &sums, sigma, deviation, options)?.sigma;
        let map = solve(&model, &sums, sigma, deviation, options)?;
        if best.is_none_or(|b| map.log_likelihood > b.log_likelihood) {
            best = Some(Noise {
                lambda,
                sigma,
                log_likelihood: map.log_likelihood,
                coordinates: sums.observations,
            });
        }
    }
    best
}

/// The data with the chain at its MAP geometry, how far that is from nominal, and σ.
pub(super) fn relinearized(
    mut data: Data,
    screened: &[SampleIndex],
    options: &Options,
    rounds: usize,
) -> Option<(Data, DVector<f64>, f64)> {
    let nominal = data.chain.clone();
    let moving = moving_joints(&data);
    let mut deviation = DVector::zeros(6 * moving.len());
    let mut sigma = options.sigma;
    for _ in 0..rounds {
        let (x, most) = {
            let model = Model::new(&data, &[], screened);
            let sums = model.sums(NOISE_RATIOS[2]);
            let map = solve(&model, &sums, sigma, &deviation, options)?;
            sigma = map.sigma;
            let x = map.x.rows(model.registration, deviation.len()).into_owned();
            let precision = prior_precision(&model, options);
            let of_prior = x.zip_map(&precision, |x, p| x * p.sqrt());
            (x, of_prior.amax())
        };
        deviation += x;
        for (g, &j) in moving.iter().enumerate() {
            let xi = deviation.rows(6 * g, 6);
            let twist = se3::Twist::new(
                Vector3::new(xi[0], xi[1], xi[2]),
                Vector3::new(xi[3], xi[4], xi[5]),
            );
            let step: Isometry3<f64> = se3::exp(&twist);
            data.chain.joints[j].parent_from_joint = nominal.joints[j].parent_from_joint * step;
        }
        if most < SETTLED {
            break;
        }
    }
    Some((data, deviation, sigma))
}
