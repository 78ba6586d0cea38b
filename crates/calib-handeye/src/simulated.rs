//! Covariance of an estimator that minimizes no cost of its own: what it makes of tables with the noise that was found.
//!
//! ```text
//! B_i± = (Z⁻¹ A_i X) · noise(±s_i),   ξ± = log of [X; Z] found from B± against [X; Z]
//! C = ½ mean(ξ₊ξ₊ᵀ + ξ₋ξ₋ᵀ)                                                                  (9)
//! ```
//!
//! s: signs, so that every coordinate of the noise has its σ in every draw. (9) is about the truth of the simulation and not about the mean: a bias
//! of the estimator is part of it.

use nalgebra::{Isometry3, SVector, Translation3, UnitQuaternion, Vector3};

use crate::{
    input::HandEyeError,
    minimum::Minimum,
    outcome::{Covariance, HandEyeNoise},
};

/// Pairs of draws: the part of chance in a σ is 1/√(2 · 256) = 4 %.
const DRAWS: u64 = 256;

/// (9); `None` where the estimator has no answer for tables with such a noise.
pub(crate) fn simulated(
    a: &[Isometry3<f64>],
    found: &Minimum,
    noise: &HandEyeNoise,
    solve: impl Fn(&[Isometry3<f64>], &[Isometry3<f64>]) -> Result<Minimum, HandEyeError>,
) -> Option<Covariance> {
    let back = found.z.inverse();
    let exact: Vec<Isometry3<f64>> = a.iter().map(|a| back * a * found.x).collect();
    let mut sum = Covariance::zeros();
    for draw in 0..DRAWS {
        for sign in [1.0, -1.0] {
            let noisy = |(i, pose): (usize, &Isometry3<f64>)| {
                let signs = |part: u64| {
                    let of = bits(draw, 2 * i as u64 + part);
                    Vector3::from_fn(|k, _| if of >> k & 1 == 1 { sign } else { -sign })
                };
                let (place, turn) = (signs(0) * noise.sigma_t, signs(1) * noise.sigma_r);
                Isometry3::from_parts(
                    Translation3::from(pose.translation.vector + place),
                    pose.rotation * UnitQuaternion::from_scaled_axis(turn),
                )
            };
            let measured: Vec<Isometry3<f64>> = exact.iter().enumerate().map(noisy).collect();
            let by = difference(found, &solve(a, &measured).ok()?);
            sum += by * by.transpose();
        }
    }
    Some(sum / (2 * DRAWS) as f64)
}

/// Right perturbation `[ω_x; v_x; ω_z; v_z]` that leads from one fit to another.
pub(crate) fn difference(from: &Minimum, to: &Minimum) -> SVector<f64, 12> {
    let mut out = SVector::<f64, 12>::zeros();
    for (k, (from, to)) in [(&from.x, &to.x), (&from.z, &to.z)].into_iter().enumerate() {
        let d = from.inverse() * to;
        out.fixed_rows_mut::<3>(6 * k)
            .copy_from(&d.rotation.scaled_axis());
        out.fixed_rows_mut::<3>(6 * k + 3)
            .copy_from(&d.translation.vector);
    }
    out
}

/// Bits that are the same on every machine: SplitMix64 (Steele, Lea & Flood 2014) of both numbers.
fn bits(draw: u64, of: u64) -> u64 {
    let mut z = (draw << 32 | of)
        .wrapping_add(1)
        .wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
