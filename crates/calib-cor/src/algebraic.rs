//! Closed-form spheres: Kåsa, Taubin, Pratt (SFE) and Hyper as one family.
//!
//! ```text
//! minimize u'Su  subject to  u'Cu = 1,      u = (a, b, e_p),   a|x|² + b·x + e_p = 0           (1)
//! Kåsa: a = 1.   Taubin: C_T = Σ ∇∇ᵀ.   Pratt: u'C_P u = |b|² − 4ae.   C = C_T + β (C_P − C_T)
//! ```
//!
//! (Sums and means are weighted where samples have weights.) With the centroid as origin, b and e can be eliminated and one scalar equation is left for the
//! multiplier λ, in the factor of [`calib_estimator::factor`] (all sums divided by n):
//!
//! ```text
//! ρ² = λ ( 4w̄ + 4β²λ + Σ_k c_k² / (s_k² − λ) ),      0 ≤ λ < s₃²                             (2)
//! m = ½ Σ_k v_k s_k c_k / (s_k² − λ),    r_p² = mean |x − m|² + 2βλ                            (3)
//! ```
//!
//! β = 0 is Taubin, 1 Pratt, −3/2 Hyper: in three dimensions `C = (5T − 3P)/2`. The root of (2) below s₃² is
//! the eigenvector with `u'Cu > 0` of least cost (the paper's rule as corrected); exact data have λ = 0.
//! Pratt 1987, Taubin 1991, Al-Sharadqah & Chernov 2009, Chang & Pollard 2007.

use calib_estimator::factor::Factor;
use calib_estimator::measured::Cloud;
use nalgebra::Vector3;

use crate::{
    options::{COMMON, EstimatorInfo},
    outcome::Outcome,
    sphere::{Candidate, judge, prepare},
};
use calib_estimator::{EstimatorError, Input, InputKind, Options, cloud_of};

/// What `sfe` is and needs.
pub(crate) const SFE: EstimatorInfo = EstimatorInfo {
    id: "sfe",
    name: "sphere fit, Pratt's constraint, exact",
    input: InputKind::Points,
    options: COMMON,
    summary: "closed form on centered data",
    source: "Pratt 1987; Chang & Pollard 2007; paper §3.2.1",
    fit: |input, options| fit(Algebraic::Pratt, input, options),
};

/// What `kasa` is and needs.
pub(crate) const KASA: EstimatorInfo = EstimatorInfo {
    id: "kasa",
    name: "sphere fit, linear",
    input: InputKind::Points,
    options: COMMON,
    summary: "one linear solve; radius and center shrink on small ranges of motion",
    source: "Kåsa 1976",
    fit: |input, options| fit(Algebraic::Kasa, input, options),
};

/// What `taubin` is and needs.
pub(crate) const TAUBIN: EstimatorInfo = EstimatorInfo {
    id: "taubin",
    name: "sphere fit, gradient-weighted",
    input: InputKind::Points,
    options: COMMON,
    summary: "closed form, radius bias 3/5 of Pratt's",
    source: "Taubin 1991",
    fit: |input, options| fit(Algebraic::Taubin, input, options),
};

/// What `hyper` is and needs.
pub(crate) const HYPER: EstimatorInfo = EstimatorInfo {
    id: "hyper",
    name: "sphere fit without second-order bias",
    input: InputKind::Points,
    options: COMMON,
    summary: "closed form with the constraint (5T − 3P)/2",
    source: "Al-Sharadqah & Chernov 2009, in three dimensions",
    fit: |input, options| fit(Algebraic::Hyper, input, options),
};

/// A member of the family.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Algebraic {
    /// λ = 0: linear, strongly biased on small ranges of motion.
    Kasa,
    /// Gradient-weighted.
    Taubin,
    /// Pratt's constraint: the paper's SFE.
    Pratt,
    /// No second-order bias of center and radius.
    Hyper,
}

impl Algebraic {
    fn beta(self) -> f64 {
        match self {
            Self::Kasa | Self::Taubin => 0.0,
            Self::Pratt => 1.0,
            Self::Hyper => -1.5,
        }
    }

    /// Radius bias in units of σ²/r.
    fn radius_bias(self) -> f64 {
        match self {
            Self::Kasa | Self::Taubin => 1.5,
            Self::Pratt => 2.5,
            Self::Hyper => 0.0,
        }
    }
}

/// Center and radii of the family's `member`; the caller has checked rank and number of samples.
pub(crate) fn solve(cloud: &Cloud, factor: &Factor, member: Algebraic) -> (Vector3<f64>, Vec<f64>) {
    let lambda = match member {
        Algebraic::Kasa => 0.0,
        _ => multiplier(factor, member.beta()),
    };
    // The factor is of sums, λ of means.
    let center = factor.center(lambda * factor.total);
    let radii = (0..cloud.markers())
        .map(|p| {
            let square = cloud
                .samples(p)
                .map(|(x, w)| w * (x - center).norm_squared())
                .sum::<f64>()
                / cloud.total(cloud.range(p));
            (square + 2.0 * member.beta() * lambda).max(0.0).sqrt()
        })
        .collect();
    (center, radii)
}

/// The root of (2) in [0, s₃²/n) by bisection-guarded Newton; the left side minus the right side falls
/// monotonically from ρ² to −∞ there.
fn multiplier(factor: &Factor, beta: f64) -> f64 {
    let n = factor.total;
    let rho2 = factor.rho * factor.rho / n;
    let s2 = factor.s.map(|s| s * s / n);
    let c2 = factor.c.map(|c| c * c / n);
    let (mut low, mut high) = (0.0, s2[2]);
    let mut lambda = 0.0;
    for _ in 0..100 {
        // g(λ) = ρ² − λ h(λ),  h = 4w̄ + 4β²λ + Σ c²/(s² − λ)
        let (mut h, mut dh) = (
            4.0 * factor.mean_square + 4.0 * beta * beta * lambda,
            4.0 * beta * beta,
        );
        for k in 0..3 {
            let gap = s2[k] - lambda;
            h += c2[k] / gap;
            dh += c2[k] / (gap * gap);
        }
        let g = rho2 - lambda * h;
        if g > 0.0 {
            low = lambda;
        } else {
            high = lambda;
        }
        let newton = lambda + g / (h + lambda * dh);
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        if (next - lambda).abs() <= 4.0 * f64::EPSILON * next || !next.is_finite() {
            return next.max(0.0);
        }
        lambda = next;
    }
    lambda
}

/// Runs a member of the family on all markers of `input`.
///
/// # Errors
/// [`EstimatorError`] for data that are non-finite or of another kind.
pub fn fit(
    member: Algebraic,
    input: &Input<'_>,
    options: &Options,
) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let estimator = match member {
        Algebraic::Kasa => "kasa",
        Algebraic::Taubin => "taubin",
        Algebraic::Pratt => "sfe",
        Algebraic::Hyper => "hyper",
    };
    let cloud = cloud_of(input, options)?;
    let factor = match prepare(estimator, &cloud, false) {
        Ok(factor) => factor,
        Err(answer) => return Ok(answer),
    };
    let (center, radii) = solve(&cloud, &factor, member);
    // Kåsa's constraint lets noise lengthen the spread; Taubin's takes it off, and the difference is the bias.
    let known_bias = match member {
        Algebraic::Kasa => center - solve(&cloud, &factor, Algebraic::Taubin).0,
        _ => Vector3::zeros(),
    };
    let candidate = Candidate {
        estimator,
        center,
        radii,
        radius_bias: member.radius_bias(),
        weights: Vec::new(),
        absolute: false,
        known_bias,
        rejected: Vec::new(),
    };
    Ok(judge(&cloud, &factor, candidate, options))
}
