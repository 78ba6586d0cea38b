//! Several markers around one center: Gamage & Lasenby 2002, and Halvorsen's 2003 bias compensation.
//!
//! ```text
//! minimize Σ_p (1/n_p) Σ_k (|x_pk − m|² − r_p²)²                                        (1)
//! noise adds  σ² I  to each marker's covariance and  2σ² x̄_p  to its correlation with |x|²:
//! (Σ_p Cov_p − P σ² I) m = ½ Σ_p cov_p(x, |x|²) − σ² Σ_p x̄_p                             (2)
//! σ² = (1/N) Σ_p Σ_k (|x_pk − m|² − r_p²)² / (4 r_p²)                                     (3)
//! ```
//!
//! For equally many samples (1) is Kåsa's fit of several markers; for one marker (2) with (3) is Taubin's.

use calib_estimator::factor::Factor;
use calib_estimator::{InputKind, Verdict, measured::Cloud};
use nalgebra::Vector3;

use crate::{
    algebraic::{Algebraic, solve},
    options::{COMMON, EstimatorInfo},
    outcome::Outcome,
    sphere::{Candidate, judge, prepare},
};
use calib_estimator::{EstimatorError, Input, Options, cloud_of};

/// Rounds of (2) and (3); each gains a factor σ²/s₃², so well-posed data need about ten.
const ROUNDS: usize = 200;

/// What `gamage_lasenby` is and needs.
pub(crate) const GAMAGE_LASENBY: EstimatorInfo = EstimatorInfo {
    id: "gamage_lasenby",
    name: "several markers, linear",
    input: InputKind::Points,
    options: COMMON,
    summary: "each marker weighs the same; the several-marker Kåsa fit",
    source: "Gamage & Lasenby 2002",
    fit: gamage_lasenby,
};

/// Gamage & Lasenby's linear fit.
///
/// # Errors
/// [`EstimatorError`] for data that are non-finite or of another kind.
pub fn gamage_lasenby(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    run("gamage_lasenby", input, options, |cloud, factor| {
        solve(cloud, factor, Algebraic::Kasa)
    })
}

/// What `halvorsen` is and needs.
pub(crate) const HALVORSEN: EstimatorInfo = EstimatorInfo {
    id: "halvorsen",
    name: "several markers, bias-compensated",
    input: InputKind::Points,
    options: COMMON,
    summary: "Gamage & Lasenby, noise-corrected; one marker: Taubin",
    source: "Halvorsen 2003",
    fit: halvorsen,
};

/// Halvorsen's bias-compensated fit.
///
/// # Errors
/// [`EstimatorError`] for data that are non-finite or of another kind.
pub fn halvorsen(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    run("halvorsen", input, options, |cloud, factor| {
        let (center, _) = compensate(cloud, factor);
        (center, rms_radii(cloud, &center))
    })
}

fn run(
    estimator: &'static str,
    input: &Input<'_>,
    options: &Options,
    fit: impl Fn(&Cloud, &Factor) -> (Vector3<f64>, Vec<f64>),
) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let cloud = cloud_of(input, options)?;
    let equal_markers = match prepare(estimator, &cloud, true) {
        Ok(factor) => factor,
        Err(answer) => return Ok(answer),
    };
    // The test counts samples, so it needs the factor in which each sample weighs the same.
    let factor = Factor::of(&cloud, false);
    let compensated = compensate(&cloud, &equal_markers).0;
    let judged = |(center, radii): (Vector3<f64>, Vec<f64>)| {
        // Zero for Halvorsen's own.
        let bias = center - compensated;
        let candidate = Candidate {
            estimator,
            center,
            radii,
            radius_bias: 1.5,
            weights: Vec::new(),
            absolute: false,
            known_bias: if bias.iter().all(|x| x.is_finite()) {
                bias
            } else {
                Vector3::zeros()
            },
            rejected: Vec::new(),
        };
        judge(&cloud, &factor, candidate, options)
    };
    let outcome = judged(fit(&cloud, &equal_markers));
    if outcome.verdict() == Verdict::Diverged {
        // The compensation diverges where the spread is noise: say that rather than "diverged".
        let linear = judged(solve(&cloud, &equal_markers, Algebraic::Kasa));
        if linear.estimate().is_none() {
            return Ok(linear);
        }
    }
    Ok(outcome)
}

fn rms_radii(cloud: &Cloud, center: &Vector3<f64>) -> Vec<f64> {
    (0..cloud.markers())
        .map(|p| {
            let squares = cloud
                .samples(p)
                .map(|(x, w)| w * (x - center).norm_squared());
            (squares.sum::<f64>() / cloud.total(cloud.range(p))).sqrt()
        })
        .collect()
}

/// The fixed point of (2) and (3): center and σ². Not finite where the noise exceeds the spread.
pub(crate) fn compensate(cloud: &Cloud, factor: &Factor) -> (Vector3<f64>, f64) {
    // What noise adds to a marker's covariance: σ² n_p / Σw.
    let shares: Vec<f64> = (0..cloud.markers())
        .map(|p| cloud.range(p).len() as f64 / cloud.total(cloud.range(p)))
        .collect();
    let share: f64 = shares.iter().sum();
    let means: Vector3<f64> = (0..cloud.markers())
        .map(|p| {
            let points = cloud.samples(p).map(|(x, w)| x * w);
            points.sum::<Vector3<f64>>() * (shares[p] / cloud.total(cloud.range(p)))
        })
        .sum();
    let mut center = factor.center(0.0);
    let mut sigma2 = 0.0;
    for _ in 0..ROUNDS {
        sigma2 = (0..cloud.markers())
            .map(|p| {
                let squares = cloud
                    .samples(p)
                    .map(|(x, w)| (w, (x - center).norm_squared()));
                let mean =
                    squares.clone().map(|(w, q)| w * q).sum::<f64>() / cloud.total(cloud.range(p));
                let off = squares.map(|(w, q)| w * (q - mean) * (q - mean));
                off.sum::<f64>() / (4.0 * mean)
            })
            .sum::<f64>()
            / cloud.points.len() as f64;
        let shift = share * sigma2;
        if shift >= factor.s[2] * factor.s[2] {
            return (Vector3::repeat(f64::NAN), sigma2);
        }
        // (2) in the basis of singular directions
        let next: Vector3<f64> = (0..3)
            .map(|k| {
                let (v, s) = (factor.v.column(k), factor.s[k]);
                v * ((0.5 * s * factor.c[k] - sigma2 * v.dot(&means)) / (s * s - shift))
            })
            .sum();
        let moved = (next - center).norm();
        center = next;
        if moved <= 1e-15 * (center.norm() + factor.s[0]) {
            break;
        }
    }
    (center, sigma2)
}
